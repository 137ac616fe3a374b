"""COLMAP's models: cameras, rigs, images, tie points and orientations, text or binary.

Layouts: https://colmap.github.io/format.html. Binary files are little-endian without padding, and
each begins with the number of its entries, 64 bits. Pixels count from the outer corner of the
top-left one; poses take the world to the camera's axes, x right, y down, z ahead.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
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

MAY_BE_EMPTY = ("points3D", *MAYBE)
"""Files that may be empty: COLMAP's manual makes models of known poses in this way."""

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


@dataclass(frozen=True, kw_only=True, eq=False)
class _Image:
    """An image: its pose is the world's in the camera's axes, `points` are those of `xy`."""

    number: int
    name: str
    camera: int
    pose: Pose
    xy: Array
    points: Index
    wrong: Wrong


@dataclass(frozen=True, kw_only=True, eq=False)
class _Rig:
    """The camera whose axes are a rig's, and the rig in the others' axes; None if not known."""

    reference: int
    others: Mapping[int, Pose | None]


@dataclass(frozen=True, kw_only=True, eq=False)
class _Model:
    """The content of the files: lenses, images, points, their places, rigs, image to frame."""

    sources: tuple[Opened, ...]
    cameras: Mapping[int, Lens]
    images: tuple[_Image, ...]
    points: tuple[Index, Array]
    rigs: tuple[_Rig, ...]
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
            assumed=(ASSUMED[0], *((metres,) if model.rigs else ())),
        )
    _require(model)
    T_w_i = stacked([image.pose for image in model.images]).inverse
    T_w_c = Pose(R=T_w_i.R @ FLIP, r=T_w_i.r)
    measured, lost = _measured(model)
    in_grid, placed = _in_grid(folder, crs, T_w_c)
    unscaled = sum(pose is not None for rig in model.rigs for pose in rig.others.values())
    unknown = sum(pose is None for rig in model.rigs for pose in rig.others.values())
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
                unscaled if crs is None else 0
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
    for ending, readers in READERS.items():
        paths = {name: folder / f"{name}{ending}" for name in (*NAMES, *MAYBE)}
        if not paths["cameras"].exists():
            continue
        has_images = any(paths[name].exists() for name in NAMES[1:])
        files: dict[str, Opened] = {}
        for name in ("cameras", *(NAMES[1:] if has_images else ()), *MAYBE):
            path = paths[name]
            if name in MAY_BE_EMPTY and path.is_file() and not path.stat().st_size:
                continue
            if name not in MAYBE or path.exists():
                files[name] = safe.read(path)
        none = np.zeros(0, dtype=np.int64), np.zeros((0, 3))
        return _Model(
            sources=tuple(files.values()),
            points=readers["points3D"](files["points3D"]) if "points3D" in files else none,
            cameras=readers["cameras"](files["cameras"]),
            images=tuple(readers["images"](files["images"])) if "images" in files else (),
            rigs=tuple(readers["rigs"](files["rigs"])) if "rigs" in files else (),
            frames=readers["frames"](files["frames"]) if "frames" in files else {},
        )
    inside = sorted(folder.glob("**/cameras.bin")) + sorted(folder.glob("**/cameras.txt"))
    hint = f" ({inside[0].parent} has them)" if inside else ""
    found_none = f"has neither cameras.bin nor cameras.txt{hint}"
    expected = "must be the folder of a model, often sparse/0"
    raise refusal(str(source), 1, "folder", found_none, expected)


def _require(model: _Model) -> None:
    """Raise where images do not fit to cameras, to each other or to names of a flight."""
    places: dict[str, _Image] = {}
    seen: set[tuple[int, int]] = set()
    for image in model.images:
        if image.camera not in model.cameras:
            raise image.wrong(f"{quoted(image.name)}: camera {image.camera}", "must be in cameras")
        if image.name in places:
            raise image.wrong(f"{quoted(image.name)} is there twice", "must be unique")
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
    mounts: dict[int, Pose] = {}
    for rig in model.rigs:
        for number, pose in rig.others.items():
            if pose is not None:
                back = pose.inverse
                r = FLIP @ back.r if is_metric else np.zeros(3)
                mounts[number] = Pose(R=turned(back.R), r=r)
    return {
        _named(i): replace(lens, mount=mounts.get(i, AHEAD)) for i, lens in model.cameras.items()
    }


