import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from acx4book.foundations import adjusting, example
from acx4book.foundations.drawings import bundle as drawings
from support.figures import assert_labelled, assert_texts_apart, drawn, quivers, title


def filled(patch, shape):
    """Return which cells of a matrix a shape covers."""
    covered = np.zeros(shape, dtype=bool)
    for bar in patch.get_path().to_polygons():
        (left, top), (right, _) = np.round(bar[0]), np.round(bar[2])
        covered[int(top), int(left) : int(right)] = True
    return covered


def test_patterns_fill_a_cell_for_every_entry_and_name_the_rows():
    A, _, _ = adjusting.equations(adjusting.start())
    fig = drawn(drawings.patterns(A, np.ones((27, 27))))
    entries = (A != 0, A.T @ A != 0, np.ones((27, 27), dtype=bool))
    for ax, entry in zip(fig.axes, entries, strict=True):
        kinds = [filled(patch, entry.shape) for patch in ax.patches]
        assert_array_equal(np.sum(kinds, axis=0), entry)
    boresight, poses, points, both = (filled(p, (33, 33)) for p in fig.axes[1].patches)
    assert boresight[0, 20]  # the boresight's border
    assert (poses[3, 8], poses[3, 9], points[27, 29], points[27, 30]) == (True, False, True, False)
    assert both[3, 27]
    assert fig.axes[0].texts[0].get_text() == "image points"
    assert_texts_apart(fig)


def test_a_block_s_images_and_points():
    fig = drawn(drawings.of_block(example.block()))
    assert_labelled(fig)
    seen, shared = (ax.patches[0] for ax in fig.axes)
    assert filled(seen, (4, 2)).all()
    assert filled(shared, (4, 4)).all()


def test_cost_is_that_of_the_formulas():
    fig = drawn(drawings.cost(points_per_image=10, rays=4, width=20))
    assert_labelled(fig)
    whole, reduced, band = (dict(zip(*line.get_data(), strict=True)) for line in fig.axes[0].lines)
    assert whole[4] == adjusting.whole(4, 40, n_shared=14)
    assert reduced[10_000] == adjusting.reduced(10_000, 100_000, 4, n_shared=14)
    assert band[10_000] < reduced[10_000] < whole[10_000]


def test_a_step_of_nothing_is_drawn_at_the_foot():
    fig = drawn(drawings.convergence({"1°": [100.0, 1e-3, 0.0], "2°": [200.0, 1e-1, 1e-5]}))
    assert_labelled(fig)
    assert_allclose(fig.axes[0].lines[0].get_ydata(), [100.0, 1e-3, drawings.ROUNDING])
    assert_allclose(fig.axes[0].lines[1].get_ydata(), [200.0, 1e-1, 1e-5])


def test_arrows_are_what_is_left_enlarged():
    views = {
        "flat": adjusting.view((0, 0, 0)),
        "hills": adjusting.view((0, 0, 0), relief_m=50.0),
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
    view = adjusting.view((0, 15, 0), relief_m=30.0)
    assert_allclose(view.by_pose.T @ view.left[:, column], 0.0, atol=1e-8)
