"""The least-squares core on problems whose answers are in every textbook."""

from dataclasses import dataclass, field, replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4lib.errors import AdjustmentError
from acx4lib.least_squares import adjustment
from acx4lib.least_squares.adjustment import (
    FIRST,
    Damping,
    cross_covariance,
    elimination,
    gain,
    solve,
)
from acx4lib.least_squares.normal_equations import Equations
from support.helpers import dense_covariance, dense_jacobian, weighted_residuals

EXACT = 1e-12  # relative; a handful of operations in double precision


@dataclass(frozen=True, kw_only=True, eq=False)
class Curve:
    """Observations y of a function of the columns; no points.

    `function` and `derivative` take the columns and give shapes (m,) and (m, n).
    """

    function: callable
    derivative: callable
    y: np.ndarray
    sigma: np.ndarray
    n_columns: int
    n_points: int = 0
    free_points: np.ndarray = field(default_factory=lambda: np.zeros(0, dtype=bool))

    def residuals(self, state):
        return [((self.function(state) - self.y)[:, None], self.sigma[:, None])]

    def equations(self, state):
        (v, sigma), *_ = self.residuals(state)
        m = len(v)
        return [
            Equations(
                kind="y",
                v=v,
                sigma=sigma,
                A=self.derivative(state)[:, None, :],
                columns=np.arange(self.n_columns)[None],
                unit=np.zeros(m, dtype=int),
            )
        ]

    def moved(self, state, dx, dp):
        return state + dx

    def column_names(self):
        return [f"x{i}" for i in range(self.n_columns)]


