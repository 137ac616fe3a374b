"""What several test files need: derivatives, normal equations, flights refused, notebooks."""

from __future__ import annotations

import ast
import importlib.util
import os
import re
import signal
from functools import cache
from pathlib import Path

import nbformat
import numpy as np
import pytest

from acx4book.reference import data
from acx4files import flight
from acx4lib.errors import UNSEEN, FlightError

ROOT = Path(__file__).parents[2]
"""The folder of the project."""


@cache
def parsed(path):
    """Return the syntax tree of a file of the sources, which several tests look at."""
    return ast.parse(path.read_text("utf-8"))


def book_extension(name):
    """Return a module of the book's own extensions of Sphinx, which are in no package."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "book" / "_ext" / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def numeric_jacobian(function, x, *, step=1e-6):
    """Central differences of a function of a vector, shape (*function(x).shape, len(x)).

    With values of size one and double precision the error is about step**2 + 1e-16 / step.
    """
    x = np.asarray(x, dtype=float)
    steps = np.broadcast_to(step, x.shape)
    columns = []
    for i, h in enumerate(steps):
        ahead, behind = x.copy(), x.copy()
        ahead[i] += h
        behind[i] -= h
        columns.append((np.asarray(function(ahead)) - np.asarray(function(behind))) / (2 * h))
    return np.stack(columns, axis=-1)


def rotation_angle(R_a, R_b=None):
    """Return the angle between two rotations, radians; exact for small ones."""
    chord = np.linalg.norm(R_a - (np.eye(3) if R_b is None else R_b), axis=(-2, -1))
    return 2 * np.arcsin(np.minimum(chord / np.sqrt(8), 1.0))


def repeats(*values):
    """Return parameters of a test with which it shows more of what others of them show."""
    return pytest.param(*values, marks=pytest.mark.repeats)


# --- an adjustment written out in full -------------------------------------------------------


def weighted_residuals(problem, state):
    """Return v / sigma of all components that take part."""
    v, sigma = (
        np.concatenate([part.ravel() for part in parts])
        for parts in zip(*problem.residuals(state), strict=True)
    )
    used = np.isfinite(sigma)
    return v[used] / sigma[used]


def dense_jacobian(problem, state):
    """Return d(v / sigma) / d(columns, free points), assembled entry by entry."""
    free = np.flatnonzero(problem.free_points)
    at = {int(point): problem.n_columns + 3 * i for i, point in enumerate(free)}
    rows = []
    for e in problem.equations(state):
        for i, d in np.ndindex(e.v.shape):
            if not np.isfinite(e.sigma[i, d]):
                continue
            row = np.zeros(problem.n_columns + 3 * len(free))
            for column, value in zip(e.columns[e.unit[i]], e.A[i, d], strict=True):
                if column >= 0:
                    row[column] += value
            if e.B is not None and int(e.point[i]) in at:
                first = at[int(e.point[i])]
                row[first : first + 3] += e.B[i, d]
            rows.append(row / e.sigma[i, d])
    return np.array(rows)


def numeric_dense_jacobian(problem, state, *, step_columns):
    """Return the same by central differences of the residuals through `moved`."""
    free = np.flatnonzero(problem.free_points)
    n = problem.n_columns

    def at(step):
        dp = np.zeros((problem.n_points, 3))
        dp[free] = step[n:].reshape(-1, 3)
        return weighted_residuals(problem, problem.moved(state, step[:n], dp))

    steps = np.concatenate([step_columns, np.full(3 * len(free), 1e-2)])
    return numeric_jacobian(at, np.zeros(len(steps)), step=steps)


def dense_covariance(problem, state):
    """Return the inverse of the full normal matrix, scaled before it is inverted."""
    J = dense_jacobian(problem, state)
    scale = 1 / np.linalg.norm(J, axis=0)
    # by the QR of the design itself: half the digits of the condition are spared
    R_inv = np.linalg.inv(np.linalg.qr(J * scale, mode="r"))
    return scale[:, None] * (R_inv @ R_inv.T) * scale


def hears_interrupts():
    """Where the tests run in the background, their children would inherit deaf ears."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


LINE = re.compile(r"[^\n]+:\d+: [^\n]+: [^\n]+; [^\n]+\Z")


def flight_problems(folder):
    """Return what is wrong with a flight, one line each, files named below its folder."""
    with pytest.raises(FlightError) as caught:
        flight.read(folder)
    for line in caught.value.problems:
        assert LINE.match(line)
        assert not UNSEEN.search(line)
        assert len(line) < 1500
    return [line.replace(f"{folder}/", "") for line in caught.value.problems]


def dots(ax):
    """Return the places of the dots of axes, one row each."""
    lines = [line for line in ax.get_lines() if line.get_marker() == "o"]
    return np.concatenate([line.get_xydata() for line in lines])


def write_notebook(path, *cells):
    """Write a notebook whose kernel is installed nowhere."""
    made = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source) for source in cells])
    made.cells[0].metadata["tags"] = ["parameters"]
    made.metadata["kernelspec"] = {"name": "nowhere", "display_name": "-", "language": "python"}
    path.parent.mkdir(exist_ok=True)
    nbformat.write(made, path)
    return path


# --- tests on other people's files: skipped where these are missing, unless they are required ---


REQUIRED = bool(os.environ.get("ACX4_REQUIRE_REFERENCE"))


def needs(name: str) -> pytest.MarkDecorator:
    """Skip without the files of a set; where ACX4_REQUIRE_REFERENCE is set, fail instead."""
    missing = not data.is_here(name) and not REQUIRED
    return pytest.mark.skipif(missing, reason=f"{name}: {data.HINT}")
