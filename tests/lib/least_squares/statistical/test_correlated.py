"""Weights of correlated observations against whole covariance matrices."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import AdjustmentError
from acx4lib.least_squares.statistical.correlated import SlowErrors
from acx4lib.least_squares.statistical.gauss_markov import GaussMarkov

TIME_S = np.cumsum(np.r_[np.full(8, 3.0), 240.0, np.full(8, 4.0), 200.0, np.full(7, 3.0)])
M = len(TIME_S)


def slow(sigma, *, share=0.95, time_constant_s=600.0):
    process = GaussMarkov(share=share, time_constant_s=time_constant_s)
    return SlowErrors(sigma=share * sigma, together=process.together(TIME_S))


def covariance(sigma, *, share=0.95, time_constant_s=600.0):
    """What the formula of `GaussMarkov` says, for one component."""
    apart = np.abs(TIME_S[:, None] - TIME_S)
    R = share**2 * np.exp(-apart / time_constant_s) + (1 - share**2) * np.eye(M)
    return sigma[:, None] * R * sigma


@pytest.fixture
def sigma(rng):
    return rng.uniform(0.01, 0.1, (M, 2))


@pytest.mark.parametrize("share", [0.2, 0.95, 0.9999])
def test_weights_are_the_inverse_of_the_covariance(sigma, rng, share):
    found, x = slow(sigma, share=share).correlation(sigma), rng.normal(size=(M, 2))
    by_weights = found.times(x / sigma) / sigma
    for c in range(2):
        P = np.linalg.inv(covariance(sigma[:, c], share=share))
        assert_allclose(by_weights[:, c], P @ x[:, c], rtol=1e-6, atol=1e-6 * np.abs(P).max())
        own = found.own[:, c] / sigma[:, c] ** 2
        assert_allclose(own, P.diagonal(), rtol=1e-8)


def test_without_white_noise_only_neighbours_are_linked(sigma):
    """The inverse correlation of such a process is known in closed form."""
    found = slow(sigma, share=1.0, time_constant_s=60.0).correlation(sigma)
    assert np.abs(found.first - found.second).max() == 1
    kept = np.exp(-np.diff(TIME_S) / 60.0)
    ahead = found.weight[found.second == found.first + 1]
    assert_allclose(ahead[:, 0], -kept / (1 - kept**2), rtol=1e-7)
    before, after = np.r_[0.0, kept], np.r_[kept, 0.0]
    diagonal = (1 - (before * after) ** 2) / ((1 - before**2) * (1 - after**2))
    assert_allclose(found.own, np.tile(diagonal[:, None], 2), rtol=1e-7)


def test_whitened_observations_have_the_same_squares(sigma, rng):
    found, z = slow(sigma).correlation(sigma), rng.normal(size=(M, 2, 3))
    white = found.whitened(z)
    assert_allclose(
        np.einsum("mdk,mdl->kl", white, white),
        np.einsum("mdk,mdl->kl", z, found.times(z)),
        rtol=1e-9,
    )


def test_an_observation_that_takes_no_part_tells_nothing(sigma, rng):
    """Weights of the others are the inverse of what is left of the covariance."""
    out = sigma.copy()
    out[5, 0] = np.inf
    found, x = slow(sigma).correlation(out), rng.normal(size=(M, 2))
    rest = np.delete(np.arange(M), 5)
    P = np.linalg.inv(covariance(sigma[:, 0])[np.ix_(rest, rest)])
    by_weights = (found.times(x / out) / out)[:, 0]
    assert by_weights[5] == 0
    assert_allclose(by_weights[rest], P @ x[rest, 0], rtol=1e-6, atol=1e-6 * np.abs(P).max())


def test_a_larger_sigma_adds_white_noise(sigma):
    more = 3.0 * sigma
    C = covariance(sigma[:, 0]) + np.diag(more[:, 0] ** 2 - sigma[:, 0] ** 2)
    found = slow(sigma).correlation(more)
    assert_allclose(found.own[:, 0] / more[:, 0] ** 2, np.linalg.inv(C).diagonal(), rtol=1e-8)


def test_errors_that_are_the_same_are_refused_in_words(sigma):
    together = np.ones((M, M))
    with pytest.raises(AdjustmentError, match="two observations are the same"):
        SlowErrors(sigma=sigma, together=together).correlation(sigma)
