"""Trajectories of a chunk, measured or adjusted, and what proves that cameras were read rightly."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from acx4lib.exchange.brought import number_of
from acx4lib.exchange.programs.metashape.files import Chunk, setting
from acx4lib.exchange.programs.metashape.markers import Locations, Surveyed
from acx4lib.exchange.programs.metashape.shots import (
    ANGLES,
    LARGEST,
    LOCATION,
    Shot,
    accuracy,
    is_on,
    location,
    measured_place,
    measured_rotation,
    rotation,
)
from acx4lib.exchange.programs.shared import crs, proof, tables
from acx4lib.exchange.programs.shared.adjusted import MEANS_NOTHING, Flown
from acx4lib.exchange.programs.shared.cameras import is_rotation
from acx4lib.exchange.programs.shared.crs import Chosen
from acx4lib.exchange.safe.xml_tree import Element
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose, transform

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True, eq=False)
class Similarity:
    """The chunk's coordinates in the ECEF frame of its coordinate system: x_e = s R x + r.

    Where that is local, it has no such frame, and x_e are its own coordinates.
    """

    R: Array
    r: Array
    scale: float

    def pose(self, T_c: Pose) -> Pose:
        """Return poses in the ECEF frame."""
        return Pose(R=self.R @ T_c.R, r=self.r + self.scale * transform(self.R, T_c.r))

    def into_chunk(self, x_e: Array) -> Array:
        """Return a point of the ECEF frame, shape (3,), in the chunk."""
        return (x_e - self.r) @ self.R / self.scale


def told(chunk: Chunk, work: Callable[[], T], element: Element | None = None) -> T:
    """Return what a work makes; its ValueError becomes a problem at an element of the chunk."""
    try:
        return work()
    except ValueError as error:
        found = " ".join(str(error).split())
        raise (element or chunk.root).wrong(found, "must be what a flight can have") from None


def trajectory(
    chunk: Chunk, used: Mapping[str, Shot], system: Chosen | None, *, wanted: str
) -> Flown:
    """Return the trajectory of the exposures: measured ("initial"), adjusted, or none."""
    leaders = {one.exposure: one for one in used.values()}
    leaders |= {one.exposure: one for one in used.values() if one.name == one.exposure}
    if wanted == "adjusted":
        return _adjusted(chunk, leaders, system)
    if wanted == "none":
        return Flown()
    return _measured(chunk, leaders, system)


def _measured(chunk: Chunk, leaders: Mapping[str, Shot], system: Chosen | None) -> Flown:
    """Return the references that have position and angles, and neither is switched off."""
    rows = [
        (name, place, turned, one.reference)
        for name, one in leaders.items()
        if one.reference is not None
        and (place := measured_place(one.reference)) is not None
        and (turned := measured_rotation(one.reference)) is not None
    ]
    here = sum(
        one.reference is not None and measured_place(one.reference) is not None
        for one in leaders.values()
    )
    without, off = len(leaders) - len(rows), _switched_off(leaders)
    if not rows or system is None:
        why = (
            "the chunk has no coordinate system (--crs)"
            if rows
            else ("none has angles as well, which trajectory.csv needs")
        )
        said = (
            f"{here} measured camera positions: {why}; another import, or --orientations adjusted"
        )
        return Flown(left_out=(*off, *((said,) if here else ())))
    names, places, angles, references = zip(*rows, strict=True)
    lonlath, of_positions = _geographic(chunk, np.array(places), system)
    yaw, pitch, roll = np.array(angles).T
    north = "true north"
    if system.source is None:
        north = f"the north of {system.crs}, made true by the convergence"
        yaw = yaw + np.degrees(system.grid().convergence(lonlath[:, :2]))
    table: dict[str, object] = {
        "exposure": list(names),
        "lat_deg": np.round(lonlath[:, 1], tables.DEGREES + 1).tolist(),
        "lon_deg": np.round(lonlath[:, 0], tables.DEGREES + 1).tolist(),
        "height_m": np.round(lonlath[:, 2], tables.METRES).tolist(),
        "roll_deg": np.round(roll, tables.DEGREES).tolist(),
        "pitch_deg": np.round(pitch, tables.DEGREES).tolist(),
        "heading_deg": np.round(yaw, tables.DEGREES).tolist(),
        **_sigmas(chunk, references),
    }
    assumed = (
        *of_positions,
        f"Yaw is the heading, clockwise from {north}, pitch is positive with the top of the "
        "image up, roll with its right side down; positions are those of the camera",
        *_whose_accuracy(references),
    )
    left = (
        (f"{number_of(without, 'exposures')} without position and angles, images included",)
        if without
        else ()
    )
    return Flown(table=table, assumed=assumed, left_out=(*off, *left))


def _switched_off(leaders: Mapping[str, Shot]) -> tuple[str, ...]:
    """Return how many measured positions, and angles, Metashape was told not to use."""
    of = [one.reference for one in leaders.values() if one.reference is not None]
    places = sum(location(one) is not None and measured_place(one) is None for one in of)
    angles = sum(
        is_on(one) and rotation(one) is not None and measured_rotation(one) is None for one in of
    )
    counted = (
        (places, 'positions, with their angles, that are switched off (enabled="false")'),
        (angles, 'attitudes that are switched off (rotation_enabled="false")'),
    )
    return tuple(f"{n} measured {what}: they are not used" for n, what in counted if n)


def _whose_accuracy(references: tuple[Element, ...]) -> tuple[str, ...]:
    """Return how many references have accuracies of their own, where not all have."""
    kinds = (("positions", LOCATION), ("attitudes", ANGLES))
    n = len(references)
    own = {
        name: sum(bool(np.isfinite(accuracy(one, names)).all()) for one in references)
        for name, names in kinds
    }
    return tuple(
        f"{k} of {n} {name} have an accuracy of their own; others have the chunk's"
        for name, k in own.items()
        if 0 < k < n
    )


def _sigmas(chunk: Chunk, references: tuple[Element, ...]) -> dict[str, list[float]]:
    """Return the columns of accuracies that any reference has; the chunk's for those that lack one.

    Raises
    ------
    FlightError
        Where a reference lacks what others have, and the chunk has none for all.
    """
    kinds = (
        (LOCATION, ("east_m", "north_m", "height_m"), "accuracy_cameras"),
        (ANGLES, ("heading_deg", "pitch_deg", "roll_deg"), "accuracy_cameras_ypr"),
    )
    columns: dict[str, list[float]] = {}
    for names, units, common in kinds:
        sigma = np.array([accuracy(one, names) for one in references])
        lacking = np.isnan(sigma)
        if lacking.all():
            continue
        of_all = setting(chunk, common)
        if lacking.any() and of_all is None:
            bare = references[int(np.flatnonzero(lacking.any(axis=1))[0])]
            raise bare.wrong(
                f"has no accuracy of {', '.join(names)}", f"others have one; or {common} is needed"
            )
        sigma[lacking] = of_all or np.nan
        columns |= {f"sigma_{u}": v for u, v in zip(units, sigma.T.tolist(), strict=True)}
    return columns


def _geographic(chunk: Chunk, xyh: Array, system: Chosen) -> tuple[Array, tuple[str, ...]]:
    """Return longitude, latitude, height of references, and what is assumed of them."""
    source = system.source
    are_degrees = (np.abs(xyh[:, 0]) <= 180).all() and (np.abs(xyh[:, 1]) <= 90).all()
    element = chunk.root.maybe("reference")
    if source is not None and source.is_projected and are_degrees:
        grid = told(chunk, system.grid, element)
        enh = np.column_stack([grid.grid_from_lonlat(xyh[:, :2]), xyh[:, 2]])
        enh = told(chunk, lambda: crs.with_heights(system, enh, crs.heights_of(source)), element)
        said = (
            "Positions of cameras are longitude and latitude: as coordinates of the chunk's "
            "system they would lie at its origin"
        )
        return np.column_stack([xyh[:, :2], enh[:, 2]]), (said,)
    enh = told(chunk, lambda: crs.into(system, xyh), element)
    grid = told(chunk, system.grid, element)
    return np.column_stack([grid.lonlat_from_grid(enh[:, :2]), enh[:, 2]]), ()


def _adjusted(chunk: Chunk, leaders: Mapping[str, Shot], system: Chosen | None) -> Flown:
    """Return the adjusted poses as a trajectory of bodies that are the master cameras."""
    known = {name: one for name, one in leaders.items() if one.T_c is not None}
    element = chunk.root.maybe("reference")
    if system is None:
        raise (element or chunk.root).wrong(
            "is no coordinate system on the Earth", "adjusted orientations need one"
        )
    grid = told(chunk, system.grid, element)
    place = similarity(chunk)
    bodies = [
        place(one).pose(one.T_c @ one.sensor.lens.mount.inverse)
        for one in known.values()
        if one.T_c is not None
    ]
    T_e_b = Pose(R=np.stack([one.R for one in bodies]), r=np.stack([one.r for one in bodies]))
    if system.source is None:
        poses = T_e_b.r, T_e_b.opk
    else:
        poses = tables.grid_poses_of_ecef(grid, T_e_b)
    table = tables.trajectory_in_grid(list(known), *poses)
    return Flown(table=table, assumed=(MEANS_NOTHING,))


def similarity(chunk: Chunk) -> Callable[[Shot], Similarity]:
    """Return the transformation of the part of the chunk that an image belongs to, by the image."""
    transforms = {
        component.attributes.get("id", ""): _similarity(element)
        for component in chunk.root.each("components", "component")
        if (element := component.maybe("transform")) is not None
    }

    def of(shot: Shot) -> Similarity:
        if shot.component not in transforms:
            transforms[shot.component] = _similarity(chunk.root.one("transform"))
        return transforms[shot.component]

    return of


def _similarity(element: Element) -> Similarity:
    rotation = element.one("rotation")
    R = rotation.numbers(9).reshape(3, 3)
    if not is_rotation(R):
        raise rotation.wrong("is no rotation", "must be a rotation matrix, row by row")
    scale = element.maybe("scale")
    size = 1.0 if scale is None else scale.number()
    if scale is not None and not 0 < size <= LARGEST:
        raise scale.wrong(f"{size:g}", f"must be positive, at most {LARGEST:g}")
    place = element.one("translation")
    r = place.numbers(3)
    if np.abs(r).max() > LARGEST:
        raise place.wrong("is too large", f"must be at most {LARGEST:g} either way")
    u, _, v = np.linalg.svd(R)
    return Similarity(R=u @ v, r=r, scale=size)


def proofs(
    chunk: Chunk,
    cameras: Mapping[str, Camera],
    places: Locations,
    known: Mapping[str, Surveyed],
    system: Chosen | None,
) -> tuple[str, ...]:
    """Return sentences on how well the imported cameras see what Metashape says that they see."""
    posed = [
        k for k, one in enumerate(places.shots) if one.T_c is not None and one.camera in cameras
    ]
    own = [k for k in posed if not places.measured[k]]
    measured = [k for k in posed if places.measured[k]]
    return (
        *_meeting(cameras, places, own, "the locations that Metashape computed itself meet"),
        *_meeting(cameras, places, measured, "the measured locations of each marker meet"),
        *_measured_against(chunk, cameras, places, measured, known, system),
    )


def _meeting(
    cameras: Mapping[str, Camera], places: Locations, rows: list[int], what: str
) -> tuple[str, ...]:
    """Return how well the rays of locations meet in a point each."""
    if not rows:
        return ()
    names, idx = tables.first_use([places.points[k] for k in rows])
    of, T = _rows(places, rows)
    x = proof.intersected(cameras, of, T, places.colrow[rows], idx, len(names))
    several = np.isfinite(x[idx, 0])
    if not several.any():
        return ()
    apart = proof.misfits(cameras, of, T, x[idx], places.colrow[rows])[several]
    return (f"{what} in a point to {proof.said(apart)}, by the cameras as imported",)


def _measured_against(
    chunk: Chunk,
    cameras: Mapping[str, Camera],
    places: Locations,
    measured: list[int],
    known: Mapping[str, Surveyed],
    system: Chosen | None,
) -> tuple[str, ...]:
    """Return the proof by surveyed markers: it has Metashape's own misfit in it."""
    rows = [k for k in measured if places.points[k] in known]
    has_place = any(
        chunk.root.maybe(*where)
        for where in (("transform",), ("components", "component", "transform"))
    )
    if not rows or system is None or not has_place:
        return ()
    xyh = np.array([known[places.points[k]].xyh for k in rows])
    element = chunk.root.maybe("reference")
    x_e = told(chunk, lambda: _ecef(system, xyh), element)
    place = similarity(chunk)
    x = np.stack([place(places.shots[k]).into_chunk(one) for k, one in zip(rows, x_e, strict=True)])
    of, T = _rows(places, rows)
    said = proof.said(proof.misfits(cameras, of, T, x, places.colrow[rows]))
    return (f"the surveyed markers are seen by Metashape's adjusted cameras to {said}",)


def _ecef(system: Chosen, xyh: Array) -> Array:
    """Return coordinates of the project in the frame of `Similarity`, shape (n, 3)."""
    if system.source is None:
        return xyh
    enh, grid = crs.into(system, xyh), system.grid()
    lonlat = grid.lonlat_from_grid(enh[:, :2])
    height = enh[:, 2] + grid.undulation(lonlat)
    return grid.ecef_from_geographic(np.column_stack([lonlat, height]))


def _rows(places: Locations, rows: list[int] | Index) -> tuple[list[str], Pose]:
    """Return the cameras and the poses of some locations."""
    some = [places.shots[k] for k in rows]
    poses = [one.T_c for one in some if one.T_c is not None]
    stacked = Pose(R=np.stack([p.R for p in poses]), r=np.stack([p.r for p in poses]))
    return [one.camera for one in some], stacked
