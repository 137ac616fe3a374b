"""The unknowns of a bundle that are not points: their names, and which column each one has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib._typing import Index
from acx4lib.camera import INTERIOR

MOUNT = ("lever_x", "lever_y", "lever_z", "boresight_x", "boresight_y", "boresight_z")
"""The six ways a mounting varies: `collinearity.mounted_jacobian`'s order."""

POSE = ("x", "y", "z", "rotation_x", "rotation_y", "rotation_z")


@dataclass(frozen=True, kw_only=True, eq=False)
class Layout:
    """Which unknown stands in which column; nobody else counts.

    Attributes
    ----------
    interior : ndarray, shape (n_cameras, 9)
        Columns of the interior parameters in the order of `camera.INTERIOR`, -1 where held.
    mount : ndarray, shape (n_cameras, 6)
        Columns of the mountings in the order of `MOUNT`, -1 where held.
    pose : ndarray, shape (n_poses, 6)
        Columns of the poses.
    """

    interior: Index
    mount: Index
    pose: Index

    @property
    def n_columns(self) -> int:
        """Number of unknowns that are not points."""
        return int(sum(np.sum(part >= 0) for part in (self.interior, self.mount, self.pose)))


def layout(
    n_cameras: int, n_poses: int, *, free: Sequence[str], free_mount: Sequence[str] = ()
) -> Layout:
    """Return which unknown has which column: per camera interior and mounting, then poses.

    Parameters
    ----------
    n_cameras, n_poses : int
    free : sequence of str
        Interior parameters to estimate, names of `camera.INTERIOR`.
    free_mount : sequence of str
        Names of `MOUNT`.

    Raises
    ------
    ValueError
        For an unknown name.
    """
    unknown = sorted((set(free) - set(INTERIOR)) | (set(free_mount) - set(MOUNT)))
    if unknown:
        msg = f"no such parameter: {', '.join(unknown)}"
        raise ValueError(msg)
    is_free = np.array([name in free for name in INTERIOR] + [name in free_mount for name in MOUNT])
    per_camera = np.tile(is_free, (n_cameras, 1))
    columns = np.where(per_camera, np.cumsum(per_camera).reshape(per_camera.shape) - 1, -1)
    first = int(per_camera.sum())
    return Layout(
        interior=columns[:, : len(INTERIOR)],
        mount=columns[:, len(INTERIOR) :],
        pose=first + np.arange(6 * n_poses).reshape(n_poses, 6),
    )
