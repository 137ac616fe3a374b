"""Curves of the heads' responses."""

import numpy as np
from numpy.testing import assert_allclose

from acx4book.chapters.synthetic_image.figures.response import response_curves
from support.figures import drawn, sentence, title


def test_response_curves_run_from_the_middle_to_the_corner(fit, orientation):
    fig = drawn(response_curves(fit, orientation))
    bands = fig.axes[:3]
    assert [title(ax) for ax in bands] == ["red", "green", "blue"]
    red = [np.asarray(line.get_ydata()) for line in bands[0].lines]
    assert_allclose([curve[0] for curve in red], 100 * np.exp([0.02, -0.02]))
    assert_allclose([curve[-1] for curve in red], 100 * np.exp([-0.23, -0.27]))
    assert_allclose(np.asarray(bands[0].lines[0].get_xdata())[[0, -1]], [0, 1])


def test_disagreements_are_in_per_cent_band_by_band(fit, orientation):
    fig = drawn(response_curves(fit, orientation))
    ax = fig.axes[3]
    before, after, floor = (np.asarray(line.get_xdata()) for line in ax.lines)
    assert_allclose(before, [10, 20, 5])
    assert_allclose(after, [0.6, 0.5, 0.4])
    assert_allclose(floor, [0.5, 0.4, 0.3])
    assert [t.get_text() for t in ax.get_yticklabels()] == ["CAM1, CAM2"]
    assert "at most 20.0 % as taken and 0.60 % after" in ax.texts[0].get_text()


def test_without_overlaps_there_is_no_response(orientation):
    assert "tells their responses" in sentence(response_curves(None, orientation))
