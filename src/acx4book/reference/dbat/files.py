"""The Damped Bundle Adjustment Toolbox (DBAT): its measurement files and its conventions.

DBAT counts image coordinates from the upper left corner of the image and subtracts the principal
point (px, py from that corner). It *adds* the distortion, so every K and P has the opposite sign.
It gives px and the width of the format for pixels that are 1 + as times wider than high. The
module `printed` reads its reports.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import INTERIOR, Camera, Interior

INTERIOR_NAMES = ("cc", "px", "py", "as", "K1", "K2", "K3", "P1", "P2")
"""DBAT's interior parameters, in the order of `interior_to_dbat`."""

_OURS = ("f", "xp", "yp", "b1", "k1", "k2", "k3", "p1", "p2")
_HALF_PIXEL = 0.5
"""Our coordinates (0, 0) are the centre of a pixel, theirs are its corner."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Measurements:
    """Image points of a file.

    Attributes
    ----------
    image, point : ndarray, shape (n,)
        DBAT's numbers of images, from 1, and of points.
    xy_px : ndarray, shape (n, 2)
        Coordinates from the upper left corner, y down.
    sigma_px : ndarray, shape (n,)
    """

    image: Index
    point: Index
    xy_px: Array
    sigma_px: Array

    @property
    def colrow(self) -> Array:
        """Pixel coordinates in the library's convention, shape (n, 2)."""
        return self.xy_px - _HALF_PIXEL


@dataclass(frozen=True, kw_only=True, eq=False)
class Surveyed:
    """Points with given coordinates.

    Attributes
    ----------
    point : ndarray, shape (n,)
    labels : tuple of str
    x, sigma : ndarray, shape (n, 3)
        Object units; sigma is zero where the file has none.
    """

    point: Index
    labels: tuple[str, ...]
    x: Array
    sigma: Array


def _rows(path: Path) -> list[list[str]]:
    """Return the cells of a comma-separated file without comments and empty lines."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return [
        [cell.strip() for cell in line.split(",")]
        for line in lines
        if line.strip() and not line.lstrip().startswith("#")
    ]


def _table(path: Path, columns: tuple[str, ...], cure: str = "") -> Array:
    """Return a file of numbers; ValueError with the line and the column where one is missing."""
    rows = _rows(path)
    for number, row in enumerate(rows, 1):
        if len(row) != len(columns):
            lacks = ", ".join(columns[len(row) :]) or f"only {len(columns)} columns"
            found = f"row {number} has {len(row)} of {len(columns)} columns"
            msg = f"{path}: {found} ({', '.join(columns)}); expected {lacks}{cure}"
            raise ValueError(msg)
    return np.array(rows, dtype=float).reshape(-1, len(columns))


def read_image_points(path: Path) -> Measurements:
    """Read "image, point, x, y, sigma".

    Raises
    ------
    ValueError
        Where a row has another number of columns, as one without sigma.
    """
    cure = ": write the sigma of every measurement, px, as the last column"
    table = _table(path, ("image", "point", "x", "y", "sigma"), cure)
    return Measurements(
        image=table[:, 0].astype(np.intp),
        point=table[:, 1].astype(np.intp),
        xy_px=table[:, 2:4],
        sigma_px=table[:, 4],
    )


def read_marked_points(path: Path, *, sigma_px: float) -> Measurements:
    """Read "point, image, x, y"; all measurements get the same sigma."""
    table = _table(path, ("point", "image", "x", "y"))
    return Measurements(
        image=table[:, 1].astype(np.intp),
        point=table[:, 0].astype(np.intp),
        xy_px=table[:, 2:4],
        sigma_px=np.full(len(table), sigma_px),
    )


def joined(parts: tuple[Measurements, ...]) -> Measurements:
    """Return the measurements of several files together."""
    return Measurements(
        image=np.concatenate([part.image for part in parts]),
        point=np.concatenate([part.point for part in parts]),
        xy_px=np.concatenate([part.xy_px for part in parts]),
        sigma_px=np.concatenate([part.sigma_px for part in parts]),
    )


def read_surveyed(path: Path) -> Surveyed:
    """Read "point, label, x, y, z" with or without three sigmas, sorted by point."""
    rows = sorted(_rows(path), key=lambda row: int(row[0]))
    numbers = np.array([row[2:] for row in rows], dtype=float)
    return Surveyed(
        point=np.array([int(row[0]) for row in rows], dtype=np.intp),
        labels=tuple(row[1] for row in rows),
        x=numbers[:, :3],
        sigma=numbers[:, 3:] if numbers.shape[1] > 3 else np.zeros((len(rows), 3)),
    )


def read_images(path: Path) -> tuple[str, ...]:
    """Read the images' file names, without folders, in the order of their numbers."""
    rows = sorted(_rows(path), key=lambda row: int(row[0]))
    return tuple(row[1].rsplit("/", 1)[-1] for row in rows)


