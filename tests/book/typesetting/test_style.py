"""The look of figures, maps, and pictures in figures."""

import io
import itertools
import re
from dataclasses import replace

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from IPython.core.formatters import DisplayFormatter
from matplotlib.collections import PolyCollection
from numpy.testing import assert_allclose
from PIL import Image
from scipy.spatial import KDTree

from acx4book.typesetting import maps, style
from acx4book.typesetting.maps import block_maps, control_maps
from acx4book.typesetting.pictures import smaller
from support.figures import assert_labelled, assert_texts_apart, drawn, legend, panels
from support.flights.simulated import fly
from support.helpers import ROOT

# --- The style of figures: colours that all tell apart, nothing left behind ------------------


LISTED = re.compile(r"--figure-([\w-]+): (#\w{6});")
SHEET = (ROOT / "book" / "_static" / "acx4.css").read_text("utf-8")
DAY, NIGHT = (dict(LISTED.findall(part)) for part in SHEET.split("@media screen")[:2])
PAGES = {"day": (DAY, "#ffffff"), "night": (NIGHT, "#121212")}


def test_the_style_leaves_pyplot_as_it_found_it():
    before = dict(mpl.rcParams), plt.get_fignums()
    with style.applied():
        fig, ax = style.subplots(figsize=(2, 2))
        assert not ax.spines["top"].get_visible()
    assert (dict(mpl.rcParams), plt.get_fignums()) == before
    assert fig.dpi == 150
    assert fig.get_facecolor() == (1, 1, 1, 1)


def test_a_figure_shows_itself_as_one_picture_as_wide_as_it_is():
    with style.applied():
        fig, _ = style.subplots(figsize=(3, 2))
        fig.text(0.5, -0.2, "below", va="top")
    shown, about = DisplayFormatter().format(fig)
    assert set(shown) == {"text/plain", "image/png"}
    assert about == {"image/png": {"width": 288}}
    picture = Image.open(io.BytesIO(shown["image/png"]))
    assert picture.width == pytest.approx(3 * 150, abs=1)
    assert picture.height > 2.2 * 150  # what reaches out of it is drawn, too
    assert DisplayFormatter().format(fig) == (shown, about)


# Linear RGB as full protanopes, deuteranopes and tritanopes see it.
VISIONS = {
    "all": np.eye(3),
    "protan": [[0.152, 1.053, -0.205], [0.115, 0.786, 0.099], [-0.004, -0.048, 1.052]],
    "deutan": [[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]],
    "tritan": [[1.256, -0.077, -0.179], [-0.078, 0.931, 0.148], [0.005, 0.691, 0.304]],
}


