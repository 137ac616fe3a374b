"""Bundler's bundle.out and VisualSFM's .nvm: images, lenses, tie points; orientations in no CRS.

Bundler's version 0.3 has list.txt beside it. Its cameras look along -z with x right, y up, which
are the library's own axes; measurements count from the middle of the image, y up:
https://www.cs.cornell.edu/~snavely/bundler/bundler-v0.4-manual.html.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from acx4lib.expected import Array, Index
from acx4lib.flight.problems import Range, quoted
from acx4lib.geometry.frames import Pose
from acx4tools.exchange import safe
from acx4tools.exchange.coordinates import FLIP, is_rotation, nearest_rotation, stacked
from acx4tools.exchange.lens import BUNDLER, Lens, Pinhole, inverse
from acx4tools.exchange.lens import FLIP as FLIP_Y
from acx4tools.exchange.project import (
    Images,
    Measured,
    Project,
    Proof,
    numbered,
    on_no_map,
    reading,
    require_all_names,
    without_folders,
)
from acx4tools.exchange.safe import COORDINATE, Line, Opened

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
    """The content of bundle.out: f (px), k1, k2 of each image, 0 where it has no pose, and points.

    Measurements are px from the middle of the image, y up.
    """

    lenses: Array
    T_w_c: Pose
    points: _Points


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
    file = safe.read(source)
    settings, in_grid = on_no_map(file, crs, "Bundler")
    bundle = _bundle(file)
    listed, names = _names(source, len(bundle.lenses), file)
    good = np.flatnonzero(bundle.lenses[:, 0] > 0)
    lens_values = [tuple(row) for row in bundle.lenses[good].tolist()]
    called = numbered(lens_values)
    images = tuple(names[k] for k in good)
    cameras = tuple(called[values] for values in lens_values)
    points = bundle.points
    named = {"image": images, "camera": cameras, "point": points.names}
    require_all_names(named, file.wrong)
    row = np.full(len(bundle.lenses), -1)
    row[good] = np.arange(len(good))
    used = row[points.image_idx] >= 0
    measured = Measured(
        points=points.names,
        x_w=points.x_w,
        image_idx=row[points.image_idx[used]],
        point_idx=points.point_idx[used],
        colrow=points.xy[used] * FLIP_Y + np.array([size[0] - 1, size[1] - 1]) / 2,
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
            "second measurements of a point in one image": points.again,
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
    rows = _Rows(file)
    head = rows.next("counts")
    n_cameras, n_points = (_count(head, k) for k in (0, 1))
    cameras = np.array([_camera(rows) for _ in range(n_cameras)]).reshape(-1, 15)
    R_c_w, t = cameras[:, 3:12].reshape(-1, 3, 3), cameras[:, 12:]
    listed = _points(_point(rows, n_cameras) for _ in range(n_points))
    return _Bundle(lenses=cameras[:, :3], T_w_c=Pose(R=R_c_w, r=t).inverse, points=listed)


def _point(rows: _Rows, n_cameras: int) -> tuple[Array, _Views, int]:
    """Return the place of a point, and its `_views`."""
    x_w = rows.next("point").numbers(0, 3, "point", COORDINATE)
    rows.next("color")
    each = "must be four for each view: camera, key, x, y"
    return x_w, *_views(rows.next("views"), 1, n_cameras, image="camera", each=each)


def _count(head: Line, k: int) -> int:
    value = head.whole_at(k, "counts")
    if value < 0:
        raise head.wrong("counts", str(value), "must be zero or positive")
    return value


def _camera(rows: _Rows) -> Array:
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


def _names(source: Path, n: int, file: Opened) -> tuple[list[Opened], tuple[str, ...]]:
    """Return list.txt, if there is one, and the names of the images."""
    for folder in (source.parent, source.parent.parent):
        path = folder / "list.txt"
        if path.is_file():
            listed = safe.read(path)
            rows = list(safe.lines(listed))
            if len(rows) != n:
                count = f"has {len(rows)} images"
                raise listed.wrong("file", count, f"must have {n}, as {file.name}")
            return [listed], without_folders([row.cell(0, "image") for row in rows])
    return [], tuple(f"image{k:04d}" for k in range(n))


# --- VisualSFM's .nvm, NVM_V3
#
# A line of a camera has its file, the focal length f in px, the quaternion w, x, y, z of R, the
# centre, r, and 0. Axes are x right, y down, z ahead. Measurements count from the middle of the
# image, y down. The lens is that of its adjustment: with m the measured point in units of f,
# m (1 + r m·m) is the ideal one: http://ccwu.me/vsfm/doc.html.


NVM_VERSION, NVM_FIXED = "NVM_V3", "FixedK"
"""First cell of the file, and the cell after it if all images have one given calibration."""

NVM_FOCAL = Range(1.0, 1e7, "must be a focal length in pixels")
NVM_COEFFICIENT = Range(-100.0, 100.0)
NVM_ENTRY = Range(-1e3, 1e3)
NVM_MOST = Range(0, 1e8, "must be a number of cameras or points", whole=True)

NVM_ASSUMED = (
    "camera axes are x right, y down, z ahead; measurements count from the middle of the image; "
    "the radial coefficient takes measured points to ideal ones",
)


@dataclass(frozen=True, kw_only=True, eq=False)
class _NvmCamera:
    """An image: its line in the file, its name, f and r, and its pose."""

    line: Line
    file: str
    lens: tuple[float, float]
    T_w_c: Pose


def project_nvm(source: Path, *, size: tuple[int, int], crs: str | None = None) -> Project:
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
    file = safe.read(source)
    settings, in_grid = on_no_map(file, crs, "VisualSFM")
    rows = _Rows(file)
    centre = _nvm_centre(rows, size)
    cameras = [_nvm_camera(row) for row in _nvm_counted(rows, "camera")]
    if not cameras:
        raise file.wrong("cameras", "there is none", "must have one")
    images = _nvm_names(cameras)
    points = _points(_nvm_point(row, len(cameras)) for row in _nvm_counted(rows, "point"))
    called = numbered(camera.lens for camera in cameras)
    measured = Measured(
        points=points.names,
        x_w=points.x_w,
        image_idx=points.image_idx,
        point_idx=points.point_idx,
        colrow=points.xy + centre,
    )
    first = {called[camera.lens]: camera for camera in reversed(cameras)}
    require_all_names({"image": images}, file.wrong)
    return Project(
        source=f"VisualSFM {NVM_VERSION}",
        sources=[file],
        lenses={name: _nvm_lens(file, first[name], size, centre) for name in called.values()},
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
            "second measurements of a point in one image": points.again,
            "cameras of further models in the file": _nvm_further(rows),
        },
        assumed=NVM_ASSUMED,
    )


read_nvm = reading(project_nvm)


def _nvm_counted(rows: _Rows, noun: str) -> Iterator[Line]:
    """Yield as many lines as the line before them states."""
    head = rows.next(f"number of {noun}s")
    for _ in range(int(head.number_at(0, f"number of {noun}s", NVM_MOST))):
        yield rows.next(noun)


def _nvm_centre(rows: _Rows, size: tuple[int, int]) -> Array:
    """Return from where measurements count, the library's pixels, by the first line."""
    first = rows.next("version")
    if first.cell(0, "version") != NVM_VERSION:
        raise first.wrong("version", quoted(first.cells[0]), f"must be {NVM_VERSION}")
    middle = np.array([size[0] - 1, size[1] - 1]) / 2
    if len(first) == 1:
        return middle
    if first.cells[1] != NVM_FIXED:
        raise first.wrong("version", quoted(first.cells[1]), f"must be {NVM_FIXED}, or nothing")
    _, cx, _, cy = first.numbers(2, 6, "fx, cx, fy, cy", NVM_FOCAL).tolist()
    return np.array([cx, cy]) - 0.5


