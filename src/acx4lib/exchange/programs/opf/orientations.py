"""Orientations of an OPF project: what was measured of captures, and calibrated cameras."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from acx4lib.errors import FlightError
from acx4lib.exchange.brought import number_of
from acx4lib.exchange.programs.opf import places
from acx4lib.exchange.programs.opf.project import Project
from acx4lib.exchange.programs.opf.sensors import Sensor
from acx4lib.exchange.programs.shared import crs, tables
from acx4lib.exchange.programs.shared.adjusted import MEANS_NOTHING, Flown
from acx4lib.exchange.programs.shared.cameras import TOP_AHEAD
from acx4lib.exchange.programs.shared.crs import Chosen
from acx4lib.exchange.safe.json_tree import Node
from acx4lib.expected import Array
from acx4lib.flight.problems import METRES, quoted
from acx4lib.geometry.frames import Pose, opk_from_rotation, rotation_from_opk
from acx4lib.geometry.geodesy import GridSystem, mean_origin

ASSUMED = (
    "Yaw, pitch, roll are zero for a camera that looks down with the top of its image to the "
    "north: yaw clockwise, pitch positive with the top up, roll with the right side down"
)


@dataclass(frozen=True, kw_only=True)
class Shot:
    """An image of the project.

    Attributes
    ----------
    number : str
    name, exposure : str
    sensor : Sensor
    capture : Node or None
        Of the reference camera only: what was measured.
    """

    number: str
    name: str
    exposure: str
    sensor: Sensor
    capture: Node | None


def calibrated(project: Project) -> dict[str, Pose]:
    """Return the poses of calibrated cameras in the processing system, by camera numbers."""
    document = project.documents.get("calibrated-cameras")
    if document is None:
        return {}
    found = {}
    for one in document.one("cameras").each():
        opk = np.radians(one.one("orientation_deg").numbers(3))
        found[one.one("id").text()] = Pose(
            R=rotation_from_opk(opk[None])[0], r=one.one("position").numbers(3, allowed=METRES)
        )
    return found


def adjusted(project: Project, shots: list[Shot], system: Chosen | None) -> Flown:
    """Return the trajectory of calibrated cameras; their exposures are those that have one."""
    frame = project.documents.get("scene-reference-frame")
    poses = calibrated(project)
    if frame is None or system is None:
        root = frame or project.documents["input-cameras"]
        raise root.wrong("has no coordinate system on the Earth", "adjusted orientations need one")
    node = frame.one("crs", "definition")
    try:
        own = crs.parsed(node.text())
        if not own.is_projected:
            raise node.wrong(quoted(own.name), "must be projected for adjusted orientations")
        bodies: dict[str, Pose] = {}
        for one in shots:
            if one.number in poses and (one.exposure not in bodies or one.capture is not None):
                bodies[one.exposure] = poses[one.number] @ one.sensor.lens.mount.inverse
        if not bodies:
            return Flown(left_out=("a trajectory: no camera is calibrated",))
        xyz = _base(frame, np.stack([one.r for one in bodies.values()]))
        there = replace(system, source=own).from_source(xyz)
        there = crs.with_heights(system, there, crs.heights_of(own))
    except ValueError as error:
        raise node.wrong(" ".join(str(error).split()), "must be convertible") from None
    opk = np.stack([one.opk for one in bodies.values()])
    table = tables.trajectory_in_grid(list(bodies), there, opk)
    return Flown(table=table, assumed=(MEANS_NOTHING,))


def _base(frame: Node, xyz: Array) -> Array:
    """Return positions of the processing system in the scene's own, east first."""
    turn = frame.one("base_to_canonical")
    scale, shift = turn.one("scale").numbers(3), turn.one("shift").numbers(3)
    if (scale == 0).any():
        raise turn.one("scale").wrong("has a zero", "must be three numbers that are not zero")
    # scaled, swapped, then shifted; what is swapped is swapped once more by its order of axes
    return np.asarray((xyz - shift) / (scale[[1, 0, 2]] if _swaps(turn) else scale))


