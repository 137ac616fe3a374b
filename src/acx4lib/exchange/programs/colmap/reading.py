"""COLMAP's models: cameras, rigs, images, tie points, and orientations where they are wanted."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acx4lib.exchange.brought import Brought, number_of
from acx4lib.exchange.programs.colmap.binary import BINARY
from acx4lib.exchange.programs.colmap.lens import HALF, MODELS
from acx4lib.exchange.programs.colmap.model import UNMATCHED, Camera, Image, Model
from acx4lib.exchange.programs.colmap.text import TEXT
from acx4lib.exchange.programs.shared import adjusted, proof, tables
from acx4lib.exchange.programs.shared.adjusted import Flown
from acx4lib.exchange.programs.shared.cameras import AHEAD, FLIP, Lens, Refitted, refitted, turned
from acx4lib.exchange.safe import opened
from acx4lib.exchange.safe.opened import checksums, refusal
from acx4lib.expected import Array, Index
from acx4lib.flight.problems import quoted
from acx4lib.flight.text.in_memory import Columns
from acx4lib.geometry.camera import Camera as OwnCamera
from acx4lib.geometry.frames import Pose

NAMES = ("cameras", "images", "points3D")
"""Files of a model; their endings are .bin or .txt."""

MAYBE = ("rigs", "frames")
"""Files that models of COLMAP 3.12 and later have as well."""

MAY_BE_EMPTY = ("points3D", *MAYBE)
"""Files of no content stand for none: COLMAP's manual makes models of known poses so."""

ASSUMED = (
    "Pixels: COLMAP counts from the outer corner of the top-left one, so 0.5 is taken off",
    "Poses take the world to the camera's axes: x right, y down, z ahead",
)


@dataclass(frozen=True, kw_only=True, eq=False)
class Tracks:
    """Measurements that belong to points.

    Attributes
    ----------
    image : ndarray, shape (n,)
        Place of the image.
    point : ndarray, shape (n,)
        Number of the point.
    xyz : ndarray, shape (n, 3)
        The point.
    colrow : ndarray, shape (n, 2)
        The library's pixels.
    without, again, lost : int
        Measurements without a point, second ones of a point in an image, and of points that the
        model has not.
    """

    image: Index
    point: Index
    xyz: Array
    colrow: Array
    without: int
    again: int
    lost: int


def read(
    source: Path,
    *,
    orientations: str = "none",
    block: str | None = None,
    crs: str | None = None,
    pixel_um: float | None = None,
) -> Brought:
    """Read a model.

    Parameters
    ----------
    source : Path
        Its folder, or a file in it; binary files are taken where there are both, as COLMAP does.
    orientations : str
        The trajectory: "adjusted" or "none"; a model has none that was measured.
    block : str, optional
        Name of the block; by default heads for a rig, else calibration.
    crs : str, optional
        Projected CRS in whose east, north and height the model's coordinates are, or whose ECEF
        frame; needed for orientations.
    pixel_um : float, optional
        Pixel size; by default 5 µm.

    Raises
    ------
    FlightError
        Where the folder has no model, or something in it cannot be.
    """
    model = _model(source)
    source = source.parent if source.is_file() else source
    if not model.images:
        return _cameras_alone(model, pixel_um)
    _require(model)
    named = {i: f"camera {i}" for i in model.cameras}
    mounts = _mounts(model, is_metric=crs is not None)
    fitted = _fitted(model, named, mounts, pixel_um)
    tracks, exposures, T_w_c = _tracks(model), _exposures(model), _poses(model)
    of_image = [mounts.get(one.camera, AHEAD) for one in model.images]
    mounted = Pose(R=np.stack([m.R for m in of_image]), r=np.stack([m.r for m in of_image]))
    flown = adjusted.flown(source, exposures, T_w_c @ mounted.inverse, crs=crs, wanted=orientations)
    folder = block or ("heads" if len(set(exposures)) < len(exposures) else "calibration")
    return Brought(
        source="COLMAP",
        sha256=checksums(model.sources),
        settings={"name": source.resolve().name, **flown.settings, **fitted.settings},
        tables=_tables(folder, model, named, exposures, tracks, flown),
        assumed=(*ASSUMED, *fitted.assumed, *flown.assumed),
        found=(
            f"{number_of(len(model.images), 'images')} of "
            f"{number_of(len(set(exposures)), 'exposures')}, "
            f"{number_of(len(model.cameras), 'cameras')}, "
            f"{number_of(len(model.points), 'points')}",
            f"{number_of(len(tracks.image), 'measurements')} of tie points",
            *fitted.found,
            *_proof(fitted.cameras, model, named, T_w_c, tracks),
        ),
        left_out=(*_left_out(model, tracks, is_metric=crs is not None), *flown.left_out),
    )


