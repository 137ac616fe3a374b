"""Figures of pixels: what is shown stands where it was taken, and is what was taken."""

import re
import warnings
from dataclasses import replace

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PathCollection
from matplotlib.quiver import Quiver
from matplotlib.text import Annotation
from numpy.testing import assert_allclose

import pictures as taken
from acx4book.chapters.synthetic_image.figures.frame import refinements
from acx4book.chapters.synthetic_image.figures.overlap import overlap_ties
from acx4book.chapters.synthetic_image.figures.pictures import head_pictures, synthetic_picture
from acx4book.chapters.synthetic_image.figures.response import response_curves
from acx4book.chapters.synthetic_image.figures.seams import seams
from acx4lib.geometry.camera import inside
from acx4lib.stages.pictures import Exposed, Pictures
from acx4lib.stages.synthetic import Refinement
from acx4lib.synthetic_image.frame import head_from_synthetic, reduced_heads
from acx4lib.synthetic_image.response import (
    OverlapResponse,
    Response,
    ResponseFit,
    estimate_response,
)
from acx4lib.tie_points.ties import TiePoints

mpl.use("agg")

K = 32
"""Images are reduced by it: 280 x 210 pixels."""

NAMES = ["CAM1", "CAM2", "CAM3", "CAM4"]
PIXEL_MM = 0.0056 * K