def _nvm_camera(row: Line) -> _NvmCamera:
    n = len(row) - 10
    if n < 1:
        expected = "must be file, f, quaternion, centre, r and 0"
        raise row.wrong("camera", f"{len(row)} cells", expected)
    f = row.number_at(n, "focal length", NVM_FOCAL)
    quaternion = row.numbers(n + 1, n + 5, "quaternion", NVM_ENTRY)
    if not np.linalg.norm(quaternion) > 0:
        raise row.wrong("quaternion", "is zero", "must be a rotation")
    R_v_w = Rotation.from_quat(quaternion, scalar_first=True).as_matrix()
    return _NvmCamera(
        line=row,
        file=" ".join(row.cells[:n]).replace("\\", "/"),
        lens=(f, row.number_at(n + 8, "radial distortion", NVM_COEFFICIENT)),
        T_w_c=Pose(R=R_v_w.T @ FLIP, r=row.numbers(n + 5, n + 8, "centre", COORDINATE)),
    )


def _nvm_names(cameras: list[_NvmCamera]) -> tuple[str, ...]:
    """Return names of files without folders, or with them where some are the same."""
    whole = [camera.file for camera in cameras]
    for k, name in enumerate(whole):
        if name in whole[:k]:
            raise cameras[k].line.wrong("image", f"{quoted(name)} is there twice", "must be once")
    return without_folders(whole)


