"""Normal equations and what is solved of them: covariance, conditions with unknowns."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.geometry.frames import rotation_from_opk
from acx4lib.least_squares import covariance
from acx4lib.least_squares.covariance import WHITE, GaussMarkov
from acx4lib.least_squares.normal_equations import Equations, PlainNormals
from acx4sim.fly import gauss_markov

# --- steps and their predictions against the full normal equations ---------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class System:
    """Random observations of two units' columns, one of them held, and of points."""

    n: int
    free_points: np.ndarray
    equations: list

    def dense(self):
        """Return J and v, weighted, over columns and free points."""
        free = np.flatnonzero(self.free_points)
        rows, values = [], []
        for e in self.equations:
            for i, d in np.ndindex(e.v.shape):
                row = np.zeros(self.n + 3 * len(self.free_points))
                for column, a in zip(e.columns[e.unit[i]], e.A[i, d], strict=True):
                    if column >= 0:
                        row[column] += a
                if e.B is not None:
                    row[self.n + 3 * e.point[i] :][:3] += e.B[i, d]
                rows.append(row / e.sigma[i, d])
                values.append(e.v[i, d] / e.sigma[i, d])
        keep = np.concatenate([np.arange(self.n), *(self.n + 3 * p + np.arange(3) for p in free)])
        return np.array(rows)[:, keep], np.array(values)


@pytest.fixture
def system(rng):
    columns = np.array([[0, 1, -1, 4], [2, 3, 1, 4]])
    seen = Equations(
        kind="seen",
        v=rng.normal(size=(40, 2)),
        sigma=rng.uniform(0.5, 2.0, (40, 2)),
        A=rng.normal(size=(40, 2, 4)),
        columns=columns,
        unit=rng.integers(0, 2, 40),
        B=rng.normal(size=(40, 2, 3)),
        point=rng.integers(0, 6, 40),
    )
    control = Equations(
        kind="control",
        v=rng.normal(size=(2, 3)),
        sigma=np.full((2, 3), 0.7),
        A=np.zeros((2, 3, 0)),
        columns=np.zeros((1, 0), dtype=int),
        unit=np.zeros(2, dtype=int),
        B=rng.normal(size=(2, 3, 3)),
        point=np.array([4, 1]),
    )
    direct = Equations(
        kind="direct",
        v=rng.normal(size=(3, 1)),
        sigma=np.full((3, 1), 0.3),
        A=rng.normal(size=(3, 1, 2)),
        columns=np.array([[3, 0]]),
        unit=np.zeros(3, dtype=int),
    )
    free = np.array([True, True, False, True, True, True])
    return System(n=5, free_points=free, equations=[seen, control, direct])


@pytest.mark.parametrize("damping", [0.0, 0.3, 100.0])
def test_a_step_solves_the_full_system_with_its_diagonal_raised(system, damping):
    J, v = system.dense()
    N = J.T @ J
    expected = -np.linalg.solve(N + damping * np.diag(np.diag(N)), J.T @ v)
    normals = PlainNormals(
        n_columns=system.n,
        free_points=system.free_points,
        equations=system.equations,
        damping=damping,
    )
    dx, dp = normals.step()
    found = np.concatenate([dx, dp[system.free_points].ravel()])
    assert_allclose(found, expected, atol=1e-11)  # well conditioned, of size one
    assert_allclose(dp[~system.free_points], 0.0, atol=0)
    # what the gradient promises along the step; without damping all that can be gained
    assert normals.promised == pytest.approx(-(J.T @ v) @ expected, rel=1e-10)
    if damping == 0.0:
        assert normals.promised == pytest.approx(v @ v - np.sum((v + J @ expected) ** 2), rel=1e-10)


# --- covariance matrices carried through derivatives, and what is read from them -------------


def test_sigmas_come_back_along_turned_axes(rng):
    R = rotation_from_opk(rng.uniform(-1, 1, (4, 3)))
    sigma = rng.uniform(0.01, 1.0, (4, 3))
    turned = covariance.propagate(R, np.apply_along_axis(np.diag, 1, sigma**2))
    assert_allclose(np.trace(turned, axis1=1, axis2=2), (sigma**2).sum(axis=1), rtol=1e-12)
    back = covariance.propagate(np.swapaxes(R, 1, 2), turned)
    assert_allclose(covariance.sigmas(back), sigma, rtol=1e-12)


def test_a_sum_and_its_parts():
    """Sum of two with sigma 3 and 4, correlated by one half: 9 + 16 + 2 * 6."""
    cov = np.array([[9.0, 6.0], [6.0, 16.0]])
    with_sum = covariance.propagate(np.array([[1.0, 0.0], [1.0, 1.0]]), cov)
    assert_allclose(with_sum, [[9.0, 15.0], [15.0, 37.0]])
    assert_allclose(covariance.correlation(cov), [[1.0, 0.5], [0.5, 1.0]])


def test_what_is_held_has_no_sigma_and_no_correlation():
    cov = np.diag([4.0, 0.0, -1e-30])
    assert_allclose(covariance.sigmas(cov), [2.0, 0.0, 0.0])
    assert_allclose(covariance.correlation(np.diag([4.0, 0.0])), [[1.0, 0.0], [0.0, 0.0]])


def test_a_half_times_itself_is_the_covariance(rng):
    """Also with scales that differ by 12 digits, and for a parameter that is held."""
    mix = rng.normal(size=(2, 4, 4))
    scale = np.array([1.0, 1e-6, 1e-12, 0.0])
    cov = scale[:, None] * (mix @ np.swapaxes(mix, 1, 2)) * scale
    H = covariance.half(cov)
    size = np.where(scale > 0, scale, 1.0)
    back = H @ np.swapaxes(H, 1, 2)
    assert_allclose(back / size[:, None] / size, cov / size[:, None] / size, atol=1e-12)


# --- errors that change slowly beside white noise --------------------------------------------


def test_the_correlation_is_that_of_the_processes_which_the_simulator_draws():
    """20 000 processes: a correlation is known to 0.02 at three standard deviations."""
    time_s = np.array([0.0, 2.0, 5.0, 60.0])
    walks = gauss_markov(time_s, np.full(20_000, 20.0), np.random.default_rng(1))
    process = GaussMarkov(share=0.5, time_constant_s=20.0)
    assert_allclose(process.together(time_s), np.corrcoef(walks), atol=0.02)


def test_the_origin_of_time_does_not_matter():
    process = GaussMarkov(share=0.5, time_constant_s=2.0)
    assert process.together(np.array([7.0, 9.0]))[0, 1] == pytest.approx(np.exp(-1.0))
    assert process.together(np.array([9.0, 7.0]))[0, 1] == pytest.approx(np.exp(-1.0))


def test_errors_are_white_unless_it_is_said_otherwise():
    assert WHITE.share == 0


@pytest.mark.parametrize(
    ("wrong", "says"),
    [
        ({"share": 1.1}, "share: expected a number from 0 to 1, got 1.1"),
        ({"share": -0.1}, "share: expected"),
        ({"share": np.nan}, "share: expected"),
        ({"time_constant_s": 0.0}, "time_constant_s"),
    ],
)
def test_wrong_values_are_named(wrong, says):
    with pytest.raises(ValueError, match=says):
        GaussMarkov(**wrong)
