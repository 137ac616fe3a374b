"""A project of OpenSfM or ODM as a flight, as far as its files are there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from acx4lib.exchange.brought import Brought, number_of
from acx4lib.exchange.programs.opensfm import control, lens, project
from acx4lib.exchange.programs.opensfm import place as places
from acx4lib.exchange.programs.opensfm.control import Control
from acx4lib.exchange.programs.opensfm.project import Project, Shots
from acx4lib.exchange.programs.shared import cameras, oriented, proof, tables
from acx4lib.exchange.programs.shared.cameras import Lens, Refitted
from acx4lib.exchange.programs.shared.oriented import Oriented
from acx4lib.exchange.safe import opened
from acx4lib.exchange.safe.json_tree import Node
from acx4lib.expected import Array
from acx4lib.flight.text.in_memory import Columns
from acx4lib.geometry.frames import Pose

ASSUMED = (
    "normalised pixels count from the middle of the image, whose longer side is 1, y down",
    "rotation and translation of a shot take object points to its camera: x right, y down, z ahead",
)


def read(
    source: Path,
    *,
    camera: str = "adjusted",
    orientations: str = "initial",
    block: str | None = None,
    crs: str | None = None,
    pixel_um: float | None = None,
) -> Brought:
    """Read a project of OpenSfM or ODM.

    Parameters
    ----------
    source : Path
        Its folder, the folder of an ODM project, or one file reconstruction.json or cameras.json.
    camera : {"adjusted", "initial"}
        Cameras of reconstruction.json, or of camera_models.json.
    orientations : {"initial", "adjusted", "none"}
        What becomes the trajectory. The project has measured positions, but no attitudes with them.
    block : str, optional
        By default calibration; heads where images of a rig were taken together.
    crs : str, optional
        Of the flight; by default the UTM zone of the project's origin.
    pixel_um : float, optional
        Pixel size.

    Raises
    ------
    FlightError
        For files that are not those of OpenSfM, or a reconstruction without what is asked for.
    """
    found = project.project_of(source)
    root, left_out = project.reconstruction(found)
    if root is None:
        return _cameras_alone(found, pixel_um)
    shots = project.shots(root, found.tree("rig_assignments.json"))
    refitted = _refitted(found, root, shots, camera, pixel_um)
    images = _images(found, root, shots, refitted)
    place = places.read(found, root, shots, crs)
    block = block or images.block
    brought = _brought(found, root, images, refitted, block)
    brought = _with_control(brought, found, images, place, block)
    if orientations == "adjusted":
        brought = _with_trajectory(brought, root, images, place, block)
    return replace(
        brought, left_out=(*brought.left_out, *left_out, *_not_used(shots, orientations))
    )


def images_of(source: Path) -> Oriented:
    """Return the images of a project in its own frame, with the adjusted cameras."""
    found = project.project_of(source)
    root, _ = project.reconstruction(found)
    if root is None:
        raise opened.refusal(str(source), 1, "file", "has no reconstruction", "must have one")
    shots = project.shots(root, found.tree("rig_assignments.json"))
    return _images(found, root, shots, _refitted(found, root, shots, "adjusted", None))


def _cameras_alone(found: Project, pixel_um: float | None) -> Brought:
    """Return the cameras of a project in which nothing is oriented yet."""
    node = found.tree(*project.MODELS)
    if node is None:
        where = str(found.folder / project.TRACKS)
        wanted = f"needs {project.RECONSTRUCTION} beside it, which names the cameras of the images"
        raise opened.refusal(where, 1, "file", "alone", wanted)
    lenses = {name: lens.read(one) for name, one in node.items()}
    refitted = _fitted(node, lenses, pixel_um)
    return Brought(
        source="OpenSfM's cameras",
        sha256=opened.checksums(found.read.values()),
        settings=refitted.settings,
        assumed=(ASSUMED[0], *refitted.assumed),
        found=refitted.found,
    )


def _refitted(
    found: Project, root: Node, shots: Shots, camera: str, pixel_um: float | None
) -> Refitted:
    """Return the cameras, or the heads of rigs, with their places in the rig."""
    models = found.tree(*project.MODELS) if camera == "initial" else root.one("cameras")
    if models is None:
        wanted = f"must be beside it for the cameras before the adjustment ({project.MODELS[0]})"
        raise root.wrong("has cameras after the adjustment only", wanted)
    mounts = project.rig_mounts(root.maybe("rig_cameras") or found.tree("rig_cameras.json"))
    lenses: dict[str, Lens] = {}
    for head, model in dict(zip(shots.heads, shots.models, strict=True)).items():
        mount = mounts.get(head)
        one = lens.read(models.one(model))
        lenses[head] = one if mount is None else replace(one, mount=_of_library(mount))
    return _fitted(models, lenses, pixel_um)


def _fitted(models: Node, lenses: Mapping[str, Lens], pixel_um: float | None) -> Refitted:
    try:
        return cameras.refitted(lenses, pixel_um=pixel_um)
    except ValueError as error:
        raise models.wrong(str(error), "must be a lens that a flight can have") from None


def _of_library(T_r_v: Pose) -> Pose:
    """Return poses between axes with y down, z ahead as those between the library's."""
    return Pose(R=cameras.turned(T_r_v.R), r=T_r_v.r @ cameras.FLIP)


