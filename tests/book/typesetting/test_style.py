"""The look of figures, maps, and pictures in figures."""

import itertools
import re

import matplotlib as mpl
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial import KDTree

from acx4book.typesetting import maps, style
from support.helpers import ROOT

# --- The style of figures: colours that all tell apart, nothing left behind ------------------


LISTED = re.compile(r"--figure-([\w-]+): (#\w{6});")
SHEET = (ROOT / "book" / "_static" / "acx4.css").read_text("utf-8")
DAY, NIGHT = (dict(LISTED.findall(part)) for part in SHEET.split("@media screen")[:2])
PAGES = {"day": (DAY, "#ffffff"), "night": (NIGHT, "#121212")}


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


EAST, NORTH, UP = np.eye(3)


def test_from_straight_above_one_sees_the_map():
    seen = maps.view(0, 90)
    assert_allclose(seen.apply([EAST, NORTH])[:, :2], np.eye(2), atol=1e-15)


@pytest.mark.parametrize(("from_deg", "right"), [(0, EAST), (90, NORTH), (180, -EAST)])
def test_from_the_horizon_up_is_up_and_what_is_right_depends_on_where_one_stands(from_deg, right):
    seen = maps.view(from_deg, 0)
    assert_allclose(seen.apply([right, UP])[:, :2], np.eye(2), atol=1e-15)
