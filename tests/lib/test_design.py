"""The design of a block, read from its trajectory."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib import design
from acx4lib.design import flying_heights
from support.flights import in_heads
from support.flights.simulated import fly


@pytest.fixture(scope="module")
def flown():
    return fly("acx4", seed=1, blocks=("heads",))


def test_the_papers_design_is_read_from_the_trajectory(flown):
    """Section 3.2: 2600 m with 10, 1600 m with three times 7 images, overlaps of 80 and 50 %."""
    high, low = design.levels(flown.flight.heads)
    assert_allclose([high.height_m, low.height_m], [2600, 1600], rtol=0.01)
    assert [len(high.strips), len(low.strips)] == [1, 3]
    assert [high.images_per_strip, low.images_per_strip] == [10, 7]
    assert_allclose([high.forward_overlap, low.forward_overlap], 0.8, atol=0.03)
    assert low.side_overlap == pytest.approx(0.5, abs=0.05)
    assert np.isnan(high.side_overlap)
    assert (high.n_directions, low.n_directions) == (1, 1)
    assert low.gsd_m == pytest.approx(0.13, abs=0.002)


def test_coincident_strips_overlap_wholly_and_are_flown_both_ways():
    high, low = design.levels(fly("acx4-ideal", seed=1).flight.calibration)
    assert high.side_overlap == pytest.approx(1.0, abs=0.02)
    assert (high.n_directions, low.n_directions) == (2, 2)


def test_a_block_without_surveyed_points_has_no_known_ground(flown):
    block = flown.flight.heads
    bare = replace(block, control=block.control[:0], check=block.check[:0])
    assert np.isnan(design.ground_height(bare))
    assert all(np.isnan(level.height_m) for level in design.levels(bare))
    assert np.isnan(design.footprints(bare)).all()


def test_footprints_lie_on_the_ground_around_the_exposure(flown):
    block = flown.flight.heads
    corners = design.footprints(block)
    assert_allclose(corners[..., 2], design.ground_height(block))
    at = block.T_m_b_images.r[:, None, :2]
    reach = np.linalg.norm(corners[..., :2] - at, axis=-1)
    assert reach.max() < 2600 * np.tan(np.radians(55))


def test_a_table_of_levels_has_their_numbers_in_its_units(noisy_block):
    table, found = design.level_table(noisy_block), design.levels(noisy_block)
    assert list(table.index) == list(range(1, len(found) + 1))
    assert_allclose(table["height above ground (m)"], [level.height_m for level in found])
    assert_allclose(table["ground pixel (cm)"], [100 * level.gsd_m for level in found])
    assert_allclose(table["forward overlap (%)"], [100 * level.forward_overlap for level in found])


def test_strips_without_names_are_not_counted(noisy_block):
    images = replace(noisy_block.images, strips=("",) * len(noisy_block.images))
    table = design.level_table(replace(noisy_block, images=images))
    assert table[["strips", "images per strip"]].isna().all(axis=None)


def test_a_table_of_standard_deviations_has_the_medians_of_every_block(noisy_block):
    table = design.sigma_table({"one": noisy_block})
    assert list(table.index) == ["one"]
    assert table["image points (px)"]["one"] == np.median(noisy_block.image_points.sigma_px)
    attitude = np.degrees(np.median(noisy_block.trajectory.sigma_attitude[:, 2]))
    assert table["heading (°)"]["one"] == attitude


def test_a_part_of_a_block_has_the_levels_of_its_images(flown):
    block = flown.flight.heads
    (lowest,) = design.levels(design.lowest_height(block))
    low = design.levels(block)[1]
    assert (lowest.strips, lowest.height_m, lowest.gsd_m) == (low.strips, low.height_m, low.gsd_m)
    assert lowest.side_overlap == low.side_overlap


# --- Parts of a block keep what they name, and nothing else changes


def test_the_lowest_height_is_within_a_tenth(noisy_block):
    lowest = design.lowest_height(noisy_block)
    height = flying_heights(lowest)[lowest.images.exposure_idx]
    assert height.max() < 1.15 * height.min()
    assert 0 < len(lowest.images) <= len(noisy_block.images)


def test_one_direction_has_no_image_flown_backwards(noisy_block):
    kept = design.one_direction(noisy_block)
    forward = kept.T_m_b_images.R[:, :2, 0]
    assert np.all(forward @ forward[0] > 0)


def test_control_points_that_are_left_out_are_tie_points(noisy_block):
    none = design.without_control(noisy_block)
    assert len(none.control) == 0
    assert len(none.image_points) == len(noisy_block.image_points)
    first = noisy_block.points[noisy_block.control.point_idx[0]]
    others = design.without_control(noisy_block, {first})
    assert len(others.control) == len(noisy_block.control) - 1
    assert first not in {others.points[i] for i in others.control.point_idx}


def test_strips_are_left_out_by_their_names(noisy_block):
    name = noisy_block.images.strips[0]
    kept = design.without_strips(noisy_block, {name})
    assert name not in kept.images.strips
    assert set(kept.images.strips) == set(noisy_block.images.strips) - {name}


def test_the_grid_taken_for_cartesian_has_the_numbers_of_the_map(noisy_block):
    wrong = design.as_if_cartesian(noisy_block)
    grid = noisy_block.frame.to_grid(noisy_block.control.x_m)
    off = wrong.control.x_m - grid
    assert_allclose(off, np.broadcast_to(off[0], off.shape), atol=1e-6)
    assert off[0] == pytest.approx(np.round(off[0]), abs=1e-6)


def test_a_surveyed_lever_arm_is_declared_and_nothing_else(noisy_block):
    lever = (0.2, -0.4, -0.1)
    changed = design.with_lever_arm(noisy_block, lever)
    assert changed.cameras[0].T_b_c.r == pytest.approx(lever)
    assert_allclose(changed.cameras[0].T_b_c.R, noisy_block.cameras[0].T_b_c.R)
    with pytest.raises(ValueError, match="camera: expected one of CAM, got 'X'"):
        design.with_lever_arm(noisy_block, lever, camera="X")
    with pytest.raises(ValueError, match="lever_m: expected shape"):
        design.with_lever_arm(noisy_block, (1.0, 2.0))


def test_focal_lengths_are_those_that_are_named(noisy_block):
    name = noisy_block.cameras[0].name
    longer = design.with_focal_lengths(noisy_block, {name: 75.0})
    assert longer.cameras[0].interior.f == 75.0
    assert longer.cameras[1:] == noisy_block.cameras[1:]
    assert longer.image_points is noisy_block.image_points
    with pytest.raises(ValueError, match="f_mm: expected names of"):
        design.with_focal_lengths(noisy_block, {"nobody": 75.0})


def test_cameras_without_shared_points_keep_every_measurement():
    block = in_heads.simulated(ties=60)
    alone = design.unshared(block)
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
    again = design.unshared(alone)
    assert again.points == alone.points  # nothing is left to split


def test_a_split_point_has_a_name_that_no_other_has():
    block = in_heads.simulated(ties=3)
    names = list(block.points)
    ties = [i for i in range(len(names)) if i not in block.control.point_idx]
    names[ties[1]] = f"{names[ties[0]]} {block.cameras[1].name}"
    alone = design.unshared(replace(block, points=tuple(names)))
    assert f"{names[ties[1]]}'" in alone.points
    assert len(set(alone.points)) == len(alone.points)
