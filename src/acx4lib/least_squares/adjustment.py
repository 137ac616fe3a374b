"""Gauss-Newton adjustment with points eliminated; it knows no camera.

There are two kinds of unknowns: the columns of the reduced system, and points with three
coordinates each. An observation depends on one point at most; therefore the Schur complement
eliminates the points. A `normal_equations.Problem` linearises its observations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from acx4lib import expected, shown
from acx4lib.errors import AdjustmentError, NotConverged, unsolvable
from acx4lib.expected import Array, Index, Mask
from acx4lib.least_squares import processors
from acx4lib.least_squares.normal_equations import (
    Equations,
    Normals,
    PlainNormals,
    Precision,
    Problem,
    point_normals,
    point_rows,
)
from acx4lib.least_squares.reduced_system import Inverse
from acx4lib.least_squares.statistics import Group, chi2_cdf, chi2_sf

S = TypeVar("S")

NEAR = 1e-4
"""Predicted decrease of the cost, in units of its mean, below which no step needs damping."""

FINE = 1e-6
"""The same, below which rounding errors may hide it: the next prediction decides instead."""

EXACT = 1e-14
"""Predicted decrease that is taken for rounding errors of data without noise."""

FORGOTTEN = 0.1
"""Share of its former value that the diagonal keeps for damping: a parameter whose effect
vanishes for a while must not run away."""


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Solution:
    """A least-squares solution and its quality.

    Attributes
    ----------
    cost : float
        Weighted sum of squared residuals.
    iterations : int
        Steps, zero where the start values are the minimum; of a search for gross errors, those of
        all its adjustments.
    n_observations, n_unknowns : int
    inverse : Inverse
        Of the reduced normal matrix: the a priori covariance of the reduced unknowns
        (sigma0 = 1), and the directions that the observations leave open.
    cov_points : ndarray, shape (n_points, 3, 3)
        A priori covariances; zero for points that are held.
    groups : tuple of Group
    """

    cost: float
    iterations: int
    n_observations: int
    n_unknowns: int
    inverse: Inverse
    cov_points: Array
    groups: tuple[Group, ...]

    @property
    def cov(self) -> Array:
        """Covariance of the reduced unknowns, a priori, shape (n_columns, n_columns).

        In blocks of a thousand images it is large; `inverse.at` then returns parts of it, and
        `inverse.times` its products.
        """
        return self.inverse.dense

    @property
    def defect(self) -> int:
        """Number of directions of the unknowns that the observations leave open."""
        return self.inverse.defect

    @property
    def undetermined(self) -> Mask:
        """Columns that take part in a direction left open, shape (n_columns,)."""
        return self.inverse.undetermined

    @property
    def condition(self) -> float:
        """Condition of the scaled reduced normal matrix."""
        return self.inverse.condition

    @property
    def weakest(self) -> Array:
        """Eigenvector of the scaled matrix's smallest eigenvalue, in scaled unknowns."""
        return self.inverse.weakest

    @property
    def redundancy(self) -> int:
        """Degrees of freedom."""
        return self.n_observations - self.n_unknowns + self.defect

    @property
    def sigma0_sq(self) -> float:
        """A posteriori variance of unit weight; one without redundancy."""
        return self.cost / self.redundancy if self.redundancy > 0 else 1.0

    @property
    def chi_square_p(self) -> float:
        """Two-sided probability of such a cost or a more extreme one, if the weights are right."""
        return two_sided_p(self.cost, self.redundancy)

    def group(self, kind: str) -> Group:
        """Return the residuals of one kind."""
        expected.one_of("kind", kind, [g.kind for g in self.groups])
        return next(g for g in self.groups if g.kind == kind)


def two_sided_p(cost: float, redundancy: float) -> float:
    """Return the two-sided probability of a chi-square value; one without redundancy."""
    if redundancy <= 0:
        return 1.0
    below, above = chi2_cdf(cost, redundancy), chi2_sf(cost, redundancy)
    return 2 * min(below, above)


def normals(
    problem: Problem[S], state: S, damping: float = 0.0, *, before: Normals | None = None
) -> Normals:
    """Return the normal equations of a problem at a state, by its method ``normals`` if it has one.

    That method may reuse the memory of the previous normal equations. Damping keeps a share of the
    previous diagonal of `PlainNormals`.
    """
    method: Callable[[S, float, Normals | None], Normals] | None = getattr(problem, "normals", None)
    if method is not None:
        return method(state, damping, before)
    least = FORGOTTEN * before.diagonal if isinstance(before, PlainNormals) else 0.0
    return PlainNormals(
        n_columns=problem.n_columns,
        free_points=problem.free_points,
        equations=problem.equations(state),
        damping=damping,
        least=least,
    )