def _cameras_alone(model: Model, pixel_um: float | None) -> Brought:
    """Return the cameras and rigs of a folder without images; lever arms are taken to be in m."""
    named = {i: f"camera {i}" for i in model.cameras}
    fitted = _fitted(model, named, _mounts(model, is_metric=True), pixel_um)
    metres = "Lever arms of cameras in rigs are metres: without images nothing tells their unit"
    return Brought(
        source="COLMAP's cameras",
        sha256=checksums(model.sources),
        settings=fitted.settings,
        assumed=(ASSUMED[0], *fitted.assumed, *((metres,) if model.rigs else ())),
        found=fitted.found,
    )


def _model(source: Path) -> Model:
    """Return the model of a folder, or of that of a file."""
    folder = source.parent if source.is_file() else source
    for encoding in (BINARY, TEXT):
        paths = {name: folder / f"{name}{encoding.ending}" for name in (*NAMES, *MAYBE)}
        if paths[NAMES[0]].exists():
            has_images = any(paths[name].exists() for name in NAMES[1:])
            files = {}
            for name in (NAMES[0], *(NAMES[1:] if has_images else ()), *MAYBE):
                path = paths[name]
                if name in MAY_BE_EMPTY and path.is_file() and not path.stat().st_size:
                    continue
                if name not in MAYBE or path.exists():
                    files[name] = opened.read(path)
            return encoding.read(files)
    inside = sorted(folder.glob("**/cameras.bin")) + sorted(folder.glob("**/cameras.txt"))
    hint = f" ({inside[0].parent} has them)" if inside else ""
    raise refusal(
        str(source),
        1,
        "folder",
        f"has neither cameras.bin nor cameras.txt{hint}",
        "must be the folder of a model, often sparse/0",
    )


def _require(model: Model) -> None:
    """Raise where images do not fit to cameras, to each other or to names of a flight."""
    places: dict[str, Image] = {}
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
    tables.require_names(
        list(places), lambda name, found, expected: places[name].wrong(found, expected)
    )


def _mounts(model: Model, *, is_metric: bool) -> dict[int, Pose]:
    """Return the mountings of cameras of rigs; lever arms only where the model's unit is metres."""
    mounts = {}
    for rig in model.rigs:
        for number, there in rig.others.items():
            if there is not None:
                back = there.inverse
                r = FLIP @ back.r if is_metric else np.zeros(3)
                mounts[number] = Pose(R=turned(back.R), r=r)
    return mounts


def _fitted(
    model: Model, named: Mapping[int, str], mounts: Mapping[int, Pose], pixel_um: float | None
) -> Refitted:
    used = {image.camera for image in model.images} or set(model.cameras)
    lenses = {
        named[i]: _lens(one, mounts.get(i, AHEAD)) for i, one in model.cameras.items() if i in used
    }
    try:
        return refitted(lenses, pixel_um=pixel_um)
    except ValueError as error:
        cameras = model.sources[0]
        raise cameras.wrong("camera", str(error), "must be one of a flight") from None


def _lens(camera: Camera, mount: Pose) -> Lens:
    kind, values = MODELS[camera.model], camera.parameters
    return Lens(
        width_px=camera.width,
        height_px=camera.height,
        hole=kind.hole(values),
        ideal=lambda colrow: kind.ideal(colrow, values),
        mount=mount,
    )


