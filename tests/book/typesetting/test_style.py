"""The style of figures: colours that all tell apart, nothing left behind."""

import io
import itertools
import re

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from IPython.core.formatters import DisplayFormatter
from PIL import Image
from scipy.spatial import KDTree

from acx4book.typesetting import style
from support.figures import drawn
from support.helpers import ROOT

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


def test_a_figure_that_has_nothing_to_show_says_so():
    fig = drawn(style.nothing("There is nothing."))
    assert [text.get_text() for text in fig.axes[0].texts] == ["There is nothing."]


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


def test_a_legend_that_would_repeat_its_colours_often_is_left_out():
    for n in (style.LISTED, style.LISTED + 1):
        with style.applied():
            fig, ax = style.subplots(figsize=(7, 3))
            handles = [ax.plot([0, i], label=f"{i}")[0] for i in range(n)]
            style.legend_below(fig, handles)
        assert len(fig.legends) == (n <= style.LISTED)
