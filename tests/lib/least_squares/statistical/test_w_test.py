"""Tests of single observations, on repeated measurements of one quantity: all in closed form."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4lib.least_squares.statistical.residuals import Group
from acx4lib.least_squares.statistical.w_test import (
    OUT,
    critical_tau,
    statistics,
    tau_limits,
    w_limits,
)

SIGMA = np.array([1.0, 2.0, 0.5, 1.5, 1.0])
Y = np.array([10.0, 11.5, 9.8, 10.9, 14.0])


def group_of(v, sigma, explained):
    """Return a group; `explained` is the share of sigma squared that the model explains."""
    redundancy = np.where(np.isfinite(sigma), 1 - explained, np.nan)
    return Group(kind="y", v=v, sigma=sigma, redundancy=redundancy)


def mean_of(y, sigma):
    """Return the group of measurements of one quantity, adjusted by their weighted mean."""
    weight = 1 / sigma**2
    mean = np.sum(weight * y) / np.sum(weight)
    explained = 1 / (np.sum(weight) * sigma**2)
    return group_of((mean - y)[:, None], sigma[:, None], explained[:, None])


def test_what_takes_part_is_tested_by_its_residual():
    w, controlled = statistics(mean_of(Y, SIGMA), np.zeros((5, 1), dtype=bool))
    weight = SIGMA**-2.0
    mean = np.sum(weight * Y) / np.sum(weight)
    of_residual = np.sqrt(SIGMA**2 - 1 / np.sum(weight))
    assert_allclose(w[:, 0], np.abs(mean - Y) / of_residual, rtol=1e-12)
    assert controlled.all()


@pytest.mark.parametrize("row", range(5))
def test_what_is_out_has_the_w_that_it_would_have_if_it_were_put_back(row):
    out = (np.arange(5) == row)[:, None]
    weakened = SIGMA * np.where(out[:, 0], OUT, 1.0)
    w, controlled = statistics(mean_of(Y, weakened), out)
    back, _ = statistics(mean_of(Y, SIGMA), np.zeros((5, 1), dtype=bool))
    # its weight of 1e-8 is not quite zero; the residual of the prediction has the mean's sigma too
    others = np.arange(5) != row
    variance = SIGMA[row] ** 2 + 1 / np.sum(SIGMA[others] ** -2.0)
    predicted = np.average(Y[others], weights=SIGMA[others] ** -2.0)
    assert_allclose(w[row, 0], abs(predicted - Y[row]) / np.sqrt(variance), rtol=1e-6)
    assert_allclose(w[row, 0], back[row, 0], rtol=1e-6)
    assert controlled[row, 0]


def test_what_nothing_else_observes_is_not_controlled():
    alone = mean_of(Y[:1], SIGMA[:1] * OUT)
    w, controlled = statistics(alone, np.ones((1, 1), dtype=bool))
    assert not controlled.any()
    assert w[0, 0] == 0


def test_what_takes_no_part_has_no_test():
    group = group_of(np.ones((2, 1)), np.full((2, 1), np.inf), np.zeros((2, 1)))
    w, controlled = statistics(group, np.zeros((2, 1), dtype=bool))
    assert not controlled.any()
    assert np.all(w == 0)


def test_a_spread_above_one_by_chance_does_not_count(rng):
    """The median of |w| scatters the spread of 400 normal w by 6 %."""
    outs = [np.zeros((1, 1), dtype=bool)]
    w = rng.normal(size=(200, 400, 1))
    one = np.ones((400, 1))
    spreads = np.median(np.abs(w), axis=1)[:, 0] / 0.6745
    assert np.std(spreads) == pytest.approx(1.17 / 20, rel=0.15)
    assert np.max(spreads) > 1.1
    limits = [w_limits([group_of(v, one, 0 * one)], outs, 3.9)[0] for v in w]
    # beyond three standard deviations: one of 740
    assert np.mean(np.array(limits) == 3.9) >= 0.99


def test_limits_grow_with_a_spread_that_exceeds_one_but_not_for_a_few():
    w = stats.norm.ppf((np.arange(101) + 0.5) / 101)[:, None]
    groups = [group_of(k * w[:n], np.ones((n, 1)), np.zeros((n, 1))) for k, n in CASES]
    outs = [np.zeros((1, 1), dtype=bool)] * 3
    # the median of |w| of these quantiles is 0.6745 to a per cent
    assert_allclose(w_limits(groups, outs, 3.9), [19.5, 3.9, 3.9], rtol=0.02)


CASES = ((5.0, 101), (0.5, 101), (5.0, 19))


def test_tau_of_two_degrees_of_freedom_is_in_closed_form():
    """Student's t of one degree is Cauchy's: t = cot(pi alpha / 2), tau = sqrt(2) cos(...)."""
    alpha = 2 * stats.norm.sf(2.5)
    expected = np.sqrt(2) * np.cos(np.pi * alpha / 2)
    assert critical_tau(2.5, 2) == pytest.approx(expected, rel=1e-12)


def test_tau_becomes_normal_with_many_degrees_of_freedom_and_is_bounded_with_few():
    assert critical_tau(3.9, 1e7) == pytest.approx(3.9, abs=1e-5)
    assert critical_tau(3.9, 5) < np.sqrt(5)
    assert critical_tau(3.9, 1) == np.inf


def test_tau_counts_in_sigma0_of_what_takes_part():
    group = mean_of(np.append(Y, 1e6), np.append(SIGMA, OUT))
    out = (np.arange(6) == 5)[:, None]
    of_others = mean_of(Y, SIGMA)
    sigma0 = np.sqrt(np.sum((of_others.v / of_others.sigma) ** 2) / 4)
    (limit,) = tau_limits([group], [out], 3.9)
    # the sixth has a weight of 1e-8, and is off by 1e6
    assert limit == pytest.approx(sigma0 * critical_tau(3.9, 4), rel=0.02)
