"""OPF projects: sensors, rigs, images, control points, measured marks, orientations."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from acx4lib.errors import FlightError
from acx4lib.exchange.brought import Brought, number_of
from acx4lib.exchange.programs.opf import measured, places, sensors, tracks
from acx4lib.exchange.programs.opf import orientations as oriented
from acx4lib.exchange.programs.opf.measured import NOTHING, Measured
from acx4lib.exchange.programs.opf.orientations import Shot
from acx4lib.exchange.programs.opf.project import Project, project_of
from acx4lib.exchange.programs.opf.sensors import Sensor
from acx4lib.exchange.programs.shared import tables
from acx4lib.exchange.programs.shared.adjusted import Flown
from acx4lib.exchange.programs.shared.cameras import Refitted, refitted
from acx4lib.exchange.programs.shared.crs import Chosen
from acx4lib.exchange.safe.json_tree import Node
from acx4lib.exchange.safe.opened import checksums
from acx4lib.expected import Array
from acx4lib.flight.problems import quoted
from acx4lib.flight.text.in_memory import Columns

ASSUMED = (
    "Pixels: OPF counts from the outer corner of the top-left one, so 0.5 is taken off",
    "The body's x axis is towards the top of the reference camera's images",
    "Rig relatives are Rx Ry Rz from the camera to the reference camera, x right, y down, z ahead",
)


def read(
    source: Path,
    *,
    camera: str = "adjusted",
    orientations: str = "initial",
    block: str | None = None,
    crs: str | None = None,
    heights: str | float | None = None,
    pixel_um: float | None = None,
) -> Brought:
    """Read a project.

    Parameters
    ----------
    source : Path
        A file .opf, or a folder with it or with the JSON files of OPF.
    camera : str
        Which internals are taken where there are both: adjusted or initial.
    orientations : str
        The trajectory: "initial" is what was measured of captures, "adjusted" the calibrated
        cameras, "none" none.
    block : str, optional
        Name of the block; by default heads for a rig, else calibration.
    crs : str, optional
        The flight's projected CRS; by default that of the scene, or the UTM zone of a place.
    heights : str or float, optional
        As the key of flight.toml; by default those of the control points, else of the captures.
    pixel_um : float, optional
        Pixel size where the project has none.

    Raises
    ------
    FlightError
        Where the files are no project of OPF, or something in them cannot be.
    """
    project = project_of(source)
    of = sensors.sensors(project, wanted=camera)
    fitted, unusable = _fitted(project, of, pixel_um)
    every = [one for one in _shots(project, of) if one.sensor.name in fitted.cameras]
    control = project.documents.get("input-control-points")
    gcps = {} if control is None else _surveyed(control)
    system = places.system(project, _captured(every), [one for one, _ in gcps.values()], crs)
    if system is not None and heights is not None:
        system = places.with_heights(system, heights)
    flown = _flown(project, every, system, orientations)
    shots = _with_trajectory(every, flown)
    named = {one.sensor.name for one in shots} or set(fitted.cameras)
    fitted = fitted.only(named)
    by_number = {one.number: one for one in shots}
    marks = measured.marks(project, by_number)
    ties = (
        NOTHING if project.tracks is None else tracks.read(project.tracks, by_number, project.files)
    )
    poses = oriented.calibrated(project)
    folder = block or _block(shots)
    known, strange = _control(gcps, system)
    return Brought(
        source=project.program,
        sha256=checksums(project.sources),
        settings={"name": project.name, **(system.settings if system else {}), **fitted.settings},
        tables=_tables(folder, shots, measured.table(marks, ties), known, flown),
        assumed=(*ASSUMED, *fitted.assumed, *(system.assumed if system else ()), *flown.assumed),
        found=(
            *_counted(shots, marks, gcps),
            *sensors.kinds(of, named),
            *fitted.found,
            *_tied(ties),
            *measured.proved(fitted.cameras, poses, marks, "the calibrated control points"),
            *measured.proved(fitted.cameras, poses, ties, "the calibrated tie points"),
        ),
        left_out=(*_lost(marks, ties), *unusable, *strange, *_others(project), *flown.left_out),
    )


def _shots(project: Project, of: Mapping[str, Sensor]) -> list[Shot]:
    """Return the images: those of captures, else those of calibrated cameras."""
    captures = list(project.documents["input-cameras"].one("captures").each())
    pairs: list[tuple[Node, Node | None]] = [
        (camera, capture) for capture in captures for camera in capture.one("cameras").each()
    ]
    after = project.documents.get("calibrated-cameras")
    if not pairs and after is not None:
        pairs = [(camera, None) for camera in after.one("cameras").each()]
    numbers = [camera.one("id").text() for camera, _ in pairs]
    labels = _labels(project)
    names, _ = tables.without_doubles([labels.get(i, i) for i in numbers], numbers)
    places_of = {name: camera for name, (camera, _) in zip(names, pairs, strict=True)}
    tables.require_names(names, lambda name, what, wanted: places_of[name].wrong(what, wanted))
    named = dict(zip(numbers, names, strict=True))
    if len(named) < len(numbers):
        times = Counter(numbers)
        again = next(camera for camera, _ in pairs if times[camera.one("id").text()] > 1)
        raise again.one("id").wrong("is there twice", "must be unique")
    return [_shot(camera, capture, named, of) for camera, capture in pairs]


def _shot(
    camera: Node, capture: Node | None, named: Mapping[str, str], of: Mapping[str, Sensor]
) -> Shot:
    number, sensor = camera.one("id").text(), camera.one("sensor_id")
    if sensor.text() not in of:
        raise sensor.wrong(quoted(sensor.text()), "must be the id of a sensor")
    leader = number if capture is None else capture.one("reference_camera_id").text()
    if capture is not None and leader not in named:
        raise capture.one("reference_camera_id").wrong(quoted(leader), "must be a camera's id")
    return Shot(
        number=number,
        name=named[number],
        exposure=named[leader],
        sensor=of[sensor.text()],
        capture=capture if number == leader else None,
    )


def _labels(project: Project) -> dict[str, str]:
    """Return the names of images by camera numbers: the last part of their addresses."""
    listed = project.documents.get("camera-list")
    if listed is None:
        return {}
    return {
        one.one("id").text(): one.one("uri").text().replace("\\", "/").rpartition("/")[2]
        for one in listed.one("cameras").each()
    }


def _captured(shots: list[Shot]) -> list[places.Place]:
    """Return the place of the first capture that has one."""
    for one in shots:
        if one.capture is not None and (node := one.capture.maybe("geolocation")) is not None:
            return [places.place(node)]
    return []


def _surveyed(control: Node) -> dict[str, tuple[places.Place, bool]]:
    """Return the places of control points, and whether they are check points."""
    found: dict[str, tuple[places.Place, bool]] = {}
    for one in control.one("gcps").each():
        name = one.one("id").text()
        if name in found:
            raise one.one("id").wrong(f"{quoted(name)} is there twice", "must be unique")
        tables.require_names([name], lambda _, what, wanted: one.one("id").wrong(what, wanted))  # noqa: B023 called at once
        check = one.maybe("is_checkpoint")
        is_check = check is not None and check.value is True
        found[name] = (places.place(one.one("geolocation")), is_check)
    return found


def _flown(project: Project, shots: list[Shot], system: Chosen | None, wanted: str) -> Flown:
    if wanted == "adjusted":
        return oriented.adjusted(project, shots, system)
    after = len(oriented.calibrated(project))
    left = (f"{after} calibrated orientations (--orientations adjusted)",) if after else ()
    if wanted == "none" or not shots:
        return Flown(left_out=left)
    flown = oriented.measured(shots, system)
    return Flown(table=flown.table, assumed=flown.assumed, left_out=(*flown.left_out, *left))


def _with_trajectory(shots: list[Shot], flown: Flown) -> list[Shot]:
    """Return the images whose exposures are in the trajectory, if there is one."""
    if flown.table is None:
        return shots
    exposures = set(flown.table["exposure"])
    return [one for one in shots if one.exposure in exposures]


def _fitted(
    project: Project, of: Mapping[str, Sensor], pixel_um: float | None
) -> tuple[Refitted, tuple[str, ...]]:
    """Return the cameras that a flight can have, and sentences on the others."""
    lenses, strange = {}, []
    for one in of.values():
        try:
            _ = refitted({one.name: one.lens}, pixel_um=pixel_um)
            lenses[one.name] = one.lens
        except ValueError as error:
            strange.append(str(error))
    if not lenses:
        root = project.documents["input-cameras"].one("sensors")
        raise root.wrong("; ".join(strange) or "has none", "must have one that a flight can have")
    said = tuple(f"camera and its images: {why}" for why in strange)
    return refitted(lenses, pixel_um=pixel_um), said


def _block(shots: list[Shot]) -> str:
    return "heads" if len({one.exposure for one in shots}) < len(shots) else "calibration"


def _control(
    gcps: Mapping[str, tuple[places.Place, bool]], system: Chosen | None
) -> tuple[Columns | None, tuple[str, ...]]:
    """Return the table of control points, and sentences on those that are not on it."""
    if system is None:
        return None, (f"{len(gcps)} control points: no system on the Earth",) * bool(gcps)
    enh: dict[str, Array] = {}
    strange = []
    for name, (spot, _) in gcps.items():
        try:
            enh[name] = places.enh(system, spot)
        except FlightError as error:
            strange.append(f"control point {name}: {error.problems[0]}")
    if not enh:
        return None, tuple(strange)
    columns: dict[str, list[Any]] = {"point": list(enh)}
    names = ("east_m", "north_m", "height_m")
    sigma = np.stack([gcps[name][0].sigma for name in enh])
    for name, values in zip(names, np.round(list(enh.values()), tables.METRES).T, strict=True):
        columns[name] = values.tolist()
    for name, values in zip(names, np.round(sigma, tables.METRES).T, strict=True):
        if (values > 0).all():
            columns[f"sigma_{name}"] = values.tolist()
    columns["role"] = ["check" if gcps[name][1] else "control" for name in enh]
    return columns, tuple(strange)


def _tables(
    folder: str, shots: list[Shot], points: Columns | None, control: Columns | None, flown: Flown
) -> dict[str, Columns]:
    found: dict[str, Columns] = {}
    if shots:
        found[f"{folder}/images.csv"] = tables.images(
            [one.name for one in shots],
            [one.sensor.name for one in shots],
            [one.exposure for one in shots],
        )
    if points is not None:
        found[f"{folder}/image_points.csv"] = points
    if control is not None:
        found["control_points.csv"] = control
    if flown.table is not None:
        found[f"{folder}/trajectory.csv"] = flown.table
    return found


def _counted(
    shots: list[Shot], marks: Measured, gcps: Mapping[str, tuple[places.Place, bool]]
) -> tuple[str, ...]:
    exposures = {one.exposure for one in shots}
    checks = sum(is_check for _, is_check in gcps.values())
    return (
        f"{number_of(len(shots), 'images')} of {number_of(len(exposures), 'exposures')}",
        f"{number_of(len(marks.points), 'marks')}; {len(gcps)} points have coordinates, "
        f"{checks} of them check points",
    )


def _tied(ties: Measured) -> tuple[str, ...]:
    n = len(ties.points)
    return (f"{number_of(n, 'measurements')} of tie points",) if n else ()


def _lost(marks: Measured, ties: Measured) -> tuple[str, ...]:
    """Return sentences on measurements that are not in the table."""
    counted = (
        (marks.lost, "marks in images that are left out"),
        (
            ties.lost,
            "measurements of tie points in other images, or second ones in one",
        ),
    )
    return tuple(f"{n} {what}" for n, what in counted if n)


def _others(project: Project) -> tuple[str, ...]:
    """Return what the project has and the flight has not."""
    bias = project.documents.get("gps-bias") is not None
    others = ", ".join(dict.fromkeys(project.others))
    return (
        *(("the bias of GPS positions",) if bias else ()),
        *((f"files of formats that are not read: {others}",) if others else ()),
    )
