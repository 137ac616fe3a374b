"""Parts of a block keep what they name, and nothing else changes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.flight import parts
from acx4lib.flight.design import flying_heights


def test_the_lowest_height_is_within_a_tenth(noisy_block):
    lowest = parts.lowest_height(noisy_block)
    height = flying_heights(lowest)[lowest.images.exposure_idx]
    assert height.max() < 1.15 * height.min()
    assert 0 < len(lowest.images) <= len(noisy_block.images)


def test_one_direction_has_no_image_flown_backwards(noisy_block):
    kept = parts.one_direction(noisy_block)
    forward = kept.T_m_b_images.R[:, :2, 0]
    assert np.all(forward @ forward[0] > 0)


def test_control_points_that_are_left_out_are_tie_points(noisy_block):
    none = parts.without_control(noisy_block)
    assert len(none.control) == 0
    assert len(none.image_points) == len(noisy_block.image_points)
    first = noisy_block.points[noisy_block.control.point_idx[0]]
    others = parts.without_control(noisy_block, {first})
    assert len(others.control) == len(noisy_block.control) - 1
    assert first not in {others.points[i] for i in others.control.point_idx}


def test_strips_are_left_out_by_their_names(noisy_block):
    name = noisy_block.images.strips[0]
    kept = parts.without_strips(noisy_block, {name})
    assert name not in kept.images.strips
    assert set(kept.images.strips) == set(noisy_block.images.strips) - {name}


def test_the_grid_taken_for_cartesian_has_the_numbers_of_the_map(noisy_block):
    wrong = parts.as_if_cartesian(noisy_block)
    grid = noisy_block.frame.to_grid(noisy_block.control.x_m)
    off = wrong.control.x_m - grid
    assert_allclose(off, np.broadcast_to(off[0], off.shape), atol=1e-6)
    assert off[0] == pytest.approx(np.round(off[0]), abs=1e-6)


def test_a_surveyed_lever_arm_is_declared_and_nothing_else(noisy_block):
    lever = (0.2, -0.4, -0.1)
    changed = parts.with_lever_arm(noisy_block, lever)
    assert changed.cameras[0].T_b_c.r == pytest.approx(lever)
    assert_allclose(changed.cameras[0].T_b_c.R, noisy_block.cameras[0].T_b_c.R)
    with pytest.raises(ValueError, match="camera: expected one of CAM, got 'X'"):
        parts.with_lever_arm(noisy_block, lever, camera="X")
    with pytest.raises(ValueError, match="lever_m: expected shape"):
        parts.with_lever_arm(noisy_block, (1.0, 2.0))
