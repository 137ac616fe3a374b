"""Distances between points, in halves."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle.observations.points import distance_equations, of_halves, usable
from acx4lib.geometry.distances import Distances, lengths
from support.helpers import numeric_jacobian


def _distances(sigma=0.01):
    """A tape of 5.02 m along a 3-4-5 triangle's longest side, and one of 4 m."""
    return Distances(
        point_idx=np.array([[0, 1], [1, 2]]),
        distance_m=np.array([5.02, 4.0]),
        sigma_m=np.array([sigma, 2 * sigma]),
    ), np.array([[0.0, 0.0, 7.0], [3.0, 4.0, 7.0], [3.0, 0.0, 7.0]])


def test_the_halves_of_a_distance_are_its_residual_with_one_point_each():
    distances, x_m = _distances()
    e = distance_equations(distances, x_m, np.array([6, 7]))
    assert_allclose(e.v.ravel(), [-0.01, 0.0, -0.01, 0.0], atol=1e-15)
    assert_allclose(of_halves(e.v).ravel(), [-0.02, 0.0], atol=1e-15)
    assert_allclose(np.sqrt(of_halves(e.sigma**2)).ravel(), distances.sigma_m)
    assert e.point.tolist() == [0, 1, 1, 2]
    assert_allclose(e.B[:, 0], [[-0.6, -0.8, 0], [0, 1, 0], [0.6, 0.8, 0], [0, -1, 0]], atol=1e-15)


def test_eliminating_the_joining_unknown_leaves_the_distances_own_normal_equations(rng):
    distances, x_m = _distances()
    x_m = x_m + rng.normal(0, 0.05, x_m.shape)
    e = distance_equations(distances, x_m, np.array([0, 1]))
    J = np.zeros((4, 2 + 9))
    for i in range(4):
        J[i, e.unit[i]] = e.A[i, 0, 0]
        J[i, 2 + 3 * e.point[i] : 5 + 3 * e.point[i]] = e.B[i, 0]
    J /= e.sigma
    v = (e.v / e.sigma).ravel()
    N, g = J.T @ J, J.T @ v
    reduced = N[2:, 2:] - N[2:, :2] @ np.linalg.solve(N[:2, :2], N[:2, 2:])
    right = g[2:] - N[2:, :2] @ np.linalg.solve(N[:2, :2], g[:2])

    def residuals(x):
        length, _ = lengths(x.reshape(-1, 3), distances.point_idx)
        return (length - distances.distance_m) / distances.sigma_m

    own = numeric_jacobian(residuals, x_m.ravel())
    assert_allclose(reduced, own.T @ own, rtol=1e-6, atol=1e-3)
    assert_allclose(right, own.T @ residuals(x_m.ravel()), rtol=1e-6, atol=1e-4)
    assert v @ v == pytest.approx(np.sum(residuals(x_m.ravel()) ** 2))


def test_distances_are_used_whose_ends_are_both_measured():
    distances, _ = _distances()
    assert usable(distances, np.array([0, 1, 1, 2, 5])).tolist() == [0, 1]
    assert usable(distances, np.array([1, 2])).tolist() == [1]
    out = replace(distances, sigma_m=np.array([0.1, np.inf]))
    assert usable(out, np.array([0, 1, 2])).tolist() == [0]
