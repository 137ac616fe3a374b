"""Figures: labelled axes with units, the artists that the data ask for, nothing left behind."""

import itertools
import re
import warnings
from dataclasses import replace

import matplotlib as mpl
import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.quiver import Quiver

from acx4book.chapters.heads.figure_held import held_focal_lengths
from acx4book.chapters.heads.figures import correlations, mean_residuals, radial_distortion
from acx4book.chapters.heads.held_focal_length import all_heads
from acx4book.chapters.synthetic_image.figures.frame import footprints
from acx4book.chapters.synthetic_image.wrong_heads import transposed
from acx4book.typesetting import style
from acx4book.typesetting.maps import block_maps, control_maps
from acx4lib.calibration.heads import Heads, calibrate_heads, relative_orientation
from acx4lib.stages.heads import HeadsStage
from flights_simulated import HEADS, fly

mpl.use("agg")

UNIT = re.compile(r"\((m|km|mm|px|deg|%|1)\)$")


@pytest.fixture(scope="module")
def flight():
    return fly("acx4", seed=1, blocks=("heads",)).flight


@pytest.fixture(scope="module")
def synthetic(flight):
    return flight.cameras["SYN"]


@pytest.fixture(scope="module")
def fits(flight):
    return calibrate_heads(flight.heads, HEADS, free=flight.estimate_heads).bundles


@pytest.fixture(scope="module")
def orientation(fits, synthetic):
    return relative_orientation(fits, synthetic)


@pytest.fixture(scope="module")
def held(flight, fits, orientation):
    stage = HeadsStage(heads=Heads(bundles=fits, failures={}), orientation=orientation)
    return all_heads(flight, stage, (-0.5, 0.0, 0.5))