def _exposures(model: _Model) -> list[str]:
    """Return the exposure of each image: the first image of its frame, of the rig's own camera."""
    references = {rig.reference for rig in model.rigs}
    leaders: dict[int, _Image] = {}
    for image in model.images:
        frame = model.frames.get(image.number)
        if frame is not None and (frame not in leaders or image.camera in references):
            leaders[frame] = image
    frames = [model.frames.get(image.number, -1) for image in model.images]
    pairs = zip(model.images, frames, strict=True)
    return [leaders[frame].name if frame in leaders else image.name for image, frame in pairs]


def _measured(model: _Model) -> tuple[Measured, dict[str, int]]:
    """Return measurements that belong to points, a point once in each image, and the others."""
    ids, x_w = model.points
    image = np.repeat(np.arange(len(model.images)), [len(shot.points) for shot in model.images])
    point = np.concatenate([shot.points for shot in model.images])
    colrow = np.concatenate([shot.xy for shot in model.images]) - HALF
    order = np.argsort(ids, kind="stable")
    row_of_point = np.searchsorted(ids, point, sorter=order)
    row_of_point = (
        order[np.minimum(row_of_point, len(order) - 1)] if len(order) else np.zeros_like(point)
    )
    matched = point != UNMATCHED
    known = matched & (ids[row_of_point] == point if len(order) else False)
    first = np.zeros(len(point), dtype=bool)
    pairs = np.stack([image, point], axis=1)[known]
    if len(pairs):
        rows = np.unique(pairs, axis=0, return_index=True)[1]
        first[np.flatnonzero(known)[rows]] = True
    measured = Measured(
        points=tuple(ids.astype(str).tolist()),
        x_w=x_w,
        image_idx=image[first],
        point_idx=row_of_point[first],
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


def _lens(name: str, width: float, height: float, parameters: Array, wrong: Wrong) -> Lens:
    """Return a camera after checks."""
    if name not in MODELS:
        raise wrong(f"lens model {quoted(name)}", f"must be one of {', '.join(MODELS)}")
    if width not in PIXELS or height not in PIXELS:
        raise wrong(f"{width} x {height} px", f"width and height {PIXELS}")
    formula = MODELS[name]
    if len(parameters) != len(formula.names):
        expected = f"must be {', '.join(formula.names)}"
        raise wrong(f"{name} has {len(parameters)} parameters", expected)
    _require_size(parameters, wrong)
    values = parameters.tolist()
    first = formula.names.index("cx")
    if min(values[:first]) <= 0:
        raise wrong(f"{name} {values}", "focal lengths must be positive")
    cx, cy = values[first : first + 2]
    return Lens(
        width_px=int(width),
        height_px=int(height),
        hole=Pinhole(fx=values[0], fy=values[first - 1], cx=cx - HALF, cy=cy - HALF),
        distortion=formula.distortion(values),
        is_fisheye=formula.is_fisheye,
        wrong=wrong,
    )


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


def _text_cameras(source: Opened) -> dict[int, Lens]:
    lenses: dict[int, Lens] = {}
    for line in _lines(source):
        if not line.cells:
            continue
        number = line.whole_at(0, "CAMERA_ID")
        if number in lenses:
            raise line.wrong("CAMERA_ID", f"{number} is there twice", "must be unique")
        lenses[number] = _lens(
            line.cell(1, "MODEL"),
            line.number_at(2, "WIDTH"),
            line.number_at(3, "HEIGHT"),
            line.numbers(4, None, "PARAMS"),
            partial(line.wrong, "camera"),
        )
    return lenses


def _text_images(source: Opened) -> Iterator[_Image]:
    """Yield images from two lines each; the second, with measurements, may be blank."""
    lines = _lines(source, cells=9)
    for line in lines:
        if not line.cells:
            continue
        wrong = partial(line.wrong, "image")
        values = line.numbers(1, 8, "QW, QX, QY, QZ, TX, TY, TZ")
        below = next(lines, Line(file=line.file, number=line.number + 1, cells=()))
        xy, points = _text_measurements(below)
        yield _Image(
            number=line.whole_at(0, "IMAGE_ID"),
            name=line.cell(9, "NAME"),
            camera=line.whole_at(8, "CAMERA_ID"),
            pose=_pose(values, wrong),
            xy=xy,
            points=points,
            wrong=wrong,
        )


def _text_measurements(line: Line) -> tuple[Array, Index]:
    whole = Line(file=line.file, number=line.number, cells=tuple(" ".join(line.cells).split()))
    if len(whole) % 3:
        raise whole.wrong("POINTS2D", f"{len(whole)} cells", "must be X, Y, POINT3D_ID of each")
    values = whole.numbers(0, None, "POINTS2D").reshape(-1, 3)
    if (values[:, 2] != np.round(values[:, 2])).any() or (np.abs(values[:, 2]) > 2**53).any():
        raise whole.wrong("POINT3D_ID", "is not whole", "must be a whole number, or -1")
    _require_size(values[:, :2], partial(whole.wrong, "POINTS2D"))
    return values[:, :2], values[:, 2].astype(np.int64)


def _text_points(source: Opened) -> tuple[Index, Array]:
    ids, xyz = [], []
    for line in _lines(source, cells=4):
        if line.cells:
            ids.append(line.whole_at(0, "POINT3D_ID"))
            xyz.append(line.numbers(1, 4, "X, Y, Z"))
            _require_size(xyz[-1], partial(line.wrong, "X, Y, Z"))
    return np.array(ids, dtype=np.int64), np.array(xyz, dtype=float).reshape(-1, 3)


def _text_rigs(source: Opened) -> Iterator[_Rig]:
    """Yield rigs: number, count, reference sensor, then type, number and pose of each other."""
    for line in _lines(source):
        if not line.cells or line.whole_at(1, "NUM_SENSORS") < 1:
            continue
        others: dict[int, Pose | None] = {}
        k = 4
        while k < len(line):
            kind, number = line.cell(k, "SENSOR_TYPE"), line.whole_at(k + 1, "SENSOR_ID")
            has_pose = line.whole_at(k + 2, "HAS_POSE") != 0
            pose = None
            if has_pose:
                wrong = partial(line.wrong, "sensor")
                pose = _pose(line.numbers(k + 3, k + 10, "pose"), wrong)
            if kind == "CAMERA":
                others[number] = pose
            k += 10 if has_pose else 3
        if line.cell(2, "REF_SENSOR_TYPE") != "CAMERA":
            raise line.wrong("REF_SENSOR_TYPE", quoted(line.cells[2]), "must be CAMERA")
        yield _Rig(reference=line.whole_at(3, "REF_SENSOR_ID"), others=others)


def _text_frames(source: Opened) -> dict[int, int]:
    """Return the frame of each image: number, rig, pose, count; type, sensor, image of each."""
    frame_of_image: dict[int, int] = {}
    for line in _lines(source):
        if not line.cells:
            continue
        number, count = line.whole_at(0, "FRAME_ID"), line.whole_at(9, "NUM_DATA_IDS")
        if len(line) != 10 + 3 * count:
            raise line.wrong("DATA_IDS", f"{len(line) - 10} cells", f"must be {count} times 3")
        for k in range(10, len(line), 3):
            if line.cells[k] == "CAMERA":
                frame_of_image[line.whole_at(k + 2, "DATA_ID")] = number
    return frame_of_image


# binary

_MEASUREMENT = np.dtype([("xy", "<f8", 2), ("point", "<i8")])
"""A measurement; without a point its 64 bits are all set, which is -1 with a sign."""

_TRACK_ELEMENT = np.dtype("V8")
"""An image and a measurement of it."""

_CAMERA = 0
"""Type of a sensor that is a camera."""


def _entries(source: Opened, element: str, least: int) -> tuple[Cursor, int]:
    """Return a cursor behind the number of entries, and that number."""
    cursor = Cursor(source=source)
    (n,) = cursor.take("<Q", "number of entries")
    if n * least > cursor.left:
        count = f"{n} entries in {cursor.left} bytes"
        raise source.wrong(element, count, f"must have {least} bytes or more each")
    return cursor, n


def _binary_cameras(source: Opened) -> dict[int, Lens]:
    cursor, n = _entries(source, "camera", 24)
    names, lenses = list(MODELS), dict[int, Lens]()
    for k in range(n):
        number, kind, width, height = cursor.take("<IiQQ", f"camera {k + 1}")
        wrong = partial(source.wrong, f"camera {number}")
        if not 0 <= kind < len(names):
            known = ", ".join(f"{i} {name}" for i, name in enumerate(names))
            raise wrong(f"lens model {kind}", f"must be one of {known}")
        if number in lenses:
            raise wrong("is there twice", "must be unique")
        values = cursor.take(f"<{len(MODELS[names[kind]].names)}d", f"camera {number}")
        lenses[number] = _lens(names[kind], width, height, np.array(values), wrong)
    return lenses


def _binary_images(source: Opened) -> Iterator[_Image]:
    cursor, n = _entries(source, "image", 73)
    for k in range(n):
        element = f"image {k + 1}"
        number, *values, camera = cursor.take("<I7dI", element)
        name = cursor.text(element)
        (count,) = cursor.take("<Q", element)
        measured = cursor.array(_MEASUREMENT, count, element)
        wrong = partial(source.wrong, element)
        _require_size(measured["xy"], wrong)
        yield _Image(
            number=number,
            name=name,
            camera=camera,
            pose=_pose(np.array(values), wrong),
            xy=np.array(measured["xy"], dtype=float).reshape(-1, 2),
            points=np.array(measured["point"], dtype=np.int64),
            wrong=wrong,
        )


def _binary_points(source: Opened) -> tuple[Index, Array]:
    cursor, n = _entries(source, "point", 51)
    ids, xyz = np.empty(n, dtype=np.int64), np.empty((n, 3))
    for k in range(n):
        number, *place = cursor.take("<q3d", "point")
        ids[k], xyz[k] = number, place
        _, _, _, _, length = cursor.take("<3BdQ", "point")
        cursor.array(_TRACK_ELEMENT, length, f"track of point {number}")
    _require_size(xyz, partial(source.wrong, "point"))
    return ids, xyz


def _binary_rigs(source: Opened) -> Iterator[_Rig]:
    cursor, n = _entries(source, "rig", 8)
    for _ in range(n):
        number, count = cursor.take("<II", "rig")
        element = f"rig {number}"
        if count == 0:
            continue
        kind, reference = cursor.take("<iI", element)
        others: dict[int, Pose | None] = {}
        for _ in range(count - 1):
            other, sensor, has_pose = cursor.take("<iIB", element)
            wrong = partial(source.wrong, element)
            pose = _pose(np.array(cursor.take("<7d", element)), wrong) if has_pose else None
            if other == _CAMERA:
                others[sensor] = pose
        if kind != _CAMERA:
            raise source.wrong(element, f"reference sensor of type {kind}", "must be a camera, 0")
        yield _Rig(reference=reference, others=others)


def _binary_frames(source: Opened) -> dict[int, int]:
    cursor, n = _entries(source, "frame", 68)
    frame_of_image: dict[int, int] = {}
    for _ in range(n):
        number, *_, count = cursor.take("<II7dI", "frame")
        for _ in range(count):
            kind, _, image = cursor.take("<iIQ", f"frame {number}")
            if kind == _CAMERA:
                frame_of_image[image] = number
    return frame_of_image


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
