"""Against closed forms: the mean, the straight line, and numpy's own least squares."""

import numpy as np
from numpy.testing import assert_allclose

from acx4book.foundations.adjusting.fitted import fit


def test_a_mean_is_weighted_by_the_inverse_squares_of_sigma():
    mean = fit(np.ones((2, 1)), np.array([1.0, 4.0]), np.array([1.0, 2.0]))
    assert_allclose(mean.dx, [(1.0 + 4.0 / 4) / 1.25])
    assert_allclose(mean.cov, [[1 / 1.25]])
    assert_allclose(mean.redundancy, [1 - 1 / 1.25, 1 - 0.25 / 1.25])
    assert_allclose(mean.square, 3.0**2 / (1.0 + 4.0))  # the difference over its own variance


def test_a_straight_line_has_its_textbook_covariance():
    t = np.array([1.0, 2.0, 4.0, 7.0])
    line = fit(np.column_stack([np.ones(4), t]), 3.0 - 0.5 * t, 0.1)
    assert_allclose(line.dx, [3.0, -0.5])
    assert_allclose(line.cov[1, 1], 0.1**2 / np.sum((t - t.mean()) ** 2))
    assert_allclose(line.cov[0, 1], -t.mean() * line.cov[1, 1])


def test_redundancy_numbers_add_up_and_w_is_standard_normal():
    rng = np.random.default_rng(4)
    A, sigma = rng.normal(size=(12, 4)), rng.uniform(0.5, 2.0, 12)
    fits = [fit(A, sigma * rng.normal(size=12), sigma) for _ in range(4000)]
    assert_allclose(fits[0].redundancy.sum(), fits[0].degrees)
    w = np.array([each.w for each in fits])
    assert_allclose(w.std(axis=0), 1.0, atol=4 / np.sqrt(2 * 4000))
    assert_allclose(np.mean([each.square for each in fits]), 8.0, atol=4 * np.sqrt(16 / 4000))
    dx = np.linalg.lstsq(A / sigma[:, None], np.ones(12) / sigma, rcond=None)[0]
    assert_allclose(fit(A, np.ones(12), sigma).dx, dx)
