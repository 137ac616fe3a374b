import numpy as np
import pytest
from matplotlib.patches import Ellipse
from numpy.testing import assert_allclose

from acx4book.foundations import adjusting, example
from acx4book.foundations.designs import lines, planned
from acx4book.foundations.drawings import least_squares as drawings
from acx4lib.bundle.free_network import adjust_free
from acx4lib.bundle.uses import free_orientation
from support.figures import assert_labelled, assert_texts_apart, drawn, title


@pytest.fixture(scope="module")
def results():
    T, xy = adjusting.cameras(), example.measured()[:, 0]
    return adjusting.intersected(T[:2], xy[:2]), adjusting.intersected(T, xy)


def test_an_ellipse_has_the_points_of_equal_probability():
    cov = np.array([[4.0, 1.5], [1.5, 2.0]])
    vertices = drawings.ellipse(np.array([1.0, 2.0]), cov, "k", k=2.0).get_verts() - [1.0, 2.0]
    square = np.einsum("ni,ij,nj->n", vertices, np.linalg.inv(cov), vertices)
    # corners of the curves lie on the ellipse, their control points outside
    assert_allclose(square.min(), 4.0)
    assert_allclose(np.median(square), 4.05, atol=0.05)


def test_rays_of_all_images_end_in_p_and_two_ellipses_are_enlarged(results):
    fig = drawn(drawings.where_rays_meet(adjusting.cameras(), results))
    assert_labelled(fig)
    assert_texts_apart(fig)
    side, *near = fig.axes
    ends = [line.get_xydata()[-1] for line in side.lines if len(line.get_xydata()) == 2]
    assert_allclose(ends, np.tile(example.points()[0, [0, 2]], (4, 1)))
    for ax in near:
        back = ax.transData.inverted()
        heights = [p.get_extents().transformed(back).height for p in ax.patches]
        assert_allclose(heights, [200 * np.sqrt(fit.cov[2, 2]) for _, fit in results], rtol=0.02)


def test_the_histogram_is_that_of_the_repetitions(results):
    fits = [results[1][1]] * 20
    fig = drawings.promise(np.zeros((20, 3)), fits)
    drawn(fig)
    errors, test = fig.axes
    assert sum(isinstance(patch, Ellipse) for patch in errors.patches) == 2
    heights = np.array([bar.get_height() for bar in test.patches])
    assert_allclose(heights[int(fits[0].square / 0.5)], 2.0)  # all of them, in half a unit
    assert "5 degrees" in title(test)


def test_bars_are_redundancy_numbers(results):
    fig = drawings.redundancy(results[0][1], results[1][1])
    bars = [bar.get_height() for bar in fig.axes[0].patches]
    assert_allclose(bars, [*results[0][1].redundancy, *results[1][1].redundancy])
    assert_allclose([sum(bars[:4]), sum(bars[4:])], [1.0, 5.0])


def test_a_valley_reaches_its_sigmas():
    cov = np.array([[4.0, 3.9], [3.9, 4.0]])
    fig = drawn(drawings.valley({"narrow": cov, "wide": np.eye(2)}))
    assert_labelled(fig)
    back = fig.axes[0].transData.inverted()
    sizes = [p.get_extents().transformed(back).size for p in fig.axes[0].patches]
    assert_allclose(sizes, [[4.0, 4.0], [2.0, 2.0]], rtol=0.02)


def test_inner_constraints_have_the_smaller_ellipses():
    block = planned(lines(90, 270), control=0)
    fig = drawn(drawings.datums(adjust_free(free_orientation(block, free=()))))
    assert_labelled(fig)
    held, inner = (np.array([p.width * p.height for p in ax.patches]) for ax in fig.axes)
    assert len(held) == len(inner) > 30
    assert inner.sum() < held.sum()
    assert title(fig.axes[1]) == "inner constraints"
