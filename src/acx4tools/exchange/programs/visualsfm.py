"""VisualSFM's .nvm (NVM_V3): images, lenses, tie points; orientations in no CRS.

A line of a camera has its file, the focal length f in px, the quaternion w, x, y, z of R, the
centre, r, and 0. Axes are x right, y down, z ahead. Measurements count from the middle of the
image, y down. The lens is that of its adjustment: with m the measured point in units of f,
m (1 + r m·m) is the ideal one: http://ccwu.me/vsfm/doc.html.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from acx4lib.expected import Array
from acx4lib.flight.problems import Range, quoted
from acx4lib.geometry.frames import Pose
from acx4tools.exchange import tables
from acx4tools.exchange.axes import FLIP, stacked
from acx4tools.exchange.lens import Pinhole, inverse
from acx4tools.exchange.lens_models import Lens
from acx4tools.exchange.project import (
    Images,
    Measured,
    Project,
    Proof,
    numbered,
    on_no_map,
    reading,
)
from acx4tools.exchange.safe import opened
from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.safe.text_lines import COORDINATE, Line, Rows, first_views

VERSION, FIXED = "NVM_V3", "FixedK"
"""First cell of the file, and the cell after it if all images have one given calibration."""

FOCAL = Range(1.0, 1e7, "must be a focal length in pixels")
COEFFICIENT = Range(-100.0, 100.0)
ENTRY = Range(-1e3, 1e3)
MOST = Range(0, 1e8, "must be a number of cameras or points", whole=True)

ASSUMED = (
    "camera axes are x right, y down, z ahead; measurements count from the middle of the image; "
    "the radial coefficient takes measured points to ideal ones",
)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Camera:
    """An image: its line in the file, its name, f and r, and its pose."""

    line: Line
    file: str
    lens: tuple[float, float]
    T_w_c: Pose


def project(source: Path, *, size: tuple[int, int], crs: str | None = None) -> Project:
    """Return the first model of a .nvm.

    Parameters
    ----------
    source : Path
    size : tuple of int
        Width and height of the images, px: VisualSFM does not write them.
    crs : str, optional
        `geodesy.LOCAL` takes the coordinates and orientations as they are, on no map.

    Raises
    ------
    FlightError
        For a file that is no NVM_V3.
    """
    file = opened.read(source)
    settings, in_grid = on_no_map(file, crs, "VisualSFM")
    rows = Rows(file)
    centre = _centre(rows, size)
    cameras = [_camera(row) for row in _counted(rows, "camera")]
    if not cameras:
        raise file.wrong("cameras", "there is none", "must have one")
    images = _names(cameras)
    points, again = _points(rows, len(cameras), centre)
    called = numbered(camera.lens for camera in cameras)
    measured = Measured(
        points=tuple(str(k) for k in range(len(points.x_w))),
        x_w=points.x_w,
        image_idx=points.views[:, 0].astype(int),
        point_idx=points.views[:, 1].astype(int),
        colrow=points.views[:, 2:],
    )
    first = {called[camera.lens]: camera for camera in reversed(cameras)}
    tables.require_all_names({"image": images}, file.wrong)
    return Project(
        source=f"VisualSFM {VERSION}",
        sources=[file],
        lenses={name: _lens(file, first[name], size, centre) for name in called.values()},
        images=Images(
            names=images,
            cameras=tuple(called[camera.lens] for camera in cameras),
            exposures=images,
            T_w_c=stacked([camera.T_w_c for camera in cameras]),
        ),
        measured=measured,
        settings=settings,
        in_grid=in_grid,
        proofs=(Proof(whose="the program's own points", measured=measured),),
        lost={
            "second measurements of a point in one image": again,
            "cameras of further models in the file": _further(rows),
        },
        assumed=ASSUMED,
    )


read = reading(project)


def _counted(rows: Rows, noun: str) -> Iterator[Line]:
    """Yield as many lines as the line before them states."""
    head = rows.next(f"number of {noun}s")
    for _ in range(int(head.number_at(0, f"number of {noun}s", MOST))):
        yield rows.next(noun)


def _centre(rows: Rows, size: tuple[int, int]) -> Array:
    """Return from where measurements count, the library's pixels, by the first line."""
    first = rows.next("version")
    if first.cell(0, "version") != VERSION:
        raise first.wrong("version", quoted(first.cells[0]), f"must be {VERSION}")
    middle = np.array([size[0] - 1, size[1] - 1]) / 2
    if len(first) == 1:
        return middle
    if first.cells[1] != FIXED:
        raise first.wrong("version", quoted(first.cells[1]), f"must be {FIXED}, or nothing")
    _, cx, _, cy = first.numbers(2, 6, "fx, cx, fy, cy", FOCAL).tolist()
    return np.array([cx, cy]) - 0.5


