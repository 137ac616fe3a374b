"""Control and check points in DBAT's report, from our adjustment."""

from __future__ import annotations

import numpy as np

from acx4book.reference.dbat.blocks import Project
from acx4book.reference.dbat.comparison import Statements, say
from acx4book.reference.dbat.misfits import QUALITY, numbers, point_covariances
from acx4lib.expected import Array, Index

EPS = np.finfo(float).eps
"""It keeps the relative change of sigma finite for a point without error."""


def statements(project: Project) -> Statements:
    """Return our statements on control points and check points."""
    return {
        **_table(project, "Ctrl", np.flatnonzero(~project.is_check)),
        **_table(project, "Check", np.flatnonzero(project.is_check)),
    }


def _table(project: Project, name: str, rows: Index) -> Statements:
    path = (QUALITY, f"{name} measurements")
    if len(rows) == 0:
        return {(*path, "none"): say("")}
    given = project.surveyed
    at = np.searchsorted(numbers(project), given.point)
    x = project.bundle.state.x_m[at] + project.origin
    sigma = np.sqrt(np.diagonal(point_covariances(project)[at], axis1=1, axis2=2))
    rays = project.bundle.network.block.rays[at]
    d = x - given.x
    change = 100 * ((sigma + EPS) / (given.sigma + EPS) - 1)
    out: Statements = {}
    for row in rows:
        point, label, n = str(given.point[row]), given.labels[row], int(rays[row])
        shift = (*d[row], np.hypot(*d[row, :2]), np.linalg.norm(d[row]))
        out[(*path, "Prior", point)] = say(
            f"{{}}, {{}}, {{}}, {{}}, {{}}, {{}}, {label}", *given.x[row], *given.sigma[row]
        )
        out[(*path, "Posterior", point)] = say(
            f"{{}}, {{}}, {{}}, {{}}, {{}}, {{}}, {{}}, {label}", *x[row], *sigma[row], n
        )
        out[(*path, "Diff (pos=abs diff, std=rel diff)", point)] = say(
            f"{{}}, {{}}, {{}}, {{}}, {{}}, {{}}%, {{}}%, {{}}%, {{}}, {label}",
            *shift,
            *change[row],
            n,
        )
    return {**out, **_largest(project, (*path, f"{name} point delta"), rows, d)}


def _largest(project: Project, path: tuple[str, ...], rows: Index, d: Array) -> Statements:
    given = project.surveyed
    length = np.linalg.norm(d, axis=1)[rows]

    def which(position: int) -> tuple[str, int]:
        row = rows[position]
        return f"{{}} ou ({given.labels[row]}, pt {{}})", int(given.point[row])

    text, point = which(int(length.argmax()))
    rms = float(np.sqrt(np.mean(length**2)))
    out: Statements = {
        (*path, "Max"): say(text, length.max(), point),
        (*path, "RMS"): say("{} ou (from {} items)", rms, len(rows)),
    }
    for k, axis in enumerate("XYZ"):
        component = np.abs(d[rows, k])
        text, point = which(int(component.argmax()))
        out[(*path, "Max X,Y,Z", axis)] = say(text, component.max(), point)
    return out
