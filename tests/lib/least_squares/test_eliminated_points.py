"""Points that were eliminated, in a bundle whose normal matrix is inverted as a whole."""

import numpy as np
from numpy.testing import assert_allclose

from acx4lib.least_squares.eliminated_points import cross_covariance, elimination
from support.helpers import dense_covariance


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
