"""What a flight that is measured in heads says of its synthetic images before they are made."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from acx4lib import flight
from acx4lib.flight.block import select_images
from acx4lib.flight.design import forward_overlaps, ground_sample_m
from acx4lib.flight.synthetic_images import synthetic_images
from support.flights import in_heads, written


@pytest.fixture(scope="module")
def read(tmp_path_factory):
    return flight.read(in_heads.write(tmp_path_factory.mktemp("in_heads")))


def test_a_block_in_heads_is_flown_as_one_of_synthetic_images(read, tmp_path):
    plain = flight.read(written.write_flight(tmp_path, blocks=("heads", "calibration"))).calibration
    mounted = read.mounted("calibration")
    assert mounted.images.names == mounted.trajectory.exposures == plain.trajectory.exposures
    assert mounted.images.strips == plain.images.strips
    assert_allclose(ground_sample_m(mounted), ground_sample_m(plain), rtol=1e-12)
    assert_allclose(forward_overlaps(mounted)[1], forward_overlaps(plain)[1], atol=1e-12)
    assert len(mounted.image_points) == 0
    assert mounted.points == read.calibration.points


def test_a_block_that_is_not_carried_is_what_was_measured(read):
    assert read.mounted("heads") is read.heads
    plain = replace(read, synthetic=replace(read.synthetic, measured_in="synthetic"))
    assert plain.mounted("calibration") is plain.calibration


def test_exposures_without_any_image_make_none(read):
    block = read.calibration
    without = select_images(block, block.images.exposure_idx != 2)
    made = synthetic_images(without, read.synthetic_camera)
    assert len(made.images) == len(block.trajectory) - 1
    assert 2 not in made.images.exposure_idx
    assert_array_equal(made.trajectory.T_m_b.r, block.trajectory.T_m_b.r)


def test_the_summary_shows_both_the_heads_and_the_synthetic_images(read):
    lines = [line.split() for line in flight.summary(read).splitlines()]
    assert lines.count(["carried", "into", "6", "images", "of", "CAM"]) == 2
    assert sum(line[:2] == ["GSD", "CAM"] for line in lines) == 2
    assert sum(line[:2] == ["GSD", "LEFT"] for line in lines) == 3
    assert np.isfinite(read.mounted("validation").T_m_b_images.r).all()
