import numpy as np
import pytest
from matplotlib.collections import QuadMesh
from numpy.testing import assert_allclose

from acx4book.foundations import example
from acx4book.foundations.adjusting import operations, self_calibration, whole_system
from acx4book.foundations.drawings import bundle as drawings
from support.figures import assert_labelled, assert_texts_apart, drawn, quivers, title


def meshes(ax):
    return [np.asarray(m.get_array()) for m in ax.collections if isinstance(m, QuadMesh)]


def test_patterns_fill_a_cell_for_every_entry_and_name_the_rows():
    A, _, _ = whole_system.equations(whole_system.start())
    fig = drawn(drawings.patterns(A, np.ones((27, 27))))
    cells = [meshes(ax)[0] for ax in fig.axes]
    assert_allclose(cells[0].reshape(46, 33) > 0, A != 0)
    assert_allclose(cells[1].reshape(33, 33) > 0, A.T @ A != 0)
    kinds = cells[1].reshape(33, 33)
    assert kinds[0, 20] == 1  # the boresight's border
    assert (kinds[3, 8], kinds[3, 9], kinds[27, 29], kinds[27, 30]) == (2, 0, 3, 0)
    assert kinds[3, 27] == 4
    assert_allclose(cells[2] > 0, True)
    assert fig.axes[0].texts[0].get_text() == "image points"
    assert_texts_apart(fig)


def test_a_block_s_images_and_points():
    fig = drawn(drawings.of_block(example.block()))
    assert_labelled(fig)
    seen, shared = (meshes(ax)[0] for ax in fig.axes)
    assert_allclose(seen.ravel(), np.ones(8))
    assert_allclose(shared.ravel(), np.ones(16))


def test_cost_is_that_of_the_formulas():
    fig = drawn(drawings.cost(points_per_image=10, rays=4, width=20))
    assert_labelled(fig)
    whole, reduced, band = (dict(zip(*line.get_data(), strict=True)) for line in fig.axes[0].lines)
    assert whole[4] == operations.whole(4, 40, n_shared=14)
    assert reduced[10_000] == operations.reduced(10_000, 100_000, 4, n_shared=14)
    assert band[10_000] < reduced[10_000] < whole[10_000]


def test_a_step_of_nothing_is_drawn_at_the_foot():
    fig = drawn(drawings.convergence({"1°": [100.0, 1e-3, 0.0], "2°": [200.0, 1e-1, 1e-5]}))
    assert_labelled(fig)
    assert_allclose(fig.axes[0].lines[0].get_ydata(), [100.0, 1e-3, drawings.ROUNDING])
    assert_allclose(fig.axes[0].lines[1].get_ydata(), [200.0, 1e-1, 1e-5])


def test_arrows_are_what_is_left_enlarged():
    views = {
        "flat": self_calibration.view((0, 0, 0)),
        "hills": self_calibration.view((0, 0, 0), relief_m=50.0),
    }
    fig = drawn(drawings.what_is_left(views))
    change, flat, hills = (quivers(ax)[0] for ax in fig.axes[:3])
    assert_allclose(np.c_[change.U, change.V], 5.0 * views["flat"].xy / example.F_MM)
    assert_allclose([flat.U, flat.V], 0.0, atol=1e-6)
    assert_allclose(np.c_[hills.U, hills.V].ravel(), 100 * views["hills"].left[:, 0])
    assert title(fig.axes[2]).startswith("hills")
    assert_texts_apart(fig)


@pytest.mark.parametrize("column", [0, 1, 2])
def test_nothing_that_is_left_looks_like_a_movement(column):
    view = self_calibration.view((0, 15, 0), relief_m=30.0)
    assert_allclose(view.by_pose.T @ view.left[:, column], 0.0, atol=1e-8)