def _exposures(model: Model) -> list[str]:
    """Return the exposure of each image: the first image of its frame, of the rig's own camera."""
    references = {rig.reference for rig in model.rigs}
    leaders: dict[int, Image] = {}
    for image in model.images:
        frame = model.frames.get(image.number)
        if frame is not None and (frame not in leaders or image.camera in references):
            leaders[frame] = image
    frames = [model.frames.get(image.number, -1) for image in model.images]
    pairs = zip(model.images, frames, strict=True)
    return [leaders[frame].name if frame in leaders else image.name for image, frame in pairs]


def _poses(model: Model) -> Pose:
    """Return T_w_c of each image, the library's camera axes."""
    there = Pose(
        R=np.stack([one.pose.R for one in model.images]),
        r=np.stack([one.pose.r for one in model.images]),
    ).inverse
    return Pose(R=there.R @ FLIP, r=there.r)


def _tracks(model: Model) -> Tracks:
    """Return the measurements that belong to points, a point once in each image."""
    image = np.repeat(np.arange(len(model.images)), [len(one.points) for one in model.images])
    point = np.concatenate([one.points for one in model.images])
    colrow = np.concatenate([one.xy for one in model.images]) - HALF
    order = np.argsort(model.point_ids, kind="stable")
    at = np.searchsorted(model.point_ids, point, sorter=order)
    at = order[np.minimum(at, len(order) - 1)] if len(order) else np.zeros_like(point)
    matched = point != UNMATCHED
    known = matched & (model.point_ids[at] == point if len(order) else False)
    first = np.zeros(len(point), dtype=bool)
    pairs = np.stack([image, point], axis=1)[known]
    if len(pairs):
        rows = np.unique(pairs, axis=0, return_index=True)[1]
        first[np.flatnonzero(known)[rows]] = True
    return Tracks(
        image=image[first],
        point=point[first],
        xyz=model.points[at[first]] if len(order) else np.zeros((0, 3)),
        colrow=colrow[first],
        without=int((~matched).sum()),
        again=int((known & ~first).sum()),
        lost=int((matched & ~known).sum()),
    )


def _tables(
    folder: str,
    model: Model,
    named: Mapping[int, str],
    exposures: Sequence[str],
    tracks: Tracks,
    flown: Flown,
) -> dict[str, Columns]:
    names = [one.name for one in model.images]
    table: dict[str, Columns] = {
        f"{folder}/images.csv": tables.images(
            names, [named[one.camera] for one in model.images], exposures
        )
    }
    if len(tracks.image):
        table[f"{folder}/image_points.csv"] = tables.image_points(
            [names[i] for i in tracks.image], tracks.point.astype(str).tolist(), tracks.colrow
        )
    if flown.table is not None:
        table[f"{folder}/trajectory.csv"] = flown.table
    return table


def _proof(
    cameras: Mapping[str, OwnCamera],
    model: Model,
    named: Mapping[int, str],
    T_w_c: Pose,
    tracks: Tracks,
) -> tuple[str, ...]:
    if not len(tracks.image):
        return ()
    of = [named[model.images[i].camera] for i in tracks.image]
    apart = proof.misfits(cameras, of, T_w_c[tracks.image], tracks.xyz, tracks.colrow)
    return (
        f"COLMAP's own points are reprojected by the cameras as imported to {proof.said(apart)}",
    )


def _left_out(model: Model, tracks: Tracks, *, is_metric: bool) -> tuple[str, ...]:
    unknown = sum(there is None for rig in model.rigs for there in rig.others.values())
    others = sum(there is not None for rig in model.rigs for there in rig.others.values())
    unscaled = 0 if is_metric else others
    counted = (
        (tracks.without, "measurements that belong to no point"),
        (tracks.again, "second measurements of a point in one image"),
        (tracks.lost, "measurements of points that the model has not"),
        (unknown, "cameras of rigs without a pose in the rig: their mountings are 0"),
        (unscaled, "lever arms of cameras in rigs: without a CRS the model has no metres"),
    )
    return tuple(f"{n} {what}" for n, what in counted if n)
