"""Measurements of an OPF project: marks of control points, and what tracks have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib.exchange.programs.opf.lens import HALF
from acx4lib.exchange.programs.opf.orientations import Shot
from acx4lib.exchange.programs.opf.project import Project
from acx4lib.exchange.programs.shared import proof, tables
from acx4lib.exchange.safe.json_tree import Node
from acx4lib.expected import Array
from acx4lib.flight.problems import METRES, RANGES
from acx4lib.flight.text.in_memory import Columns
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose


@dataclass(frozen=True, kw_only=True, eq=False)
class Measured:
    """Measurements in images.

    Attributes
    ----------
    shots : sequence of Shot
        The image of each.
    points : sequence of str
        The point of each.
    colrow : ndarray, shape (n, 2)
        The library's pixels.
    xyz : ndarray, shape (n, 3)
        The calibrated point in the processing system; NaN where there is none.
    lost : int
        Measurements in images that are not used.
    """

    shots: Sequence[Shot]
    points: Sequence[str]
    colrow: Array
    xyz: Array
    lost: int = 0


NOTHING = Measured(shots=(), points=(), colrow=np.zeros((0, 2)), xyz=np.zeros((0, 3)))
"""No measurements."""


def table(*parts: Measured) -> Columns | None:
    """Return image_points.csv of measurements; None where there are none."""
    if not any(len(one.points) for one in parts):
        return None
    return tables.image_points(
        [shot.name for one in parts for shot in one.shots],
        [point for one in parts for point in one.points],
        np.concatenate([one.colrow for one in parts]),
    )


def proved(
    cameras: Mapping[str, Camera], poses: Mapping[str, Pose], found: Measured, what: str
) -> tuple[str, ...]:
    """Return how well calibrated cameras see calibrated points where they were measured."""
    known = np.flatnonzero(np.isfinite(found.xyz).all(axis=1)).tolist()
    rows = [k for k in known if found.shots[k].number in poses]
    if not rows:
        return ()
    there = [poses[found.shots[k].number] for k in rows]
    apart = proof.misfits(
        cameras,
        [found.shots[k].sensor.name for k in rows],
        Pose(R=np.stack([one.R for one in there]), r=np.stack([one.r for one in there])),
        found.xyz[rows],
        found.colrow[rows],
    )
    return (f"{what} are seen by the cameras as imported to {proof.said(apart)}",)


def marks(project: Project, shots: Mapping[str, Shot]) -> Measured:
    """Return the marks of control points and of manual tie points."""
    control = project.documents.get("input-control-points")
    if control is None:
        return NOTHING
    rows: list[tuple[Shot, str, Array]] = []
    lost = 0
    for kind in ("gcps", "mtps"):
        listed = control.maybe(kind)
        for one in listed.each() if listed is not None else ():
            of_point = _marks_of(one)
            rows += [(shots[n], name, at) for n, name, at in of_point if n in shots]
            lost += sum(n not in shots for n, _, _ in of_point)
    known = _calibrated(project)
    nowhere = np.full(3, np.nan)
    return Measured(
        shots=[shot for shot, _, _ in rows],
        points=[point for _, point, _ in rows],
        colrow=np.array([colrow for _, _, colrow in rows]).reshape(-1, 2),
        xyz=np.array([known.get(point, nowhere) for _, point, _ in rows]).reshape(-1, 3),
        lost=lost,
    )


def _marks_of(point: Node) -> list[tuple[str, str, Array]]:
    """Return the camera's number, the point and the pixel of a point's marks."""
    name, found = point.one("id"), []
    tables.require_names([name.text()], lambda _, what, wanted: name.wrong(what, wanted))
    seen = set()
    for mark in point.one("marks").each():
        number, at = mark.one("camera_id").text(), mark.one("position_px")
        if number in seen:
            raise mark.wrong(f"{name.text()} is twice in one camera", "must be there once")
        seen.add(number)
        colrow = at.numbers(2) - HALF
        if np.abs(colrow).max() > RANGES["col_px"].high:
            raise at.wrong("is too large", str(RANGES["col_px"]))
        found.append((number, name.text(), colrow))
    return found


def _calibrated(project: Project) -> dict[str, Array]:
    document = project.documents.get("calibrated-control-points")
    if document is None:
        return {}
    return {
        one.one("id").text(): one.one("coordinates").numbers(3, allowed=METRES)
        for one in document.one("points").each()
    }