def solve(
    problem: Problem[S], state: S, *, max_iterations: int = 200, tolerance: float = 1e-5
) -> tuple[S, Solution]:
    """Adjust by Gauss-Newton, damped by the gain ratio where a full step falls short of prediction.

    Parameters
    ----------
    problem : Problem
    state : start values
    max_iterations : int
    tolerance : float
        Largest next step at the end, in standard deviations of the unknowns.

    Raises
    ------
    AdjustmentError
        Where it does not converge, or observations are fewer than unknowns.

    Notes
    -----
    The iteration ends where the next full step would be shorter than `tolerance`, or where
    rounding errors keep both the cost and the length of the step from decreasing any more.
    """
    with _solving():
        state, at_state, iterations = _iterate(problem, state, max_iterations, tolerance)
        precision = at_state.precision()
    return state, _solution(problem, at_state, precision, iterations)


def designed(problem: Problem[S], state: S) -> Solution:
    """Return the precision of a design, at a known state, before any measurement.

    Parameters
    ----------
    problem : Problem
        Its observations are the expected ones, without errors.
    state
        The true one.

    Returns
    -------
    Solution
        Without an iteration. The cost is its expectation, the redundancy: sigma0 is one.

    Raises
    ------
    AdjustmentError
        Where observations are fewer than unknowns.
    """
    with _solving():
        at_state = normals(problem, state)
        _degrees_of_freedom(problem, at_state)
        solution = _solution(problem, at_state, at_state.precision(), 0)
    return replace(solution, cost=float(solution.redundancy))


def covariance(problem: Problem[S], state: S, columns: Index) -> Array:
    """Return the covariance of some reduced unknowns at a state, a priori.

    Parameters
    ----------
    problem, state
        As `designed` takes them.
    columns : ndarray, shape (k,)

    Returns
    -------
    ndarray, shape (k, k)
        Computed faster than a whole solution.

    Raises
    ------
    AdjustmentError
        Where it cannot be computed.
    """
    with _solving():
        at_state = normals(problem, state)
        method: Callable[[Index], Array] | None = getattr(at_state, "covariance", None)
        if method is not None:
            return method(columns)
        return at_state.precision().inverse.at(columns[:, None], columns)


@contextmanager
def _solving() -> Iterator[None]:
    """Solve on one thread; raise an AdjustmentError for a singular system.

    Matrices are small or banded: more threads cost more than they save.
    """
    try:
        with processors.on_one_thread():
            yield
    except np.linalg.LinAlgError as error:
        raise unsolvable(str(error)) from error


def _solution(
    problem: Problem[S], at_state: Normals, precision: Precision, iterations: int
) -> Solution:
    return Solution(
        cost=at_state.cost,
        iterations=iterations,
        n_observations=at_state.n_observations,
        n_unknowns=_n_unknowns(problem),
        inverse=precision.inverse,
        cov_points=precision.cov_points,
        groups=precision.groups,
    )


def _iterate(
    problem: Problem[S], state: S, max_iterations: int, tolerance: float
) -> tuple[S, Normals, int]:
    """Return the state of least cost, the normal equations there, and the number of steps."""
    here, damping = normals(problem, state), Damping()
    if not np.isfinite(here.cost):
        raise AdjustmentError("the start values leave points behind a camera or at infinity")
    degrees = _degrees_of_freedom(problem, here)
    for iteration in range(max_iterations + 1):
        unit = here.cost / max(degrees, 1)
        taken = _descend(problem, state, here, damping=damping, unit=unit, tolerance=tolerance)
        if taken is None:
            return state, here, iteration
        state, here, damping = taken
    msg = f"no convergence after {max_iterations} iterations{_left_open(problem, state)}"
    raise NotConverged(msg)


def _descend(
    problem: Problem[S],
    state: S,
    here: Normals,
    *,
    damping: Damping,
    unit: float,
    tolerance: float,
) -> tuple[S, Normals, Damping] | None:
    """Return the next state, its normal equations and damping; None at the minimum."""
    start, hidden, promised = here, False, np.inf
    while not (damping.exhausted or (hidden and promised <= EXACT)):
        promised = here.promised
        if damping.value == 0.0 and promised <= tolerance**2 * unit:
            return None
        trial = problem.moved(state, *here.step())
        trial_normals = normals(problem, trial, damping.most_hopeful, before=start)
        kept = gain(start.cost - trial_normals.cost, promised)
        if damping.helps(kept):
            after = damping.after_success(kept, near=promised <= max(NEAR * unit, EXACT))
            if after.value != damping.most_hopeful:
                trial_normals = normals(problem, trial, after.value, before=start)
            return trial, trial_normals, after
        if damping.value == 0.0 and promised <= max(FINE * unit, EXACT):
            if trial_normals.promised < promised:
                return trial, trial_normals, damping
            hidden = True
        damping = damping.after_failure()
        here = normals(problem, state, damping.value, before=start)
    if hidden:
        return None
    raise NotConverged("no step reduces the cost any more")


