"""COLMAP's models: cameras, rigs, images, tie points and orientations, text or binary.

Layouts: https://colmap.github.io/format.html. Binary files are little-endian without padding, and
each begins with the number of its entries, 64 bits. Pixels count from the outer corner of the
top-left one; poses take the world to the camera's axes, x right, y down, z ahead.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from acx4files.exchange import lens, options, project, safe
from acx4files.exchange.coordinates import AHEAD, FLIP, stacked, turned
from acx4files.exchange.lens import Lens, Pinhole, Wrong
from acx4files.exchange.project import Images, Measured, Project, Proof
from acx4files.exchange.safe import Line, Opened, refusal
from acx4files.flight.problems import METRES, PIXELS, quoted
from acx4lib.expected import Array, Index
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import LOCAL, GridSystem

HALF = 0.5
"""The middle of the top-left pixel has the coordinates 0.5, 0.5 in COLMAP."""

EARTH = (6.3e6, 6.5e6)
"""Least and largest distance of a flight from the Earth's centre, m."""

ASSUMED = (
    "Pixels: COLMAP counts from the outer corner of the top-left one, so 0.5 is taken off",
    "Poses take the world to the camera's axes: x right, y down, z ahead",
)

CAMERA = "CAMERA"
"""The kind of sensor that is a camera; it has the number 0 in binary files."""

Camera = tuple[int, str, float, float, Array, Wrong]
"""Number, lens model, width, height, parameters."""

Sensor = tuple[str, int, Array | None]
"""Kind, number, and the rig in its axes where the file has it."""

Rig = tuple[str, int, list[Sensor], Wrong]
"""Kind and number of the sensor whose axes are the rig's, and other sensors."""


@dataclass(frozen=True, kw_only=True, eq=False)
class _Image:
    """An image: `pose` is the world's in the camera's axes, `points` are those of `xy`."""

    number: int
    name: str
    camera: int
    pose: Array
    xy: Array
    points: Index
    wrong: Wrong


def read_project(
    source: Annotated[Path, options.Source],
    *,
    crs: options.CrsOfFiles = None,
    orientations: options.AsAdjusted = "none",
) -> Project:
    """Read a model of COLMAP: cameras, rigs, images and tie points, text or binary.

    SOURCE is the folder of a model, often sparse/0, with cameras, images and points3D as .bin or
    .txt; rigs and frames of COLMAP 3.12 and later are read, too. Measurements that belong to no
    point are left out. A model has no coordinate system: with --crs its x, y, z are east, north and
    height of that system, or its earth-centred coordinates, and --orientations adjusted makes a
    trajectory of its poses, on which a boresight means nothing. With --crs local they are taken as
    they are; to calibrate, `acx4 run` needs three control points in them, or sigma of positions.

    Examples
    --------
    acx4 import colmap sparse/0 --out my_flight
    acx4 import colmap sparse/0 --crs local --out my_flight
    acx4 import colmap aligned --crs EPSG:31982 --orientations adjusted --out my_flight

    Raises
    ------
    FlightError
        Where the folder has no model, or something in it cannot be.
    """
    folder = source.parent if source.is_file() else source
    sources, rows = _rows(source, folder)
    lenses, (references, in_rigs) = _lenses(rows["cameras"]), _rigs(rows["rigs"])
    images: list[_Image] = rows["images"]
    rigged = _mounted(lenses, in_rigs, is_metric=crs is not None)
    if not images:
        raise refusal(str(folder), 1, "folder", "has no image", "must be a model with images")
    frames = {image: frame for frame, kind, image in rows["frames"] if kind == CAMERA}
    _require(images, lenses, frames)
    T_w_i = stacked([_pose(image.pose, image.wrong) for image in images]).inverse
    T_w_c = Pose(R=T_w_i.R @ FLIP, r=T_w_i.r)
    measured, lost = _measured(images, dict(rows["points3D"]))
    in_grid, placed = _in_grid(folder, crs, T_w_c)
    unknown = list(in_rigs.values()).count(None)
    return Project(
        source="COLMAP",
        sources=sources,
        lenses=rigged,
        images=Images(
            names=tuple(image.name for image in images),
            cameras=tuple(f"camera {image.camera}" for image in images),
            exposures=tuple(_exposures(images, frames, references)),
            T_w_c=T_w_c,
        ),
        measured=measured,
        proofs=(Proof(whose="COLMAP's own points", measured=measured, is_own=True),),
        settings={
            "name": folder.resolve().name,
            **({} if crs is None else {"crs": crs, "heights": "ellipsoidal"}),
        },
        orientations=orientations,
        in_grid=in_grid,
        placed=placed,
        lost={
            **lost,
            "cameras of rigs without a pose in the rig: their mountings are 0": unknown,
            "lever arms of cameras in rigs: without a CRS the model has no metres": (
                len(in_rigs) - unknown if crs is None else 0
            ),
        },
        assumed=ASSUMED,
    )