# --- conventions -----------------------------------------------------------------------------


def camera_from_dbat(
    *, cc: float, pp: tuple[float, float] | None, size_px: tuple[int, int], pixel_mm: float
) -> Camera:
    """Return a camera without distortion from DBAT's values.

    Parameters
    ----------
    cc : float
        Camera constant, mm.
    pp : tuple of float, optional
        px and py, mm; by default the middle of the image.
    size_px : tuple of int
        Width and height.
    pixel_mm : float
    """
    middle = 0.5 * pixel_mm * np.array(size_px)
    xp, yp = (np.array(pp) - middle) * [1, -1] if pp is not None else (0.0, 0.0)
    return Camera(
        name="Camera1",
        width_px=size_px[0],
        height_px=size_px[1],
        pixel_mm=pixel_mm,
        interior=Interior(f=cc, xp=float(xp), yp=float(yp)),
    )


def interior_to_dbat(camera: Camera, cov: Array) -> tuple[Array, Array]:
    """Return an interior orientation and its covariance in DBAT's parameters.

    Parameters
    ----------
    camera : Camera
    cov : ndarray, shape (10, 10)
        In the order of `camera.INTERIOR`; b2, which DBAT does not have, is left out.

    Returns
    -------
    values : ndarray, shape (9,)
        In the order of `INTERIOR_NAMES`.
    cov : ndarray, shape (9, 9)

    Notes
    -----
    x (1 + b1) - xp equals (1 + b1) (x - xp / (1 + b1)). From this follow px and its derivatives.
    """
    interior = camera.interior
    order = [INTERIOR.index(name) for name in _OURS]
    values = interior.to_array()[order]
    scale = 1 + interior.b1
    values[1] = interior.xp / scale + 0.5 * camera.width_px * camera.pixel_mm
    values[2] = 0.5 * camera.height_px * camera.pixel_mm - interior.yp
    values[4:] *= -1
    by_ours = np.diag([1.0, 1 / scale, -1.0, 1.0, -1.0, -1.0, -1.0, -1.0, -1.0])
    by_ours[1, 3] = -interior.xp / scale**2
    return values, by_ours @ cov[np.ix_(order, order)] @ by_ours.T


def sensor_size_mm(camera: Camera) -> Array:
    """Return width and height of the format as in DBAT's report, mm, shape (2,)."""
    size = camera.pixel_mm * np.array([camera.width_px, camera.height_px])
    return size * np.array([1 + camera.interior.b1, 1.0])


def largest_distortion_mm(camera: Camera) -> float:
    """Return DBAT's value of the distortion in the corners of the image, mm.

    Computed as in its report: with square pixels, with ``|dx| + |dy|`` instead of their root sum
    of squares, and with P1 and P2 exchanged in dx and in dy.
    """
    values, _ = interior_to_dbat(camera, np.zeros(2 * (len(INTERIOR),)))
    _, px, py, _, k1, k2, k3, p1, p2 = values
    size = camera.pixel_mm * np.array([camera.width_px, camera.height_px])
    corners = _HALF_PIXEL * camera.pixel_mm + size * np.array([[0, 0], [0, 1], [1, 1], [1, 0]])
    x, y = corners[:, 0] - px, corners[:, 1] - py
    r2 = x * x + y * y
    radial = r2 * (k1 + r2 * (k2 + r2 * k3))
    dx = x * radial + p1 * (r2 + 2 * x * x) + 2 * p1 * x * y
    dy = y * radial + p2 * (r2 + 2 * y * y) + 2 * p2 * x * y
    return float(np.max(np.abs(dx) + np.abs(dy)))


