"""Frames of NOAA's digital sensor system, and OSSIM's ground points."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from acx4book.reference import data
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.collinearity import rays
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import GridSystem, MappingFrame

# --- OSSIM's keyword lists: frames of the sensor model ``ossimApplanixUtmModel``
#
# OSSIM counts pixels from the reference point of the image; the pixel (0, 0) is a corner of the
# image. It multiplies measured points by 1 - (k0 + k1 r^2 + k2 r^4 + k3 r^6). It stores the
# boresight with omega, phi, kappa but does not apply it: these angles are those of the camera.


CORNERS = ("ul", "ur", "lr", "ll")
"""Order of the corners."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Frame:
    """One frame with its orientation and its reference coordinates.

    Attributes
    ----------
    name : str
    camera : Camera
    crs : str
        UTM on WGS 84.
    enh : ndarray, shape (3,)
        Perspective centre: easting, northing, ellipsoidal height, m.
    opk : ndarray, shape (3,)
        Attitude of the camera relative to the grid, radians.
    colrow : ndarray, shape (5, 2)
        The corners in the order of `CORNERS`, then the reference point.
    lonlat : ndarray, shape (5, 2)
        OSSIM's positions of these points on the ground, degrees.
    ground_m : float
        Ellipsoidal height of the ground.
    """

    name: str
    camera: Camera
    crs: str
    enh: Array
    opk: Array
    colrow: Array
    lonlat: Array
    ground_m: float


def read(path: Path) -> Frame:
    """Read a frame."""
    lines = (line.partition(":") for line in path.read_text(encoding="ascii").splitlines())
    words = {key.strip(): value.strip() for key, _, value in lines}

    def numbers(key: str) -> Array:
        return np.array([float(word) for word in words[key].split() if word != "WGE"])

    left, top, right, bottom = numbers("rect")
    centre = np.array([float(words["ref_point_samp"]), float(words["ref_point_line"])])
    corners = [[left, top], [right, top], [right, bottom], [left, bottom]]
    places = [[float(words[f"{name}_{axis}"]) for axis in ("lon", "lat")] for name in CORNERS]
    hemisphere = 326 if words["utm_hemisphere"] == "N" else 327
    return Frame(
        name=words["image_id"],
        camera=_camera(words, size_px=(int(right) + 1, int(bottom) + 1), centre=centre),
        crs=f"EPSG:{hemisphere}{int(words['utm_zone']):02d}",
        enh=numbers("utm_platform_position"),
        opk=np.radians([float(words[name]) for name in ("omega", "phi", "kappa")]),
        colrow=np.array([*corners, centre]),
        lonlat=np.array([*places, [float(words["ref_point_lon"]), float(words["ref_point_lat"])]]),
        ground_m=float(words["ref_point_hgt"]),
    )


def _camera(words: dict[str, str], *, size_px: tuple[int, int], centre: Array) -> Camera:
    """Return the camera; the scale factor k0 is included in f and the other coefficients."""
    pixel_mm = float(words["pixel_size"].split()[0])
    k0, k1, k2, k3 = (float(words[f"distortion.k{power}"]) for power in range(4))
    principal = np.array([float(word) for word in words["principal_point"].split()])
    middle = 0.5 * (np.array(size_px) - 1)
    xp, yp = principal + (centre - middle) * pixel_mm * [1, -1]
    return Camera(
        name=words["sensor"],
        width_px=size_px[0],
        height_px=size_px[1],
        pixel_mm=pixel_mm,
        interior=Interior(
            f=float(words["focal_length"]) / (1 - k0),
            xp=float(xp),
            yp=float(yp),
            k1=k1 / (1 - k0),
            k2=k2 / (1 - k0),
            k3=k3 / (1 - k0),
        ),
    )


# --- Ground corners from Applanix orientations of NOAA's frames, compared with another program


FRAMES = ("C19748959", "C25959144")


def results() -> pd.DataFrame:
    """Return the ground corners and the reference points of all frames, and OSSIM's.

    Returns
    -------
    DataFrame
        frame, point, lon_deg, lat_deg (OSSIM's), d_east_m, d_north_m (ours minus OSSIM's),
        distance_m, ground_pixel_m.
    """
    frames = [read(data.path(f"noaa-dss-dg/{name}.geom")) for name in FRAMES]
    return pd.concat([_compared(frame) for frame in frames], ignore_index=True)


def _compared(frame: Frame) -> pd.DataFrame:
    d, ground_pixel_m = differences(frame)
    return pd.DataFrame(
        {
            "frame": frame.name,
            "point": [*CORNERS, "centre"],
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
    x_m = _on_ground(mapping, pose, rays(frame.camera, pose, frame.colrow), frame.ground_m)
    published = np.column_stack([frame.lonlat, np.full(5, frame.ground_m)])
    above_m = frame.enh[2] - frame.ground_m
    return (
        x_m - mapping.from_geographic(published),
        above_m * frame.camera.pixel_mm / frame.camera.interior.f,
    )


def _on_ground(mapping: MappingFrame, T_m_c: Pose, directions: Array, height_m: float) -> Array:
    """Return the intersections of rays with the surface of one ellipsoidal height."""
    x_m = T_m_c.r
    for _ in range(5):  # the steps correct the Earth's curvature, d^2 / 2R, then its slope
        above_m = mapping.to_geographic(x_m)[:, 2] - height_m
        x_m = x_m - (above_m / directions[:, 2])[:, None] * directions
    return x_m
