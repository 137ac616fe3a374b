from dataclasses import replace

import numpy as np
import pytest

from acx4lib.errors import FlightError
from acx4lib.planning.choosing import target

from .conftest import CANDIDATES


def test_candidates_are_all_combinations_and_the_plans_own_strips(plan):
    read = target.from_values({"sigma": {"f_mm": 0.002}, "candidates": CANDIDATES}, plan)
    strips = read.plan.blocks["calibration"].strips
    assert [*strips][:3] == ["there", "c-500-0", "c-500-90"]
    assert len(strips) == 9
    assert strips["c-900-270"].flying_height_m == 900
    assert strips["c-900-270"].course_deg == 270
    assert read.sigma == {"f_mm": 0.002}
    assert read.minutes == np.inf


def test_without_candidates_the_plans_own_strips_are_the_choice(plan):
    read = target.from_values({"minutes": 60, "check_points": {"height_m": 0.1}}, plan)
    assert [*read.plan.blocks["calibration"].strips] == ["there"]
    assert read.minutes == 60.0


@pytest.mark.parametrize(
    ("written", "message"),
    [
        ("minutes = 60", "sigma: nothing is wanted; needs [sigma] with f_mm = 0.002, or"),
        ("[sigma]\nf_m = 1", "t.toml:2: sigma.f_m: unknown key (did you mean 'f_mm'?)"),
        ("[sigma]\nf_mm = -1", "t.toml:2: sigma.f_mm: -1; must be positive"),
        ("minutes = 0\n[sigma]\nf_mm = 1", "t.toml:1: minutes: 0; must be positive"),
        (
            "[sigma]\nf_mm = 1\n[candidates]\nc = {flying_height_m = [500, 0], course_deg = 0, "
            "length_m = 600, overlap = 0.8}",
            "t.toml:4: calibration.strips.c-0.flying_height_m: 0; must lie",
        ),
        (
            "[sigma]\nf_mm = 1\n[candidates]\nc = 5",
            "t.toml:4: candidates.c: 5; must be a table, as",
        ),
        (
            "[sigma]\nf_mm = 1\n[candidates]\nc = {course_deg = []}",
            "t.toml:4: candidates.c.course_deg: []; must be a value, or a list of 1 to 200",
        ),
        (
            f"[sigma]\nf_mm = 1\n[candidates]\nc = {{a = {[*range(20)]}, b = {[*range(20)]}}}",
            "t.toml:3: candidates: 400 strips; must be at most 200",
        ),
        ("[sigma", "must be valid TOML"),
    ],
)
def test_a_mistake_is_named_with_its_line_and_a_cure(plan, tmp_path, written, message):
    path = tmp_path / "t.toml"
    path.write_text(written, encoding="utf-8")
    with pytest.raises(FlightError) as error:
        target.read(path, plan)
    assert message in str(error.value)


def test_check_points_need_a_mapping_flight(plan):
    without = replace(plan, blocks={"calibration": plan.blocks["calibration"]})
    with pytest.raises(FlightError, match="a plan without block validation; the plan needs"):
        target.from_values({"check_points": {"height_m": 0.1}}, without)
    with pytest.raises(FlightError, match="a plan without block calibration"):
        target.from_values(
            {"sigma": {"f_mm": 1}}, replace(plan, blocks={"validation": plan.blocks["validation"]})
        )


def test_sigma_of_distortion_may_be_as_small_as_they_are(plan):
    wanted = {"k1": 5e-8, "k2": 3e-10, "k3": 2e-13, "p1": 1e-6}
    assert target.from_values({"sigma": wanted}, plan).sigma == wanted
    with pytest.raises(FlightError, match=r"sigma\.k2: 0; must be positive"):
        target.from_values({"sigma": {"k2": 0}}, plan)
