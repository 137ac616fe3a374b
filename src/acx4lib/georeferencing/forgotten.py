"""Direct georeferencing with one step left out, to show its effect.

Each function returns the input of a validation, a calibration or a block, without the step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from acx4lib.block import Block
from acx4lib.calibration.estimates import Calibration
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose, turn


def lever_arm(calibration: Calibration) -> Calibration:
    """Return a calibration without lever arms: cameras at the place of the IMU."""
    return _changed(calibration, lambda c: replace(c, T_b_c=Pose(R=c.T_b_c.R, r=np.zeros(3))))


def boresight(calibration: Calibration) -> Calibration:
    """Return a calibration with boresights rounded to quarter turns, as the eye sees a mount."""
    return _changed(
        calibration, lambda c: replace(c, T_b_c=Pose(R=_nearest_quarter(c.T_b_c.R), r=c.T_b_c.r))
    )


def distortion(calibration: Calibration) -> Calibration:
    """Return a calibration without radial and decentring distortion."""
    return _changed(
        calibration,
        lambda c: c.with_interior(replace(c.interior, k1=0.0, k2=0.0, k3=0.0, p1=0.0, p2=0.0)),
    )


def principal_point(calibration: Calibration) -> Calibration:
    """Return a calibration with the principal point in the middle of the image."""
    return _changed(calibration, lambda c: c.with_interior(replace(c.interior, xp=0.0, yp=0.0)))


def convergence(block: Block) -> Block:
    """Return a block with attitudes that were read as if grid north were true north."""
    trajectory = block.trajectory
    lonlat = block.frame.to_geographic(trajectory.T_m_b.r)[:, :2]
    gamma = block.frame.grid.convergence(lonlat)
    R_g_m = trajectory.R_g_m
    wrong = np.swapaxes(R_g_m, 1, 2) @ turn(2, gamma) @ R_g_m @ trajectory.T_m_b.R
    return replace(block, trajectory=replace(trajectory, T_m_b=Pose(R=wrong, r=trajectory.T_m_b.r)))


def _changed(calibration: Calibration, change: Callable[[Camera], Camera]) -> Calibration:
    return replace(calibration, cameras=tuple(map(change, calibration.cameras)))


def _nearest_quarter(R_b_c: Array) -> Array:
    rounded: Array = np.round(R_b_c)
    return rounded if np.linalg.det(rounded) == 1 else np.eye(3)
