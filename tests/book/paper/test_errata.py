"""The paper against itself: numbers computed independently of the library."""

from __future__ import annotations

import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.paper import errata, printed
from acx4files.stages import mounting
from acx4lib.calibration.determination import absorption
from support.flights.simulated import fly


@pytest.fixture(scope="module")
def findings() -> dict[int, errata.Finding]:
    return {finding.number: finding for finding in errata.audit()}


def test_there_are_22_findings_and_none_is_empty(findings):
    assert [*findings] == [*range(1, 23)]
    for finding in findings.values():
        assert all([finding.place, finding.printed, finding.computed, finding.verdict])
        assert "nan" not in finding.computed


@pytest.mark.parametrize(
    ("number", "numbers"),
    [
        (2, "(14)"),
        (3, "28 µm"),
        (5, "0.505, 0.497, 0.487"),
        (5, "n = 3.8 to 4.2"),
        (6, "7.3 % or 2.6 points"),
        (6, "P = 1·10⁻⁷"),
        (6, "0.22 m per axis"),
        (6, "21 %, on one axis 50 %"),
        (5, "for n = 4, and no other n up to 36, all 6 printed RMS come out exactly"),
        (7, "21.7 and 13.3 cm for 72 mm; 21.1 and 13.0 cm for 74 mm"),
        (7, "mean heads of 74.44, 74.17, 74.29, 74.37 mm"),
        (8, "44 px"),
        (9, "29 and 3 (28 and 3) standard deviations"),
        (9, "2.30 (2.33) px at r = 45.4 mm, 4.97 (5.05) px at the corner"),
        (10, "14.5, 13.2, 12.5, 13.7 px"),
        (12, "7.0, 12.6, 3.6; √52 = 7.2"),
        (13, "0.052: as mm in the image it would be 9 px"),
        (14, "the lever arm z, x, y is -0.201, +0.223, -0.399 m"),
        (
            14,
            "mean flying height of 1250 m the sums of the differences, +0.180, -0.198, +0.383",
        ),
        (14, "are -21, +25, -16 mm"),
        (15, "0.0035°, 3.6 standard deviations"),
        (15, "7.9 cm at 1300 m, 4.5 µm in the image beside the 11.8 µm of x_p"),
        (16, "12.8, 12.2, -9.9, -9.6°, in the mean 1.37°"),
        (17, "uncovered 0 %, with transposed rotations 47 %"),
        (18, "0.43 to 0.46 m, 4.3 to 4.6 pixels"),
        (20, "1:2000 C in plan, D in height; 1:5000 A in plan, B in height"),
        (20, "1:2000 in height: none"),
        (21, "0.113 m in plan"),
        (21, "0.44 m with the 67.2 mm along the flight (B/H 0.361)"),
        (21, "0.33 m with the 90.7 mm (B/H 0.487)"),
    ],
)
def test_computed_numbers_are_those_found_independently(findings, number, numbers):
    assert numbers in findings[number].computed


@pytest.mark.parametrize(
    ("number", "numbers"),
    [
        (2, "(15)"),
        (3, "2.57^07, -1.04^10, 2.28^14 in Table 3, but k1 = 2.27^-06"),
        (4, "p1, p2 in mm^-2 (Tables 1 and 3)"),
        (14, "+0.0107, -0.0118, +0.0228 mm, 11, 8, 13 standard"),
        (17, "67.20 × 90.72 mm with 5.6 µm"),
        (22, "262 pairs for 36 points"),
    ],
)
def test_printed_numbers_are_those_of_the_paper(findings, number, numbers):
    assert numbers in findings[number].printed


def test_heads_are_as_long_as_table_3_and_their_z_say():
    """A trial with a closed chain found 74.440, 74.169, 74.292, 74.370 mm."""
    assert_allclose(errata.numbers(7)["heads"], (74.440, 74.169, 74.292, 74.370), atol=0.006)


def test_what_the_images_say_of_the_fixed_focal_length_comes_from_a_run():
    rejected = {"value": 74.0, "cost": 36.3, "moves": {}}
    summary = {
        "heads/bundle/CAM1": {"held": {"CAM1/f_mm": rejected}, "held_rejected": ["CAM1/f_mm"]},
        "heads/bundle/CAM2": {"held": {"CAM2/f_mm": rejected}, "held_rejected": []},
        "mounting/single_step": {},
    }
    costs = errata.rejected_focal_lengths(SimpleNamespace(summary=summary))
    assert costs == {"CAM1": 36.3}
    (said, silent) = (errata.audit(errata.Run(held_f=of))[6].verdict for of in (costs, {}))
    assert "reject the fixed value: it costs 36 in v'Pv" in said
    assert "reject" not in silent


def test_neither_nominal_focal_length_is_proved_by_rounded_ground_pixels(findings):
    assert "misses them by at most 0.3 cm, 74 mm by 0.9 cm" in findings[7].verdict
    assert "says nothing" not in findings[7].verdict