read = project.reader(read_project)


def _rows(source: Path, folder: Path) -> tuple[list[Opened], dict[str, Any]]:
    """Return the files of a model and their content; binary ones first, as COLMAP does."""
    ending = next((one for one in READERS if (folder / f"cameras{one}").exists()), "")
    if not ending:
        found_none = "has neither cameras.bin nor cameras.txt"
        expected = "must be the folder of a model, often sparse/0"
        raise refusal(str(source), 1, "folder", found_none, expected)
    paths = {name: folder / f"{name}{ending}" for name in READERS[ending]}
    needed = ("cameras", "images", "points3D")
    files: list[Opened] = []
    rows: dict[str, Any] = dict.fromkeys(paths, ())
    for name, path in paths.items():
        # COLMAP's manual makes models of known poses with an empty file of points
        is_empty = path.is_file() and not path.stat().st_size and name not in ("cameras", "images")
        if (name in needed or path.exists()) and not is_empty:
            files.append(safe.read(path))
            try:
                rows[name] = [*READERS[ending][name](files[-1])]
            except (struct.error, ValueError, OverflowError):
                fault, expected = "ends too early", "must be complete; is the file cut off?"
                raise files[-1].wrong("file", fault, expected) from None
    return files, rows


def _require(images: list[_Image], cameras: Mapping[int, Lens], frames: Mapping[int, int]) -> None:
    """Raise where images do not fit to cameras, to each other or to names of a flight."""
    places = project.by_id((image.name, image) for image in images)
    seen: set[tuple[int, int]] = set()
    for image in images:
        if image.camera not in cameras:
            raise image.wrong(f"{quoted(image.name)}: camera {image.camera}", "must be in cameras")
        _require_size(image.xy, image.wrong)
        key = (frames.get(image.number, -image.number), image.camera)
        if key in seen:
            fault = f"frame {key[0]} has camera {key[1]} twice"
            raise image.wrong(fault, "must have each camera once")
        seen.add(key)
    project.named(places, list(places))


def _mounted(
    lenses: Mapping[int, Lens], in_rigs: Mapping[int, Pose | None], *, is_metric: bool
) -> dict[str, Lens]:
    """Return cameras with their mountings in rigs; lever arms only where the unit is metres."""
    mounts = dict.fromkeys(lenses, AHEAD)
    for number, pose in in_rigs.items():
        if pose is not None:
            back = pose.inverse
            r = FLIP @ back.r if is_metric else np.zeros(3)
            mounts[number] = Pose(R=turned(back.R), r=r)
    return {f"camera {i}": replace(lens, mount=mounts[i]) for i, lens in lenses.items()}


def _exposures(
    images: list[_Image], frames: Mapping[int, int], references: set[int]
) -> Iterator[str]:
    """Yield the exposure of each image: the first image of its frame, of the rig's own camera."""
    leaders: dict[int, str] = {}
    for image in images:
        frame = frames.get(image.number, -image.number)
        if frame not in leaders or image.camera in references:
            leaders[frame] = image.name
    yield from (leaders[frames.get(image.number, -image.number)] for image in images)


