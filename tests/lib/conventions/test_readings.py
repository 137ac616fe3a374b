"""Which measurements readings are compared by."""

from dataclasses import replace

import numpy as np

from acx4lib.conventions.readings import MOST_IMAGES, MOST_MEASUREMENTS, sightings
from acx4lib.flight.block import select_images
from acx4lib.flight.reader import read
from support.flights import planted, sized


def block_of(tmp_path, size):
    flight = sized.clean("single-head", "grid", size)
    return read(planted.write(flight, tmp_path / "flight")).calibration


def test_surveyed_points_are_enough_where_there_are_some(tmp_path):
    block = block_of(tmp_path, "medium")
    seen = sightings(block)
    assert len(seen.exposures) == 37
    assert np.isfinite(seen.x_m).all()
    names = [block.points[i] for i in block.control.point_idx]
    assert len(seen.x_m) == len(names)


def test_sixty_images_of_a_large_block_are_looked_at(tmp_path):
    block = block_of(tmp_path, "large")
    for own in (sightings(block), sightings(_without_control(block))):
        assert MOST_IMAGES / 2 < len(own.exposures) <= MOST_IMAGES
        assert len(own) <= 1.05 * MOST_MEASUREMENTS  # rays of whole tie points
        assert own.point_idx.max() == len(own.x_m) - 1


def test_nothing_can_be_said_of_a_few_images(tmp_path):
    block = block_of(tmp_path, "small")
    assert sightings(select_images(block, np.arange(len(block.images)) < 5)) is None


def _without_control(block):
    none = np.zeros(len(block.control), dtype=bool)
    return replace(block, control=block.control[none])