# --- Table 4 -------------------------------------------------------------------------------


def test_rms_of_36_errors_is_at_least_half_a_metre():
    assert_allclose(errata.numbers(5)["least"], (0.505, 0.497, 0.487), atol=5e-4)


def test_implied_sample_sizes_are_about_four():
    found = errata.numbers(5)
    sizes = found["sizes"]
    assert found["n_axes"] == 6
    assert_allclose(sizes, (3.77, 4.17, 4.08, 3.82, 3.85, 3.78), atol=0.005)
    assert (found["least_sizes"] < sizes).all()
    assert (sizes < found["largest_sizes"]).all()
    assert found["largest_sizes"].max() < 5


def test_a_sample_of_the_implied_size_has_the_printed_rms():
    sizes = iter(errata.numbers(5)["sizes"])
    for method in printed.METHODS:
        for axis in ("east", "north", "height"):
            mean, rms = (printed.value(4, f"{kind}_{axis}_m", method) for kind in ("mean", "rms"))
            std = printed.sigma(4, f"mean_{axis}_m", method)
            assert rms == pytest.approx(np.sqrt(mean**2 + (1 - 1 / next(sizes)) * std**2))


def test_every_printed_rms_is_that_of_four_errors():
    """sqrt(mean^2 + 3/4 std^2), by hand: 0.4445, 0.4371, 0.4285; 0.4435, 0.4629, 0.4543."""
    assert errata.numbers(5)["matching"] == "4"


def test_fourteen_small_errors_of_36_do_not_happen_by_chance():
    assert errata.numbers(6)["share"] == pytest.approx(7.3, abs=0.05)
    assert errata.numbers(6)["p"] == pytest.approx(1e-7, rel=0.5)
    assert errata.numbers(6)["needed"] == pytest.approx(0.22, abs=0.005)


def test_errors_of_the_needed_size_have_the_printed_share_of_small_ones():
    rms = errata.numbers(6)["needed"]
    d = np.random.default_rng(3).normal(0.0, rms, (4000, 36, 3))
    share = np.mean(np.linalg.norm(d, axis=2) <= 0.30)
    assert share == pytest.approx(14 / 36, abs=0.004)  # 3 sigma


# --- heads ---------------------------------------------------------------------------------


def test_border_distortion_of_the_heads():
    found = errata.numbers(10)
    assert_allclose(found["radial"], (14.5, 13.2, 12.5, 13.7), atol=0.05)
    assert np.all(found["total"] > found["radial"])


def test_coverage_tells_which_way_the_angles_turn():
    found = errata.numbers(17)
    assert found["as_read"] == 0.0
    assert found["transposed"] == pytest.approx(47, abs=1)


def test_footprints_reach_beyond_the_synthetic_image():
    """An earlier count without distortion, principal points and Zc: -43.9..38.6, -56.2..56.0."""
    found = errata.numbers(17)
    for name, ends in (("x", (-43.9, 38.6)), ("y", (-56.2, 56.0))):
        assert_allclose([float(end) for end in found[name].split(" to ")], ends, atol=0.3)


def test_correlations_are_judged_by_the_largest():
    below = {"CAM1 xp_mm/omega_deg": -0.09, "CAM1 yp_mm/phi_deg": 0.02}
    finding = errata.audit(errata.Run(correlations=below))[10]
    assert finding.computed.startswith("largest: -0.09 (CAM1 x_p/ω)")
    assert finding.verdict.startswith("Holds")
    above = {"CAM1 xp_mm/omega_deg": 0.02, "CAM2 yp_mm/phi_deg": -0.85}
    finding = errata.audit(errata.Run(correlations=above))[10]
    assert finding.computed.startswith("largest: -0.85 (CAM2 y_p/φ)")
    assert finding.verdict.startswith("Cannot")


# --- mounting ------------------------------------------------------------------------------


def test_interior_orientation_absorbed_the_lever_arm():
    table = errata.lever_arm_in_interior()
    assert [*table["lever"]] == ["lever_z_m", "lever_x_m", "lever_y_m"]
    assert_allclose(table["at_ground_m"], (0.180, -0.198, 0.383), atol=5e-4)
    assert_allclose(table["lever_m"], (-0.201, 0.223, -0.399))
    assert_allclose(table["shift_in_sigma"], (11, 8, 13), atol=0.5)
    assert_allclose(table["sum_m"], (-0.021, 0.025, -0.016), atol=5e-4)


@pytest.fixture(scope="module")
def absorbed_by_the_study():
    """By the simulated flight without noise, whose lever arm is Table 3's."""
    flight = fly("acx4-ideal", seed=1, blocks=("calibration",), exact=True).flight
    return absorption(mounting.calibrate(flight, flight.calibration))


