"""The residual pattern of the synthetic image at other flying heights."""

import numpy as np
import pandas as pd
import pytest

from acx4book.chapters.beyond.synthetic_cost import heights, study


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
    found = heights.at_height(pattern, 3000.0)
    assert found["d_col_px"].tolist() == pytest.approx([1.0, -2.0])
    assert heights.largest_px(found) == pytest.approx(2.0)
    assert heights.largest_step_px(found) == pytest.approx(3.0)
    assert heights.rms_px(found) == pytest.approx(np.sqrt(5 / 4))


def test_a_step_within_one_head_is_none_of_a_seam():
    found = heights.at_height(two_heights((3.0, -6.0), (2.0, -4.0), ("CAM1", "CAM1")), 1000.0)
    assert heights.largest_step_px(found) == 0


def test_the_flying_heights_of_the_study_come_out_as_stored():
    pattern = study.read().pattern
    for height_m, own in pattern.groupby("height_m"):
        found = heights.at_height(pattern, float(height_m))
        assert heights.rms_px(found) == pytest.approx(heights.rms_px(own))


def test_the_largest_steps_are_at_the_seams():
    pattern = study.read().pattern
    found = heights.at_height(pattern, 1000.0)
    whole = found.assign(head=[f"{c % 2}{r % 2}" for c, r in zip(*places(found), strict=True)])
    within = heights.largest_step_px(whole)  # every pair of neighbours counts as a seam
    assert heights.largest_step_px(found) == pytest.approx(within)


def places(found):
    return [np.unique(found[name], return_inverse=True)[1] for name in ("col_px", "row_px")]
