"""Least squares that knows no camera.

Unknowns are of two kinds: the columns of the reduced system, and points, three coordinates each,
which the observations meet only in small groups and which are eliminated by the Schur
complement. A `Problem` says what its observations are at a state; everything else is here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from scipy import linalg, stats

from acx4lib._typing import Array, Index, Mask
from acx4lib.errors import AdjustmentError
from acx4lib.normal_equations import (
    SINGULAR,
    Equations,
    column_normals,
    damped_step,
    point_normals,
    strips,
    units,
)

S = TypeVar("S")


class Problem(Protocol[S]):
    """What an adjustment has to know of its application."""

    @property
    def n_columns(self) -> int:
        """Number of reduced unknowns."""
        ...

    @property
    def n_points(self) -> int:
        """Number of points, free or held."""
        ...

    @property
    def free_points(self) -> Mask:
        """Which points are unknowns."""
        ...

    def equations(self, state: S) -> Sequence[Equations]:
        """Linearise at a state."""
        ...

    def residuals(self, state: S) -> Sequence[tuple[Array, Array]]:
        """Return v and sigma of the same groups without derivatives."""
        ...

    def moved(self, state: S, dx: Array, dp: Array) -> S:
        """Return the state after a step in the columns and in the points."""
        ...

    def column_names(self) -> Sequence[str]:
        """Return a name per column, for messages."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False)
class Group:
    """Residuals of one group after the adjustment.

    Attributes
    ----------
    kind : str
    v, sigma, redundancy, w : ndarray, shape (m, d)
        `redundancy` is the share of an error that shows in its own residual, `w` Baarda's
        standardised residual with the a priori sigma; NaN where nothing controls it.
    """

    kind: str
    v: Array
    sigma: Array
    redundancy: Array
    w: Array

    @property
    def used(self) -> Mask:
        """Which components took part."""
        return np.isfinite(self.sigma)


@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """A least-squares solution and its quality.

    Attributes
    ----------
    cost : float
        Weighted sum of squared residuals.
    iterations : int
    n_observations, n_unknowns : int
    defect : int
        Number of directions of the unknowns that the observations leave open.
    cov : ndarray, shape (n_columns, n_columns)
        Of the reduced unknowns, for unit weight one (a priori).
    cov_points : ndarray, shape (n_points, 3, 3)
        A priori; zero for points that are held.
    undetermined : ndarray, shape (n_columns,)
        Columns with a part in a direction that the observations leave open.
    condition : float
        Of the scaled reduced normal matrix.
    weakest : ndarray, shape (n_columns,)
        Its eigenvector with the smallest eigenvalue, in scaled unknowns.
    groups : tuple of Group
    """

    cost: float
    iterations: int
    n_observations: int
    n_unknowns: int
    defect: int
    cov: Array
    cov_points: Array
    undetermined: Mask
    condition: float
    weakest: Array
    groups: tuple[Group, ...]

    @property
    def redundancy(self) -> int:
        """Degrees of freedom."""
        return self.n_observations - self.n_unknowns + self.defect

    @property
    def sigma0_sq(self) -> float:
        """A posteriori variance of unit weight; one where there is no redundancy."""
        return self.cost / self.redundancy if self.redundancy > 0 else 1.0

    @property
    def chi_square_p(self) -> float:
        """Two-sided probability of a cost as far from its expectation, were the weights right."""
        return two_sided_p(self.cost, self.redundancy)

    def group(self, kind: str) -> Group:
        """Return the residuals of one kind."""
        return next(g for g in self.groups if g.kind == kind)


def two_sided_p(cost: float, redundancy: int) -> float:
    """Return the probability of a chi-square variable as far out; one without redundancy."""
    if redundancy <= 0:
        return 1.0
    return float(2 * min(stats.chi2.cdf(cost, redundancy), stats.chi2.sf(cost, redundancy)))