def linear(design, y, sigma):
    return Curve(
        function=lambda x: design @ x,
        derivative=lambda _: design,
        y=np.asarray(y, dtype=float),
        sigma=np.broadcast_to(np.asarray(sigma, dtype=float), len(y)),
        n_columns=design.shape[1],
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Points:
    """Points observed directly, some in a frame that is shifted by the three columns.

    Attributes
    ----------
    n_points : int
    point, shifted : ndarray, shape (m,)
    y, sigma : ndarray, shape (m, 3)
    """

    n_points: int
    point: np.ndarray
    shifted: np.ndarray
    y: np.ndarray
    sigma: np.ndarray
    n_columns: int = 3
    held: tuple[int, ...] = ()

    @property
    def free_points(self):
        return ~np.isin(np.arange(self.n_points), self.held)

    def residuals(self, state):
        columns, points = state
        return [(points[self.point] + self.shifted[:, None] * columns - self.y, self.sigma)]

    def equations(self, state):
        (v, sigma), *_ = self.residuals(state)
        m = len(v)
        return [
            Equations(
                kind="y",
                v=v,
                sigma=sigma,
                A=np.tile(np.eye(3), (m, 1, 1)),
                columns=np.array([[0, 1, 2], [-1, -1, -1]]),
                unit=np.where(self.shifted, 0, 1),
                B=np.tile(np.eye(3), (m, 1, 1)),
                point=self.point,
            )
        ]

    def moved(self, state, dx, dp):
        return state[0] + dx, state[1] + dp

    def column_names(self):
        return ["x", "y", "z"]


def start(problem):
    return np.zeros(3), np.zeros((problem.n_points, 3))


def shifted_points(rng, *, n=8, m=30, held=()):
    """Three observations or more of every point, every other one shifted; in any order."""
    order = rng.permutation(m)
    point, shifted = np.arange(m) % n, (np.arange(m) // n) % 2 == 1
    return Points(
        n_points=n,
        point=point[order],
        shifted=shifted[order],
        y=rng.normal(size=(m, 3)),
        sigma=rng.uniform(0.5, 2.0, (m, 3)),
        held=held,
    )


# --- textbook cases --------------------------------------------------------------------------


def test_a_straight_line_has_the_textbooks_estimate_and_sigmas(rng):
    x = np.array([0.0, 1.0, 2.0, 3.0, 5.0, 8.0])
    y = 2.0 - 0.5 * x + rng.normal(0, 0.3, 6)
    state, solution = solve(linear(np.column_stack([np.ones(6), x]), y, 0.3), np.zeros(2))
    line = stats.linregress(x, y)
    assert_allclose(state, [line.intercept, line.slope], rtol=EXACT)
    v = line.intercept + line.slope * x - y
    assert_allclose(solution.group("y").v[:, 0], v, atol=EXACT)
    assert solution.cost == pytest.approx(np.sum(v**2) / 0.09, rel=EXACT)
    assert (solution.redundancy, solution.n_observations, solution.n_unknowns) == (4, 6, 2)
    # linregress scales by the a posteriori variance: s^2 = sum v^2 / (n - 2)
    sigma = np.sqrt(solution.sigma0_sq * np.diag(solution.cov))
    assert_allclose(sigma, [line.intercept_stderr, line.stderr], rtol=1e-10)
    # redundancy numbers: 1 - 1/n - (x - mean)^2 / Sxx; w: v over its own sigma
    redundancy = 1 - 1 / 6 - (x - x.mean()) ** 2 / np.sum((x - x.mean()) ** 2)
    assert_allclose(solution.group("y").redundancy[:, 0], redundancy, rtol=1e-10)
    assert_allclose(solution.group("y").w[:, 0], v / (0.3 * np.sqrt(redundancy)), rtol=1e-10)


def test_a_weighted_mean_of_numbers():
    y, sigma = np.array([10.0, 12.0, 11.0]), np.array([1.0, 2.0, 0.5])
    state, solution = solve(linear(np.ones((3, 1)), y, sigma), np.zeros(1))
    P = 1 / sigma**2
    assert state[0] == pytest.approx(np.sum(P * y) / np.sum(P), rel=EXACT)
    assert solution.cov[0, 0] == pytest.approx(1 / np.sum(P), rel=EXACT)
    assert_allclose(solution.group("y").redundancy[:, 0], 1 - P / np.sum(P), rtol=EXACT)


def test_a_weighted_mean_of_a_point(rng):
    problem = Points(
        n_points=1,
        point=np.zeros(4, dtype=int),
        shifted=np.zeros(4, dtype=bool),
        y=rng.normal(size=(4, 3)),
        sigma=rng.uniform(0.5, 2.0, (4, 3)),
        n_columns=0,
    )
    problem = replace(problem)
    (_, points), solution = solve(without_columns(problem), (np.zeros(0), np.zeros((1, 3))))
    P = 1 / problem.sigma**2
    assert_allclose(points[0], np.sum(P * problem.y, axis=0) / P.sum(axis=0), rtol=EXACT)
    assert_allclose(solution.cov_points[0], np.diag(1 / P.sum(axis=0)), atol=EXACT)
    assert solution.redundancy == 9
    assert_allclose(solution.group("y").redundancy, 1 - P / P.sum(axis=0), rtol=EXACT)


def without_columns(problem):
    """The same problem in a form without any column."""

    class Plain(Points):
        def residuals(self, state):
            return [(state[1][self.point] - self.y, self.sigma)]

        def equations(self, state):
            (e,) = Points.equations(self, (np.zeros(3), state[1]))
            m = len(e.v)
            nothing = {"A": np.zeros((m, 3, 0)), "columns": np.zeros((1, 0), dtype=int)}
            return [replace(e, **nothing, unit=np.zeros(m, dtype=int))]

        def column_names(self):
            return []

    return Plain(**{name: getattr(problem, name) for name in problem.__dataclass_fields__})


def test_a_point_observed_once_takes_the_observation_and_its_sigma():
    problem = Points(
        n_points=1,
        point=np.zeros(1, dtype=int),
        shifted=np.zeros(1, dtype=bool),
        y=np.array([[1.0, -2.0, 3.0]]),
        sigma=np.array([[0.1, 0.2, 0.3]]),
        n_columns=0,
    )
    (_, points), solution = solve(without_columns(problem), (np.zeros(0), np.zeros((1, 3))))
    assert_allclose(points, problem.y, atol=EXACT)
    assert_allclose(solution.cov_points[0], np.diag([0.01, 0.04, 0.09]), rtol=EXACT)
    assert solution.redundancy == 0
    assert solution.sigma0_sq == 1.0  # nothing says otherwise
    assert solution.chi_square_p == 1.0
    assert_allclose(solution.group("y").redundancy, 0.0, atol=EXACT)
    assert np.isnan(solution.group("y").w).all()  # nothing controls it


# --- against the full normal equations -------------------------------------------------------


@pytest.mark.parametrize("held", [(), (2,), (0, 1, 2)])
def test_eliminating_the_points_changes_nothing(rng, held):
    problem = shifted_points(rng, held=held)
    state, solution = solve(problem, start(problem))
    J = dense_jacobian(problem, state)
    # the gradient of the full system vanishes
    assert_allclose(J.T @ weighted_residuals(problem, state), 0.0, atol=1e-10)
    full = dense_covariance(problem, state)
    assert_allclose(solution.cov, full[:3, :3], rtol=1e-10)
    free = np.flatnonzero(problem.free_points)
    for i, point in enumerate(free):
        block = slice(3 + 3 * i, 6 + 3 * i)
        assert_allclose(solution.cov_points[point], full[block, block], atol=1e-12)
    assert_allclose(solution.cov_points[list(held)], 0.0, atol=0)
    assert_allclose(state[1][list(held)], 0.0, atol=0)  # they stay where they were
    leverage = np.einsum("ij,jk,ik->i", J, full, J)
    redundancy = solution.group("y").redundancy
    assert_allclose(redundancy.ravel(), 1 - leverage, atol=1e-10)
    assert np.sum(redundancy) == pytest.approx(solution.redundancy, abs=1e-9)
    w = weighted_residuals(problem, state) / np.sqrt(1 - leverage)
    assert_allclose(solution.group("y").w.ravel(), w, atol=1e-8)
    cross = cross_covariance(problem, state, solution, free)
    assert_allclose(cross.reshape(-1, 3), full[3:, :3], atol=1e-12)


def test_an_infinite_sigma_takes_a_component_out(rng):
    problem = shifted_points(rng)
    sigma = problem.sigma.copy()
    sigma[[3, 20], [0, 2]] = np.inf
    y = problem.y.copy()
    y[[3, 20], [0, 2]] = 1e6  # must not matter
    state, solution = solve(replace(problem, sigma=sigma, y=y), start(problem))
    other, _ = solve(replace(problem, sigma=sigma), start(problem))
    assert_allclose(state[0], other[0], atol=1e-9)
    assert solution.n_observations == 3 * 30 - 2
    used = solution.group("y").used
    assert np.isnan(solution.group("y").w[~used]).all()
    assert np.sum(solution.group("y").redundancy[used]) == pytest.approx(solution.redundancy)


def test_the_order_of_the_observations_changes_nothing(rng):
    """Sorted by point and in any order, which take different ways through the sums."""
    problem = shifted_points(rng)
    order = np.argsort(problem.point, kind="stable")
    state, solution = solve(problem, start(problem))
    ordered = replace(
        problem,
        **{name: getattr(problem, name)[order] for name in ("point", "shifted", "y", "sigma")},
    )
    other_state, other = solve(ordered, start(problem))
    assert_allclose(other_state[0], state[0], atol=1e-12)
    assert_allclose(other_state[1], state[1], atol=1e-12)
    assert_allclose(other.cov, solution.cov, rtol=1e-12)
    assert_allclose(other.group("y").w, solution.group("y").w[order], atol=1e-9)


def test_a_shift_of_many_points_is_their_mean_difference(rng):
    """Two observations per point, one of them shifted: the shift is the mean difference."""
    n = 612
    y = rng.normal(size=(2 * n, 3))
    problem = Points(
        n_points=n,
        point=np.repeat(np.arange(n), 2),
        shifted=np.arange(2 * n) % 2 == 1,
        y=y,
        sigma=np.ones((2 * n, 3)),
    )
    (columns, points), solution = solve(problem, start(problem))
    difference = y[1::2] - y[0::2]
    assert_allclose(columns, difference.mean(axis=0), atol=EXACT)
    assert_allclose(points, (y[0::2] + y[1::2] - columns) / 2, atol=EXACT)
    assert_allclose(solution.cov, 2 / n * np.eye(3), atol=EXACT)
    # var(point) = 1/2 + 1/4 var(shift)
    assert_allclose(solution.cov_points[-1], (1 / 2 + 1 / (2 * n)) * np.eye(3), atol=EXACT)
    cross = cross_covariance(problem, (columns, points), solution, np.array([0, n - 1]))
    assert_allclose(cross, -np.tile(np.eye(3), (2, 1, 1)) / n, atol=EXACT)


def test_units_do_not_matter(rng):
    """Columns of sizes as different as those of f and k3, with the same relative result."""
    design = rng.normal(size=(20, 3))
    y = rng.normal(size=20)
    sizes = np.array([1.0, 1e-14, 1e6])
    state, solution = solve(linear(design, y, 0.1), np.zeros(3))
    scaled_state, scaled = solve(linear(design / sizes, y, 0.1), np.zeros(3))
    assert_allclose(scaled_state, state * sizes, rtol=1e-10)
    assert_allclose(scaled.cov, solution.cov * np.outer(sizes, sizes), rtol=1e-10)
    assert scaled.condition == pytest.approx(solution.condition, rel=1e-8)
    assert not scaled.undetermined.any()


# --- what the data do not determine ----------------------------------------------------------


def test_columns_that_are_seen_only_in_their_sum_are_undetermined(rng):
    x = rng.normal(size=(15, 2))
    design = np.column_stack([x[:, 0], x[:, 1], 3 * x[:, 1]])
    state, solution = solve(linear(design, rng.normal(size=15), 0.1), np.zeros(3))
    assert solution.undetermined.tolist() == [False, True, True]
    assert np.isfinite(state).all()
    alone = np.linalg.lstsq(x, linear(design, np.zeros(15), 1).y, rcond=None)[0]
    assert_allclose(alone, 0)  # the determined column is unharmed by the open direction:
    fit = np.linalg.inv(x.T @ x / 0.01)
    assert solution.cov[0, 0] == pytest.approx(fit[0, 0], rel=1e-8)
    weakest = np.abs(solution.weakest)
    assert weakest[0] < 1e-6  # the direction that is open has no part in the first column
    assert min(weakest[1:]) > 0.5


def test_a_column_that_is_not_observed_at_all_is_undetermined():
    design = np.column_stack([np.ones(4), np.zeros(4)])
    _, solution = solve(linear(design, np.arange(4.0), 1.0), np.zeros(2))
    assert solution.undetermined.tolist() == [False, True]
    assert solution.condition == pytest.approx(1.0)  # of what is observed
    assert_allclose(np.abs(solution.weakest), [1, 0])
    assert solution.cov[0, 0] == pytest.approx(0.25)


def test_a_shift_without_any_unshifted_observation_is_undetermined(rng):
    """A datum defect: all points and the shift can move together, axis by axis."""
    problem = shifted_points(rng)
    problem = replace(problem, shifted=np.ones(30, dtype=bool))
    _, solution = solve(problem, start(problem))
    assert solution.undetermined.tolist() == [True, True, True]


def test_fewer_observations_than_unknowns_are_an_error():
    with pytest.raises(AdjustmentError, match="2 observations cannot determine 3 unknowns"):
        solve(linear(np.ones((2, 3)), np.zeros(2), 1.0), np.zeros(3))


# --- convergence -----------------------------------------------------------------------------


def arctangent(start_at, *, sign=1.0):
    """Gauss-Newton on arctan(x) = 0 diverges from beyond 1.39; nine copies give redundancy."""
    problem = Curve(
        function=lambda x: np.arctan(x[0]) * np.ones(9),
        derivative=lambda x: sign * np.full((9, 1), 1 / (1 + x[0] ** 2)),
        y=np.zeros(9),
        sigma=np.ones(9),
        n_columns=1,
    )
    return solve(problem, np.array([start_at]))


@pytest.mark.parametrize("start_at", [0.5, 3.0, -20.0])
def test_damping_brings_far_start_values_home(start_at):
    state, solution = arctangent(start_at)
    assert state[0] == pytest.approx(0.0, abs=1e-9)
    assert solution.iterations < 30


def test_an_exponential_is_fitted_from_afar(rng):
    t = np.linspace(0, 4, 25)
    y = 3.0 * np.exp(-0.7 * t) + rng.normal(0, 0.01, 25)
    problem = Curve(
        function=lambda x: x[0] * np.exp(-x[1] * t),
        derivative=lambda x: np.column_stack([np.exp(-x[1] * t), -x[0] * t * np.exp(-x[1] * t)]),
        y=y,
        sigma=np.full(25, 0.01),
        n_columns=2,
    )
    state, solution = solve(problem, np.array([30.0, 5.0]))
    assert np.all(np.abs(state - [3.0, 0.7]) < 4 * np.sqrt(np.diag(solution.cov)))
    gradient = dense_jacobian(problem, state).T @ weighted_residuals(problem, state)
    # a step of 1e-6 sigma is left at most: gradient = N dx
    left = np.abs(gradient) * np.sqrt(np.diag(solution.cov))
    assert np.all(left < 1e-5)


def test_a_wider_tolerance_stops_sooner_and_is_kept():
    """With large residuals Gauss-Newton converges linearly, here by a hundred per step."""
    t = np.linspace(0, 2, 12)
    problem = Curve(
        function=lambda x: np.exp(x[0] * t),
        derivative=lambda x: (t * np.exp(x[0] * t))[:, None],
        y=np.exp(t) + 5 * (t - 1),
        sigma=np.ones(12),
        n_columns=1,
    )
    exact, _ = solve(problem, np.ones(1), tolerance=1e-9)
    iterations = []
    for tolerance in (1e-1, 1e-2, 1e-4, 1e-6):
        state, solution = solve(problem, np.ones(1), tolerance=tolerance)
        sigma = np.sqrt(solution.sigma0_sq * solution.cov[0, 0])
        assert abs(state - exact)[0] < tolerance * sigma
        iterations.append(solution.iterations)
    assert iterations == sorted(iterations)
    assert iterations[0] < iterations[-1]


def test_what_is_left_open_is_named_where_nothing_converges():
    """Only the sum of the first two columns enters."""
    design = np.array([1.0, 1.0, 0.0, 0.0, 0.0, 0.0])
    problem = Curve(
        function=lambda x: np.exp(x[:1] + x[1:2]) * np.ones(8),
        derivative=lambda x: np.exp(x[0] + x[1]) * np.tile(design, (8, 1)),
        y=np.arange(8.0),
        sigma=np.ones(8),
        n_columns=6,
    )
    with pytest.raises(AdjustmentError) as error:
        solve(problem, np.full(6, 3.0), max_iterations=2)
    assert str(error.value).endswith("leave open x0, x1, x2, x3 and 2 more")


def test_too_few_iterations_are_an_error():
    problem = Curve(
        function=lambda x: np.exp(x[0]) * np.ones(3),
        derivative=lambda x: np.exp(x[0]) * np.ones((3, 1)),
        y=np.array([1.0, 2.0, 3.0]),
        sigma=np.ones(3),
        n_columns=1,
    )
    with pytest.raises(AdjustmentError, match=r"no convergence after 2 iterations$"):
        solve(problem, np.array([3.0]), max_iterations=2)


def test_a_derivative_of_the_wrong_sign_is_not_taken_for_convergence():
    with pytest.raises(AdjustmentError, match="no step reduces the cost"):
        arctangent(0.5, sign=-1.0)


def test_start_values_at_infinity_are_an_error():
    with pytest.raises(AdjustmentError, match="start values"):
        solve(linear(np.ones((3, 1)), [0.0, 1.0, np.nan], 1.0), np.zeros(1))


# --- the global test -------------------------------------------------------------------------


@pytest.mark.parametrize("tail", [0.005, 0.3])
def test_the_global_test_is_two_sided(tail):
    low, high = stats.chi2.ppf([tail, 1 - tail], 12)
    assert adjustment.two_sided_p(low, 12) == pytest.approx(2 * tail)
    assert adjustment.two_sided_p(high, 12) == pytest.approx(2 * tail)


def test_a_far_too_large_cost_has_a_small_probability_not_zero():
    """One minus the distribution function would be zero from 1e-16 on."""
    assert 0 < adjustment.two_sided_p(200.0, 10) < 1e-35


# --- Nielsen's rule, by the figures of his report


def test_damping_begins_where_a_full_step_fails_and_grows_faster_and_faster():
    damping, values = Damping(), []
    for _ in range(4):
        damping = damping.after_failure()
        values.append(damping.value / FIRST)
    assert values == pytest.approx([1.0, 2.0, 8.0, 64.0])  # factors 2, 4, 8


@pytest.mark.parametrize(("kept", "factor"), [(1.0, 1 / 3), (0.5, 1.0), (0.0, 2.0), (0.75, 0.875)])
def test_after_a_success_it_follows_the_gain(kept, factor):
    after = Damping(value=0.1, growth=16.0).after_success(kept, near=False)
    assert after.value == pytest.approx(0.1 * factor)
    assert after.growth == 2.0


def test_near_the_minimum_steps_are_full_and_damping_is_remembered():
    after = Damping(value=0.3).after_success(1.0, near=True)
    assert after.value == 0.0
    assert after.after_failure().value == pytest.approx(0.1)


def test_a_full_step_must_keep_a_quarter_of_its_promise():
    assert not Damping().helps(0.2)
    assert Damping().helps(0.3)
    assert Damping(value=0.1).helps(0.01)
    assert not Damping(value=0.1).helps(gain(1.0, 0.0))  # nothing was promised


# --- Points that were eliminated, in a bundle whose normal matrix is inverted as a whole


def test_points_follow_the_unknowns_and_keep_a_rest(mounted):
    network, solution = mounted.network, mounted.solution
    full, n = dense_covariance(network, mounted.state), network.n_columns
    free = np.flatnonzero(network.free_points)
    some = np.array([5, 0, len(free) - 1, 5])
    gain, own = elimination(network, mounted.state, free[some])
    at = n + 3 * some[:, None] + np.arange(3)
    sigma = np.sqrt(np.diag(full))
    for i, a in enumerate(at):
        for j, b in enumerate(at):
            expected = full[np.ix_(a, b)]
            found = gain[i] @ full[:n, :n] @ gain[j].T + (own[i] if some[i] == some[j] else 0.0)
            assert_allclose(
                found / np.outer(sigma[a], sigma[b]),
                expected / np.outer(sigma[a], sigma[b]),
                atol=1e-8,
            )
    cross = cross_covariance(network, mounted.state, solution, free[some])
    assert_allclose(cross, -solution.inverse.times(gain))


def test_a_held_point_follows_nothing(mounted):
    network = mounted.network
    held = np.flatnonzero(~network.free_points)
    gain, own = elimination(network, mounted.state, held)
    assert not gain.any()
    assert not own.any()
