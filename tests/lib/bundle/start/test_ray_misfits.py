"""Start values that are bad, and whose measurements say so."""

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from acx4lib.bundle import uses
from acx4lib.bundle.start.ray_misfits import far_off, in_front, suspects
from acx4lib.geometry.frames import Pose, turn
from support import blocks

FREE = ("f", "xp", "yp", "k1")


def test_ordinary_start_values_are_taken_as_they_are(exact_block):
    """Half a degree and 0.3 mm: no phase comes before the adjustment."""
    rough = blocks.approximate(exact_block)
    network = uses.mounted_orientation(rough, free=FREE)
    assert not far_off(network, network.start).any()
    assert_allclose(network.start.T_b_c.R[0], rough.cameras[0].T_b_c.R, atol=0)


def test_a_single_image_that_looks_elsewhere_is_far_off(exact_block):
    network = uses.free_orientation(exact_block, free=FREE)
    R = network.start.T_m_b.R.copy()
    R[3] = R[3] @ turn(0, np.radians(6.0))
    state = replace(network.start, T_m_b=Pose(R=R, r=network.start.T_m_b.r))
    assert np.flatnonzero(far_off(network, state)).tolist() == [3]
    assert np.flatnonzero(far_off(network, state, limit=np.radians(6.5))).tolist() == []
    assert "in 1 of 12 images (3_CAM by 6 degrees)" in suspects(network, state)


def test_good_start_values_raise_no_suspicion(exact_block):
    network = uses.mounted_orientation(exact_block, free=FREE)
    assert suspects(network, network.start) == ""


def test_a_point_behind_a_camera_is_not_in_front(exact_block):
    network = uses.mounted_orientation(exact_block, free=FREE)
    assert in_front(network, network.start)
    x_m = network.start.x_m.copy()
    x_m[network.image_points.point_idx[0], 2] = 5000.0  # m, above all flying heights
    assert not in_front(network, replace(network.start, x_m=x_m))


def test_without_measurements_nothing_is_far_off(exact_block):
    empty = replace(exact_block, image_points=exact_block.image_points[np.zeros(0, dtype=int)])
    network = uses.free_orientation(empty, free=FREE)
    assert not far_off(network, network.start).any()
    assert suspects(network, network.start) == ""
