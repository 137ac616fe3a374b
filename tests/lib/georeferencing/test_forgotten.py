"""A validation with a forgotten step, against what the geometry of the ideal flight says."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.georeferencing import forgotten
from acx4lib.georeferencing.validation import validate


def rms(block, calibration):
    found = validate(block, calibration, method="given")
    return float(np.sqrt(np.mean(np.sum(found.points.d**2, axis=1))))


@pytest.mark.parametrize("name", ["lever_arm", "boresight", "distortion", "principal_point"])
def test_a_step_that_a_calibration_lacks_is_seen_at_exact_check_points(block, cameras, name):
    without = getattr(forgotten, name)(cameras)
    assert rms(block, cameras) < 1e-6
    assert rms(block, without) > 1e-3


def test_a_forgotten_convergence_turns_by_it(block, cameras):
    wrong = forgotten.convergence(block)
    lonlat = block.frame.to_geographic(block.trajectory.T_m_b.r)[:, :2]
    gamma = np.abs(block.frame.grid.convergence(lonlat))
    turned = np.swapaxes(block.trajectory.T_m_b.R, 1, 2) @ wrong.trajectory.T_m_b.R
    angle = np.arccos(np.clip((np.trace(turned, axis1=1, axis2=2) - 1) / 2, -1, 1))
    assert_allclose(angle, gamma, rtol=1e-6)
    assert rms(wrong, cameras) > 1e-3


def test_the_other_steps_stay(cameras):
    (camera,) = cameras.cameras
    (without,) = forgotten.lever_arm(cameras).cameras
    assert_allclose(without.T_b_c.r, 0.0)
    assert_allclose(without.T_b_c.R, camera.T_b_c.R)
    assert without.interior == camera.interior
    (straight,) = forgotten.boresight(cameras).cameras
    assert_allclose(np.abs(straight.T_b_c.R).sum(axis=0), 1.0)  # quarter turns
    (plain,) = forgotten.distortion(cameras).cameras
    assert plain.interior == replace(camera.interior, k1=0.0, k2=0.0, k3=0.0, p1=0.0, p2=0.0)
