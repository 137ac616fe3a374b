"""Axes of other programs' cameras: x right, y down, z ahead; the library's are turned about x."""

from __future__ import annotations

import numpy as np

from acx4lib.expected import Array
from acx4lib.geometry.frames import Pose, turn

FLIP = np.diag([1.0, -1.0, -1.0])
"""Between the library's camera axes and those with y down, z ahead."""

TOP_AHEAD = turn(2, -np.pi / 2)
"""R_b_c of a camera that looks down with the top of its images ahead: yaw, pitch, roll are zero."""

AHEAD = Pose(R=np.eye(3), r=np.zeros(3))
"""Mounting of a camera whose own axes are the body's."""

UNKNOWN = Pose(R=np.full((3, 3), np.nan), r=np.full(3, np.nan))
"""Pose of an image that is not oriented."""


def turned(R_cv: Array) -> Array:
    """Return rotations between axes with y down, z ahead as those between the library's."""
    return FLIP @ R_cv @ FLIP


def is_rotation(R: Array, off: float = 1e-4) -> bool:
    """Tell whether a matrix, shape (3, 3), of any numbers turns, and does not mirror."""
    if not (np.abs(R) < 2).all():
        return False
    return bool(np.abs(R @ R.T - np.eye(3)).max() <= off and np.linalg.det(R) > 0)


def nearest_rotation(R: Array) -> Array:
    """Return the rotation that is nearest to a matrix printed with few digits, shape (3, 3)."""
    u, _, v = np.linalg.svd(R)
    return u @ v


def stacked(poses: list[Pose]) -> Pose:
    """Return single poses as one of shape (n,)."""
    return Pose(
        R=np.array([pose.R for pose in poses]).reshape(-1, 3, 3),
        r=np.array([pose.r for pose in poses]).reshape(-1, 3),
    )
