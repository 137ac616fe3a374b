"""Figures of pixels: what is shown stands where it was taken, and is what was taken."""

import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.collections import PathCollection
from matplotlib.text import Annotation
from numpy.testing import assert_allclose

from acx4book.chapters.synthetic_image.figures import seams
from acx4book.chapters.synthetic_image.pictures import (
    head_pictures,
    overlap_ties,
    synthetic_picture,
)
from acx4lib.synthetic_image.frame import reduced_heads
from support.figures import drawn, sentence, title
from support.pictures import taken
from support.pictures.known import NAMES, PIXEL_MM, K, pictured, refined, tied

# --- as they were taken ----------------------------------------------------------------------


def heads_of(fig):
    """Axes with pictures, by head."""
    return {title(ax): ax for ax in fig.axes if ax.images}


def test_heads_stand_as_they_lie_in_the_synthetic_image(pictures, orientation):
    fig = drawn(head_pictures(pictures, orientation))
    place = {name: ax.get_position().p0 for name, ax in heads_of(fig).items()}
    assert sorted(place) == NAMES
    # as Table 1 places them: 1 and 2 to the left, 2 and 3 above
    corners = np.array([place[name] for name in NAMES])
    (left, below), (right, above) = corners[0], corners[2]
    assert left < right
    assert below < above
    expected = [[left, below], [left, above], [right, above], [right, below]]
    assert_allclose(corners, expected, atol=1e-12)


def test_the_arrow_shows_the_flight_as_the_heads_are_turned(pictures, orientation):
    fig = drawn(head_pictures(pictures, orientation))
    down = {}
    for name, ax in heads_of(fig).items():
        (arrow,) = (t for t in ax.texts if isinstance(t, Annotation) and t.arrow_patch)
        (col, row), (tail_col, tail_row) = arrow.xy, arrow.xyann
        assert abs(row - tail_row) > 10 * abs(col - tail_col)
        down[name] = bool(row > tail_row)
    # kappa of Table 1 is near +90 degrees for 1 and 4: forward is the head's -y, down
    assert down == {"CAM1": True, "CAM2": False, "CAM3": False, "CAM4": True}


# --- put together ----------------------------------------------------------------------------


def test_the_synthetic_image_is_shown_the_right_way_up(pictures, orientation):
    image = np.full((506, 375, 3), 1000, np.uint16)
    image[:50, :50] = 3000
    fig = drawn(synthetic_picture(image, pictures, orientation))
    shown = fig.axes[0].images[0]
    assert shown.origin == "upper"
    values = np.asarray(shown.get_array())
    assert values[:10, :10].min() > values[-10:, -10:].max()
    assert_allclose(shown.get_extent(), [-33.6, 33.6, -45.3376, 45.3376])  # 375 x 506 of 179.2 um
    assert {t.get_text() for t in fig.axes[0].texts} >= set(NAMES)


@pytest.mark.parametrize(("height_m", "unit"), [(None, "mm"), (1300.0, "m")])
def test_the_scale_bar_is_in_the_image_or_on_the_ground(pictures, orientation, height_m, unit):
    image = np.full((506, 375, 3), 1000, np.uint16)
    fig = drawn(synthetic_picture(image, pictures, orientation, height_m=height_m))
    labels = [t.get_text() for t in fig.axes[0].texts]
    (bar,) = (label for label in labels if re.fullmatch(r"[\d.]+ m+", label))
    # a quarter of 67.2 mm at most; at 1300 m and a focal length of 74 mm 1 mm is 17.6 m
    assert bar == {"mm": "10 mm", "m": "200 m"}[unit]


# --- all of them -----------------------------------------------------------------------------


def test_without_pixels_there_is_a_sentence(orientation, found, fit):
    figures = [
        head_pictures(None, orientation),
        overlap_ties(None, orientation, found[0]),
        synthetic_picture(None, None, orientation),
        seams(None, found[0], fit),
    ]
    expected = "heads/images.csv names no files with pixels."
    assert [sentence(fig) for fig in figures] == [expected] * 4


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
