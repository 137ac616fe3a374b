"""Heads that turn from exposure to exposure: their variance, and what it does to the mean's."""

import numpy as np
import pytest

from acx4lib.least_squares.statistics import chi2_ppf, chi2_sf
from acx4lib.tie_points.between_exposures import OneExposure, components, covariance

AXIS = np.tile(np.arange(3), 3)
"""Three heads beside the held one, three rotations each."""

TURNS = np.array([0.2, 0.1, 0.4])
N_EXPOSURES = 19


def exposures(rng, turns, n=N_EXPOSURES):
    """Normal equations of exposures at the common estimate, and this estimate; the truth is 0."""
    N, x = [], []
    for _ in range(n):
        J = rng.normal(0, 30.0 * rng.uniform(1, 2), (27, 9))
        N.append(J.T @ J)
        own = rng.normal(0, 1, (4, 3)) * turns
        noise = np.linalg.cholesky(np.linalg.inv(N[-1])) @ rng.normal(0, 1, 9)
        x.append((own[1:] - own[0]).ravel() + noise)
    mean = np.linalg.solve(np.sum(N, axis=0), sum(a @ b for a, b in zip(N, x, strict=True)))
    at_mean = [OneExposure(N=a, h=a @ (mean - b)) for a, b in zip(N, x, strict=True)]
    return at_mean, mean


def test_the_variance_is_that_of_a_head_and_each_component_has_its_own(rng):
    """57 - 3 differences of two heads a component, half of them independent: within a third."""
    found = [components(exposures(rng, TURNS)[0], AXIS, 1.0) for _ in range(20)]
    np.testing.assert_allclose(np.sqrt(np.mean(found, axis=0)), TURNS[AXIS], rtol=0.1)


def test_the_mean_of_heads_that_turn_is_off_by_its_sigma(rng):
    """The joint chi-square of 100 flights, 99.9 % two-sided but for what estimating it adds."""
    total = 0.0
    for _ in range(100):
        own, mean = exposures(rng, TURNS)
        noise = np.linalg.inv(np.sum([one.N for one in own], axis=0))
        cov = noise + covariance(own, AXIS, components(own, AXIS, 1.0))
        total += float(mean @ np.linalg.solve(cov, mean))
        assert float(mean @ np.linalg.solve(noise, mean)) > chi2_ppf(0.999, 9)
    assert chi2_ppf(0.0005, 900) < total < 1.15 * chi2_ppf(0.9995, 900)


def test_noise_alone_is_no_component(rng):
    """In a hundred flights three in a hundred have one by chance: one for each component."""
    found = [components(exposures(rng, 0.0 * TURNS)[0], AXIS, 1.0).any() for _ in range(100)]
    assert sum(found) <= 9


def test_one_exposure_tells_nothing_of_it(rng):
    assert not components(exposures(rng, TURNS, n=1)[0], AXIS, 1.0).any()


@pytest.mark.parametrize("n", [3, 50])
def test_half_of_the_exposures_predicts_the_other(rng, n):
    """By the joint chi-square of the difference, in nine of ten flights and more."""
    good = 0
    for _ in range(40):
        parts = [exposures(rng, TURNS, n=n) for _ in range(2)]
        cov = sum(
            np.linalg.inv(np.sum([one.N for one in own], axis=0))
            + covariance(own, AXIS, components(own, AXIS, 1.0))
            for own, _ in parts
        )
        d = parts[0][1] - parts[1][1]
        good += chi2_sf(float(d @ np.linalg.solve(cov, d)), 9) > 0.01
    assert good >= 36 if n > 3 else good >= 30
