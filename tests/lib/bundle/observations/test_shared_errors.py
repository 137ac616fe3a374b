"""Covariances between the poses of a trajectory whose errors change slowly."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle.observations.shared_errors import shared_errors
from acx4lib.errors import AdjustmentError
from acx4lib.least_squares.statistical.gauss_markov import GaussMarkov
from support import blocks


@pytest.fixture(scope="module")
def trajectory():
    """Positions and attitudes with processes of their own, in strips of four."""
    found = blocks.in_strips(blocks.standard(), 4).trajectory
    return replace(
        found,
        sigma_position=found.sigma_position * np.linspace(1, 2, len(found))[:, None],
        slow_positions=GaussMarkov(share=0.9, time_constant_s=20.0),
        slow_attitudes=GaussMarkov(share=0.6, time_constant_s=5.0),
    )


def test_two_exposures_have_the_covariance_of_the_process_along_the_axes_of_their_sigma(trajectory):
    found = shared_errors(trajectory)
    apart = abs(trajectory.time_s[3] - trajectory.time_s[7])
    (cov,) = found.between(np.array([3]), np.array([7]))
    grid = trajectory.R_g_m[3] @ cov[:3, :3] @ trajectory.R_g_m[7].T
    sigma = trajectory.sigma_position[3] * trajectory.sigma_position[7]
    assert_allclose(grid, np.diag(0.81 * np.exp(-apart / 20) * sigma), atol=1e-15)
    sigma = trajectory.sigma_attitude[3] * trajectory.sigma_attitude[7]
    assert_allclose(cov[3:, 3:], np.diag(0.36 * np.exp(-apart / 5) * sigma), atol=1e-20)
    assert not cov[:3, 3:].any()


def test_an_exposure_with_itself_is_left_to_the_trajectory(trajectory):
    every = np.arange(len(trajectory))
    assert not shared_errors(trajectory).between(every, every).any()


def test_what_quantities_share_is_the_sum_over_all_pairs_of_exposures(trajectory, rng):
    found, n = shared_errors(trajectory), len(trajectory)
    J = rng.normal(size=(n, 4, 6))
    cov = sum(
        J[i] @ found.between(np.array([i]), np.array([j]))[0] @ J[j].T
        for i in range(n)
        for j in range(n)
    )
    assert_allclose(found.among(J), cov, rtol=1e-12)


def test_all_errors_together_have_a_covariance_that_can_be_had(trajectory):
    """Own and shared blocks together are positive definite."""
    n = len(trajectory)
    whole = shared_errors(trajectory).among(np.eye(6 * n).reshape(6 * n, n, 6).swapaxes(0, 1))
    for i, own in enumerate(trajectory.cov):
        whole[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] += own
    size = np.sqrt(np.diag(whole))
    assert np.linalg.eigvalsh(whole / size / size[:, None]).min() > 0


def test_chosen_exposures_share_what_they_share_among_all(trajectory):
    rows = np.array([1, 4, 9])
    one, other = np.array([0, 2]), np.array([1, 0])
    chosen = shared_errors(trajectory, rows).between(one, other)
    assert_allclose(chosen, shared_errors(trajectory).between(rows[one], rows[other]), rtol=1e-15)


def test_white_errors_share_nothing_and_slow_ones_need_times(trajectory):
    white = replace(trajectory, slow_positions=GaussMarkov(), slow_attitudes=GaussMarkov())
    assert shared_errors(white) is None
    with pytest.raises(AdjustmentError, match="errors of positions need times"):
        shared_errors(replace(trajectory, time_s=np.full(1, np.nan)))
