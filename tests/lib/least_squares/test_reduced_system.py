"""Reduced systems, dense and banded, against numpy's own linear algebra."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import linalg

from acx4lib.errors import AdjustmentError
from acx4lib.least_squares.reduced_system import (
    SINGULAR,
    Banded,
    BandedInverse,
    Bordered,
    Dense,
    too_large,
)

ROUNDING = 1e-11  # relative, for condition numbers of a few thousand


def bordered(rng, *, n_poses=11, band=3, n_border=5):
    """Normal equations of random observations, each of two neighbouring poses and the border."""
    n = n_border + 6 * n_poses
    N = np.zeros((n, n))
    for pose in range(n_poses):
        for other in range(pose, min(pose + band, n_poses)):
            J = np.zeros((8, n))
            for k in (pose, other):
                J[:, n_border + 6 * k : n_border + 6 * k + 6] = rng.normal(size=(8, 6))
            J[:, :n_border] = 0.3 * rng.normal(size=(8, n_border))
            N += J.T @ J
    scale = 10.0 ** rng.uniform(-4, 4, n)  # metres beside radians and mm^-6
    N *= scale[:, None] * scale
    m = n_border
    P = np.zeros((6 * n_poses, 6 * band))
    for k in range(6 * band):
        P[: 6 * n_poses - k, k] = np.diagonal(N[m:, m:], k)
    C, D, g = N[:m, m:].copy(), N[:m, :m].copy(), rng.normal(size=n) * scale
    system = Bordered(P=P, C=C, D=D, g=g, diagonal=np.diag(N).copy())
    return N, system


@pytest.mark.parametrize(
    ("n_poses", "band", "n_border"), [(11, 3, 5), (12, 1, 4), (7, 7, 3), (10, 4, 0), (1, 1, 2)]
)
def test_a_banded_system_has_the_solution_and_the_inverse_of_the_whole_matrix(
    rng, n_poses, band, n_border
):
    N, system = bordered(rng, n_poses=n_poses, band=band, n_border=n_border)
    assert_allclose(system.dense(), N, atol=0)
    banded, sigma = Banded(system), np.sqrt(np.diag(np.linalg.inv(N)))
    assert_allclose(banded.solve(system.g) / sigma, np.linalg.solve(N, system.g) / sigma, atol=1e-9)
    order = rng.permutation(len(N))
    inverse = BandedInverse(factored=banded, part=banded.inverse(), order=order)
    expected = np.zeros_like(N)
    expected[np.ix_(order, order)] = np.linalg.inv(N)
    spread = np.sqrt(np.diag(expected))
    correlated = expected / np.outer(spread, spread)
    each = np.arange(len(N))
    assert_allclose(inverse.at(each, each), np.diag(expected), rtol=ROUNDING)
    # entries inside the band come from Takahashi's recursion, the others from the whole inverse
    place = np.argsort(order)
    pose = (place - n_border) // 6
    near = np.abs(pose[:, None] - pose) < band
    near |= (place < n_border)[:, None] | (place < n_border)
    rows, columns = np.nonzero(near)
    found = inverse.at(rows, columns) / (spread[rows] * spread[columns])
    J = rng.normal(size=(2, 3, len(N))) / spread
    product = inverse.times(J)
    assert "dense" not in vars(inverse)
    assert_allclose(product / spread, J @ expected / spread, atol=ROUNDING)
    assert_allclose(found, correlated[rows, columns], atol=ROUNDING)
    everything = inverse.at(each[:, None], each[None]) / np.outer(spread, spread)
    assert_allclose(everything, correlated, atol=ROUNDING)


def test_condition_and_weakest_direction_of_a_banded_system_are_those_of_the_whole(rng):
    N, system = bordered(rng)
    order = rng.permutation(len(N))
    inverse = BandedInverse(factored=(banded := Banded(system)), part=banded.inverse(), order=order)
    scale = 1 / np.sqrt(np.diag(N))
    values, vectors = np.linalg.eigh(N * np.outer(scale, scale))
    assert inverse.condition == pytest.approx(values[-1] / values[0], rel=1e-4)
    weakest = np.zeros(len(N))
    weakest[order] = vectors[:, 0]
    assert abs(weakest @ inverse.weakest) == pytest.approx(1.0, abs=1e-4)
    dense = Dense(N=N, diagonal=np.diag(N)).inverse().reordered(order)
    assert dense.condition == pytest.approx(values[-1] / values[0], rel=1e-8)
    assert abs(weakest @ dense.weakest) == pytest.approx(1.0, abs=1e-8)
    assert_allclose(dense.at(order, order), np.diag(np.linalg.inv(N)), rtol=1e-9)
    assert_allclose(dense.times(np.eye(len(N))), dense.dense, atol=0)


def test_a_banded_system_that_is_open_is_refused(rng):
    _, system = bordered(rng)
    system.P[24:30] = 0.0  # a pose without any observation
    with pytest.raises(linalg.LinAlgError):
        Banded(system)
    assert isinstance(too_large(), AdjustmentError)


@pytest.mark.parametrize("part", ["P", "C", "D"])
def test_a_banded_system_with_what_is_not_a_number_is_refused(rng, part):
    _, system = bordered(rng)
    getattr(system, part)[0, 0] = np.nan
    with pytest.raises((linalg.LinAlgError, ValueError)):
        Banded(system)


def test_a_singular_system_is_solved_with_the_shortest_scaled_step():
    """Two columns seen only in their sum share it in proportion to their scales."""
    a = np.array([1.0, 4.0])
    N = np.outer(a, a)
    system = Dense(N=N, diagonal=np.diag(N).copy())
    x = system.solve(N @ [1.0, 1.0])
    assert_allclose(a @ x, 5.0)
    assert_allclose(x[0] * a[0], x[1] * a[1])
    inverse = system.inverse()
    assert inverse.defect == 1
    assert inverse.undetermined.all()


def test_what_is_barely_open_is_found_though_cholesky_passes(rng):
    """The pivots may be far above the smallest eigenvalue: the trace of the inverse tells."""
    n = 40
    factor = np.eye(n) - np.triu(np.ones((n, n)), 1)  # Kahan's kind of matrix
    N = factor.T @ factor
    N /= np.sqrt(np.outer(np.diag(N), np.diag(N)))
    pivots = np.diag(np.linalg.cholesky(N)) ** 2
    assert pivots.min() > SINGULAR > np.linalg.eigvalsh(N)[0]
    inverse = Dense(N=N, diagonal=np.ones(n)).inverse()
    assert inverse.defect >= 1


def test_without_columns_there_is_nothing_to_solve():
    system = Dense(N=np.zeros((0, 0)), diagonal=np.zeros(0))
    assert system.solve(np.zeros(0)).shape == (0,)
    inverse = system.inverse()
    assert (inverse.defect, inverse.condition, inverse.dense.shape) == (0, 1.0, (0, 0))