def _images(found: Project, root: Node, shots: Shots, refitted: Refitted) -> Oriented:
    """Return shots, points and measurements."""
    known = root.maybe("points")
    x_w = {} if known is None else project.points(known)
    source = found.maybe(project.TRACKS)
    images, names, points = ([], [], np.zeros((0, 2))) if source is None else project.tracks(source)
    row_of = {name: row for row, name in enumerate(shots.names)}
    used = np.array([image in row_of for image in images], dtype=bool)
    image_idx = np.array([row_of[image] for image in images if image in row_of], dtype=int)
    tracks, point_idx = tables.first_use([n for n, one in zip(names, used, strict=True) if one])
    sizes = [refitted.cameras[head] for head in shots.heads]
    wh = np.array([(one.width_px, one.height_px) for one in sizes])[image_idx]
    return Oriented(
        cameras=refitted.cameras,
        images=shots.names,
        camera_of=shots.heads,
        exposure_of=shots.instances,
        T_w_c=Pose(R=shots.T_w_v.R @ cameras.FLIP, r=shots.T_w_v.r),
        points=tuple(tracks),
        x_w=np.array([x_w.get(track, [np.nan] * 3) for track in tracks]).reshape(-1, 3),
        image_idx=image_idx,
        point_idx=point_idx,
        colrow=points[used] * wh.max(axis=1, initial=0)[:, None] + (wh - 1) / 2,
    )


def _brought(
    found: Project, root: Node, images: Oriented, refitted: Refitted, block: str
) -> Brought:
    ties = len(set(images.point_idx.tolist()))
    counts = (
        f"{number_of(len(images.images), 'images')} of {number_of(len(images.cameras), 'cameras')}"
    )
    return Brought(
        source="OpenSfM",
        sha256=opened.checksums(found.read.values()),
        settings=refitted.settings,
        tables=oriented.tables_of(images, block, root.source),
        assumed=(*ASSUMED, *refitted.assumed),
        found=(
            f"{counts}, {number_of(ties, 'tie points')} with "
            f"{number_of(len(images.colrow), 'measurements')}",
            oriented.proved(images, "the program's own points"),
            *refitted.found,
        ),
    )


def _with_control(
    brought: Brought, found: Project, images: Oriented, place: places.Place | None, block: str
) -> Brought:
    """Return what was brought with the control points of the project and their measurements."""
    files = [one for one in map(found.maybe, control.FILES) if one is not None]
    if not files:
        return brought
    if place is None:
        said = f"{files[0].name}: the reconstruction has no place on the Earth"
        return replace(brought, left_out=(*brought.left_out, said))
    sizes = {
        image: (images.cameras[name].width_px, images.cameras[name].height_px)
        for image, name in zip(images.images, images.camera_of, strict=True)
    }
    points = control.read(files[0], sizes, place.frame.grid.crs)
    known, colrow = control.colrow(points, sizes)
    measured = tables.image_points(
        [points.images[k] for k in known], [points.points[k] for k in known], colrow
    )
    name = f"{block}/image_points.csv"
    ties = _renamed(brought.tables.get(name), set(points.points))
    both = {"control_points.csv": points.table(place.frame.grid), name: _joined(measured, ties)}
    return replace(
        brought,
        sha256=opened.checksums(found.read.values()),
        settings={**brought.settings, **place.settings},
        tables={**brought.tables, **both},
        assumed=(*brought.assumed, *place.said),
        found=(
            *brought.found,
            f"{number_of(len(points.names) - points.flat, 'control points')} with "
            f"{number_of(len(known), 'measurements')}",
            _proved(points, images, place, known, colrow),
        ),
        left_out=(
            *brought.left_out,
            *_of_control(points, len(known)),
            *(f"{one.name}: {files[0].name} is taken" for one in files[1:]),
        ),
    )


