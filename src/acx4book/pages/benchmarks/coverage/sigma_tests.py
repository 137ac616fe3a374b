"""Whether standard deviations keep what they promise: statistics of errors over many flights.

Normalised errors, errors over their a priori sigma, should be standard normal. Flights are
independent of each other; what belongs to one flight is not.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy import stats

from acx4lib import expected
from acx4lib.expected import Array
from acx4lib.least_squares.adjustment import two_sided_p

LEVELS = (1, 2, 3)
"""Multiples of sigma whose coverage is counted."""

CONFIDENCE = 0.95
"""Of the intervals of a coverage."""

RESAMPLED = 20_000
"""Samples of a bootstrap: its p values are multiples of 1 / 20 001."""


@dataclass(frozen=True, kw_only=True)
class Share:
    """A share with its confidence interval.

    Attributes
    ----------
    value, low, high : float
    """

    value: float
    low: float
    high: float


def nominal(level: float) -> float:
    """Return the probability that a normal error stays within some sigma."""
    expected.positive_number("level", level)
    return float(stats.norm.cdf(level) - stats.norm.cdf(-level))


# --- independent errors ----------------------------------------------------------------------


def mean_p(z: Array) -> float:
    """Return the two-sided p value of a mean of zero: Student's test, shape (n,)."""
    return float(stats.ttest_1samp(z, 0.0).pvalue)


def spread_p(z: Array) -> float:
    """Return the two-sided p value of a standard deviation of one about the mean: chi-square."""
    dof = len(z) - 1
    return two_sided_p(float(dof * np.var(z, ddof=1)), dof)


def sum_p(chi_squares: Array, dof: int) -> float:
    """Return the two-sided p value of the sum of chi-squares of one number of freedoms each."""
    expected.whole("dof", dof)
    return two_sided_p(float(np.sum(chi_squares)), dof * len(chi_squares))


def distribution_p(chi_squares: Array, dof: int) -> float:
    """Return the p value of all chi-squares as a sample: Kolmogorov's and Smirnov's test."""
    expected.whole("dof", dof)
    return float(stats.kstest(chi_squares, stats.chi2(dof).cdf).pvalue)


def share_within(z: Array, level: float) -> Share:
    """Return the share of independent errors within some sigma, with its binomial interval.

    The interval is Clopper's and Pearson's.

    Parameters
    ----------
    z : ndarray, shape (n,)
    level : float
    """
    expected.positive_number("level", level)
    expected.some("z", z, "number")
    return binomial(int(np.sum(np.abs(z) <= level)), len(z))


def binomial(k: int, n: int) -> Share:
    """Return the share k of n independent cases with its interval, Clopper's and Pearson's."""
    test = stats.binomtest(k, n)
    low, high = test.proportion_ci(CONFIDENCE)
    return Share(value=float(test.statistic), low=float(low), high=float(high))


def share_p(k: int, n: int, share: float) -> float:
    """Return the two-sided p value of k of n independent cases where a share is expected."""
    return float(stats.binomtest(k, n, share).pvalue)


def too_many_p(k: int, n: int, share: float) -> float:
    """Return the probability of k or more of n independent cases where a share is expected."""
    return float(stats.binomtest(k, n, share, alternative="greater").pvalue)


# --- errors that belong to flights -----------------------------------------------------------


def flight_mean_p(of_flights: Array, expected: Array) -> Array:
    """Return the two-sided p value of the mean over flights, by bootstrap over flights.

    Parameters
    ----------
    of_flights : ndarray, shape (n_flights, k)
        One value of each of k quantities for a flight: a mean over its errors.
    expected : ndarray, shape (k,)

    Returns
    -------
    ndarray, shape (k,)

    Notes
    -----
    Student's statistic of the sample is compared with that of the samples drawn from it with
    replacement, about the mean of the sample [1]_.

    References
    ----------
    .. [1] B. Efron and R. J. Tibshirani, "An Introduction to the Bootstrap", 1993, section 16.4.
    """
    n = len(of_flights)
    mean = of_flights.mean(axis=0)
    observed = (mean - expected) / (of_flights.std(axis=0, ddof=1) / np.sqrt(n))
    counts = _resampled(n)
    centred = of_flights - mean
    means = counts @ centred / n
    squares = counts @ centred**2 / n - means**2
    drawn = means / np.sqrt(squares / (n - 1))
    return (1 + np.sum(np.abs(drawn) >= np.abs(observed), axis=0)) / (len(counts) + 1)


def share_within_by_flights(z: Array, level: float) -> Share:
    """Return the share of errors within some sigma, with its interval by bootstrap over flights.

    Parameters
    ----------
    z : ndarray, shape (n_flights, k)
        The k errors of a flight may be correlated; NaN where it has fewer.
    level : float
    """
    of_flights = np.nanmean(np.where(np.isnan(z), np.nan, np.abs(z) <= level), axis=1)
    means = _resampled(len(z)) @ of_flights / len(z)
    tail = (1 - CONFIDENCE) / 2
    low, high = np.quantile(means, [tail, 1 - tail])
    return Share(value=float(of_flights.mean()), low=float(low), high=float(high))


@lru_cache(maxsize=1)
def _resampled(n: int) -> Array:
    """Return how often each of n flights is drawn in each sample, always the same samples."""
    rng = np.random.default_rng(n)
    return rng.multinomial(n, np.full(n, 1 / n), size=RESAMPLED).astype(float)


# --- all together ----------------------------------------------------------------------------


def holm(p: Array) -> Array:
    """Return p values adjusted for their number by Holm's method, shape (n,).

    Those below alpha are rejected jointly: none is by chance, with probability 1 - alpha.
    """
    beyond = ~((np.asarray(p) >= 0) & (np.asarray(p) <= 1))
    if beyond.any():
        row = int(np.argmax(beyond))
        msg = f"p: expected probabilities between 0 and 1, got {p[row]} in row {row}"
        raise ValueError(msg)
    order = np.argsort(p)
    factors = np.arange(len(p), 0, -1)
    adjusted = np.empty(len(p))
    adjusted[order] = np.minimum(np.maximum.accumulate(factors * np.asarray(p)[order]), 1.0)
    return adjusted


# --- what tests would find -------------------------------------------------------------------


def found_bias(n: int, alpha: float) -> float:
    """Return the mean of n normalised errors that `mean_p` finds in `CONFIDENCE` of all cases.

    Parameters
    ----------
    n : int
        Number of independent errors.
    alpha : float
        Two-sided error probability of the single test.
    """
    critical = stats.t.ppf(1 - alpha / 2, n - 1)
    return float((critical + stats.norm.ppf(CONFIDENCE)) / np.sqrt(n))


def found_scales(n: int, alpha: float) -> tuple[float, float]:
    """Return the scatters below and above one that `spread_p` finds in `CONFIDENCE` of all cases.

    Parameters
    ----------
    n, alpha : int and float
        As of `found_bias`.
    """
    chi2 = stats.chi2(n - 1)
    below = chi2.ppf(alpha / 2) / chi2.ppf(CONFIDENCE)
    above = chi2.ppf(1 - alpha / 2) / chi2.ppf(1 - CONFIDENCE)
    return float(np.sqrt(below)), float(np.sqrt(above))