def _measured(images: list[_Image], points: Mapping[int, Any]) -> tuple[Measured, dict[str, int]]:
    """Return measurements that belong to points, a point once in each image, and the others."""
    image = np.repeat(np.arange(len(images)), [len(shot.points) for shot in images])
    point = np.concatenate([shot.points for shot in images])
    colrow = np.concatenate([shot.xy for shot in images]) - HALF
    row = pd.Index(list(points), dtype=np.int64).get_indexer(pd.Index(point))
    matched, known = point != -1, row >= 0
    first = known & ~pd.DataFrame({"image": image, "row": row}).duplicated().to_numpy()
    measured = Measured(
        points=tuple(map(str, points)),
        x_w=np.array([*points.values()], dtype=float).reshape(-1, 3),
        image_idx=image[first],
        point_idx=row[first],
        colrow=colrow[first],
    )
    lost = {
        "measurements that belong to no point": int((~matched).sum()),
        "second measurements of a point in one image": int((known & ~first).sum()),
        "measurements of points that the model has not": int((matched & ~known).sum()),
    }
    return measured, lost


def _in_grid(folder: Path, crs: str | None, T_w_c: Pose) -> tuple[project.InGrid, tuple[str, ...]]:
    """Return the map from a model's poses into the grid, and a sentence on its assumption."""
    if crs is None:
        expected = f"adjusted orientations need a projected CRS, or {LOCAL!r}"
        return refusal(str(folder), 1, "--crs", "missing", expected), ()
    if crs == LOCAL:
        sentence = "The model's x, y, z are coordinates on no map, of the model's own scale"
        return project.as_they_are, (sentence,)
    try:
        grid = GridSystem(crs=crs)
    except ValueError as error:
        raise refusal(str(folder), 1, "--crs", str(error), "must be a projected CRS") from None
    distance = np.linalg.norm(T_w_c.r, axis=1)
    if ((distance > EARTH[0]) & (distance < EARTH[1])).all():
        sentence = f"The model is in the earth-centred frame of {crs}"
        return lambda T: project.grid_poses_of_ecef(grid, T), (sentence,)
    sentence = f"The model's x, y, z are east, north and ellipsoidal height of {crs}"
    return project.as_they_are, (sentence,)


# what text and binary files have in common


def _lenses(rows: Iterable[Camera]) -> dict[int, Lens]:
    """Return cameras of their number, model, width, height and parameters, after checks."""
    lenses: dict[int, Lens] = {}
    for number, name, width, height, parameters, wrong in rows:
        if number in lenses:
            raise wrong(f"camera {number} is there twice", "must be unique")
        if width not in PIXELS or height not in PIXELS:
            raise wrong(f"{width} x {height} px", f"width and height {PIXELS}")
        formula = _formula(name, wrong)
        if len(parameters) != len(formula.names):
            expected = f"must be {', '.join(formula.names)}"
            raise wrong(f"{name} has {len(parameters)} parameters", expected)
        _require_size(parameters, wrong)
        values, first = parameters.tolist(), formula.names.index("cx")
        if min(values[:first]) <= 0:
            raise wrong(f"{name} {values}", "focal lengths must be positive")
        cx, cy = values[first : first + 2]
        hole = Pinhole(fx=values[0], fy=values[first - 1], cx=cx - HALF, cy=cy - HALF)
        lenses[number] = formula.lens(values, hole, (int(width), int(height)), wrong)
    return lenses


def _formula(model: str, wrong: Wrong) -> lens.Formula:
    if model not in lens.COLMAP:
        raise wrong(f"lens model {quoted(model)}", f"must be one of {', '.join(lens.COLMAP)}")
    return lens.COLMAP[model]


def _rigs(rows: Iterable[Rig]) -> tuple[set[int], dict[int, Pose | None]]:
    """Return reference cameras, and rigs in the axes of others, of references and other sensors."""
    references, in_rigs = set[int](), dict[int, Pose | None]()
    for kind, reference, others, wrong in rows:
        if kind != CAMERA:
            raise wrong(f"reference sensor {quoted(kind)}", "must be CAMERA, in binary files 0")
        references.add(reference)
        for other, number, values in others:
            if other == CAMERA:
                in_rigs[number] = None if values is None else _pose(values, wrong)
    return references, in_rigs


def _require_size(values: Array, wrong: Wrong) -> None:
    """Raise where coordinates are not finite, or larger than any is."""
    fits = np.abs(values) <= METRES.high
    if not fits.all():
        raise wrong(f"coordinate {values[~fits][0]:g}", str(METRES))