def test_effective_heights_explain_the_paper_to_millimetres(absorbed_by_the_study):
    """Found independently: 1411, 1362, 1286 m for z, x, y, and sums of +2, +7, -5 mm."""
    table = errata.lever_arm_in_interior(absorbed_by_the_study)
    assert_allclose(table["height_m"], (1411, 1362, 1286), rtol=0.01)
    assert_allclose(table["sum_effective_m"], (0.002, 0.007, -0.005), atol=0.0015)
    assert_allclose(table["expected_mm"], table["shift_mm"], atol=0.0004)


def test_item_14_says_more_with_a_run(absorbed_by_the_study):
    finding = errata.audit(errata.Run(absorbed=absorbed_by_the_study))[13]
    assert "with the heights that least squares gives" in finding.computed
    assert "more than the rounding of the print, 0.04 µm" in finding.verdict


def test_distortion_left_in_the_synthetic_image():
    """At the middle of the short sides, and at the corner."""
    found = errata.numbers(9)
    assert found["edge"] == pytest.approx(90.72 / 2)
    for column, edge_px, corner_px in (("single", 2.30, 4.97), ("two", 2.33, 5.05)):
        assert found[column]["edge_px"] == pytest.approx(edge_px, abs=0.005)
        assert found[column]["corner_px"] == pytest.approx(corner_px, abs=0.005)


def test_decentring_at_the_corner():
    """1.8 px in x; the vector is longer."""
    component, length = (errata.numbers(9)["two"][name] for name in ("component", "length"))
    assert component == pytest.approx(1.8, abs=0.05)
    x, y, p1, p2 = 33.6, 45.36, 1.73e-6, 2.46e-7
    dx, dy = 3 * p1 * x**2 + p1 * y**2 + 2 * p2 * x * y, 3 * p2 * y**2 + p2 * x**2 + 2 * p1 * x * y
    assert length == pytest.approx(np.hypot(dx, dy) / 0.0056)


def test_scatter_and_parameter_sigmas():
    assert_allclose(errata.numbers(12)["ratios"], (7.0, 12.6, 3.6), atol=0.05)


def test_exponents_are_taken_literally():
    """2.57^07, 2.28^14 and a corner at 56.4 mm."""
    found, r = errata.numbers(3), np.hypot(33.6, 45.36)
    assert found["k1_m"] == pytest.approx(1e-3 * 2.57e7 * r**3)
    assert found["k3_m"] == pytest.approx(1e-3 * 2.28e14 * r**7)


# --- text, budget, agreements --------------------------------------------------------------


def test_eq_2_as_printed_would_be_seen():
    """At the corners, k1 r^2 (|x| + |y|) of CAM1, its principal point included."""
    x, y = 26.952 + 0.0465, 20.196 + 0.0813  # mm from the principal point, worst corner
    moved = errata.numbers(1)["moved_px"]
    assert moved >= 2.27e-6 * 33.679**2 * (26.952 + 20.196) / 0.006
    assert moved == pytest.approx(2.27e-6 * (x**2 + y**2) * (x + y) / 0.006, rel=0.01)


def test_pairs_per_point():
    m = errata.numbers(22)["images"]
    assert m * (m - 1) / 2 == pytest.approx(262 / 36)


SIDES = ("by_width", "by_height")


def test_error_budget():
    found = errata.numbers(21)
    along, across = ([found[side][key] for key in ("ratio", "m")] for side in SIDES)
    assert_allclose((found["plan"], *along), (0.113, 0.361, 0.44), atol=0.005)
    assert_allclose(across, (0.487, 0.33), atol=0.005)


def test_what_agrees():
    agreements = errata.agreements().set_index("paper")["computed"]
    assert agreements["31 and 52 images"].endswith("31 and 52")
    assert agreements["60.5 megapixels"].endswith("60.5 million")
    assert agreements["67.20 × 90.72 mm"].startswith("67.20 × 90.72 mm")
    said = "ground pixels 8 and 11 cm in block 2, 10 cm in block 3"
    assert agreements[said] == "7.5, 11.3, 9.8 cm, by the pixels of the synthetic image"
    assert agreements["residuals of 3 µm, 0.5 pixel"].startswith("0.54 pixel")
    assert agreements["38.89 %"].endswith("38.89 %")
    assert agreements["rotation matrix of ω, φ, κ"].startswith("a proper rotation")


def test_every_decimal_of_the_errata_is_computed():
    """No finding's text has a number with decimals typed in it."""
    source = re.sub(r'"""[\s\S]*?"""', "", Path(errata.__file__).read_text("utf-8"))
    findings = [line for line in errata.TEXT.read_text("utf-8").splitlines() if line[:2] != "##"]
    typed = [*re.findall(r'f?"([^"\n]*)"', source), *findings]
    plain = [re.sub(r"\{+[^}]*\}+", "", piece) for piece in typed]
    sections = {"2.1", "2.2", "3.1", "3.2", "4.1", "4.3"}
    assert {n for piece in plain for n in re.findall(r"\d+\.\d+", piece)} <= sections
