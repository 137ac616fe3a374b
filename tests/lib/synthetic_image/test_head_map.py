"""Where heads see the synthetic image, between the nodes of a grid."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.geometry.camera import inside, xy_from_colrow
from acx4lib.synthetic_image.frame import (
    TOLERANCE,
    HeadMap,
    between_nodes,
    fitting_step,
    head_from_synthetic,
    head_map,
    levelled,
    reduced_camera,
    reduced_heads,
    window_map,
)
from support.pictures import taken

SYN = taken.printed_synthetic()
HEADS = taken.printed_heads()


def errors(orientation, k, synthetic, head, rows, cols):
    """Return the errors at rows x columns that the head sees, px."""
    colrow = np.stack(np.meshgrid(cols, rows), axis=-1).astype(float)
    xy = xy_from_colrow(synthetic, colrow).reshape(-1, 2)
    exact = head_from_synthetic(orientation, k, xy).reshape(colrow.shape)
    seen = inside(orientation.heads[k], exact)
    return np.linalg.norm(between_nodes(head, rows, cols) - exact, axis=-1)[seen]


@pytest.mark.parametrize("k", range(4))
def test_positions_of_table_1s_heads_are_right_to_a_four_hundredth_of_a_pixel(k):
    head = head_map(HEADS, k, SYN)
    rows = np.r_[0 : SYN.height_px : 71, SYN.height_px - 1]  # 71 meets every place in a cell
    cols = np.r_[0 : SYN.width_px : 53, SYN.width_px - 1]
    misfit = errors(HEADS, k, SYN, head, rows, cols)
    assert len(misfit) > 10_000
    assert misfit.max() < 0.0025  # NaN where a cell that is seen had no nodes


def test_errors_go_with_the_step_squared():
    rows, cols = np.arange(0, 16200, 71), np.arange(0, 12000, 53)
    worst = [
        errors(HEADS, 0, SYN, head_map(HEADS, 0, SYN, step_px=step), rows, cols).max()
        for step in (16, 32)
    ]
    assert_allclose(worst[1] / worst[0], 4.0, rtol=0.05)  # the interpolation's remainder


@pytest.mark.parametrize(("k", "step"), [(1, 8), (2, 4), (4, 4), (8, 2)])
def test_small_images_need_closer_nodes(k, step):
    heads, synthetic = reduced_heads(HEADS, k), reduced_camera(SYN, k)
    assert fitting_step(heads, synthetic) == step
    rows, cols = np.arange(0, synthetic.height_px, 17), np.arange(0, synthetic.width_px, 13)
    head = head_map(heads, 0, synthetic, step_px=step)
    assert errors(heads, 0, synthetic, head, rows, cols).max() < TOLERANCE


def test_nodes_are_exact_and_far_ones_are_left_out():
    head = head_map(HEADS, 0, SYN)
    i, j = np.nonzero(np.isfinite(head.nodes[..., 0]))
    xy = xy_from_colrow(SYN, 16.0 * np.column_stack([j, i]))
    exact = head_from_synthetic(HEADS, 0, xy)
    assert_allclose(head.nodes[i, j], exact, rtol=0, atol=1e-7)  # px
    share = len(i) / head.nodes[..., 0].size  # the head covers a third of the frame
    assert 0.3 < share < 0.6


def test_a_lens_that_no_polynomial_follows_is_computed_node_by_node():
    wild = HEADS.heads[0].with_interior(replace(HEADS.heads[0].interior, k2=2e-7, k3=-1.2e-10))
    heads = replace(HEADS, heads=(wild, *HEADS.heads[1:]))
    head = head_map(heads, 0, SYN, step_px=32)
    i, j = np.nonzero(np.isfinite(head.nodes[..., 0]))
    xy = xy_from_colrow(SYN, 32.0 * np.column_stack([j, i]))
    assert_allclose(head.nodes[i, j], head_from_synthetic(heads, 0, xy), rtol=0, atol=1e-7)


@pytest.mark.parametrize("k", range(4))
def test_a_levelled_map_is_right_on_average(k):
    """Of a quadratic 2/3 of the largest error are left, and 0.42 of its root mean square."""
    exact = head_map(HEADS, k, SYN)
    level = levelled(exact)
    rows, cols = (np.arange(3, n, 37) for n in (SYN.height_px, SYN.width_px))
    before, after = (errors(HEADS, k, SYN, head, rows, cols) for head in (exact, level))
    assert after.max() < 0.8 * before.max()
    assert np.sqrt(np.mean(after**2)) < 0.45 * np.sqrt(np.mean(before**2))


def test_levelling_leaves_planes_and_what_is_unseen():
    grid = np.stack(np.meshgrid(np.arange(5.0), np.arange(4.0)), axis=-1)
    grid[2:, 3:] = np.nan
    head = HeadMap(nodes=grid, step_px=8, width_px=100, height_px=100)
    assert_allclose(levelled(head).nodes, grid, atol=1e-14)


def test_a_window_is_seen_as_it_is_in_the_whole_image():
    whole, part = head_map(HEADS, 0, SYN), window_map(HEADS, 0, SYN, (10000, 10300, 2000, 2100))
    rows, cols = np.arange(0, 300, 7), np.arange(0, 100, 3)
    assert_allclose(
        between_nodes(part, rows, cols),
        between_nodes(whole, 10000 + rows, 2000 + cols),
        atol=0.005,  # px, both may be off by 0.0025
    )


def test_the_last_nodes_lie_behind_the_last_pixels():
    synthetic = reduced_camera(SYN, 100)
    head = head_map(reduced_heads(HEADS, 100), 0, synthetic, step_px=8)
    n_rows, n_cols = head.nodes.shape[:2]
    assert synthetic.height_px <= 8 * (n_rows - 1) < synthetic.height_px + 8
    assert synthetic.width_px <= 8 * (n_cols - 1) < synthetic.width_px + 8


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"nodes": np.zeros((3, 3))}, r"shape \(3, 3\)|got \(3, 3\)"),
        ({"nodes": np.zeros((1, 3, 2))}, "two at least"),
        ({"step_px": 0}, "step of 1 px at least"),
        ({"width_px": 1}, "2 x 2 px at least, got 16 px and 1 x 20 px"),
    ],
)
def test_what_is_no_map_is_refused(change, words):
    given = {"nodes": np.zeros((3, 3, 2)), "step_px": 16, "width_px": 20, "height_px": 20}
    with pytest.raises(ValueError, match=words):
        HeadMap(**(given | change))
