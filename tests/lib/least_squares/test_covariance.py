"""Covariance matrices carried through derivatives, and what is read from them."""

import numpy as np
from numpy.testing import assert_allclose

from acx4lib.geometry.frames import rotation_from_opk
from acx4lib.least_squares import covariance


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
