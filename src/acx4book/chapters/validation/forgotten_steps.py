"""A validation with one step of direct georeferencing forgotten."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from acx4lib.calibration.estimates import Calibration
from acx4lib.expected import Array
from acx4lib.flight.block import Block
from acx4lib.geometry.camera import Interior
from acx4lib.geometry.frames import Pose, turn
from acx4lib.georeferencing.validation import validate


def validations(
    block: Block, calibrations: Sequence[Calibration], *, refraction: str = "none"
) -> pd.DataFrame:
    """Repeat the validation with one step of direct georeferencing forgotten at a time.

    Parameters
    ----------
    block : Block
    calibrations : sequence of Calibration
        The last one is used.
    refraction : str
        ``"none"`` or ``"standard"``.

    Returns
    -------
    DataFrame
        One row per mistake: mean and RMS of the points' differences in east, north, height, m;
        no rows without a calibration.
    """
    if not calibrations:
        return pd.DataFrame()
    calibration = calibrations[-1]
    mistakes: dict[str, tuple[Block, Calibration]] = {
        "none": (block, calibration),
        "lever arm forgotten": (block, _mounted(calibration, r=np.zeros(3))),
        "boresight forgotten": (block, _mounted(calibration, R=_nearest_quarter)),
        "distortion forgotten": (block, _interior(calibration, _undistorted)),
        "principal point forgotten": (block, _interior(calibration, _centred)),
        "meridian convergence forgotten": (_without_convergence(block), calibration),
    }
    rows = []
    for name, (spoilt, said) in mistakes.items():
        points = validate(spoilt, said, method=name, refraction=refraction).points
        d = points.d if len(points) else np.full((1, 3), np.nan)  # a mistake may leave none
        mean, rms = d.mean(axis=0), np.sqrt(np.mean(d**2, axis=0))
        rows.append(
            {
                "mistake": name,
                "points": len(points),
                **dict(zip(("mean_east_m", "mean_north_m", "mean_height_m"), mean, strict=True)),
                **dict(zip(("rms_east_m", "rms_north_m", "rms_height_m"), rms, strict=True)),
            }
        )
    return pd.DataFrame(rows)


def _mounted(
    calibration: Calibration, *, R: Callable[[Array], Array] | None = None, r: Array | None = None
) -> Calibration:
    """Return the calibration with another boresight or lever arm of every camera."""
    cameras = tuple(
        replace(
            camera,
            T_b_c=Pose(
                R=R(camera.T_b_c.R) if R else camera.T_b_c.R, r=camera.T_b_c.r if r is None else r
            ),
        )
        for camera in calibration.cameras
    )
    return replace(calibration, cameras=cameras)


def _nearest_quarter(R_b_c: Array) -> Array:
    """Return the rotation by quarter turns that is nearest: what a mount looks like by eye."""
    return np.round(R_b_c) if np.linalg.det(np.round(R_b_c)) == 1 else np.eye(3)


def _interior(calibration: Calibration, change: Callable[[Interior], Interior]) -> Calibration:
    cameras = tuple(c.with_interior(change(c.interior)) for c in calibration.cameras)
    return replace(calibration, cameras=cameras)


def _undistorted(interior: Interior) -> Interior:
    return Interior(f=interior.f, xp=interior.xp, yp=interior.yp, b1=interior.b1)


def _centred(interior: Interior) -> Interior:
    return replace(interior, xp=0.0, yp=0.0)


def _without_convergence(block: Block) -> Block:
    """Return the block with attitudes read as if grid north were true north."""
    trajectory = block.trajectory
    lonlat = block.frame.to_geographic(trajectory.T_m_b.r)[:, :2]
    gamma = block.frame.grid.convergence(lonlat)
    R_t_m = block.trajectory.R_g_m  # mapping to grid axes; turning by gamma undoes convergence
    wrong = np.swapaxes(R_t_m, 1, 2) @ turn(2, gamma) @ R_t_m @ trajectory.T_m_b.R
    return replace(block, trajectory=replace(trajectory, T_m_b=Pose(R=wrong, r=trajectory.T_m_b.r)))
