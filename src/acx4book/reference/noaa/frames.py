"""Ground corners from Applanix orientations of NOAA's frames, compared with another program."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4book.reference import data
from acx4book.reference.noaa import files
from acx4book.reference.noaa.files import Frame
from acx4lib.expected import Array
from acx4lib.geometry.collinearity import rays
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import GridSystem, MappingFrame

FRAMES = ("C19748959", "C25959144")


def results() -> pd.DataFrame:
    """Return the ground corners and the reference points of all frames, and OSSIM's.

    Returns
    -------
    DataFrame
        frame, point, lon_deg, lat_deg (OSSIM's), d_east_m, d_north_m (ours minus OSSIM's),
        distance_m, ground_pixel_m.
    """
    frames = [files.read(data.path(f"noaa-dss-dg/{name}.geom")) for name in FRAMES]
    return pd.concat([_compared(frame) for frame in frames], ignore_index=True)


def _compared(frame: Frame) -> pd.DataFrame:
    d, ground_pixel_m = differences(frame)
    return pd.DataFrame(
        {
            "frame": frame.name,
            "point": [*files.CORNERS, "centre"],
            "lon_deg": frame.lonlat[:, 0],
            "lat_deg": frame.lonlat[:, 1],
            "d_east_m": d[:, 0],
            "d_north_m": d[:, 1],
            "distance_m": np.hypot(d[:, 0], d[:, 1]),
            "ground_pixel_m": ground_pixel_m,
        }
    )


def differences(frame: Frame) -> tuple[Array, float]:
    """Return our ground points minus OSSIM's, and the size of a pixel on the ground.

    Returns
    -------
    d : ndarray, shape (5, 3)
        East, north, up in the mapping frame, m.
    ground_pixel_m : float
    """
    grid = GridSystem(crs=frame.crs)
    below = grid.lonlat_from_grid(frame.enh[None, :2])[0]
    mapping = MappingFrame(grid=grid, origin=below)
    pose = mapping.pose_from_grid(frame.enh[None], frame.opk[None])[np.zeros(5, dtype=int)]
    x_m = on_ground(mapping, pose, rays(frame.camera, pose, frame.colrow), frame.ground_m)
    given = np.column_stack([frame.lonlat, np.full(5, frame.ground_m)])
    above_m = frame.enh[2] - frame.ground_m
    return (
        x_m - mapping.from_geographic(given),
        above_m * frame.camera.pixel_mm / frame.camera.interior.f,
    )


def on_ground(mapping: MappingFrame, T_m_c: Pose, directions: Array, height_m: float) -> Array:
    """Return the intersections of rays with the surface of one ellipsoidal height.

    Parameters
    ----------
    mapping : MappingFrame
    T_m_c : Pose
        One per ray, above the surface.
    directions : ndarray, shape (n, 3)
        Directions downwards, mapping axes.
    height_m : float

    Returns
    -------
    ndarray, shape (n, 3)
        Mapping frame, m.
    """
    x_m = T_m_c.r
    for _ in range(5):  # the steps correct the Earth's curvature, d^2 / 2R, then its slope
        above_m = mapping.to_geographic(x_m)[:, 2] - height_m
        x_m = x_m - (above_m / directions[:, 2])[:, None] * directions
    return x_m
