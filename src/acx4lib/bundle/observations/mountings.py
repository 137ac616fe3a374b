"""Declared mountings that have standard deviations, as observations of those estimated."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from acx4lib.expected import Index
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose, log, log_jacobian, transform
from acx4lib.least_squares.problem import Equations


def mounting_equations(
    cameras: Sequence[Camera], T_b_c: Pose, columns: Index
) -> Iterator[Equations]:
    """Linearise the declared mountings that have sigma: lever arms, then boresights.

    Both along the body's axes. Only those that are estimated are observations.

    Parameters
    ----------
    cameras : sequence of Camera
        As declared.
    T_b_c : Pose
        Estimates.
    columns : ndarray, shape (n_cameras, 6)
        Columns of the mountings.
    """
    if len(rows := observed_mountings(cameras, "lever_arm", columns)):
        yield Equations(
            kind="lever_arm",
            v=T_b_c.r[rows] - np.array([cameras[k].T_b_c.r for k in rows]),
            sigma=np.array([cameras[k].prior.lever_sigma for k in rows]),
            A=np.tile(np.eye(3), (len(rows), 1, 1)),
            columns=columns[rows, :3],
            unit=np.arange(len(rows)),
        )
    if len(rows := observed_mountings(cameras, "boresight", columns)):
        R_declared = np.array([cameras[k].T_b_c.R for k in rows])
        v = log(np.swapaxes(R_declared, -1, -2) @ T_b_c.R[rows])
        yield Equations(
            kind="boresight",
            v=transform(R_declared, v),
            sigma=np.array([cameras[k].prior.boresight_sigma for k in rows]),
            A=R_declared @ log_jacobian(v),
            columns=columns[rows, 3:],
            unit=np.arange(len(rows)),
        )


def observed_mountings(cameras: Sequence[Camera], part: str, columns: Index) -> Index:
    """Return the cameras of which a part of the mounting is estimated and declared with sigma.

    Parameters
    ----------
    cameras : sequence of Camera
    part : str
        ``"lever_arm"`` or ``"boresight"``.
    columns : ndarray, shape (n_cameras, 6)
        Columns of the mountings.
    """
    own = columns[:, :3] if part == "lever_arm" else columns[:, 3:]
    sigma = np.array(
        [c.prior.lever_sigma if part == "lever_arm" else c.prior.boresight_sigma for c in cameras]
    )
    return np.flatnonzero(np.isfinite(sigma).any(axis=1) & np.all(own >= 0, axis=1))
