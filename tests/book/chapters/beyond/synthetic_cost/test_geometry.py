"""What four lens centres make of one camera: patterns, a lever arm, and radial distortion."""

import numpy as np
import pandas as pd
import pytest

from acx4book.chapters.beyond.synthetic_cost import geometry, study
from acx4book.paper import printed

# --- the pattern of residuals


def two_heights(at_1000, at_1500, heads=("CAM1", "CAM2")):
    """Return a pattern of two nodes beside each other."""
    return pd.DataFrame(
        [
            {
                "height_m": h,
                "head": head,
                "col_px": c,
                "row_px": 0.0,
                "d_col_px": d,
                "d_row_px": 0.0,
            }
            for h, values in ((1000.0, at_1000), (1500.0, at_1500))
            for head, c, d in zip(heads, (0.0, 1.0), values, strict=True)
        ]
    )


def test_a_pattern_in_proportion_to_1_over_h_is_followed_to_any_height():
    pattern = two_heights((3.0, -6.0), (2.0, -4.0))
    found = geometry.at_height(pattern, 3000.0)
    assert found["d_col_px"].tolist() == pytest.approx([1.0, -2.0])
    assert geometry.largest_px(found) == pytest.approx(2.0)
    assert geometry.largest_step_px(found) == pytest.approx(3.0)
    assert geometry.rms_px(found) == pytest.approx(np.sqrt(5 / 4))


def test_a_step_within_one_head_is_none_of_a_seam():
    found = geometry.at_height(two_heights((3.0, -6.0), (2.0, -4.0), ("CAM1", "CAM1")), 1000.0)
    assert geometry.largest_step_px(found) == 0


def test_the_flying_heights_of_the_study_come_out_as_stored():
    pattern = study.read().pattern
    for height_m, own in pattern.groupby("height_m"):
        found = geometry.at_height(pattern, float(height_m))
        assert geometry.rms_px(found) == pytest.approx(geometry.rms_px(own))


def test_the_largest_steps_are_at_the_seams():
    pattern = study.read().pattern
    found = geometry.at_height(pattern, 1000.0)
    whole = found.assign(head=[f"{c % 2}{r % 2}" for c, r in zip(*places(found), strict=True)])
    within = geometry.largest_step_px(whole)  # every pair of neighbours counts as a seam
    assert geometry.largest_step_px(found) == pytest.approx(within)


def places(found):
    return [np.unique(found[name], return_inverse=True)[1] for name in ("col_px", "row_px")]


# --- the lever arm


def test_it_is_the_least_squares_factor_over_the_frame():
    size, f, side = np.array([60.0, 80.0]), 70.0, 0.2
    axes = [(np.arange(n) + 0.5) / n - 0.5 for n in (200, 300)]
    t = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2) * size / f
    d = np.sign(t) * side / 2
    expected = np.linalg.lstsq(t.reshape(-1, 1), d.ravel(), rcond=None)[0][0]
    assert geometry.apparent_rise_m(side, f, size) == pytest.approx(expected, rel=1e-4)


def test_it_explains_the_exact_lever_arm_but_for_an_eighth():
    z = study.read().squares.query("parameter == 'lever_z_m'").set_index("side_m")["value"]
    size = np.ptp(printed.corners("SYN"), axis=0)
    rise = geometry.apparent_rise_m(0.16, 74.44, size)
    # the points do not fill the frame evenly, and GNSS positions have a say
    assert z.loc[0.16] - z.loc[0] == pytest.approx(rise, rel=0.15)
    assert z.loc[0.08] - z.loc[0] == pytest.approx((z.loc[0.16] - z.loc[0]) / 2, abs=0.001)
    assert z.loc[0] == pytest.approx(geometry.true_centre_m()[2], abs=0.01)


# --- radial distortion


def test_it_is_the_polynomial_of_eq_7():
    found = geometry.radial_um(np.array([1e-7, 1e-10, 1e-13]), np.array([10.0, 0.0]))
    assert found == pytest.approx([1000 * (1e-4 + 1e-5 + 1e-6), 0])


def test_the_radius_ends_at_the_corner_of_the_frame():
    assert geometry.radius_mm()[-1] == pytest.approx(np.hypot(67.2, 90.72) / 2)


def test_a_line_is_followed_to_the_focal_length_of_the_print():
    differences = pd.DataFrame({"k1": [-1.0, 1.0], "k2": [-3.0, -1.0]}, index=[74.0, 74.2])
    assert geometry.focal_lengths(differences) == pytest.approx([74.1, 74.3])


def test_the_print_itself_is_no_sigma_away():
    found = study.read()
    own = found.sweep.copy()
    for name, value in zip(geometry.RADIAL, geometry.printed_with_sigma()[0], strict=True):
        own.loc[(own["camera"] == "SYN") & (own["parameter"] == name), "value"] = value
    planted = study.Study(**{**vars(found), "sweep": own})
    assert all((table == 0).all(axis=None) for table in geometry.in_sigma(planted).values())


def test_without_distance_of_the_centres_there_is_hardly_any_distortion():
    curves = geometry.by_side(study.read())
    corner = geometry.radial_um(curves.to_numpy().T, geometry.radius_mm())[-1]
    assert abs(corner[0]) < 0.5
    assert corner[2] == pytest.approx(2 * corner[1], rel=0.1)  # in proportion to the side