# --- DBAT's report: every printed number with its place
#
# The report is a tree with indentation. The place of a line is the path of headings above it and
# its own label. Its statement is the rest, without the numbers.


NUMBER = re.compile(r"(?<![\w.%])(?<!\^\()(?<!\^\(-)-?\d+(?:\.\d+)?(?:e[-+]\d+)?(?!\w|\.\w)")
"""A separate number: not the 3 of K3, the 4.13 of the label B4.13 or the power of a unit."""

_COUNTED = re.compile(r"^(\d+) (points with \d+ rays)\.$")
_RAYS = re.compile(r"^(\d+): (\d+\.\d+ \([\d ]*\))$")
_ROW = re.compile(r"^(\d+),")
_TABLES = ("Prior", "Posterior", "Diff", "Smallest angles")


@dataclass(frozen=True, kw_only=True)
class Line:
    """One line of a report.

    Attributes
    ----------
    path : tuple of str
        Headings, the outermost first, then the line's own label.
    statement : str
        Text after the label, with ``{}`` in the place of every number.
    numbers : tuple of str
        The numbers as printed.
    """

    path: tuple[str, ...]
    statement: str
    numbers: tuple[str, ...]


def read(path: Path) -> dict[tuple[str, ...], Line]:
    """Read a report.

    Parameters
    ----------
    path : Path

    Returns
    -------
    dict
        Its lines by their path, in their order, without headings that have no statement.

    Raises
    ------
    ValueError
        Where two lines have the same place.
    """
    lines: dict[tuple[str, ...], Line] = {}
    for line in _lines(path.read_text(encoding="utf-8")):
        if line.path in lines:
            msg = f"{path}: {' > '.join(line.path)} stands there twice"
            raise ValueError(msg)
        lines[line.path] = line
    headings = {place[:depth] for place in lines for depth in range(1, len(place))}
    return {place: line for place, line in lines.items() if line.statement or place not in headings}


def _lines(text: str) -> Iterator[Line]:
    headings: list[tuple[int, str]] = []
    for raw in text.splitlines()[1:-1]:
        content = raw.strip()
        depth = len(raw) - len(raw.lstrip())
        if content.startswith("id,"):
            continue
        if _ROW.match(content) or _RAYS.match(content):
            depth = _table_depth(headings)  # the indentation of right-aligned numbers varies
        while headings and headings[-1][0] >= depth:
            headings.pop()
        label, statement = _split(content)
        path = (*(heading for _, heading in headings), label)
        headings.append((depth, label))
        numbers = tuple(NUMBER.findall(statement))
        yield Line(path=path, statement=_plain(NUMBER.sub("{}", statement)), numbers=numbers)


def _table_depth(headings: list[tuple[int, str]]) -> int:
    """Return a depth just below the table's heading."""
    return next(depth for depth, name in reversed(headings) if name.startswith(_TABLES)) + 1


def _split(content: str) -> tuple[str, str]:
    """Return a line's label and its statement."""
    for pattern in (_COUNTED, _RAYS):
        if found := pattern.match(content):
            first, second = found.groups()
            return (second, first) if pattern is _COUNTED else (first, second)
    if _ROW.match(content):
        label, _, statement = content.partition(",")
        return label, statement
    if content.startswith("Redundancy "):  # this is the only label without a colon
        return "Redundancy", content.removeprefix("Redundancy")
    label, _, statement = content.partition(":")
    return label.strip(), statement.strip()


def _plain(statement: str) -> str:
    """Return a statement with single spaces, and none after an opening parenthesis."""
    return " ".join(statement.split()).replace("( ", "(")
