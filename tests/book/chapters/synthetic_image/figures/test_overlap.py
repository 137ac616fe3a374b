"""Figures of an overlap: tie points stand where both heads see them."""

import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import PathCollection
from numpy.testing import assert_allclose

from acx4book.chapters.synthetic_image.figures.overlap import overlap_ties
from acx4lib.synthetic_image.frame import reduced_heads
from support.figures import drawn, sentence, title
from support.pictures import taken
from support.pictures.tied import PIXEL_MM, K, pictured, refined, tied


def test_tie_points_stand_where_both_heads_see_them(pictures, orientation, found):
    fig = drawn(overlap_ties(pictures, orientation, found[0]))
    picture = fig.axes[0]
    assert title(picture) == "CAM1 and CAM2"  # most tie points
    (marks,) = (c for c in picture.collections if isinstance(c, PathCollection))
    at = np.asarray(marks.get_offsets())
    order = np.lexsort(at.T), np.lexsort(found[1].T)
    # the pixels are known to 1e-9, which are rounded off 1e-7 mm at most
    assert_allclose(at[order[0]], found[1][order[1]], atol=1e-6)
    assert "150 tie points" in picture.texts[0].get_text()  # those of the other exposure are not


def test_lengths_of_differences_are_in_pixels_of_the_synthetic_image(pictures, orientation, found):
    fig = drawn(overlap_ties(pictures, orientation, found[0]))
    histogram = fig.axes[2]
    (marks,) = (c for c in fig.axes[0].collections if isinstance(c, PathCollection))
    assert_allclose(np.asarray(marks.get_array()), 0.5, rtol=1e-6)  # 0.3 and 0.4
    rms = float(re.search(r"rms ([\d.]+) px", histogram.texts[0].get_text())[1])
    assert rms == pytest.approx(0.5 / np.sqrt(2), abs=5e-4)  # printed with three digits
    assert sum(bar.get_height() for bar in histogram.patches) == 150
    assert histogram.get_xlabel() == "length of the difference (px)"


def test_predicted_lengths_are_those_of_normal_errors(pictures, orientation):
    rng = np.random.default_rng(2)
    ties, _ = tied(orientation, (0, 1), 3000)
    noise = rng.standard_normal((2, 3000, 2))
    noisy = replace(ties, colrow_a=ties.colrow_a + noise[0], colrow_b=ties.colrow_b + noise[1])
    fig = drawn(overlap_ties(pictures, orientation, refined(orientation, noisy)))
    histogram = fig.axes[2]
    (line,) = histogram.lines
    count = np.array([bar.get_height() for bar in histogram.patches])
    expected = np.asarray(line.get_ydata())
    # counts scatter by their root; heads see the frame at a slant, which is not in a pixel's size
    assert np.abs(count - expected).max() < 5 * np.sqrt(expected.max()) + 0.1 * expected.max()


def test_the_picture_of_an_overlap_shows_the_ground_at_its_place(orientation, found):
    synthetic = taken.synthetic(K)
    ground = np.full((512, 512), 1000.0)
    ground[258:264, 100:106] = 30000.0  # columns 100 to 105, rows 258 to 263 of the image
    rng = np.random.default_rng(1)
    seen = taken.pictures(reduced_heads(orientation, K), synthetic, ground, rng, noise=0.0)
    fig = drawn(overlap_ties(pictured(seen), orientation, found[0]))
    image = fig.axes[0].images[0]
    shown = np.asarray(image.get_array())
    values = np.where(shown[..., 3] > 0, shown[..., 0], 0)  # transparent is no data
    left, right, bottom, top = image.get_extent()
    row, col = np.unravel_index(np.argmax(values), values.shape)
    x = left + (col + 0.5) * (right - left) / values.shape[1]
    y = top - (row + 0.5) * (top - bottom) / values.shape[0]
    expected = PIXEL_MM * np.array([102.5 - 187, 252.5 - 260.5])  # from 375 x 506 pixels
    assert_allclose([x, y], expected, atol=4 * PIXEL_MM)  # the spot is 6 pixels wide


def test_a_pair_can_be_chosen(pictures, orientation, found):
    fig = drawn(overlap_ties(pictures, orientation, found[0], pair=(2, 3)))
    assert title(fig.axes[0]) == "CAM3 and CAM4"
    assert "40 tie points" in fig.axes[0].texts[0].get_text()


def test_an_overlap_without_tie_points_says_so(pictures, orientation, found):
    chosen = overlap_ties(pictures, orientation, found[0], pair=(0, 3))
    none = overlap_ties(pictures, orientation, refined(orientation, found[0].kept[:0]))
    assert sentence(chosen) == sentence(none)
    assert "No tie point" in sentence(none)