def _pose(values: Array, wrong: Wrong) -> Pose:
    """Return a pose from qw, qx, qy, qz, tx, ty, tz."""
    _require_size(values, wrong)
    size = float(np.linalg.norm(values[:4]))
    if not 0.5 < size < 2:
        raise wrong(f"quaternion of length {size:g}", "must be a quaternion of length 1")
    R = Rotation.from_quat(values[:4], scalar_first=True).as_matrix()
    return Pose(R=R, r=np.asarray(values[4:7], dtype=float))


# text


def _lines(source: Opened, *, cells: int = -1) -> Iterator[Line]:
    """Yield all lines but comments, blank ones too; after `cells` cells the rest is one."""
    for number, text in enumerate(source.text().split("\n"), start=1):
        if not text.lstrip().startswith("#"):
            split = tuple(text.strip().split(maxsplit=cells))
            yield Line(file=source.file, number=number, cells=split)


def _text_cameras(source: Opened) -> Iterator[Camera]:
    for line in filter(len, _lines(source)):
        yield (
            line.whole_at(0, "CAMERA_ID"),
            line.cell(1, "MODEL"),
            line.number_at(2, "WIDTH"),
            line.number_at(3, "HEIGHT"),
            line.numbers(4, None, "PARAMS"),
            partial(line.wrong, "camera"),
        )


def _text_images(source: Opened) -> Iterator[_Image]:
    """Yield images from two lines each; the second, with measurements, may be blank."""
    lines = _lines(source, cells=9)
    for line in filter(len, lines):
        below = next(lines, replace(line, cells=()))
        whole = replace(below, cells=tuple(" ".join(below.cells).split()))
        if len(whole) % 3:
            raise whole.wrong("POINTS2D", f"{len(whole)} cells", "must be X, Y, POINT3D_ID of each")
        values = whole.numbers(0, None, "POINTS2D").reshape(-1, 3)
        if (values[:, 2] != np.round(values[:, 2])).any() or (np.abs(values[:, 2]) > 2**53).any():
            raise whole.wrong("POINT3D_ID", "is not whole", "must be a whole number, or -1")
        yield _Image(
            number=line.whole_at(0, "IMAGE_ID"),
            name=line.cell(9, "NAME"),
            camera=line.whole_at(8, "CAMERA_ID"),
            pose=line.numbers(1, 8, "QW, QX, QY, QZ, TX, TY, TZ"),
            xy=values[:, :2],
            points=values[:, 2].astype(np.int64),
            wrong=partial(line.wrong, "image"),
        )


def _text_points(source: Opened) -> Iterator[tuple[int, Array]]:
    for line in filter(len, _lines(source, cells=4)):
        yield line.whole_at(0, "POINT3D_ID"), line.numbers(1, 4, "X, Y, Z", METRES)


def _text_rigs(source: Opened) -> Iterator[Rig]:
    """Yield rigs: number, count, reference sensor, then type, number and pose of each other."""
    for line in filter(len, _lines(source)):
        if line.whole_at(1, "NUM_SENSORS") < 1:
            continue
        others, k = list[Sensor](), 4
        while k < len(line):
            has_pose = line.whole_at(k + 2, "HAS_POSE") != 0
            pose = line.numbers(k + 3, k + 10, "pose") if has_pose else None
            others.append((line.cell(k, "SENSOR_TYPE"), line.whole_at(k + 1, "SENSOR_ID"), pose))
            k += 10 if has_pose else 3
        kind, reference = line.cell(2, "REF_SENSOR_TYPE"), line.whole_at(3, "REF_SENSOR_ID")
        yield kind, reference, others, partial(line.wrong, "rig")


def _text_frames(source: Opened) -> Iterator[tuple[int, str, int]]:
    """Yield frame, sensor and image; a line has number, rig, pose, count, and such threes."""
    for line in filter(len, _lines(source)):
        number, count = line.whole_at(0, "FRAME_ID"), line.whole_at(9, "NUM_DATA_IDS")
        if len(line) != 10 + 3 * count:
            raise line.wrong("DATA_IDS", f"{len(line) - 10} cells", f"must be {count} times 3")
        for k in range(10, len(line), 3):
            yield number, line.cells[k], line.whole_at(k + 2, "DATA_ID")


# binary

