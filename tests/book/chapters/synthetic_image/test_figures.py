"""The chapter on the synthetic image: figures, tables, turned heads."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.quiver import Quiver
from numpy.testing import assert_allclose

from acx4book.chapters.synthetic_image import tables
from acx4book.chapters.synthetic_image.figures import (
    footprints,
    refinements,
    response_curves,
    seams,
)
from acx4files import flight as flights
from acx4files.stages import synthetic
from acx4lib.geometry.frames import opk_from_rotation, rotation_from_opk
from acx4lib.synthetic_image.frame import (
    coverage,
    reduced_heads,
)
from acx4lib.synthetic_image.response import estimate_response
from acx4lib.synthetic_image.transferred_points import transfer
from support.figures import (
    assert_labelled,
    assert_texts_apart,
    drawn,
    legend,
    panels,
    title,
)
from support.flights import in_heads
from support.flights import pictured as flights_pictured
from support.pictures import taken
from support.pictures.known import NAMES, PIXEL_MM, K, pictured, refined, tied

# --- figures of the frame and of the heads' responses ----------------------------------------


def test_footprints_show_the_frame_and_every_head(orientation):
    R = np.swapaxes(rotation_from_opk(orientation.opk), 1, 2)
    readings = [orientation, replace(orientation, opk=opk_from_rotation(R))]
    fig = drawn(footprints(readings, taken.printed_synthetic(), ["one", "two"]))
    assert_labelled(fig)
    assert_texts_apart(fig)
    for ax in panels(fig):
        assert len(ax.lines) == 4
        (frame,) = ax.patches
        assert (frame.get_width(), abs(frame.get_height())) == pytest.approx((67.2, 90.72))
    assert [text.get_text() for text in panels(fig)[0].texts[:4]] == NAMES
    assert "47." in panels(fig)[1].texts[-1].get_text()  # per cent uncovered
    assert legend(fig)[:5] == [*NAMES, "no head"]


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


def test_what_refinements_take_away_stands_beside_the_differences_in_one_scale(orientation):
    fig = drawn(refinements(ways(orientation), taken.synthetic(1)))
    assert [title(ax) for ax in fig.axes] == [
        "as calibrated",
        "less by mean differences",
        "less by three rotations",
    ]
    said = [ax.texts[0].get_text() for ax in fig.axes]
    # 2 px in x and none in y; no noise
    assert said[0].startswith("rms 1.41, largest 2.00")
    assert said[1].startswith("left: rms 0.71, largest 1.00")
    assert said[2].startswith("left: rms 0.000, largest 0.00")
    arrows = [next(c for c in ax.get_children() if isinstance(c, Quiver)) for ax in fig.axes]
    lengths = [np.hypot(a.U, a.V).mean() for a in arrows]
    # of 2 px one is taken away, then both
    assert lengths == pytest.approx([lengths[2], lengths[2] / 2, lengths[2]], rel=1e-6)


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


# --- Seams before and after they are blended


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


def test_each_step_brings_a_seam_nearer_to_what_is_blended(seamed):
    for line in rows_of(seamed):
        crops = [np.asarray(ax.images[0].get_array()) for ax in line[1:]]
        off = [np.sqrt(np.mean((crop - crops[-1]) ** 2)) for crop in crops]
        assert off[0] > off[1] > off[2]


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


# --- tables of the synthetic image beside Table 2 and the paper's claims ---------------------


@pytest.fixture(scope="module")
def refinement(refined):
    return refined[0]


def test_table_2_is_the_papers(flight):
    table = tables.table_2(flight, flight.synthetic_camera)
    printed = table["paper"].str.split(" x ").str[0].astype(float)
    assert np.array_equal(table["value"].astype(float), printed)


def test_coverage_is_that_of_the_printed_table_1(flight, refined):
    """0.00 / 69.2 / 28.7 / 0.4 / 1.7 per cent with eq. (6) as printed."""
    heads = {"ours": refined[0].before, **tables.printed_heads(flight)}
    ours, printed = (100 * coverage(one, flight.synthetic_camera).share for one in heads.values())
    assert np.allclose(printed, [0.0, 69.2, 28.7, 0.4, 1.7], atol=0.3)
    assert np.allclose(ours, printed, atol=0.5)
    table = tables.seen({"ours": ours / 100})
    assert table.index.tolist() == ["no head", "1 head", "2 heads", "3 heads", "4 heads"]
    assert table["ours"].sum() == pytest.approx(100)


def test_heads_that_are_not_the_papers_stand_beside_none(scene_flight):
    assert tables.printed_heads(scene_flight) == {}


def test_the_first_head_is_not_turned(refinement):
    table = tables.turns(refinement)
    sigma = table.xs("sigma", axis=1, level=1)
    assert sigma.loc["CAM1"].isna().all()
    assert (sigma.loc["CAM2":] > 0).all(axis=None)
    value = table.xs("value", axis=1, level=1)
    assert (value.loc["CAM1"] == 0).all()
    assert (np.abs(value) < 6 * sigma).loc["CAM2":].all(axis=None)  # of true heads and angles


def test_every_way_to_refine_has_a_row_and_none_makes_it_worse(flight, refinement):
    table = tables.ways(refinement, flight.synthetic_camera)
    assert table.index.tolist() == [*tables.WAYS.values()]
    left = table[tables.RMS]
    assert (left.iloc[1:] <= left.iloc[0]).all()
    assert (table[tables.EVERY] >= left - 1e-9).all()


def test_each_exposure_by_itself_is_a_row_where_there_are_pictures(
    scene_flight, scene_orientation, scene_ties
):
    refinement = synthetic.refine(scene_flight, scene_orientation, scene_ties)
    table = tables.ways(refinement, scene_flight.synthetic_camera)
    assert table.index[-1] == tables.EACH


def test_carried_points_are_counted_by_block(tmp_path):
    small = flights.read(in_heads.write(tmp_path))
    points = transfer(small.calibration, flights_pictured.orientation(), small.synthetic_camera)
    row = tables.transferred_points(small, {"calibration": points}).loc["calibration"]
    assert row["Measured in heads"] == len(small.calibration.image_points)
    assert row["Transferred"] + row["outside the frame"] == row["Points of exposures"]
