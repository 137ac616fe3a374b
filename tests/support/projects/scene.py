"""A small block as other programs see it: by PROJ, OpenCV and formulas of its own, without acx4lib.

Camera axes have x right, y down, z ahead; pixels count from the outer corner of the top-left one.
"""

from dataclasses import dataclass

import cv2
import numpy as np
import pyproj

WIDTH, HEIGHT, PIXEL_MM = 1280, 960, 0.00375
F, CX, CY = 1450.0, 651.5, 472.25
K1, K2, K3, P1, P2 = -0.05, 0.03, 0.0, 3e-4, -2e-4
CRS, GEOCENTRIC, GEOGRAPHIC = "EPSG:31982", "EPSG:4988", "EPSG:4674"

YPR = np.array([[37.0, 2.5, -1.5], [38.0, -1.0, 2.0], [215.0, 0.5, 1.0], [120.0, -2.0, -0.5]])
"""Yaw, pitch, roll of exposures: zero looks down with the image's top to the north."""

SLAVE = cv2.Rodrigues(np.radians([0.4, -0.3, 1.2]))[0]
"""From the second camera's axes to the first one's."""

NAMES = ("one.jpg", "two.jpg", "three.jpg", "four.jpg")


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Points and cameras in the ECEF frame, and the same on the map."""

    points_e: np.ndarray
    points_enh: np.ndarray
    R_e_c: np.ndarray
    r_e: np.ndarray
    lonlath: np.ndarray


def scene():
    """Return four exposures over nine points."""
    to_e = pyproj.Transformer.from_crs(
        pyproj.CRS(CRS).to_3d(), pyproj.CRS(GEOCENTRIC), always_xy=True
    )
    to_lonlat = pyproj.Transformer.from_crs(CRS, GEOGRAPHIC, always_xy=True)
    at = np.array([[676000.0, 7184000.0, 1100.0]])
    corners = [[x, y, z] for x, z in ((-17, 3), (0, 0), (17, 5)) for y in (-17, 0, 17)]
    points = at - [0, 0, 100] + np.array(corners, dtype=float)
    shifts = np.array([[0, 0, 0], [8, 3, 1], [-5, 9, -1], [4, -7, 2]], dtype=float)
    centres = at + shifts
    lon, lat = to_lonlat.transform(*centres.T[:2])
    axes = np.stack([_ned(*pair) for pair in np.radians(np.stack([lon, lat], axis=1))])
    return Scene(
        points_e=np.stack(to_e.transform(*points.T), axis=1),
        points_enh=points,
        R_e_c=axes @ np.stack([camera(*angles) for angles in np.radians(YPR)]),
        r_e=np.stack(to_e.transform(*centres.T), axis=1),
        lonlath=np.stack([lon, lat, centres[:, 2]], axis=1),
    )


def seen(R, r, points, size=(F, CX, CY)):
    """Return the pixels of points by OpenCV; R takes camera axes to those of r and the points."""
    f, cx, cy = size
    matrix = np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])
    x_c = (points - r) @ R
    zero = np.zeros(3)
    return cv2.projectPoints(x_c, zero, zero, matrix, np.array([K1, K2, P1, P2, K3]))[0][:, 0]


def _ned(lon, lat):
    """Return north, east, down as columns in the ECEF frame."""
    east = [-np.sin(lon), np.cos(lon), 0.0]
    up = [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)]
    north = np.cross(up, east)
    return np.stack([north, east, -np.array(up)], axis=1)


def camera(yaw, pitch, roll):
    """Return the camera's axes in north, east, down: right is the body's right, ahead its down."""
    R = _turn(2, yaw) @ _turn(1, pitch) @ _turn(0, roll)
    forward, right, down = R.T
    return np.stack([right, -forward, down], axis=1)


def _turn(axis, angle):
    return cv2.Rodrigues(angle * np.eye(3)[axis])[0]
