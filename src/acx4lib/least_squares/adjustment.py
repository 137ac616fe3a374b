"""Least squares that knows no camera.

There are two kinds of unknowns: the columns of the reduced system, and points with three
coordinates each. An observation depends on one point at most; therefore the Schur complement
eliminates the points. A `problem.Problem` linearises its observations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from acx4lib import expected, shown
from acx4lib.errors import AdjustmentError, unsolvable
from acx4lib.expected import Array, Index, Mask
from acx4lib.least_squares import processors
from acx4lib.least_squares.damping import Damping, gain
from acx4lib.least_squares.dense import Inverse
from acx4lib.least_squares.normal_equations import PlainNormals
from acx4lib.least_squares.problem import Normals, Precision, Problem
from acx4lib.least_squares.statistical.distributions import chi2_cdf, chi2_sf
from acx4lib.least_squares.statistical.residuals import Group

S = TypeVar("S")

NEAR = 1e-4
"""Predicted decrease of the cost, in units of its mean, below which no step needs damping."""

FINE = 1e-6
"""The same, below which rounding errors may hide it: the next prediction tells instead."""

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
    n_observations, n_unknowns : int
    inverse : Inverse
        Of the reduced normal matrix: the a priori covariance of the reduced unknowns
        (sigma0 = 1), and the directions that the observations leave open.
    cov_points : ndarray, shape (n_points, 3, 3)
        A priori covariances; zero for points that are held.
    groups : tuple of Group
    datum : str
        What the covariances refer to: ``"observed"``, or held unknowns, or ``"inner"``
        constraints on points.
    """

    cost: float
    iterations: int
    n_observations: int
    n_unknowns: int
    inverse: Inverse
    cov_points: Array
    groups: tuple[Group, ...]
    datum: str = "observed"

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
        """A posteriori variance of unit weight; one where there is no redundancy."""
        return self.cost / self.redundancy if self.redundancy > 0 else 1.0

    @property
    def chi_square_p(self) -> float:
        """Two-sided probability of such a cost or a more extreme one, if the weights are right."""
        return two_sided_p(self.cost, self.redundancy)

    def group(self, kind: str) -> Group:
        """Return the residuals of one kind."""
        expected.one_of("kind", kind, [g.kind for g in self.groups])
        return next(g for g in self.groups if g.kind == kind)


def two_sided_p(cost: float, redundancy: int) -> float:
    """Return the two-sided probability of a chi-square value; one without redundancy."""
    if redundancy <= 0:
        return 1.0
    below, above = chi2_cdf(cost, redundancy), chi2_sf(cost, redundancy)
    return 2 * min(below, above)


def normals(
    problem: Problem[S], state: S, damping: float = 0.0, *, before: Normals | None = None
) -> Normals:
    """Return a problem's normal equations at a state, from its own method if it has one.

    Its own may take over the memory of the normal equations at the state before. Damping remembers
    the diagonal of plain ones.
    """
    own: Callable[[S, float, Normals | None], Normals] | None = getattr(problem, "normals", None)
    if own is not None:
        return own(state, damping, before)
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
    """Adjust: Gauss-Newton, damped by the gain ratio where full steps do not keep their promise.

    Parameters
    ----------
    problem : Problem
    state : start values
    max_iterations : int
    tolerance : float
        Largest next step at the end, in standard deviations of the unknowns.

    Returns
    -------
    state, solution

    Raises
    ------
    AdjustmentError
        Where it does not converge, or observations are fewer than unknowns.

    Notes
    -----
    The iteration ends where the next full step would be shorter than `tolerance`, or where
    rounding errors keep both the cost and the length of the step from decreasing any more.
    """
    expected.whole("max_iterations", max_iterations)
    expected.positive_number("tolerance", tolerance)
    with _solving():
        state, at_state, iterations = _iterate(problem, state, max_iterations, tolerance)
        precision = at_state.precision()
    return state, _solution(problem, at_state, precision, iterations)


def designed(problem: Problem[S], state: S) -> Solution:
    """Return the precision of a design: at a known state, before anything is measured.

    Parameters
    ----------
    problem : Problem
        Its observations are where they would be, without errors.
    state
        The true one.

    Returns
    -------
    Solution
        Without an iteration. The cost is the one that is expected, the redundancy: sigma0 is one.

    Raises
    ------
    AdjustmentError
        Where observations are fewer than unknowns.
    """
    with _solving():
        at_state = normals(problem, state)
        _degrees_of_freedom(problem, at_state)
        found = _solution(problem, at_state, at_state.precision(), 0)
    return replace(found, cost=float(found.redundancy))


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
        Sooner than all that a solution has.

    Raises
    ------
    AdjustmentError
        Where it cannot be computed.
    """
    with _solving():
        at_state = normals(problem, state)
        own: Callable[[Index], Array] | None = getattr(at_state, "covariance", None)
        if own is not None:
            return own(columns)
        return at_state.precision().inverse.at(columns[:, None], columns)


@contextmanager
def _solving() -> Iterator[None]:
    """Solve on one thread; what cannot be solved is an AdjustmentError.

    Matrices are small or banded: more threads cost more than they bring.
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
        msg = "the start values leave points behind a camera or at infinity"
        raise AdjustmentError(msg)
    degrees = _degrees_of_freedom(problem, here)
    for iteration in range(max_iterations + 1):
        unit = here.cost / max(degrees, 1)
        taken = _descend(problem, state, here, damping=damping, unit=unit, tolerance=tolerance)
        if taken is None:
            return state, here, iteration
        state, here, damping = taken
    msg = f"no convergence after {max_iterations} iterations{_left_open(problem, state)}"
    raise AdjustmentError(msg)


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
        there = normals(problem, trial, damping.most_hopeful, before=start)
        kept = gain(start.cost - there.cost, promised)
        if damping.helps(kept):
            after = damping.after_success(kept, near=promised <= max(NEAR * unit, EXACT))
            if after.value != damping.most_hopeful:
                there = normals(problem, trial, after.value, before=start)
            return trial, there, after
        if damping.value == 0.0 and promised <= max(FINE * unit, EXACT):
            if there.promised < promised:
                return trial, there, damping
            hidden = True
        damping = damping.after_failure()
        here = normals(problem, state, damping.value, before=start)
    if hidden:
        return None
    msg = "no step reduces the cost any more"
    raise AdjustmentError(msg)


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


def require_own_datum(solution: Solution) -> None:
    """Raise a ValueError for a solution in the datum of inner constraints."""
    if solution.datum == "inner":
        msg = (
            "solution: expected one in the datum of its observations or held unknowns, got one of "
            "inner constraints; take that with minimal constraints, whose residuals are the same"
        )
        raise ValueError(msg)