def _nvm_point(row: Line, n_cameras: int) -> tuple[Array, _Views, int]:
    """Return the place of a point, and its `_views`."""
    x_w = row.numbers(0, 3, "point", COORDINATE)
    each = "must be four for each: image, feature, x, y"
    return x_w, *_views(row, 7, n_cameras, image="image", each=each)


def _nvm_further(rows: _Rows) -> int:
    """Return how many cameras a further model of the file has; 0 where there is none."""
    row = rows.maybe()
    return max(0, row.whole_at(0, "number of cameras")) if row is not None and len(row) == 1 else 0


def _nvm_lens(file: Opened, camera: _NvmCamera, size: tuple[int, int], centre: Array) -> Lens:
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


# --- Both: lines one after another, and points with their views


_Views = dict[float, tuple[float, float]]
"""A point's pixel by image."""


class _Rows:
    """The lines of a text, one after another, without lines of comment (#)."""

    def __init__(self, file: Opened) -> None:
        self._file = file
        self._rows = safe.lines(file, comment="#")

    def maybe(self) -> Line | None:
        """Return the next line, None at the end."""
        return next(self._rows, None)

    def next(self, what: str) -> Line:
        """Return the next line; `what` is its name in the message where the text ends too early."""
        row = self.maybe()
        if row is None:
            end = self._file.data.count(b"\n") + 1
            fault = f"{what} is missing at the end of the file"
            raise self._file.wrong(what, fault, "must be complete; is the file cut off?", line=end)
        return row


@dataclass(frozen=True, kw_only=True, eq=False)
class _Points:
    """Places of points, shape (n, 3); image, point and x, y of measurements; repeated ones."""

    x_w: Array
    image_idx: Index
    point_idx: Index
    xy: Array
    again: int

    @property
    def names(self) -> tuple[str, ...]:
        """Their numbers in the file."""
        return tuple(str(k) for k in range(len(self.x_w)))


def _points(listed: Iterable[tuple[Array, _Views, int]]) -> _Points:
    """Return points from the place of each, and its `_views`."""
    x_w, measurements, again = [], [], 0
    for point, (place, views, repeated) in enumerate(listed):
        x_w.append(place)
        measurements += [(image, point, x, y) for image, (x, y) in views.items()]
        again += repeated
    table = np.array(measurements, dtype=float).reshape(-1, 4)
    return _Points(
        x_w=np.array(x_w).reshape(-1, 3),
        image_idx=table[:, 0].astype(int),
        point_idx=table[:, 1].astype(int),
        xy=table[:, 2:],
        again=again,
    )


def _views(row: Line, start: int, n_images: int, *, image: str, each: str) -> tuple[_Views, int]:
    """Return a point's pixel in each image, the first of several, and how many are passed over.

    Their number stands before the cell `start`, from which on each has four: image, feature, x, y.
    Messages call an image `image`, and what is expected of the cells `each`.
    """
    n = row.whole_at(start - 1, "views")
    if not 0 <= n == (len(row) - start) / 4:
        raise row.wrong("views", f"{len(row) - start} cells after the number {n}", each)
    views: _Views = {}
    for k, _, x, y in row.numbers(start, None, "views", COORDINATE).reshape(-1, 4).tolist():
        if not (0 <= k < n_images and k.is_integer()):
            raise row.wrong("views", f"{image} {k:g}", f"must be one of {n_images}, from 0")
        views.setdefault(k, (x, y))
    return views, n - len(views)
