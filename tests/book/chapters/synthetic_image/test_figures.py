"""The chapter on the synthetic image: figures, tables, turned heads."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.synthetic_image import tables
from acx4book.chapters.synthetic_image.figures import (
    response_curves,
    seams,
)
from acx4lib.synthetic_image.frame import (
    coverage,
    reduced_heads,
)
from acx4lib.synthetic_image.response import estimate_response
from support.figures import (
    drawn,
    title,
)
from support.pictures import taken
from support.pictures.known import K, refined, tied

# --- figures of the frame and of the heads' responses ----------------------------------------


def test_response_curves_run_from_the_middle_to_the_corner(fit, orientation):
    fig = drawn(response_curves(fit, orientation))
    bands = fig.axes[:3]
    assert [title(ax) for ax in bands] == ["red", "green", "blue"]
    red = [np.asarray(line.get_ydata()) for line in bands[0].lines]
    assert_allclose([curve[0] for curve in red], 100 * np.exp([0.02, -0.02]))
    assert_allclose([curve[-1] for curve in red], 100 * np.exp([-0.23, -0.27]))
    assert_allclose(np.asarray(bands[0].lines[0].get_xdata())[[0, -1]], [0, 1])


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


def test_the_first_head_is_not_turned(refinement):
    table = tables.turns(refinement)
    sigma = table.xs("sigma", axis=1, level=1)
    assert sigma.loc["CAM1"].isna().all()
    assert (sigma.loc["CAM2":] > 0).all(axis=None)
    value = table.xs("value", axis=1, level=1)
    assert (value.loc["CAM1"] == 0).all()
    assert (np.abs(value) < 6 * sigma).loc["CAM2":].all(axis=None)  # of true heads and angles
