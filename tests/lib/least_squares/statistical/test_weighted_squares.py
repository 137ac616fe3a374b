"""Weighted sums of squares: where they are chi-square, sums of exponential values, by counting."""

import numpy as np
import pytest
from scipy import stats

from acx4lib.least_squares.statistical.weighted_squares import tails

SHARES = (1e-60, 1e-12, 1e-4, 0.01, 0.3, 0.5)


@pytest.mark.parametrize("n", [1, 2, 3, 5, 17, 100, 2000])
def test_of_equal_weights_it_is_chi_square_far_into_both_tails(n):
    for share in SHARES:
        for x in (stats.chi2.isf(share, n), stats.chi2.ppf(share, n)):
            below, above = tails(2.5 * x, np.full(n, 2.5))
            assert below == pytest.approx(stats.chi2.cdf(x, n), rel=1e-9)
            assert above == pytest.approx(stats.chi2.sf(x, n), rel=1e-9)


def test_of_weights_in_pairs_it_is_a_sum_of_exponential_values(rng):
    """Two squares are exponential with the mean 2 w; the sum has the known mixture of these."""
    for _ in range(200):
        w = np.sort(rng.uniform(0.02, 1.0, rng.integers(2, 6)))
        if np.min(np.diff(w)) < 0.05:
            continue
        x = 2 * w.sum() * np.exp(rng.uniform(-1.0, 2.0))
        share = [np.prod([a / (a - b) for b in w if b != a]) for a in w]
        expected = sum(s * np.exp(-x / 2 / a) for s, a in zip(share, w, strict=True))
        assert tails(x, np.repeat(w, 2))[1] == pytest.approx(expected, rel=1e-6)


def test_of_unequal_weights_it_is_what_is_counted(rng):
    weights = np.array([1.0, 0.7, 0.7, 0.2, 0.05, 0.01, 0.0])
    sums = np.square(rng.normal(size=(400_000, len(weights)))) @ weights
    for x in (0.3, 1.0, 2.66, 6.0, 10.0):
        below, above = tails(x, weights)
        assert below + above == pytest.approx(1.0, abs=1e-12)
        sigma = np.sqrt(below * above / len(sums))
        assert np.mean(sums < x) == pytest.approx(below, abs=4 * sigma)


def test_nothing_lies_below_zero():
    assert tails(0.0, np.array([0.3, 0.1])) == (0.0, 1.0)


@pytest.mark.parametrize("weights", [[0.0, 0.0], [], [0.5, -0.1], [np.nan]])
def test_weights_are_positive(weights):
    with pytest.raises(ValueError, match="weights"):
        tails(1.0, np.array(weights, dtype=float))
