"""Bars end where the shares say, lines at the standard deviations."""

from dataclasses import replace

import numpy as np
import pytest

from acx4book.chapters.beyond.error_budget import figures
from acx4book.chapters.beyond.error_budget.tables import plan_and_height
from acx4lib.georeferencing import budget
from acx4lib.georeferencing.mapping_flight import over_ground
from support.figures import drawn, panels


def test_stacked_bars_end_at_a_hundred_percent(found):
    fig = drawn(figures.stacked(found.points))
    for ax in panels(fig):
        ends = {}
        for bar in ax.patches:
            middle = round(bar.get_y() + bar.get_height() / 2)
            ends[middle] = max(ends.get(middle, 0.0), bar.get_x() + bar.get_width())
        assert list(ends.values()) == pytest.approx([100.0] * len(found.validations))


def test_the_calibrations_parts_are_signed(found):
    fig = drawn(figures.calibration(found.points))
    height = panels(fig)[1]
    widths = np.array([bar.get_width() for bar in height.patches]).reshape(2, -1)
    part = plan_and_height(found.points["two_step"].mean)[1]
    expected = 100 * part[-len(budget.CALIBRATION) :] / part.sum()
    np.testing.assert_allclose(widths[0, :-1], expected)
    assert widths[0, -1] == pytest.approx(expected.sum())
    assert widths[0].min() < 0


@pytest.fixture(scope="module")
def heights(found):
    heights_m = np.array([500.0, 1000.0, 2000.0, 3000.0])
    return heights_m, {
        name: [over_ground(one, replace(found.mapping, height_m=h)) for h in heights_m]
        for name, one in found.calibrations.items()
    }


def test_lines_are_standard_deviations(heights):
    fig = drawn(figures.over_heights(*heights, method="single_step"))
    line = panels(fig)[1].lines[0]
    expected = [np.sqrt(split.mean[2].sum()) for split in heights[1]["single_step"]]
    np.testing.assert_allclose(line.get_ydata(), expected)


def test_image_points_grow_with_the_height(heights):
    """Within a percent: the lever arm, 0.2 m, moves the borders of low images on the ground."""
    first, *_, last = heights[1]["single_step"]
    np.testing.assert_allclose(np.sqrt(last.mean[:, 0] / first.mean[:, 0]), 6, rtol=1e-2)


def test_the_two_step_calibration_is_good_at_its_own_heights_only(heights):
    share = [budget.shares(split.mean[2])["calibration"] for split in heights[1]["two_step"]]
    assert np.argmin(share) == 1
    assert share[-1] > 10 * min(share)
    single = [budget.shares(split.mean[2])["calibration"] for split in heights[1]["single_step"]]
    assert max(single) < 0.03
