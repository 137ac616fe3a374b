"""Points that were eliminated: how they follow the reduced unknowns, and vary with them."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from acx4lib.expected import Array, Index
from acx4lib.least_squares.adjustment import Solution, require_own_datum
from acx4lib.least_squares.normal_equations import point_normals, strips
from acx4lib.least_squares.problem import Equations, Problem

S = TypeVar("S")


def cross_covariance(problem: Problem[S], state: S, solution: Solution, points: Index) -> Array:
    """Return the a priori covariance of some points with the reduced unknowns.

    Parameters
    ----------
    problem : Problem
    state : the solution's
    solution : Solution
    points : ndarray, shape (k,)

    Returns
    -------
    ndarray, shape (k, 3, n_columns)

    Raises
    ------
    ValueError
        In the datum of inner constraints, where points depend on more than their observations.
    """
    require_own_datum(solution)
    gain, _ = elimination(problem, state, points)
    return np.asarray(-solution.inverse.times(gain))


def elimination(problem: Problem[S], state: S, points: Index) -> tuple[Array, Array]:
    """Return how some points follow the reduced unknowns, and what is left to themselves.

    Parameters
    ----------
    problem : Problem
        It needs no observations of other points.
    state : the solution's
    points : ndarray, shape (k,)
        Held ones follow nothing, and are known.

    Returns
    -------
    gain : ndarray, shape (k, 3, n_columns)
        Points move by -gain dx where the reduced unknowns move by dx.
    own : ndarray, shape (k, 3, 3)
        Covariance of each point where the reduced unknowns are known.
    """
    known, back = np.unique(points, return_inverse=True)
    equations = [of_points(e, known)[0] for e in problem.equations(state) if e.B is not None]
    free = problem.free_points[known]
    V, _ = point_normals(free, equations)
    own, gain = np.linalg.inv(V), np.zeros((len(known), 3, problem.n_columns))
    for chunk, strip in strips(problem.n_columns, free, equations):
        gain[chunk] = own[chunk] @ strip
    own[~free] = 0.0
    return gain[back], own[back]


def of_points(e: Equations, points: Index) -> tuple[Equations, Index]:
    """Return the observations of some points, numbered by their places among these; their rows.

    Parameters
    ----------
    e : Equations
        With points.
    points : ndarray, shape (k,)
        Sorted.
    """
    of = np.asarray(e.point)
    rows = np.flatnonzero(np.isin(of, points))
    parts = {name: getattr(e, name)[rows] for name in ("v", "sigma", "A", "unit", "B")}
    return replace(e, **parts, point=np.searchsorted(points, of[rows])), rows
