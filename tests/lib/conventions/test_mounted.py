"""Mountings on a trajectory taken as exact: derivatives, truth, robustness."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.conventions import mounted as conventions_mounted
from acx4lib.conventions.mounted import measuring_noise, mounted, size
from acx4lib.conventions.readings import sightings
from acx4lib.conventions.search import RIGHT
from acx4lib.geometry.frames import Pose, turn
from support.flights import simulated
from support.helpers import rotation_angle


@pytest.fixture(scope="module")
def flown():
    return simulated.fly("single-head", seed=1, blocks=("calibration",), exact=True)


@pytest.fixture(scope="module")
def block(flown):
    return flown.flight.calibration


def body(block, seen):
    return block.trajectory.T_m_b[seen.exposures]


def test_exact_data_give_the_truth(flown, block):
    seen = sightings(block)
    found = mounted(seen, body(block, seen))
    true = flown.truth["cameras"]["CAM"]
    (camera,) = found.cameras
    assert found.misfit < 1e-8  # 1e-4 px; the prior of the lens pulls by less
    assert_allclose(camera.interior.f, true["f_mm"], atol=2e-3)
    assert_allclose(camera.T_b_c.r, [true[f"lever_{a}_m"] for a in "xyz"], atol=0.03)


def test_any_start_of_the_boresight_does(block):
    seen = sightings(block)
    (camera,) = seen.cameras
    right = mounted(seen, body(block, seen))
    away = replace(camera, T_b_c=Pose(R=camera.T_b_c.R @ turn(0, 2.5), r=camera.T_b_c.r))
    found = mounted(replace(seen, cameras=(away,)), body(block, seen))
    assert rotation_angle(found.cameras[0].T_b_c.R, right.cameras[0].T_b_c.R) < 1e-6


def test_a_delay_is_told_from_a_lever_arm_that_cannot_be(block):
    seen = sightings(block)
    speed = 70.0 * block.trajectory.T_m_b.R[seen.exposures, :, 0]
    late = Pose(R=body(block, seen).R, r=body(block, seen).r + 0.5 * speed)
    assert mounted(seen, late).misfit > 0.005  # of 35 m in 600 m to 1000 m; the boresight helps
    found = mounted(seen, late, speed)
    assert_allclose(found.delay_s, -0.5, atol=0.01)
    assert found.misfit < 1e-4


def test_derivatives_agree_with_differences(block):
    seen = sightings(block)
    velocity = np.random.default_rng(1).normal(size=(len(seen.exposures), 3))
    state = replace(conventions_mounted.started(seen, body(block, seen)), delay_s=0.1)
    v, A, B = conventions_mounted._linear(seen, body(block, seen), state, velocity)
    steps = np.array([*[1e-6] * 3, *[1e-3] * 6, 1e-9, 1e-12, 1e-15, 1e-8, 1e-8, 1e-4])
    for column, h in enumerate(steps):
        dx = np.zeros(len(steps))
        dx[column] = h
        there, back = (
            conventions_mounted._linear(
                seen,
                body(block, seen),
                conventions_mounted._moved(state, s * dx, state.x_m),
                velocity,
            )[0]
            for s in (1, -1)
        )
        numeric = (there - back) / (2 * h)
        assert_allclose(A[:, :, column], numeric, atol=1e-5 * np.abs(numeric).max())
    shifted = replace(state, x_m=state.x_m + np.array([0.0, 0.0, 1e-3]))
    numeric = (
        conventions_mounted._linear(seen, body(block, seen), shifted, velocity)[0] - v
    ) / 1e-3
    assert_allclose(B[:, :, 2], numeric, atol=1e-5 * np.abs(numeric).max())


def test_size_is_the_standard_deviation_of_normal_residuals():
    v = np.random.default_rng(2).normal(scale=[2.0, 2.0], size=(40_000, 2))
    assert_allclose(size(v), 2.0, rtol=0.02)  # 40 000 numbers: 0.5 %
    v[::20] = np.nan  # one in twenty behind the camera
    assert size(v) < 2.3


def test_noise_of_measuring_is_found_under_errors_of_the_trajectory(block):
    rng = np.random.default_rng(3)
    seen = sightings(block)
    px = seen.cameras[0].pixel_mm / seen.cameras[0].interior.f
    noisy = replace(seen, colrow=seen.colrow + 0.5 * rng.normal(size=seen.colrow.shape))
    T_m_b = body(block, seen)
    shaken = Pose(R=T_m_b.R, r=T_m_b.r + rng.normal(size=T_m_b.r.shape))
    found = mounted(noisy, shaken)
    assert found.misfit > 5 * px  # 1 m are 15 px
    noise = measuring_noise(noisy, shaken, found)  # the lens takes up a part of the metre
    assert 1 / RIGHT < noise / (0.5 * px) < RIGHT