def solve(
    problem: Problem[S], state: S, *, max_iterations: int = 50, tolerance: float = 1e-6
) -> tuple[S, Solution]:
    """Adjust: Gauss-Newton, damped where a step does not reduce the cost.

    Parameters
    ----------
    problem : Problem
    state : start values
    max_iterations : int
    tolerance : float
        In standard deviations of the unknowns.

    Returns
    -------
    state, solution

    Raises
    ------
    AdjustmentError
        Where it does not converge, or observations are fewer than unknowns.

    Notes
    -----
    Converged when a full step moves the unknowns by less than `tolerance`, or when rounding lets
    no step reduce the cost any more.
    """
    state, iterations = _iterate(problem, state, max_iterations, tolerance)
    equations = problem.equations(state)
    return state, _quality(problem, equations, iterations)


def _iterate(problem: Problem[S], state: S, max_iterations: int, tolerance: float) -> tuple[S, int]:
    damping = 0.0
    cost = _cost(problem.residuals(state))
    if not np.isfinite(cost):
        msg = "the start values leave points behind a camera or at infinity"
        raise AdjustmentError(msg)
    for iteration in range(1, max_iterations + 1):
        equations = problem.equations(state)
        sigma0_sq = cost / max(_degrees_of_freedom(problem, equations), 1)
        descent = _descend(problem, state, equations, cost=cost, damping=damping, unit=sigma0_sq)
        if descent is None:
            return state, iteration
        state, cost, damping, decrement = descent
        if damping == 0.0 and decrement <= tolerance**2 * sigma0_sq:
            return state, iteration
        damping = damping / 10 if damping > 1e-8 else 0.0
    msg = f"no convergence after {max_iterations} iterations"
    raise AdjustmentError(msg)


def _descend(
    problem: Problem[S],
    state: S,
    equations: Sequence[Equations],
    *,
    cost: float,
    damping: float,
    unit: float,
) -> tuple[S, float, float, float] | None:
    """Damp until a step reduces the cost; None where only rounding is left to reduce."""
    n, free_points = problem.n_columns, problem.free_points
    while damping <= 1e12:
        dx, dp, decrement = damped_step(n, free_points, equations, damping)
        trial = problem.moved(state, dx, dp)
        trial_cost = _cost(problem.residuals(trial))
        if trial_cost <= cost:
            return trial, trial_cost, damping, decrement
        # a damped step may also be small because the derivatives are wrong
        if decrement <= max(1e-8 * unit, 1e-14) and (
            damped_step(n, free_points, equations, 0.0)[2] <= max(1e-4 * unit, 1e-14)
        ):
            return None
        damping = max(10 * damping, 1e-6)
    msg = "no step reduces the cost any more"
    raise AdjustmentError(msg)


def _degrees_of_freedom(problem: Problem[S], equations: Sequence[Equations]) -> int:
    n_observations = sum(int(np.isfinite(e.sigma).sum()) for e in equations)
    n_unknowns = problem.n_columns + 3 * int(problem.free_points.sum())
    if n_observations < n_unknowns:
        msg = f"{n_observations} observations cannot determine {n_unknowns} unknowns"
        raise AdjustmentError(msg)
    return n_observations - n_unknowns


def _cost(groups: Sequence[tuple[Array, Array]]) -> float:
    with np.errstate(over="ignore"):  # of a wild step
        cost = sum(float(np.sum(np.square(v / sigma))) for v, sigma in groups)
    return cost if np.isfinite(cost) else np.inf


# --- quality ---------------------------------------------------------------------------------


