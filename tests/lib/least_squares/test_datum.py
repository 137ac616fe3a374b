"""The S-transformation of a small network: points measured from stations, all of them unknown."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.least_squares import adjustment
from acx4lib.least_squares.datum import Motions, with_inner_constraints
from acx4lib.least_squares.normal_equations import Equations

N_STATIONS, N_POINTS = 3, 5


@dataclass(frozen=True, kw_only=True, eq=False)
class Stations:
    """Vectors from stations to points; columns are the free stations' coordinates."""

    columns: np.ndarray
    vectors: np.ndarray
    sigma: np.ndarray

    @property
    def n_columns(self):
        return int((self.columns >= 0).sum())

    n_points = N_POINTS

    @property
    def free_points(self):
        return np.ones(N_POINTS, dtype=bool)

    def column_names(self):
        return [f"c{i}" for i in range(self.n_columns)]

    def equations(self, state):
        stations, x = state
        at, to = (i.ravel() for i in np.indices((N_STATIONS, N_POINTS)))
        identity = np.tile(np.eye(3), (len(at), 1, 1))
        return [
            Equations(
                kind="vector",
                v=x[to] - stations[at] - self.vectors,
                sigma=self.sigma,
                A=-identity,
                columns=self.columns,
                unit=at,
                B=identity,
                point=to,
            )
        ]

    def moved(self, state, dx, dp):
        stations, x = state
        return stations + np.append(dx, 0.0)[self.columns], x + dp


@pytest.fixture
def everything(rng):
    """Return the whole problem with all columns free, one with a held station, and its start."""
    stations, x = rng.normal(size=(N_STATIONS, 3)), rng.normal(size=(N_POINTS, 3))
    vectors = (x[None] - stations[:, None]).reshape(-1, 3)
    sigma = rng.uniform(0.5, 2.0, vectors.shape)
    whole = Stations(
        columns=np.arange(9).reshape(3, 3),
        vectors=vectors + sigma * rng.normal(size=vectors.shape),
        sigma=sigma,
    )
    place = np.array([0, 1, 2, -1, -1, -1, 3, 4, 5])
    return whole, replace(whole, columns=place.reshape(3, 3)), place, (stations, x)


@pytest.mark.parametrize("which", [range(N_POINTS), (1, 3)])
def test_the_covariance_is_that_of_normal_equations_with_a_border(everything, which):
    whole, held, place, start = everything
    state, solution = adjustment.solve(held, start)
    shift = np.tile(np.eye(3), (N_POINTS, 1, 1))
    chosen = np.isin(np.arange(N_POINTS), list(which))
    found = with_inner_constraints(
        (held, state, solution),
        Motions(columns=np.tile(np.eye(3), (N_STATIONS, 1)), points=shift),
        place,
        chosen,
    )
    (e,) = whole.equations(state)
    J = np.zeros((len(e.v), 3, 9 + 3 * N_POINTS))
    for i in range(len(e.v)):
        J[i, :, 3 * e.unit[i] + np.arange(3)] = -np.eye(3)
        J[i, :, 9 + 3 * e.point[i] + np.arange(3)] = np.eye(3)
    J = (J / e.sigma[:, :, None]).reshape(-1, J.shape[2])
    border = np.concatenate([np.zeros((9, 3)), (shift * chosen[:, None, None]).reshape(-1, 3)])
    expected = np.linalg.inv(np.block([[J.T @ J, border], [border.T, np.zeros((3, 3))]]))
    assert_allclose(found.cov, expected[:9, :9], atol=1e-12)
    for p in range(N_POINTS):
        own = slice(9 + 3 * p, 12 + 3 * p)
        assert_allclose(found.cov_points[p], expected[own, own], atol=1e-12)
    some = np.arange(18.0).reshape(2, 9)
    assert_allclose(found.inverse.times(some), some @ expected[:9, :9], atol=1e-10)
    assert (found.redundancy, found.defect) == (solution.redundancy, 3)
    assert found.n_unknowns == 9 + 3 * N_POINTS
    assert found.condition == solution.condition
    assert_allclose(found.inverse.weakest[place >= 0], solution.weakest)
    assert not found.undetermined.any()
