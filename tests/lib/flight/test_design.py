"""The design of a block, read from its trajectory."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.flight import design, parts
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
    (lowest,) = design.levels(parts.lowest_height(block))
    low = design.levels(block)[1]
    assert (lowest.strips, lowest.height_m, lowest.gsd_m) == (low.strips, low.height_m, low.gsd_m)
    assert lowest.side_overlap == low.side_overlap