def _quality(problem: Problem[S], equations: Sequence[Equations], iterations: int) -> Solution:
    """Return covariances, redundancy numbers and tests at the solution."""
    N, _ = column_normals(problem.n_columns, equations)
    diagonal = N.diagonal().copy()
    V, _ = point_normals(problem.free_points, equations)
    V_inv = np.linalg.inv(V)
    for points, strip in strips(problem.n_columns, problem.free_points, equations):
        Z = (np.linalg.inv(np.linalg.cholesky(V[points])) @ strip).reshape(3 * len(strip), -1)
        N -= Z.T @ Z
    cov, undetermined, values, weakest = _inverse(N, diagonal)
    explained = [np.zeros_like(e.v) for e in equations]
    cov_points = V_inv
    cov_points[~problem.free_points] = 0.0
    for points, strip in strips(problem.n_columns, problem.free_points, equations):
        gain = V_inv[points] @ strip  # -d(point)/d(columns)
        cross = -gain @ cov
        cov_points[points] -= cross @ np.swapaxes(gain, 1, 2)
        for e, part in zip(equations, explained, strict=True):
            _add_explained_by_points(part, e, points, cross, cov_points)
    for e, part in zip(equations, explained, strict=True):
        for rows, columns, held in units(e):
            A = e.A[rows][:, :, ~held]
            part[rows] += np.sum((A @ cov[np.ix_(columns, columns)]) * A, axis=2)
    used = [np.isfinite(e.sigma) for e in equations]
    return Solution(
        cost=_cost([(e.v, e.sigma) for e in equations]),
        iterations=iterations,
        n_observations=sum(int(u.sum()) for u in used),
        n_unknowns=problem.n_columns + 3 * int(problem.free_points.sum()),
        defect=int(np.sum(values <= SINGULAR)),
        cov=cov,
        cov_points=cov_points,
        undetermined=undetermined,
        condition=float(values[-1] / max(values[0], 1e-300)) if len(values) else 1.0,
        weakest=weakest,
        groups=tuple(_tested(e, part) for e, part in zip(equations, explained, strict=True)),
    )


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
    """
    equations = problem.equations(state)
    V, _ = point_normals(problem.free_points, equations)
    out = np.zeros((len(points), 3, problem.n_columns))
    for chunk, strip in strips(problem.n_columns, problem.free_points, equations):
        here = np.flatnonzero((points >= chunk.start) & (points < chunk.stop))
        gain = np.linalg.inv(V[points[here]]) @ strip[points[here] - chunk.start]
        out[here] = -gain @ solution.cov
    return out


def _inverse(N: Array, diagonal: Array) -> tuple[Array, Mask, Array, Array]:
    """Return the (pseudo-)inverse, what it leaves open, eigenvalues and the weakest vector."""
    if len(N) == 0:
        return N, np.zeros(0, dtype=bool), np.ones(0), np.zeros(0)
    scale = 1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    values, vectors = linalg.eigh(N * scale[:, None] * scale)
    keep = values > SINGULAR
    part = vectors[:, keep] * scale[:, None]
    open_part = np.linalg.norm(vectors[:, ~keep], axis=1)
    return (part / values[keep]) @ part.T, open_part > 1e-4, values, vectors[:, 0]


def _add_explained_by_points(
    total: Array, e: Equations, points: slice, cross: Array, cov_points: Array
) -> None:
    """Add to the variance of adjusted observations what depends on the chunk's points."""
    if e.B is None or e.point is None:
        return
    rows = np.flatnonzero((e.point >= points.start) & (e.point < points.stop))
    B, point = e.B[rows], e.point[rows]
    total[rows] += np.sum((B @ cov_points[point]) * B, axis=2)
    if e.A.shape[2]:
        padded = np.concatenate([cross, np.zeros((*cross.shape[:2], 1))], axis=2)
        columns = e.columns[e.unit[rows]]
        local = padded[(point - points.start)[:, None], :, columns]  # (rows, k, 3)
        total[rows] += 2 * np.sum((e.A[rows] @ local) * B, axis=2)


def _tested(e: Equations, explained: Array) -> Group:
    """Return redundancy numbers and Baarda's w of one group."""
    used = np.isfinite(e.sigma)
    redundancy = np.where(used, 1 - explained / e.sigma**2, np.nan)
    controlled = used & (redundancy > 1e-6)
    w = np.full_like(e.v, np.nan)
    w[controlled] = e.v[controlled] / (e.sigma[controlled] * np.sqrt(redundancy[controlled]))
    return Group(kind=e.kind, v=e.v, sigma=e.sigma, redundancy=redundancy, w=w)
