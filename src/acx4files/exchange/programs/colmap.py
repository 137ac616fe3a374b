"""COLMAP's models: cameras, rigs, images, tie points and orientations, text or binary.

Layouts: https://colmap.github.io/format.html. Binary files are little-endian without padding, and
each begins with the number of its entries, 64 bits. Pixels count from the outer corner of the
top-left one; poses take the world to the camera's axes, x right, y down, z ahead.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from acx4files.exchange import safe
from acx4files.exchange.coordinates import AHEAD, FLIP, stacked, turned
from acx4files.exchange.flight_folder import ImportedFlight
from acx4files.exchange.lens import COLMAP as MODELS
from acx4files.exchange.lens import WORST_PX, Lens, Pinhole, Wrong
from acx4files.exchange.options import (
    Allow,
    AsAdjusted,
    BlockOfProject,
    CrsOfFiles,
    PixelUmOfProject,
    Source,
)
from acx4files.exchange.project import (
    Images,
    InGrid,
    Measured,
    Project,
    Proof,
    as_they_are,
    flight_of,
    grid_poses_of_ecef,
    nowhere,
    require_names,
)
from acx4files.exchange.safe import Cursor, Line, Opened, refusal
from acx4files.flight.problems import PIXELS, quoted
from acx4lib.expected import Array, Index
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import LOCAL, GridSystem

NAMES = ("cameras", "images", "points3D")
"""Files of a model; their endings are .bin or .txt."""

MAYBE = ("rigs", "frames")
"""Files that models of COLMAP 3.12 and later have as well."""

HALF = 0.5
"""The middle of the top-left pixel has the coordinates 0.5, 0.5 in COLMAP."""

LARGEST = 1e8
"""Largest coordinate, in pixels as in units of the model."""

UNMATCHED = -1
"""Number of the point of a measurement without a point."""

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


@dataclass(frozen=True, kw_only=True, eq=False)
class _Model:
    """The content of the files.

    `points` are numbers and places. `references` are the cameras whose axes are those of rigs,
    `in_rigs` the rigs in the other cameras' axes, None if not known; `frames` are those of images.
    """

    sources: tuple[Opened, ...]
    cameras: Mapping[int, Lens]
    images: tuple[_Image, ...]
    points: tuple[Index, Array]
    references: set[int]
    in_rigs: Mapping[int, Pose | None]
    frames: Mapping[int, int]


def project(source: Path, *, crs: str | None = None) -> Project:
    """Return a model.

    Parameters
    ----------
    source : Path
        Its folder, or a file in it; binary files are taken where there are both, as COLMAP does.
    crs : str, optional
        Projected CRS in whose east, north and height the model's coordinates are, or whose ECEF
        frame; the size of the coordinates tells which. `geodesy.LOCAL` takes them as they are.

    Raises
    ------
    FlightError
        Where the folder has no model, or something in it cannot be.
    """
    model = _model(source)
    folder = source.parent if source.is_file() else source
    if not model.images:
        metres = "Lever arms of cameras in rigs are metres: without images nothing tells their unit"
        return Project(
            source="COLMAP's cameras",
            sources=model.sources,
            lenses=_lenses(model, is_metric=True),
            assumed=(ASSUMED[0], *((metres,) if model.in_rigs else ())),
        )
    _require(model)
    T_w_i = stacked([_pose(image.pose, image.wrong) for image in model.images]).inverse
    T_w_c = Pose(R=T_w_i.R @ FLIP, r=T_w_i.r)
    measured, lost = _measured(model)
    in_grid, placed = _in_grid(folder, crs, T_w_c)
    unknown = list(model.in_rigs.values()).count(None)
    return Project(
        source="COLMAP",
        sources=model.sources,
        lenses=_lenses(model, is_metric=crs is not None),
        images=Images(
            names=tuple(image.name for image in model.images),
            cameras=tuple(_named(image.camera) for image in model.images),
            exposures=tuple(_exposures(model)),
            T_w_c=T_w_c,
        ),
        measured=measured,
        proofs=(Proof(whose="COLMAP's own points", measured=measured),),
        settings={
            "name": folder.resolve().name,
            **({} if crs is None else {"crs": crs, "heights": "ellipsoidal"}),
        },
        in_grid=in_grid,
        placed=placed,
        lost={
            **lost,
            "cameras of rigs without a pose in the rig: their mountings are 0": unknown,
            "lever arms of cameras in rigs: without a CRS the model has no metres": (
                len(model.in_rigs) - unknown if crs is None else 0
            ),
        },
        assumed=ASSUMED,
    )


def read(
    source: Annotated[Path, Source],
    *,
    block: BlockOfProject = None,
    crs: CrsOfFiles = None,
    orientations: AsAdjusted = "none",
    pixel_um: PixelUmOfProject = None,
    allow: Allow = WORST_PX,
) -> ImportedFlight:
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
        As `project` and `flight_of`.
    """
    return flight_of(
        project(source, crs=crs),
        orientations=orientations,
        block=block,
        pixel_um=pixel_um,
        allow=allow,
    )


