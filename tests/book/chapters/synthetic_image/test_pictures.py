"""Figures of pixels: what is shown stands where it was taken, and is what was taken."""

import re
from dataclasses import replace

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.collections import PathCollection
from matplotlib.text import Annotation
from numpy.testing import assert_allclose

from acx4book.chapters.synthetic_image.figures import seams
from acx4book.chapters.synthetic_image.pictures import (
    head_pictures,
    overlap_ties,
    stack,
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


def test_all_heads_are_shown_with_one_stretch(pictures, orientation, images):
    fig = drawn(head_pictures(pictures, orientation))
    shown = {name: np.asarray(ax.images[0].get_array()) for name, ax in heads_of(fig).items()}
    assert all(values.shape == (*images[0].shape[:2], 3) for values in shown.values())
    middle = np.s_[60:150, 90:190]
    # the pictures' own gains: 3 % more from head to head; and their falloff to the corners
    means = [shown[name].mean() for name in NAMES]
    taken_means = [image.mean() for image in images]
    assert np.array_equal(np.argsort(means), np.argsort(taken_means))
    assert all(v[middle].mean() > v[:40, :40].mean() for v in shown.values())


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


def test_large_pictures_are_reduced_to_what_a_figure_shows(orientation):
    images = [np.full((1683, 2246, 3), 1000 + k, np.uint16) for k in range(4)]
    fig = drawn(head_pictures(pictured(images, 4), orientation))
    for ax in heads_of(fig).values():
        across = ax.get_window_extent().width * 150 / fig.dpi
        assert ax.images[0].get_array().shape[1] < 1.5 * across


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("bands", [1, 2, 4])
def test_any_number_of_bands_and_bits_is_shown(orientation, dtype, bands):
    images = [np.full((210, 280, bands), 90 + k, dtype) for k in range(4)]
    fig = drawn(head_pictures(pictured(images), orientation))
    shown = [np.asarray(ax.images[0].get_array()) for ax in heads_of(fig).values()]
    assert all(values.shape[2] == 3 for values in shown)


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


def test_enlarged_parts_are_the_pixels_at_the_place_that_is_said(orientation):
    rng = np.random.default_rng(1)
    image = np.full((2025, 1500, 3), 5000, np.uint16)
    for row, col in ((400, 400), (1500, 1000)):
        image[row : row + 100, col : col + 100] = rng.integers(1000, 60000, (100, 100, 3))
    fig = drawn(synthetic_picture(image, pictured([], 8), orientation))
    crops = fig.axes[1:]
    assert len(crops) == 2
    for ax, (row, col) in zip(crops, ((400, 400), (1500, 1000)), strict=True):
        text = ax.texts[0].get_text()
        left, top = (int(n) for n in re.search(r"column (\d+), row (\d+)", text).groups())
        assert left - 100 < col < left + 170
        assert top - 100 < row < top + 170
        part = image[top : top + 170, left : left + 170].astype(float)
        shown = np.asarray(ax.images[0].get_array())
        inside_range = (shown > 0.02) & (shown < 0.98)
        order = np.argsort(part[inside_range])
        # grey values grow with those of the file, to a 256th
        assert np.diff(shown[inside_range][order]).min() >= -1e-9


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


def test_heads_over_each_other_have_fringes_only_before_they_are_refined(orientation, images):
    one = replace(
        orientation,
        heads=orientation.heads[:1] * 3,
        opk=orientation.opk[[0, 0, 0]],
        xyz_mm=orientation.xyz_mm[[0, 0, 0]],
        cov_joint=np.zeros((48, 48)),
    )
    off = replace(one, opk=one.opk + np.radians([[0, 0, 0], [0.6, 0, 0], [0, 0.6, 0]]))
    ties, _ = tied(one, (0, 1), 20)
    pictures = pictured([images[0]] * 3)
    fig = drawn(stack(pictures, refined(off, ties, rotations=one)))
    crops = {title(ax): np.asarray(ax.images[0].get_array()) for ax in fig.axes[1:]}
    assert sorted(crops) == ["A, as calibrated", "A, refined"]  # elsewhere the head sees nothing
    for name, crop in crops.items():  # one picture as three bands is grey where they fit
        assert (np.ptp(crop, axis=-1).max() < 0.02) == name.endswith("refined")
    assert sentence(stack(None, refined(off, ties))).endswith("names no files with pixels.")


def test_figures_of_pixels_are_the_same_every_time_and_leave_nothing(pictures, orientation, found):
    before = dict(mpl.rcParams), plt.get_fignums()
    one, two = (
        np.asarray(drawn(overlap_ties(pictures, orientation, found[0])).canvas.buffer_rgba())
        for _ in range(2)
    )
    assert np.array_equal(one, two)
    assert (dict(mpl.rcParams), plt.get_fignums()) == before


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
