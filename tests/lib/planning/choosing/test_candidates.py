import numpy as np
import pytest

from acx4lib.errors import FlightError
from acx4lib.planning import design
from acx4lib.planning.choosing import candidates, target
from acx4lib.planning.choosing.chosen import with_strips
from acx4lib.planning.exposures import flying_time_s

from .conftest import CANDIDATES

WANTED = {
    "sigma": {"f_mm": 1e-4, "boresight_kappa_deg": 1.0, "gnss_shift_east_m": 1.0},
    "check_points": {"height_m": 1.0, "east_m": 1.0},
    "candidates": CANDIDATES,
}


@pytest.fixture(scope="module")
def found(plan):
    return candidates.of(target.from_values(WANTED, plan))


def test_what_is_wanted_is_what_the_plan_of_these_strips_has(found):
    """Boresight angles in degrees, a shift of GNSS, and RMS of check points, by `design.of`."""
    chosen = (0, 1, 3, 5, 8)
    designed = design.of(with_strips(found.target.plan, chosen))
    parameters = {p.name: p.sigma for p in candidates.shared(designed.mountings["single_step"])}
    rms = np.sqrt(np.mean(designed.validations["single_step"].points.sigma ** 2, axis=0))
    expected = [parameters[name] for name in WANTED["sigma"]] + [rms[2], rms[0]]
    assert found.planned(designed.plan) == pytest.approx(expected, rel=1e-12)
    assert found.given(chosen) == pytest.approx(expected, rel=0.05)


def test_what_no_choice_gives_is_known_with_what_it_would_need(found):
    (failing,) = found.failing
    assert (failing.camera, failing.name) == ("CAM", "f_mm")
    assert failing.with_all > failing.limit
    assert failing.needs


def test_the_flying_time_is_the_plans(found):
    strips = [*found.target.plan.blocks["calibration"].strips.values()]
    for chosen in ((), (2,), (0, 4, 5)):
        expected = flying_time_s(tuple(strips[k] for k in chosen)) / 60
        assert found.minutes(chosen) == pytest.approx(expected)


def test_what_the_plan_does_not_estimate_cannot_be_wanted(plan):
    wanted = target.from_values({"sigma": {"k3": 1.0}}, plan)
    with pytest.raises(
        FlightError, match=r"sigma\.k3: the plan does not estimate it, but f_mm, xp"
    ):
        candidates.of(wanted)
