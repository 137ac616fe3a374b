"""Parts of a block keep what they name, and nothing else changes."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.flight import parts
from acx4lib.flight.design import flying_heights
from support.flights import rigs


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


def test_focal_lengths_are_those_that_are_named(noisy_block):
    name = noisy_block.cameras[0].name
    longer = parts.with_focal_lengths(noisy_block, {name: 75.0})
    assert longer.cameras[0].interior.f == 75.0
    assert longer.cameras[1:] == noisy_block.cameras[1:]
    assert longer.image_points is noisy_block.image_points
    with pytest.raises(ValueError, match="f_mm: expected names of"):
        parts.with_focal_lengths(noisy_block, {"nobody": 75.0})


def test_cameras_without_shared_points_keep_every_measurement():
    block = rigs.simulated(ties=60)
    alone = parts.unshared(block)
    points, before = alone.image_points, block.image_points
    assert_allclose(points.colrow, before.colrow)
    assert len(set(alone.points)) == len(alone.points)
    head = alone.images.camera_idx[points.image_idx]
    ties = ~np.isin(points.point_idx, block.control.point_idx)
    for point in np.unique(points.point_idx[ties]):
        assert len(set(head[points.point_idx == point])) == 1
    said = [alone.points[i].partition(" ")[0] for i in points.point_idx]
    assert said == [block.points[i] for i in before.point_idx]
    assert np.all(points.point_idx[~ties] == before.point_idx[~ties])
    again = parts.unshared(alone)
    assert again.points == alone.points  # nothing is left to split


def test_a_split_point_has_a_name_that_no_other_has():
    block = rigs.simulated(ties=3)
    names = list(block.points)
    ties = [i for i in range(len(names)) if i not in block.control.point_idx]
    names[ties[1]] = f"{names[ties[0]]} {block.cameras[1].name}"
    alone = parts.unshared(replace(block, points=tuple(names)))
    assert f"{names[ties[1]]}'" in alone.points
    assert len(set(alone.points)) == len(alone.points)