def _swaps(turn: Node) -> bool:
    swap = turn.maybe("swap_xy")
    return swap is not None and swap.value is True


def measured(shots: list[Shot], system: Chosen | None) -> Flown:
    """Return the trajectory of what was measured of captures."""
    rows = [
        (one, one.capture.one("geolocation"), one.capture.one("orientation"))
        for one in shots
        if one.capture is not None
        and one.capture.maybe("geolocation") is not None
        and one.capture.maybe("orientation") is not None
    ]
    exposures = len({one.exposure for one in shots})
    missing = exposures - len(rows)
    left = (f"{number_of(missing, 'exposures')} without position or angles, images included",)
    if not rows or system is None:
        return Flown(left_out=("a trajectory: no capture has position and angles",))
    names = [one.exposure for one, _, _ in rows]
    spots = [places.place(where) for _, where, _ in rows]
    try:
        enh = np.stack([places.enh(system, spot) for spot in spots])
    except FlightError as error:
        return Flown(left_out=(f"the measured orientations: {error.problems[0]}",))
    opk, sigma = zip(
        *(_attitude(how, at, system) for (_, _, how), at in zip(rows, enh, strict=True)),
        strict=True,
    )
    table: dict[str, object] = {
        **dict(tables.trajectory_in_grid(names, enh, np.stack(opk))),
        **_sigmas(("east_m", "north_m", "height_m"), np.stack([one.sigma for one in spots])),
        **_sigmas(("roll_deg", "pitch_deg", "heading_deg"), np.stack(sigma)),
    }
    return Flown(table=table, assumed=(ASSUMED,), left_out=left if missing else ())


def _sigmas(names: tuple[str, str, str], values: Array) -> Mapping[str, list[float]]:
    """Return the columns of standard deviations; none where one is not known."""
    if not (values > 0).all():
        return {}
    pairs = zip(names, np.round(values, tables.DEGREES).T.tolist(), strict=True)
    return {f"sigma_{name}": column for name, column in pairs}


def _attitude(node: Node, enh: Array, system: Chosen) -> tuple[Array, Array]:
    """Return a body's omega, phi, kappa against the grid, rad, and sigma of its axes, degrees."""
    kind = node.one("type").text()
    angles = np.radians(node.one("angles_deg").numbers(3))
    given = node.maybe("sigmas_deg")
    sigma = np.zeros(3) if given is None else np.maximum(given.numbers(3), 0.0)
    grid = crs.grid_of(system.crs)
    lonlat = grid.lonlat_from_grid(enh[None, :2])
    if kind == "yaw_pitch_roll":
        frame = mean_origin(grid, lonlat)
        lonlath = np.append(lonlat, [[enh[2]]], axis=1)
        T_b = frame.pose_from_geographic(lonlath, angles[None, [2, 1, 0]])
        return frame.pose_to_grid(T_b)[1][0], sigma[[2, 1, 0]]
    if kind != "omega_phi_kappa":
        expected = "must be yaw_pitch_roll or omega_phi_kappa"
        raise node.one("type").wrong(quoted(kind), expected)
    R_g_b = rotation_from_opk(angles[None])[0] @ TOP_AHEAD.T
    turned = _meridians(node.one("crs"), lonlat, grid) @ R_g_b
    return opk_from_rotation(turned[None])[0], sigma[[1, 0, 2]]


def _meridians(node: Node, lonlat: Array, grid: GridSystem) -> Array:
    """Return the rotation from the axes of another grid to those of the flight's at a place."""
    try:
        other = crs.grid_of(node.text())
    except ValueError as error:
        raise node.wrong(str(error), "must be a projected coordinate system") from None
    here, there = (one.convergence(lonlat)[0] for one in (grid, other))
    if not np.isfinite([here, there]).all():
        raise node.wrong(f"{node.text()} is not defined there", "must be that of the place")
    c, s = np.cos(here - there), np.sin(here - there)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