def _camera(row: Line) -> _Camera:
    n = len(row) - 10
    if n < 1:
        expected = "must be file, f, quaternion, centre, r and 0"
        raise row.wrong("camera", f"{len(row)} cells", expected)
    f = row.number_at(n, "focal length", FOCAL)
    quaternion = row.numbers(n + 1, n + 5, "quaternion", ENTRY)
    if not np.linalg.norm(quaternion) > 0:
        raise row.wrong("quaternion", "is zero", "must be a rotation")
    R_v_w = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
    return _Camera(
        line=row,
        file=" ".join(row.cells[:n]).replace("\\", "/"),
        lens=(f, row.number_at(n + 8, "radial distortion", COEFFICIENT)),
        T_w_c=Pose(R=R_v_w.T @ FLIP, r=row.numbers(n + 5, n + 8, "centre", COORDINATE)),
    )


def _names(cameras: list[_Camera]) -> tuple[str, ...]:
    """Return names of files without folders, or with them where some are the same."""
    whole = [camera.file for camera in cameras]
    for k, name in enumerate(whole):
        if name in whole[:k]:
            raise cameras[k].line.wrong("image", f"{quoted(name)} is there twice", "must be once")
    return tables.without_folders(whole)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Points:
    """Points, shape (n, 3), and rows of image, point, column and row."""

    x_w: Array
    views: Array


def _points(rows: Rows, n_cameras: int, centre: Array) -> tuple[_Points, int]:
    """Return the points, and how often an image has one of them again."""
    x_w, views, again = [], [], 0
    for point, row in enumerate(_counted(rows, "point")):
        x_w.append(row.numbers(0, 3, "point", COORDINATE))
        n = row.whole_at(6, "views")
        if not 0 <= n == (len(row) - 7) / 4:
            count = f"{len(row) - 7} cells after the number {n}"
            raise row.wrong("views", count, "must be four for each: image, feature, x, y")
        by_image = first_views(row, 7, n_cameras)
        views += [(k, point, x + centre[0], y + centre[1]) for k, (x, y) in by_image.items()]
        again += n - len(by_image)
    table = np.array(views, dtype=float).reshape(-1, 4)
    return _Points(x_w=np.array(x_w).reshape(-1, 3), views=table), again


def _further(rows: Rows) -> int:
    """Return how many cameras a further model of the file has; 0 where there is none."""
    row = rows.maybe()
    return max(0, row.whole_at(0, "number of cameras")) if row is not None and len(row) == 1 else 0


def _lens(file: Opened, camera: _Camera, size: tuple[int, int], centre: Array) -> Lens:
    f, r = camera.lens
    cx, cy = centre.tolist()

    def ideal(points: Array) -> Array:
        return points * (1 + r * np.sum(points**2, axis=1, keepdims=True))

    return Lens(
        width_px=size[0],
        height_px=size[1],
        hole=Pinhole(fx=f, fy=f, cx=cx, cy=cy),
        distortion=lambda points: inverse(ideal, points, points) if r else points,
        wrong=partial(file.wrong, "camera", line=camera.line.number),
    )