_MEASUREMENT = np.dtype([("xy", "<f8", 2), ("point", "<i8")])
"""A measurement; without a point its 64 bits are all set, which is -1 with a sign."""

_TRACK_ELEMENT = np.dtype("V8")
"""An image and a measurement of it."""


class _Values:
    """Values of a binary file one after another; at its end an error of struct or a ValueError."""

    def __init__(self, source: Opened) -> None:
        self.data, self.at = source.data, 0

    def take(self, layout: str) -> tuple[Any, ...]:
        """Return the next values, by a layout of `struct`."""
        values = struct.unpack_from(layout, self.data, self.at)
        self.at += struct.calcsize(layout)
        return values

    def array(self, layout: np.dtype[Any]) -> NDArray[Any]:
        """Return the next records of a layout, whose number is before them."""
        (n,) = self.take("<Q")
        found = np.frombuffer(self.data, layout, n, self.at) if n else np.zeros(0, layout)
        self.at += n * layout.itemsize
        return found

    def text(self) -> str:
        """Return the next text, which a null byte ends."""
        begin, self.at = self.at, self.data.index(b"\0", self.at) + 1
        return self.data[begin : self.at - 1].decode("utf-8")


def _entries(source: Opened) -> tuple[_Values, range]:
    """Return the values behind the number of entries, and a range of that length."""
    values = _Values(source)
    return values, range(*values.take("<Q"))


def _kind(number: int) -> str:
    return CAMERA if number == 0 else str(number)


def _binary_cameras(source: Opened) -> Iterator[Camera]:
    file, entries = _entries(source)
    models = dict(enumerate(lens.COLMAP))
    for _ in entries:
        number, kind, width, height = file.take("<IiQQ")
        wrong = partial(source.wrong, f"camera {number}")
        name = models.get(kind, str(kind))
        values = file.take(f"<{len(_formula(name, wrong).names)}d")
        yield number, name, width, height, np.array(values), wrong


def _binary_images(source: Opened) -> Iterator[_Image]:
    file, entries = _entries(source)
    for k in entries:
        number, *pose, camera = file.take("<I7dI")
        name, measured = file.text(), file.array(_MEASUREMENT)
        yield _Image(
            number=number,
            name=name,
            camera=camera,
            pose=np.array(pose),
            xy=np.array(measured["xy"], dtype=float).reshape(-1, 2),
            points=np.array(measured["point"], dtype=np.int64),
            wrong=partial(source.wrong, f"image {k + 1}"),
        )


def _binary_points(source: Opened) -> Iterator[tuple[int, list[float]]]:
    file, entries = _entries(source)
    for _ in entries:
        number, *xyz, _, _, _, _ = file.take("<q3d3Bd")
        file.array(_TRACK_ELEMENT)
        if not all(x in METRES for x in xyz):
            raise source.wrong(f"point {number}", f"coordinates {xyz}", str(METRES))
        yield number, xyz


def _binary_rigs(source: Opened) -> Iterator[Rig]:
    file, entries = _entries(source)
    for _ in entries:
        number, count = file.take("<II")
        if count == 0:
            continue
        kind, reference = file.take("<iI")
        others: list[Sensor] = []
        for _ in range(count - 1):
            other, sensor, has_pose = file.take("<iIB")
            others.append((_kind(other), sensor, np.array(file.take("<7d")) if has_pose else None))
        yield _kind(kind), reference, others, partial(source.wrong, f"rig {number}")


def _binary_frames(source: Opened) -> Iterator[tuple[int, str, int]]:
    file, entries = _entries(source)
    for _ in entries:
        number, *_, count = file.take("<II7dI")
        for _ in range(count):
            kind, _, image = file.take("<iIQ")
            yield number, _kind(kind), image


READERS: dict[str, dict[str, Callable[[Opened], Any]]] = {
    ".bin": {
        "cameras": _binary_cameras,
        "images": _binary_images,
        "points3D": _binary_points,
        "rigs": _binary_rigs,
        "frames": _binary_frames,
    },
    ".txt": {
        "cameras": _text_cameras,
        "images": _text_images,
        "points3D": _text_points,
        "rigs": _text_rigs,
        "frames": _text_frames,
    },
}
"""Readers of the files of a model, by their endings; binary ones first."""