def drawn(fig):
    """Draw a figure as it goes into the book; every warning is an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        FigureCanvasAgg(fig).draw()
    return fig


def sentence(fig):
    (text,) = drawn(fig).axes[0].texts
    return text.get_text()


def title(ax):
    return ax.get_title(loc="left")


def pictured(images, k=K):
    """As the stage hands them to the figures: the exposure in the middle is the second of two."""
    dark = tuple(np.zeros_like(image) for image in images)
    return Pictures(
        exposed=(
            Exposed(exposure="before", exposure_idx=3, images=dark),
            Exposed(exposure="now", exposure_idx=7, images=tuple(images)),
        ),
        reduction=k,
        synthetic=taken.synthetic(k),
        n_complete=2,
    )


@pytest.fixture(scope="module")
def orientation():
    return taken.heads(1)


@pytest.fixture(scope="module")
def images(orientation):
    rng = np.random.default_rng(1)
    ground = taken.texture(512, rng)
    ground[200:204, 100:104] *= 4  # a white square, for its place
    return taken.pictures(reduced_heads(orientation, K), taken.synthetic(K), ground, rng)


@pytest.fixture(scope="module")
def pictures(images):
    return pictured(images)


def tied(orientation, pair, n, *, shift_mm=(0.0, 0.0), exposure=7, seed=1):
    """Tie points of a pair whose second head is off by a shift in the synthetic image."""
    xy = np.random.default_rng(seed).uniform([-33, -45], [33, 45], (40 * n, 2))
    colrow = [head_from_synthetic(orientation, k, xy) for k in pair]
    both = np.all(
        [inside(orientation.heads[k], c) for k, c in zip(pair, colrow, strict=True)], axis=0
    )
    xy = xy[both][:n]
    a = head_from_synthetic(orientation, pair[0], xy - np.array(shift_mm) / 2)
    b = head_from_synthetic(orientation, pair[1], xy + np.array(shift_mm) / 2)
    ties = TiePoints(
        head_a=np.full(len(xy), pair[0]),
        head_b=np.full(len(xy), pair[1]),
        exposure_idx=np.full(len(xy), exposure),
        point_idx=np.arange(len(xy)),
        colrow_a=a,
        colrow_b=b,
        sigma_px=np.full(len(xy), 1.0),
    )
    return ties, xy


def joined(*parts):
    names = TiePoints.__dataclass_fields__
    return TiePoints(**{n: np.concatenate([getattr(p, n) for p in parts]) for n in names})


def refined(orientation, ties, **others):
    ways = {"before": orientation} | others
    return Refinement(ties=ties, from_pixels=True, orientations=ways, fits={}, reasons={})


@pytest.fixture(scope="module")
def found(orientation):
    """150 tie points of heads 1 and 2 that differ by 0.3 and 0.4 pixels, fewer of others."""
    shift = (0.3 * PIXEL_MM, 0.4 * PIXEL_MM)
    ties, xy = tied(orientation, (0, 1), 150, shift_mm=shift)
    elsewhere, _ = tied(orientation, (0, 1), 100, exposure=3)
    across, _ = tied(orientation, (2, 3), 40)
    return refined(orientation, joined(ties, elsewhere, across)), xy


# --- as they were taken ----------------------------------------------------------------------


def heads_of(fig):
    """Axes with pictures, by head."""
    return {title(ax): ax for ax in fig.axes if ax.images}


def test_heads_stand_as_they_lie_in_the_synthetic_image(pictures, orientation):
    fig = drawn(head_pictures(pictures, orientation))
    place = {name: ax.get_position().p0 for name, ax in heads_of(fig).items()}
    assert sorted(place) == NAMES
    # as Table 1 places them: 1 and 2 to the left, 2 and 3 above
    assert place["CAM1"][0] == place["CAM2"][0] < place["CAM3"][0] == place["CAM4"][0]
    assert place["CAM1"][1] == place["CAM4"][1] < place["CAM2"][1] == place["CAM3"][1]


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


# --- tied ------------------------------------------------------------------------------------


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
    values = np.asarray(image.get_array())[..., 0]
    left, right, bottom, top = image.get_extent()
    values = np.where(values < 1, values, 0)  # white is no data
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


def ways(orientation, n=4):
    """Orientations that leave 2, 1 and no pixels between heads 1 and 2."""
    ties, _ = tied(orientation, (0, 1), 300)
    shifted = []
    for px in (2.0, 1.0, 0.0):
        xyz = orientation.xyz_mm.copy()
        xyz[1, 0] += px * 0.0056
        shifted.append(replace(orientation, xyz_mm=xyz))
    names = ("before", "mean shift", "rotations", "six")
    return refined(orientation, ties, **dict(zip(names[:n], [*shifted, orientation], strict=False)))


def test_refinements_stand_beside_each_other_in_one_scale(orientation):
    fig = drawn(refinements(ways(orientation), taken.synthetic(1)))
    assert [title(ax) for ax in fig.axes] == [
        "as calibrated",
        "mean differences",
        "three rotations",
    ]
    said = [ax.texts[0].get_text() for ax in fig.axes]
    # 2 px in x and none in y; no noise
    assert said[0].startswith("rms 1.41, largest 2.00")
    assert said[1].startswith("rms 0.71, largest 1.00")
    assert said[2].startswith("rms 0.000, largest 0.00")
    arrows = [next(c for c in ax.get_children() if isinstance(c, Quiver)) for ax in fig.axes]
    lengths = [np.hypot(a.U, a.V).mean() for a in arrows]
    assert lengths[0] == pytest.approx(2 * lengths[1], rel=1e-6)


def test_ways_that_are_missing_are_left_out(orientation):
    fig = drawn(refinements(ways(orientation, 1), taken.synthetic(1)))
    assert [title(ax) for ax in fig.axes] == ["as calibrated"]
    none = refined(orientation, ways(orientation).kept[:0])
    assert "No two heads" in sentence(refinements(none, taken.synthetic(1)))


# --- equalised -------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def fit():
    """Two heads, three bands."""
    g = np.array([[0.02, 0.0, -0.01], [-0.02, 0.0, 0.01]])
    coefficients = np.stack([g, np.full((2, 3), -0.3), np.full((2, 3), 0.05)], axis=-1)
    overlap = OverlapResponse(
        head_a=0,
        head_b=1,
        before=np.log1p([0.1, 0.2, 0.05]),
        after=np.log1p([0.006, 0.005, 0.004]),
        floor=np.log1p([0.005, 0.004, 0.003]),
        n_used=np.full(3, 900),
        n_saturated=np.zeros(3, int),
        n_dark=np.zeros(3, int),
    )
    return ResponseFit(
        response=Response(coefficients=coefficients),
        sigma=np.full((2, 3, 3), 1e-3),
        overlaps=(overlap,),
    )


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


# --- put together ----------------------------------------------------------------------------


@pytest.fixture(scope="module")
def seamed(pictures, orientation, images):
    rng = np.random.default_rng(3)
    heads = reduced_heads(orientation, K)
    response = estimate_response(images, heads, taken.synthetic(K), rng=rng)
    wrong = taken.turned_heads(orientation, 0.2, rng)  # some pixels of the reduced images
    both = refined(orientation, tied(orientation, (0, 1), 10)[0], rotations=orientation)
    both.orientations["before"] = wrong
    return drawn(seams(pictures, both, response))


def rows_of(fig):
    """Per place: axes of the plan, and of the four crops."""
    return np.array(fig.axes).reshape(-1, 5)


def test_seams_are_shown_in_three_places_and_four_states(seamed):
    rows = rows_of(seamed)
    assert len(rows) == 3
    states = ["as taken", "heads refined", "and equalised", "and blended"]
    assert [title(ax) for ax in rows[0, 1:]] == states
    assert title(rows[2, 0]) == "the middle"
    assert all(re.fullmatch(r"CAM\d \| CAM\d", title(ax)) for ax in rows[:2, 0])


def test_each_step_brings_a_seam_nearer_to_what_is_blended(seamed):
    for line in rows_of(seamed):
        crops = [np.asarray(ax.images[0].get_array()) for ax in line[1:]]
        off = [np.sqrt(np.mean((crop - crops[-1]) ** 2)) for crop in crops]
        assert off[0] > off[1] > off[2]


def test_a_seam_is_marked_outside_of_its_pixels_only(seamed):
    for line in rows_of(seamed):
        for ax in line[1:4]:
            rows, cols = ax.images[0].get_array().shape[:2]
            marks = np.array([np.transpose(mark.get_data()) for mark in ax.lines])
            assert len(marks) >= 2
            size = np.array([cols, rows])
            inner = np.all((marks > -0.5 + 1e-9) & (marks < size - 0.5 - 1e-9), axis=-1)
            assert not inner.any()
        assert len(line[4].lines) == 0


def test_a_misfit_is_shown_where_it_crosses_edges(orientation):
    row, col = np.mgrid[:512, :512]
    above, below = col - row, col + row  # stripes across the misfit, to the upper right, and along
    ground = 12000 + 4000 * np.sin(2 * np.pi / 24 * np.where(row < 253, above, below))
    rng = np.random.default_rng(1)
    seen = taken.pictures(reduced_heads(orientation, K), taken.synthetic(K), ground, rng)
    xyz = orientation.xyz_mm.copy()
    xyz[:2, :2] += 2 * PIXEL_MM
    both = refined(orientation, tied(orientation, (0, 1), 10)[0], rotations=orientation)
    both.orientations["before"] = replace(orientation, xyz_mm=xyz)
    fig = drawn(seams(pictured(seen), both, None))
    assert title(fig.axes[0]) == "CAM2 | CAM3"


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


def test_figures_of_pixels_are_the_same_every_time_and_leave_nothing(pictures, orientation, found):
    before = dict(mpl.rcParams), plt.get_fignums()
    one, two = (
        np.asarray(drawn(overlap_ties(pictures, orientation, found[0])).canvas.buffer_rgba())
        for _ in range(2)
    )
    assert np.array_equal(one, two)
    assert (dict(mpl.rcParams), plt.get_fignums()) == before