def drawn(fig):
    """Draw a figure as it goes into the book; every warning is an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        FigureCanvasAgg(fig).draw()
    return fig


def panels(fig):
    """Return the axes that hold data, not colour bars."""
    return [ax for ax in fig.axes if ax.get_label() != "<colorbar>"]


def quivers(ax):
    return [artist for artist in ax.get_children() if isinstance(artist, Quiver)]


def legend(fig):
    return [text.get_text() for text in fig.legends[0].get_texts()]


def assert_labelled(fig):
    for ax in panels(fig):
        assert UNIT.search(ax.get_xlabel()), ax.get_xlabel()
        if ax.get_ylabel():  # a neighbour with a shared axis has none
            assert UNIT.search(ax.get_ylabel()), ax.get_ylabel()
    assert any(ax.get_ylabel() for ax in panels(fig))


def assert_texts_apart(fig):
    """No two labels or titles of a figure lie on each other."""
    renderer = fig.canvas.get_renderer()
    texts = []
    for ax in fig.axes:
        texts += [ax.title, ax._left_title, ax.xaxis.label, ax.yaxis.label]
    texts += [text for found in fig.legends for text in found.get_texts()]
    boxes = [t.get_window_extent(renderer) for t in texts if t.get_text() and t.get_visible()]
    for a, b in itertools.combinations(boxes, 2):
        assert not a.overlaps(b)


# --- style -----------------------------------------------------------------------------------


def test_the_style_leaves_pyplot_as_it_found_it():
    before = dict(mpl.rcParams), plt.get_fignums()
    with style.style():
        fig, ax = plt.subplots()
        assert not ax.spines["top"].get_visible()
    assert (dict(mpl.rcParams), plt.get_fignums()) == before
    assert fig.dpi == 150
    assert fig.get_facecolor() == (1, 1, 1, 1)


def test_the_style_closes_its_figures_also_after_an_error():
    before = plt.get_fignums()
    with pytest.raises(ValueError, match="FixedLocator"), style.style():
        plt.subplots(subplot_kw={"xlim": (0, 1)}, figsize=(2, 2))[1].set_xticks([9], ["9", "9"])
    assert plt.get_fignums() == before


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


@pytest.mark.parametrize("vision", VISIONS)
def test_every_colour_vision_tells_the_palette_apart(vision):
    seen = [lab(colour, VISIONS[vision]) for colour in style.PALETTE]
    apart = [np.linalg.norm(a - b) for a, b in itertools.combinations(seen, 2)]
    assert min(apart) > 20  # two are told apart side by side from about 2, in a legend from 10


@pytest.mark.parametrize("vision", VISIONS)
@pytest.mark.parametrize("colours", [style.SEQUENCE, style.DIVERGING], ids=lambda c: c.name)
def test_colour_scales_run_one_way_in_lightness(colours, vision):
    seen = [lab(colours(x), VISIONS[vision])[0] for x in np.linspace(0, 1, 21)]
    middle = 0 if colours is style.SEQUENCE else 10
    assert np.all(np.diff(seen[middle:]) < 0)
    assert np.all(np.diff(seen[: middle + 1]) > 0)


@pytest.mark.parametrize(
    ("longest", "length"), [(1.0, 1.0), (1.9, 1.0), (4.99, 2.0), (730.0, 500.0), (0.1, 0.1)]
)
def test_scale_bars_have_round_lengths(longest, length):
    assert style.round_length(longest) == pytest.approx(length)


def test_a_figure_that_has_nothing_to_show_says_so():
    fig = drawn(style.nothing("There is nothing."))
    assert [text.get_text() for text in fig.axes[0].texts] == ["There is nothing."]


# --- maps ------------------------------------------------------------------------------------


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


def test_maps_of_a_single_camera_stand_beside_each_other():
    flight = fly("single-head", seed=1).flight
    fig = drawn(block_maps(flight.calibration, flight.validation))
    assert_labelled(fig)
    assert_texts_apart(fig)
    assert [ax.get_title(loc="left") for ax in panels(fig)] == ["calibration", "validation"]
    assert "check points" in legend(fig)


def test_exposures_without_strips_are_not_joined(flight):
    images = replace(flight.heads.images, strips=("",) * len(flight.heads.images))
    fig = drawn(block_maps(replace(flight.heads, images=images)))
    (exposures,) = (line for line in panels(fig)[0].lines if len(line.get_xdata()) == 31)
    assert exposures.get_linestyle() == "None"
    assert "exposures" in legend(fig)


def test_a_map_without_surveyed_points_has_no_footprints(flight):
    block = flight.heads
    bare = replace(block, control=block.control[:0], check=block.check[:0])
    fig = drawn(block_maps(bare))
    assert legend(fig) == ["higher strips", "lower strips"]
    assert "124 images" in [text.get_text() for text in panels(fig)[0].texts]
    (text,) = drawn(control_maps(bare)).axes[0].texts
    assert "No surveyed point" in text.get_text()


def test_surveyed_points_have_their_names(flight):
    fig = drawn(control_maps(flight.heads, None))
    assert_labelled(fig)
    names = {flight.heads.points[i] for i in flight.heads.control.point_idx}
    assert names <= {text.get_text() for text in panels(fig)[0].texts}
    assert [ax.get_xlabel() for ax in fig.axes if ax not in panels(fig)] == ["height (m)"]


def test_a_flight_without_a_block_gets_a_sentence():
    (text,) = drawn(block_maps(None)).axes[0].texts
    assert text.get_text() == "The flight has no such block."


# --- heads -----------------------------------------------------------------------------------


def test_mean_residuals_have_one_field_per_head(fits):
    fig = drawn(mean_residuals(fits))
    assert_labelled(fig)
    assert_texts_apart(fig)
    assert [ax.get_title(loc="left") for ax in panels(fig)] == list(HEADS)
    for ax, fit in zip(panels(fig), fits.values(), strict=True):
        (arrows,) = quivers(ax)
        assert 80 <= len(arrows.U) <= 108  # 12 x 9 cells, some with too few points
        assert ax.get_ylim() == (fit.cameras[0].height_px, 0)  # rows run down


def test_a_pattern_in_the_residuals_is_told_from_noise(fits):
    fit = fits["CAM1"]
    group = fit.solution.group("image_point")
    shifted = replace(group, v=group.v + np.array([1.0, 0.0]))
    groups = tuple(shifted if g is group else g for g in fit.solution.groups)
    spoilt = replace(fit, solution=replace(fit.solution, groups=groups))
    colours = [
        {tuple(c) for c in quivers(panels(mean_residuals({"CAM1": f}))[0])[0].get_facecolor()}
        for f in (fit, spoilt)
    ]
    orange = mpl.colors.to_rgba(style.ORANGE)
    assert orange not in colours[0]
    assert orange in colours[1]


def test_radial_distortion_ends_at_the_corner_beside_the_papers_values(fits):
    printed = dict.fromkeys(HEADS, 14.0)
    fig = drawn(radial_distortion(fits, printed_px=printed, claim_px=15.0))
    assert_labelled(fig)
    assert_texts_apart(fig)
    wide, near = panels(fig)
    assert len(wide.lines) == 4 + 1
    assert len(near.lines) == 4 + 4 + 1
    assert wide.lines[0].get_xdata()[-1] == pytest.approx(33.68, abs=0.01)  # half the diagonal, mm
    assert wide.lines[0].get_ydata()[-1] == pytest.approx(15.0, abs=1.0)
    assert legend(fig)[-2:] == ["Table 1 of the paper", "its text: about 15 px"]


def test_other_cameras_are_not_compared_with_the_paper(fits):
    fig = drawn(radial_distortion(fits))
    assert [len(ax.lines) for ax in panels(fig)] == [4, 4]
    assert legend(fig) == list(HEADS)


def test_correlations_show_every_pair_and_all_values(fits):
    fig = drawn(correlations(fits, claim=0.1))
    assert_texts_apart(fig)
    pairs, shares = panels(fig)
    assert pairs.images[0].get_array().shape == (5, 6)
    assert len([text for text in pairs.texts if re.fullmatch(r"\d\.\d\d", text.get_text())]) == 30
    assert len(shares.lines) == 4 + 1
    assert len(shares.lines[0].get_xdata()) == 31 * 5 * 6
    assert shares.lines[0].get_ydata()[-1] == 100
    assert UNIT.search(shares.get_xlabel())


def test_held_focal_lengths_have_a_line_per_head_in_every_panel(held):
    fig = drawn(held_focal_lengths(held))
    assert_texts_apart(fig)
    assert all(UNIT.search(ax.get_ylabel()) for ax in panels(fig))
    assert [len(ax.lines) for ax in panels(fig)] == [4, 4, 5, 4, 4, 4]
    assert legend(fig) == list(HEADS)


@pytest.mark.parametrize(
    "draw",
    [mean_residuals, radial_distortion, correlations],
    ids=lambda f: f.__name__,
)
def test_without_a_head_there_is_a_sentence(draw):
    assert [t.get_text() for t in drawn(draw({})).axes[0].texts] == ["No head could be adjusted."]


# --- synthetic image -------------------------------------------------------------------------


def test_footprints_show_the_frame_and_every_head(orientation, synthetic):
    readings = [orientation, transposed(orientation)]
    fig = drawn(footprints(readings, synthetic, ["one", "two"]))
    assert_labelled(fig)
    assert_texts_apart(fig)
    for ax in panels(fig):
        assert len(ax.lines) == 4
        (frame,) = ax.patches
        assert (frame.get_width(), abs(frame.get_height())) == pytest.approx((67.2, 90.72))
    assert [text.get_text() for text in panels(fig)[0].texts[:4]] == list(HEADS)
    assert "47." in panels(fig)[1].texts[-1].get_text()  # per cent uncovered
    assert legend(fig)[:5] == [*HEADS, "no head"]


def test_a_figure_is_the_same_every_time(orientation, synthetic):
    one, two = (
        np.asarray(drawn(footprints([orientation], synthetic, ["a"])).canvas.buffer_rgba())
        for _ in range(2)
    )
    assert np.array_equal(one, two)