def lab(colour, seen):
    """Return CIE L*a*b* of a colour as a kind of colour vision sees it."""
    rgb = np.array(mpl.colors.to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    linear = np.clip(np.array(seen) @ linear, 0, 1)
    to_xyz = [[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]
    xyz = np.array(to_xyz) @ linear / [0.9505, 1.0, 1.089]
    f = np.where(xyz > 0.008856, np.cbrt(xyz), 7.787 * xyz + 16 / 116)
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


def luminance(colour):
    rgb = np.array(mpl.colors.to_rgb(colour))
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return linear @ [0.2126, 0.7152, 0.0722]


def contrast(one, other):
    """Return the contrast of WCAG 2."""
    dark, light = sorted([luminance(one), luminance(other)])
    return (light + 0.05) / (dark + 0.05)


def test_the_style_sheet_has_every_colour_by_day_and_by_night():
    named = style.NAMES | style.SCALES
    assert {name: colour for colour, name in named.items()} == DAY
    assert NIGHT.keys() == DAY.keys()


@pytest.mark.parametrize("time", PAGES)
def test_words_have_the_contrast_of_wcag_aa(time):
    colours, page = PAGES[time]
    for word in ("ink", "soft", "blue", "plum", "brick", "teal-words", "orange-words"):
        for ground in (page, colours["paper"]):
            assert contrast(colours[word], ground) >= 4.5, (word, ground)


@pytest.mark.parametrize("time", PAGES)
@pytest.mark.parametrize("vision", VISIONS)
def test_every_colour_vision_tells_the_palette_apart(vision, time):
    colours, _ = PAGES[time]
    palette = [colours[style.NAMES[colour]] for colour in style.PALETTE]
    seen = [lab(colour, VISIONS[vision]) for colour in palette]
    apart = [np.linalg.norm(a - b) for a, b in itertools.combinations(seen, 2)]
    assert min(apart) > 20  # two are told apart side by side from about 2, in a legend from 10


@pytest.mark.parametrize("vision", VISIONS)
@pytest.mark.parametrize("time", PAGES)
@pytest.mark.parametrize(("scale", "middle"), [("large", 0), ("off", 4)])
def test_colour_scales_lead_away_from_the_page_in_lightness(scale, middle, time, vision):
    colours, page = PAGES[time]
    seen = [lab(colours[f"{scale}-{step}"], VISIONS[vision])[0] for step in range(9)]
    away = np.sign(50 - lab(page, VISIONS["all"])[0])
    assert np.all(away * np.diff(seen[middle:]) > 0)
    assert np.all(away * np.diff(seen[: middle + 1]) < 0)


@pytest.mark.parametrize(
    ("longest", "length"), [(1.0, 1.0), (1.9, 1.0), (4.99, 2.0), (730.0, 500.0), (0.1, 0.1)]
)
def test_scale_bars_have_round_lengths(longest, length):
    assert style.round_length(longest) == pytest.approx(length)


def test_of_few_marks_all_are_drawn_the_large_ones_last(rng):
    at, values = rng.uniform(0, 9, (style.MANY, 2)), rng.normal(size=style.MANY)
    drawn = style.largest_in_cells(at, values)
    assert sorted(drawn) == list(range(style.MANY))
    assert np.all(np.diff(values[drawn]) > 0)


@pytest.mark.parametrize("size", [(9.0, 9.0), (1.0, 300.0), (700.0, 0.0)])
def test_of_many_marks_the_largest_of_every_place_is_drawn(rng, size):
    n = 20 * style.MANY
    at, values = rng.uniform(0, 1, (n, 2)) * size + 7000, rng.exponential(size=n)
    drawn = style.largest_in_cells(at, values)
    assert 0.5 * style.MANY < len(drawn) < 1.2 * style.MANY  # with the cells of two sides
    assert np.argmax(values) == drawn[-1]
    assert np.all(np.diff(values[drawn]) > 0)
    if min(size) > 0:
        distance, near = KDTree(at[drawn]).query(at, k=8)
        side = np.sqrt(np.prod(size) / style.MANY)
        # whoever is left out has a larger one in its cell
        larger = (values[drawn][near] >= values[:, None]) & (distance <= np.sqrt(2) * side)
        assert np.mean(larger.any(axis=1)) > 0.999  # the others have more than 8 nearer ones


# --- Maps of a flight: every exposure, strip and point has its place -------------------------


@pytest.fixture(scope="module")
def flight():
    return fly("acx4", seed=1, blocks=("heads",)).flight


def test_a_map_shows_every_exposure_strip_and_control_point(flight):
    block = flight.heads
    fig = drawn(block_maps(block, None))
    assert_labelled(fig)
    assert_texts_apart(fig)
    (ax,) = panels(fig)
    assert len(ax.get_title(loc="left")) > 0
    lines = [len(line.get_xdata()) for line in ax.lines]
    assert sorted(n for n in lines if n > 2) == sorted([10, 7, 7, 7, len(block.control)])
    outlined = [c for c in ax.collections if isinstance(c, PolyCollection)]
    assert sorted(len(c.get_paths()) for c in outlined) == [4, 4, len(block.images)]
    assert legend(fig) == ["higher strips", "lower strips", "control points"]
    assert ax.get_aspect() == 1.0


def test_the_map_of_one_point_shows_the_flight_around_it(flight):
    block = flight.heads
    fig = drawn(control_maps(replace(block, control=block.control[:1], check=block.check[:0])))
    (ax,) = panels(fig)
    exposures = block.frame.to_grid(block.trajectory.T_m_b.r)[:, :2] / 1000
    low, high = np.transpose([ax.get_xlim(), ax.get_ylim()])
    assert np.all(low < exposures.min(axis=0))
    assert np.all(high > exposures.max(axis=0))
    assert any(t.get_text().startswith("1 point in ") for t in ax.texts)


EAST, NORTH, UP = np.eye(3)


def test_from_straight_above_one_sees_the_map():
    seen = maps.view(0, 90)
    assert_allclose(seen.apply([EAST, NORTH])[:, :2], np.eye(2), atol=1e-15)


@pytest.mark.parametrize(("from_deg", "right"), [(0, EAST), (90, NORTH), (180, -EAST)])
def test_from_the_horizon_up_is_up_and_what_is_right_depends_on_where_one_stands(from_deg, right):
    seen = maps.view(from_deg, 0)
    assert_allclose(seen.apply([right, UP])[:, :2], np.eye(2), atol=1e-15)


# --- Pictures reduced to the pixels of a figure, against means that are written out ----------


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_a_smaller_picture_has_the_means_of_squares_from_the_middle(dtype):
    rng = np.random.default_rng(2)
    image = rng.integers(0, 250, (23, 31, 3)).astype(dtype)
    found = smaller(image, 5)
    middle = image[1:21]
    squares = [[middle[i : i + 5, j : j + 5] for j in range(0, 30, 5)] for i in range(0, 20, 5)]
    assert found.shape == (4, 6, 3)
    assert_allclose(found, np.mean(squares, axis=(2, 3), dtype=float), rtol=1e-6)