def _model(source: Path) -> _Model:
    """Return the model in a folder, or in the folder of a file."""
    folder = source.parent if source.is_file() else source
    endings = [ending for ending in READERS if (folder / f"cameras{ending}").exists()]
    if not endings:
        found_none = "has neither cameras.bin nor cameras.txt"
        expected = "must be the folder of a model, often sparse/0"
        raise refusal(str(source), 1, "folder", found_none, expected)
    paths = {name: folder / f"{name}{endings[0]}" for name in (*NAMES, *MAYBE)}
    has_images = any(paths[name].exists() for name in NAMES[1:])
    files: list[Opened] = []
    rows: dict[str, Iterable[Any]] = dict.fromkeys(paths, ())
    for name, path in paths.items():
        is_needed = name == "cameras" or (has_images and name in NAMES)
        # COLMAP's manual makes models of known poses with an empty file of points
        is_empty = name in ("points3D", *MAYBE) and path.is_file() and not path.stat().st_size
        if (is_needed or (name in MAYBE and path.exists())) and not is_empty:
            files.append(safe.read(path))
            rows[name] = READERS[endings[0]][name](files[-1])
    points = list(rows["points3D"])
    cameras = _cameras(rows["cameras"])
    images = tuple(rows["images"])
    references, in_rigs = _rigs(rows["rigs"])
    return _Model(
        sources=tuple(files),
        cameras=cameras,
        images=images,
        points=(
            np.array([number for number, _ in points], dtype=np.int64),
            np.array([xyz for _, xyz in points], dtype=float).reshape(-1, 3),
        ),
        references=references,
        in_rigs=in_rigs,
        frames={image: frame for frame, kind, image in rows["frames"] if kind == CAMERA},
    )


def _require(model: _Model) -> None:
    """Raise where images do not fit to cameras, to each other or to names of a flight."""
    places: dict[str, _Image] = {}
    seen: set[tuple[int, int]] = set()
    for image in model.images:
        if image.camera not in model.cameras:
            raise image.wrong(f"{quoted(image.name)}: camera {image.camera}", "must be in cameras")
        if image.name in places:
            raise image.wrong(f"{quoted(image.name)} is there twice", "must be unique")
        _require_size(image.xy, image.wrong)
        places[image.name] = image
        key = (model.frames.get(image.number, -1), image.camera)
        if key in seen and key[0] >= 0:
            raise image.wrong(
                f"frame {key[0]} has camera {key[1]} twice", "must have each camera once"
            )
        seen.add(key)
    require_names(list(places), lambda name, fault, expected: places[name].wrong(fault, expected))


def _named(camera: int) -> str:
    return f"camera {camera}"


def _lenses(model: _Model, *, is_metric: bool) -> dict[str, Lens]:
    """Return cameras with their mountings in rigs; lever arms only where the unit is metres."""
    mounts = dict.fromkeys(model.cameras, AHEAD)
    for number, pose in model.in_rigs.items():
        if pose is not None:
            back = pose.inverse
            r = FLIP @ back.r if is_metric else np.zeros(3)
            mounts[number] = Pose(R=turned(back.R), r=r)
    return {_named(i): replace(lens, mount=mounts[i]) for i, lens in model.cameras.items()}