def _left_open(problem: Problem[S], state: S) -> str:
    """Return the part of a message that names the unknowns left open; empty for none."""
    undetermined = normals(problem, state).precision().inverse.undetermined
    names = np.array(problem.column_names(), dtype=object)[undetermined].tolist()
    if not names:
        return ""
    more = f" and {len(names) - 4} more" if len(names) > 4 else ""
    return f"; the observations leave open {', '.join(names[:4])}{more}"


def _n_unknowns(problem: Problem[S]) -> int:
    return problem.n_columns + 3 * int(problem.free_points.sum())


def _degrees_of_freedom(problem: Problem[S], at_state: Normals) -> int:
    n_observations, n_unknowns = at_state.n_observations, _n_unknowns(problem)
    if n_observations < n_unknowns:
        msg = f"{n_observations} observations cannot determine {n_unknowns} unknowns"
        raise AdjustmentError(msg)
    return n_observations - n_unknowns


# --- Damping of Gauss-Newton steps by the gain ratio (Levenberg, Marquardt, Nielsen)


FIRST = 1e-3
"""Damping where the first full step fails, as a share of the diagonal."""

LEAST_SHRINKAGE = 1 / 3
"""Factor on the damping after a step that kept all of its promise."""

NEGLIGIBLE, MOST = 1e-14, 1e20
"""Damping below which steps are full, and above which the iteration fails."""

FULL_GAIN = 0.25
"""Gain of a full step below which a shorter one is tried."""


def gain(decrease: float, promised: float) -> float:
    """Return the decrease of the cost divided by the predicted one; zero without a prediction."""
    return decrease / promised if promised > 0 else -np.inf


@dataclass(frozen=True, kw_only=True)
class Damping:
    """Damping of the next step, and its change after success or failure.

    Attributes
    ----------
    value : float
        Share of the diagonal; zero for a full step.
    kept : float
        The value with which damping begins again if the full step fails.
    growth : float
        Factor after a step that fails; it doubles from failure to failure.

    Notes
    -----
    After a success
    the damping changes by ``max(1/3, 1 - (2 gain - 1)^3)`` [1]_.

    References
    ----------
    .. [1] H. B. Nielsen, "Damping parameter in Marquardt's method", IMM-REP-1999-05, 1999.
    """

    value: float = 0.0
    kept: float = FIRST
    growth: float = 2.0

    @property
    def most_hopeful(self) -> float:
        """The value after a step that keeps all of its promise."""
        return LEAST_SHRINKAGE * self.value

    @property
    def exhausted(self) -> bool:
        """Whether no step can be expected to help any more."""
        return self.value > MOST

    def helps(self, gain: float) -> bool:
        """Tell whether a step with this gain is taken."""
        return gain > (0.0 if self.value else FULL_GAIN)

    def after_success(self, gain: float, *, near: bool) -> Damping:
        """Return the damping after a successful step; near the minimum the next step is full."""
        if self.value == 0.0:
            return self
        value = max(self.most_hopeful, self.value * (1 - (2 * gain - 1) ** 3))
        if near or value < NEGLIGIBLE:
            return Damping(kept=max(value, NEGLIGIBLE))
        return Damping(value=value)

    def after_failure(self) -> Damping:
        """Return the damping after a failed step."""
        if self.value == 0.0:
            return replace(self, value=self.kept)
        return replace(self, value=self.value * self.growth, growth=2 * self.growth)


# --- Eliminated points: derivatives by the reduced unknowns, and covariances with them


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
    gain, _ = elimination(problem, state, points)
    return np.asarray(-solution.inverse.times(gain))


def elimination(problem: Problem[S], state: S, points: Index) -> tuple[Array, Array]:
    """Return derivatives of points by the reduced unknowns, and their conditional covariances.

    Parameters
    ----------
    problem : Problem
        Observations of other points are not used.
    state : the solution's
    points : ndarray, shape (k,)
        Held points have zero gain and zero covariance.

    Returns
    -------
    gain : ndarray, shape (k, 3, n_columns)
        Points move by -gain dx where the reduced unknowns move by dx.
    cov_points : ndarray, shape (k, 3, 3)
        Covariance of each point where the reduced unknowns are known.
    """
    known, back = np.unique(points, return_inverse=True)
    equations = [of_points(e, known)[0] for e in problem.equations(state) if e.B is not None]
    free = problem.free_points[known]
    V, _ = point_normals(free, equations)
    cov_points = np.linalg.inv(V)
    gain = cov_points @ point_rows(problem.n_columns, free, equations)
    cov_points[~free] = 0.0
    return gain[back], cov_points[back]


def of_points(e: Equations, points: Index) -> tuple[Equations, Index]:
    """Return the observations of some points, renumbered by places in `points`, and their rows.

    Parameters
    ----------
    e : Equations
        With points.
    points : ndarray, shape (k,)
        Sorted.
    """
    point_idx = np.asarray(e.point)
    rows = np.flatnonzero(np.isin(point_idx, points))
    parts = {name: getattr(e, name)[rows] for name in ("v", "sigma", "A", "unit", "B")}
    return replace(e, **parts, point=np.searchsorted(points, point_idx[rows])), rows
