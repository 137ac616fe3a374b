"""IGN's Borea: orientations (OPK), image measurements (mes), ground points (app), cameras.

Borea counts columns and rows from the pixel that it calls (0, 0), rows downwards. It gives the
principal point and the focal length in pixels. Its image heights may be altered, so that the map
can be used as if it were Cartesian: Z' = z0 + k (Z - z0), with the ground height z0 below the
image and the scale k of the map there. `unaltered` removes this.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import Camera, Interior


@dataclass(frozen=True, kw_only=True, eq=False)
class Orientations:
    """Exterior orientations of an OPK file.

    Attributes
    ----------
    names : tuple of str
    enh : ndarray, shape (n, 3)
        Easting, northing and height of the perspective centres, m.
    opk : ndarray, shape (n, 3)
        Attitudes of the camera relative to the grid, radians.
    """

    names: tuple[str, ...]
    enh: Array
    opk: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Measurements:
    """Image points of a mes file.

    Attributes
    ----------
    points, images : tuple of str
        The point and the image of each measurement.
    colrow : ndarray, shape (n, 2)
        Pixels.
    """

    points: tuple[str, ...]
    images: tuple[str, ...]
    colrow: Array


def _rows(path: Path) -> list[list[str]]:
    lines = path.read_text(encoding="utf-8").replace('"', "").splitlines()
    return [line.split() for line in lines if line.strip()]


def read_opk(path: Path) -> Orientations:
    """Read "NOM X Y Z O P K CAMERA" below a line of headings."""
    rows = _rows(path)[1:]
    values = np.array([row[1:7] for row in rows], dtype=float)
    return Orientations(
        names=tuple(row[0] for row in rows), enh=values[:, :3], opk=np.radians(values[:, 3:])
    )


def read_measurements(path: Path) -> Measurements:
    """Read "point image column row"."""
    rows = _rows(path)
    return Measurements(
        points=tuple(row[0] for row in rows),
        images=tuple(row[1] for row in rows),
        colrow=np.array([row[2:4] for row in rows], dtype=float),
    )


def read_points(path: Path) -> dict[str, Array]:
    """Read ground points, "point X Y Z" or "point type X Y Z": easting, northing, height in m."""
    return {row[0]: np.array(row[-3:], dtype=float) for row in _rows(path)}


def read_camera(path: Path, *, pixel_mm: float) -> Camera:
    """Read a camera; the unit of the file is the pixel, so any pixel size can be given.

    Parameters
    ----------
    path : Path
    pixel_mm : float
    """
    words = {row[0]: row[-1] for row in _rows(path)}  # rows are "name = value"
    width, height = int(words["width"]), int(words["height"])
    return Camera(
        name=words["Name"],
        width_px=width,
        height_px=height,
        pixel_mm=pixel_mm,
        interior=Interior(
            f=float(words["focal"]) * pixel_mm,
            xp=(float(words["PPAx"]) - (width - 1) / 2) * pixel_mm,
            yp=((height - 1) / 2 - float(words["PPAy"])) * pixel_mm,
        ),
    )


def unaltered(heights: Array, *, ground: Array | float, scale: Array | float) -> Array:
    """Return heights without the linear alteration Z' = z0 + k (Z - z0), shape (n,)."""
    return np.asarray(ground + (heights - ground) / scale)


def indices(names: tuple[str, ...], within: tuple[str, ...]) -> Index:
    """Return the indices of names among others."""
    where = {name: k for k, name in enumerate(within)}
    return np.array([where[name] for name in names], dtype=np.intp)
