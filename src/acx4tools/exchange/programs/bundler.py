"""Bundler's bundle.out, version 0.3, with list.txt: images, tie points, orientations in no CRS.

Cameras look along -z with x right, y up, which are the library's own axes; measurements count from
the middle of the image, y up: https://www.cs.cornell.edu/~snavely/bundler/bundler-v0.4-manual.html.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from acx4lib.expected import Array, Index
from acx4lib.flight.problems import Range, quoted
from acx4lib.geometry.frames import Pose
from acx4tools.exchange import tables
from acx4tools.exchange.axes import is_rotation, nearest_rotation
from acx4tools.exchange.lens import FLIP as FLIP_Y
from acx4tools.exchange.lens import Pinhole
from acx4tools.exchange.lens_models import BUNDLER, Lens
from acx4tools.exchange.project import (
    Images,
    Measured,
    Project,
    Proof,
    numbered,
    on_no_map,
    reading,
)
from acx4tools.exchange.safe import opened, text_lines
from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.safe.text_lines import COORDINATE, Line, Rows, first_views

VERSIONS = ("# Bundle file v0.3", "# Bundle file v0.4")
"""First lines; 0.4 has the same layout."""

SKEW = 1e-4
"""Largest difference of a matrix from a rotation; some writers print seven digits."""

FOCAL = Range(0.0, 1e7, "must be a focal length in pixels, 0 for an image without orientation")

ENTRY = Range(-2.0, 2.0, "must be an entry of a rotation")
COEFFICIENT = Range(-1e6, 1e6)

ASSUMED = (
    "camera axes are x right, y up, z backwards; measurements count from the middle of the image",
)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Bundle:
    """The content of bundle.out.

    `lenses` are f (px), k1, k2 of each image, f is 0 where it was not oriented; `xy` are px from
    the middle of the image, y up; `again` counts points that an image has twice.
    """

    lenses: Array
    T_w_c: Pose
    x_w: Array
    image_idx: Index
    point_idx: Index
    xy: Array
    again: int


def project(source: Path, *, size: tuple[int, int], crs: str | None = None) -> Project:
    """Return bundle.out, with the names of the images from list.txt beside it or above.

    Parameters
    ----------
    source : Path
        The file bundle.out.
    size : tuple of int
        Width and height of the images, px: Bundler does not write them.
    crs : str, optional
        `geodesy.LOCAL` takes the coordinates and orientations as they are, on no map.

    Raises
    ------
    FlightError
        For a file that is no bundle.out.
    """
    file = opened.read(source)
    settings, in_grid = on_no_map(file, crs, "Bundler")
    bundle = _bundle(file)
    listed, names = _names(source, len(bundle.lenses), file)
    good = np.flatnonzero(bundle.lenses[:, 0] > 0)
    lens_values = [tuple(row) for row in bundle.lenses[good].tolist()]
    called = numbered(lens_values)
    images = tuple(names[k] for k in good)
    cameras = tuple(called[values] for values in lens_values)
    points = tuple(str(k) for k in range(len(bundle.x_w)))
    named = {"image": images, "camera": cameras, "point": points}
    tables.require_all_names(named, file.wrong)
    row = np.full(len(bundle.lenses), -1)
    row[good] = np.arange(len(good))
    used = row[bundle.image_idx] >= 0
    measured = Measured(
        points=points,
        x_w=bundle.x_w,
        image_idx=row[bundle.image_idx[used]],
        point_idx=bundle.point_idx[used],
        colrow=bundle.xy[used] * FLIP_Y + np.array([size[0] - 1, size[1] - 1]) / 2,
    )
    return Project(
        source=file.text().split("\n", 1)[0].lstrip("# ").replace("Bundle file", "Bundler"),
        sources=[file, *listed],
        lenses={name: _lens(file, values, size) for values, name in called.items()},
        images=Images(names=images, cameras=cameras, exposures=images, T_w_c=bundle.T_w_c[good]),
        measured=measured,
        proofs=(Proof(whose="the program's own points", measured=measured),),
        settings=settings,
        in_grid=in_grid,
        lost={
            "images that Bundler did not orient": len(bundle.lenses) - len(good),
            "second measurements of a point in one image": bundle.again,
        },
        assumed=ASSUMED,
    )


read = reading(project)


def _lens(file: Opened, values: tuple[float, ...], size: tuple[int, int]) -> Lens:
    f, *coefficients = values
    return Lens(
        width_px=size[0],
        height_px=size[1],
        hole=Pinhole(fx=f, fy=f, cx=(size[0] - 1) / 2, cy=(size[1] - 1) / 2),
        distortion=BUNDLER.distortion(coefficients),
        wrong=partial(file.wrong, "camera"),
    )


def _bundle(file: Opened) -> _Bundle:
    first = file.text().split("\n", 1)[0].strip()
    if first not in VERSIONS:
        raise file.wrong("version", quoted(first), f"must be {quoted(VERSIONS[0])}")
    rows = Rows(file)
    head = rows.next("counts")
    n_cameras, n_points = (_count(head, k) for k in (0, 1))
    cameras = np.array([_camera(rows) for _ in range(n_cameras)]).reshape(-1, 15)
    R_c_w, t = cameras[:, 3:12].reshape(-1, 3, 3), cameras[:, 12:]
    x_w, measurements, again = [], [], 0
    for point in range(n_points):
        x_w.append(rows.next("point").numbers(0, 3, "point", COORDINATE))
        rows.next("color")
        row = rows.next("views")
        n, views = row.whole_at(0, "views"), _views(row, n_cameras)
        measurements += [(image, point, x, y) for image, (x, y) in views.items()]
        again += n - len(views)
    table = np.array(measurements, dtype=float).reshape(-1, 4)
    return _Bundle(
        lenses=cameras[:, :3],
        T_w_c=Pose(R=R_c_w, r=t).inverse,
        x_w=np.array(x_w).reshape(-1, 3),
        image_idx=table[:, 0].astype(int),
        point_idx=table[:, 1].astype(int),
        xy=table[:, 2:],
        again=again,
    )


def _count(head: Line, k: int) -> int:
    value = head.whole_at(k, "counts")
    if value < 0:
        raise head.wrong("counts", str(value), "must be zero or positive")
    return value


def _camera(rows: Rows) -> Array:
    """Return f, k1, k2, the rotation and the translation of a camera, shape (15,)."""
    first = rows.next("camera")
    f = first.number_at(0, "focal length", FOCAL)
    second = rows.next("rotation")
    below = [second, rows.next("rotation"), rows.next("rotation")]
    R = np.stack([row.numbers(0, 3, "rotation", ENTRY) for row in below])
    if f > 0 and not is_rotation(R, SKEW):
        raise second.wrong("rotation", "three rows are no rotation", "must be one")
    t = rows.next("translation").numbers(0, 3, "translation", COORDINATE)
    k = first.numbers(1, 3, "k1, k2", COEFFICIENT)
    return np.concatenate([[f], k, (nearest_rotation(R) if f > 0 else np.eye(3)).ravel(), t])


def _views(row: Line, n_cameras: int) -> dict[float, tuple[float, float]]:
    """Return the measurements of a point by image, the first of each."""
    if not 0 <= row.whole_at(0, "views") == (len(row) - 1) / 4:
        count = f"{len(row) - 1} cells after the number {row.whole_at(0, 'views')}"
        raise row.wrong("views", count, "must be four for each view: camera, key, x, y")
    return first_views(row, 1, n_cameras, "camera")


def _names(source: Path, n: int, file: Opened) -> tuple[list[Opened], tuple[str, ...]]:
    """Return list.txt, if there is one, and the names of the images."""
    for folder in (source.parent, source.parent.parent):
        path = folder / "list.txt"
        if path.is_file():
            listed = opened.read(path)
            rows = list(text_lines.lines(listed))
            if len(rows) != n:
                count = f"has {len(rows)} images"
                raise listed.wrong("file", count, f"must have {n}, as {file.name}")
            return [listed], tables.without_folders([row.cell(0, "image") for row in rows])
    return [], tuple(f"image{k:04d}" for k in range(n))