def _exposures(model: _Model) -> list[str]:
    """Return the exposure of each image: the first image of its frame, of the rig's own camera."""
    leaders: dict[int, str] = {}
    frames = [model.frames.get(image.number) for image in model.images]
    for frame, image in zip(frames, model.images, strict=True):
        if frame is not None and (frame not in leaders or image.camera in model.references):
            leaders[frame] = image.name
    return [
        image.name if frame is None else leaders[frame]
        for frame, image in zip(frames, model.images, strict=True)
    ]


def _measured(model: _Model) -> tuple[Measured, dict[str, int]]:
    """Return measurements that belong to points, a point once in each image, and the others."""
    ids, x_w = model.points
    image = np.repeat(np.arange(len(model.images)), [len(shot.points) for shot in model.images])
    point = np.concatenate([shot.points for shot in model.images])
    colrow = np.concatenate([shot.xy for shot in model.images]) - HALF
    row_of = pd.Series(np.arange(len(ids)), index=ids)
    row = row_of[~row_of.index.duplicated()].reindex(point, fill_value=-1).to_numpy()
    matched, known = point != UNMATCHED, row >= 0
    first = known & ~pd.DataFrame({"image": image, "row": row}).duplicated().to_numpy()
    measured = Measured(
        points=tuple(ids.astype(str).tolist()),
        x_w=x_w,
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


def _in_grid(folder: Path, crs: str | None, T_w_c: Pose) -> tuple[InGrid, tuple[str, ...]]:
    """Return the map from a model's poses into the grid, and a sentence on its assumption."""
    if crs is None:
        expected = f"adjusted orientations need a projected CRS, or {LOCAL!r}"
        return nowhere(refusal(str(folder), 1, "--crs", "missing", expected)), ()
    if crs == LOCAL:
        sentence = "The model's x, y, z are coordinates on no map, of the model's own scale"
        return as_they_are, (sentence,)
    try:
        grid = GridSystem(crs=crs)
    except ValueError as error:
        raise refusal(str(folder), 1, "--crs", str(error), "must be a projected CRS") from None
    distance = np.linalg.norm(T_w_c.r, axis=1)
    if ((distance > EARTH[0]) & (distance < EARTH[1])).all():
        sentence = f"The model is in the earth-centred frame of {crs}"
        return lambda T: grid_poses_of_ecef(grid, T), (sentence,)
    sentence = f"The model's x, y, z are east, north and ellipsoidal height of {crs}"
    return lambda T: (T.r, T.opk), (sentence,)


# what text and binary files have in common


def _cameras(rows: Iterable[Camera]) -> dict[int, Lens]:
    """Return cameras of their number, model, width, height and parameters, after checks."""
    lenses: dict[int, Lens] = {}
    for number, name, width, height, parameters, wrong in rows:
        if number in lenses:
            raise wrong(f"camera {number} is there twice", "must be unique")
        if width not in PIXELS or height not in PIXELS:
            raise wrong(f"{width} x {height} px", f"width and height {PIXELS}")
        names = _names(name, wrong)
        if len(parameters) != len(names):
            expected = f"must be {', '.join(names)}"
            raise wrong(f"{name} has {len(parameters)} parameters", expected)
        _require_size(parameters, wrong)
        values, first = parameters.tolist(), names.index("cx")
        if min(values[:first]) <= 0:
            raise wrong(f"{name} {values}", "focal lengths must be positive")
        cx, cy = values[first : first + 2]
        lenses[number] = Lens(
            width_px=int(width),
            height_px=int(height),
            hole=Pinhole(fx=values[0], fy=values[first - 1], cx=cx - HALF, cy=cy - HALF),
            distortion=MODELS[name].distortion(values),
            is_fisheye=MODELS[name].is_fisheye,
            wrong=wrong,
        )
    return lenses


def _names(model: str, wrong: Wrong) -> tuple[str, ...]:
    """Return the names of the parameters of a lens model."""
    if model not in MODELS:
        raise wrong(f"lens model {quoted(model)}", f"must be one of {', '.join(MODELS)}")
    return MODELS[model].names


def _rigs(rows: Iterable[Rig]) -> tuple[set[int], dict[int, Pose | None]]:
    """Return reference cameras, and rigs in the axes of others, of references and other sensors."""
    references, in_rigs = set[int](), dict[int, Pose | None]()
    for kind, reference, others, wrong in rows:
        for other, number, values in others:
            pose = None if values is None else _pose(values, wrong)
            if other == CAMERA:
                in_rigs[number] = pose
        if kind != CAMERA:
            raise wrong(f"reference sensor {quoted(kind)}", "must be CAMERA, in binary files 0")
        references.add(reference)
    return references, in_rigs


def _require_size(values: Array, wrong: Wrong) -> None:
    """Raise where coordinates are not finite, or larger than any is."""
    fits = np.abs(values) <= LARGEST
    if not fits.all():
        expected = f"must be between -{LARGEST:g} and {LARGEST:g}"
        raise wrong(f"coordinate {values[~fits][0]:g}", expected)


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
        below = next(lines, Line(file=line.file, number=line.number + 1, cells=()))
        whole = Line(
            file=line.file, number=below.number, cells=tuple(" ".join(below.cells).split())
        )
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
        xyz = line.numbers(1, 4, "X, Y, Z")
        _require_size(xyz, partial(line.wrong, "X, Y, Z"))
        yield line.whole_at(0, "POINT3D_ID"), xyz


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


def _entries(source: Opened) -> tuple[Cursor, range]:
    """Return a cursor behind the number of entries, and a range of that length."""
    cursor = Cursor(source=source)
    (n,) = cursor.take("<Q", "number of entries")
    return cursor, range(n)


def _kind(number: int) -> str:
    return CAMERA if number == 0 else str(number)


def _binary_cameras(source: Opened) -> Iterator[Camera]:
    cursor, entries = _entries(source)
    models = dict(enumerate(MODELS))
    for k in entries:
        number, kind, width, height = cursor.take("<IiQQ", f"camera {k + 1}")
        wrong = partial(source.wrong, f"camera {number}")
        name = models.get(kind, str(kind))
        values = cursor.take(f"<{len(_names(name, wrong))}d", f"camera {number}")
        yield number, name, width, height, np.array(values), wrong


def _binary_images(source: Opened) -> Iterator[_Image]:
    cursor, entries = _entries(source)
    for k in entries:
        element = f"image {k + 1}"
        number, *values, camera = cursor.take("<I7dI", element)
        name = cursor.text(element)
        (count,) = cursor.take("<Q", element)
        measured = cursor.array(_MEASUREMENT, count, element)
        yield _Image(
            number=number,
            name=name,
            camera=camera,
            pose=np.array(values),
            xy=np.array(measured["xy"], dtype=float).reshape(-1, 2),
            points=np.array(measured["point"], dtype=np.int64),
            wrong=partial(source.wrong, element),
        )


def _binary_points(source: Opened) -> Iterator[tuple[int, list[float]]]:
    cursor, entries = _entries(source)
    for _ in entries:
        number, *xyz, _, _, _, _, length = cursor.take("<q3d3BdQ", "point")
        cursor.array(_TRACK_ELEMENT, length, f"track of point {number}")
        if not all(abs(x) <= LARGEST for x in xyz):  # of each point, an array would take long
            _require_size(np.array(xyz), partial(source.wrong, f"point {number}"))
        yield number, xyz


def _binary_rigs(source: Opened) -> Iterator[Rig]:
    cursor, entries = _entries(source)
    for _ in entries:
        number, count = cursor.take("<II", "rig")
        if count == 0:
            continue
        element = f"rig {number}"
        kind, reference = cursor.take("<iI", element)
        others: list[Sensor] = []
        for _ in range(count - 1):
            other, sensor, has_pose = cursor.take("<iIB", element)
            pose = np.array(cursor.take("<7d", element)) if has_pose else None
            others.append((_kind(other), sensor, pose))
        yield _kind(kind), reference, others, partial(source.wrong, element)


def _binary_frames(source: Opened) -> Iterator[tuple[int, str, int]]:
    cursor, entries = _entries(source)
    for _ in entries:
        number, *_, count = cursor.take("<II7dI", "frame")
        for _ in range(count):
            kind, _, image = cursor.take("<iIQ", f"frame {number}")
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
