"""Steps and their predictions against the full normal equations."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.least_squares.normal_equations import Equations, PlainNormals


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
