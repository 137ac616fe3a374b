"""Bars end where the shares say, lines at the standard deviations."""

import numpy as np
import pytest

from acx4book.chapters.beyond.error_budget import figures
from acx4book.chapters.beyond.error_budget.examined import BARE, PAPERS, plan_and_height
from acx4lib.georeferencing import budget
from support.figures import drawn, panels


def test_stacked_bars_end_at_a_hundred_percent(found):
    fig = drawn(figures.stacked(found))
    for ax in panels(fig):
        ends = {}
        for bar in ax.patches:
            middle = round(bar.get_y() + bar.get_height() / 2)
            ends[middle] = max(ends.get(middle, 0.0), bar.get_x() + bar.get_width())
        assert list(ends.values()) == pytest.approx([100.0] * len(found.validations))


def test_the_calibrations_parts_are_signed(found):
    fig = drawn(figures.calibration(found))
    height = panels(fig)[1]
    widths = np.array([bar.get_width() for bar in height.patches]).reshape(2, -1)
    part = plan_and_height(found.points(BARE).mean)[1]
    expected = 100 * part[-len(budget.CALIBRATION) :] / part.sum()
    np.testing.assert_allclose(widths[0, :-1], expected)
    assert widths[0, -1] == pytest.approx(expected.sum())
    assert widths[0].min() < 0


def test_lines_are_standard_deviations(flown):
    fig = drawn(figures.over_heights(flown))
    line = panels(fig)[1].lines[0]
    expected = np.sqrt(flown.variance[PAPERS][:, 1].sum(axis=-1))
    np.testing.assert_allclose(line.get_ydata(), expected)