def _of_control(points: Control, measured: int) -> tuple[str, ...]:
    """Return sentences on control points and measurements that could not be used."""
    lost = len(points.images) - measured
    said = (
        f"{number_of(points.flat, 'control points')} without an altitude",
        f"{number_of(lost, 'measurements')} of control points in images that were not oriented",
    )
    return tuple(one for one, n in zip(said, (points.flat, lost), strict=True) if n)


def _proved(
    points: Control, images: Oriented, place: places.Place, known: list[int], colrow: Array
) -> str:
    """Return the sentence on how well the surveyed points are met."""
    x_m = dict(zip(points.names, place.frame.from_geographic(points.lonlath), strict=True))
    row_of = {image: row for row, image in enumerate(images.images)}
    rows = [k for k in range(len(known)) if points.points[known[k]] in x_m]
    idx = [row_of[points.images[known[k]]] for k in rows]
    apart = proof.misfits(
        images.cameras,
        [images.camera_of[i] for i in idx],
        place.in_frame(images.T_w_c[np.array(idx, dtype=int)]),
        np.array([x_m[points.points[known[k]]] for k in rows]).reshape(-1, 3),
        colrow[rows],
    )
    return f"control points, by the adjusted orientations: {proof.said(apart)}"


def _renamed(ties: Columns | None, taken: set[str]) -> Columns:
    """Return a table of tie points none of which has the name of a control point."""
    if ties is None:
        return {}
    names = list(ties["point"])
    if not taken.intersection(names):
        return ties
    return {**_columns(ties), "point": [f"track {name}" for name in names]}


def _columns(table: Columns) -> dict[str, Any]:
    return {name: table[name] for name in ("image", "point", "col_px", "row_px")}


def _joined(first: Columns, second: Columns) -> Columns:
    """Return the rows of two tables with the same columns, the second may be empty."""
    if not second:
        return first
    return {name: [*first[name], *second[name]] for name in _columns(first)}


def _with_trajectory(
    brought: Brought, root: Node, images: Oriented, place: places.Place | None, block: str
) -> Brought:
    """Return what was brought with the adjusted orientations as the trajectory."""
    if place is None:
        found = "has no measured position: the adjusted orientations are nowhere on the Earth"
        raise root.one("shots").wrong(found, "must have gps_position, with reference_lla")
    first_of: dict[str, int] = {}
    for i, one in enumerate(images.exposure_of):
        first_of.setdefault(one, i)
    first = np.array([*first_of.values()], dtype=int)
    mounts = [images.cameras[images.camera_of[i]].T_b_c for i in first]
    T_b_c = Pose(R=np.array([one.R for one in mounts]), r=np.array([one.r for one in mounts]))
    T_m_b = place.in_frame(images.T_w_c[first]) @ T_b_c.inverse
    exposures = [images.exposure_of[i] for i in first]
    table = oriented.trajectory(T_m_b, exposures, place.frame)
    said = (
        "the adjusted orientations stand for the trajectory: the body is the camera, or the rig, "
        "so that a boresight and a lever arm found with them mean nothing"
    )
    assumed = tuple(dict.fromkeys((*brought.assumed, *place.said, said)))
    return replace(
        brought,
        settings={**brought.settings, **place.settings},
        tables={**brought.tables, f"{block}/trajectory.csv": table},
        assumed=assumed,
        found=(*brought.found, f"{len(exposures)} adjusted orientations"),
    )


def _not_used(shots: Shots, orientations: str) -> tuple[str, ...]:
    """Return sentences on positions and orientations that are in no table."""
    measured = int(np.isfinite(shots.gps).all(axis=1).sum())
    said = (
        f"{measured} measured positions: without attitudes they are no trajectory",
        f"{len(shots.names)} adjusted orientations (--orientations adjusted)",
    )
    return tuple(
        one for one, n in zip(said, (measured, orientations != "adjusted"), strict=True) if n
    )
