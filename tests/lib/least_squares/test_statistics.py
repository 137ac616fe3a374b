"""Tests of correlated observations, limits, probabilities."""

import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4lib.bundle.reliability import reliability
from acx4lib.errors import AdjustmentError
from acx4lib.least_squares import statistics as least_squares_statistics
from acx4lib.least_squares.covariance import GaussMarkov
from acx4lib.least_squares.normal_equations import Equations, PlainNormals
from acx4lib.least_squares.statistics import (
    OUT,
    Group,
    SlowErrors,
    critical_tau,
    holm,
    statistics,
    tau_limits,
    w_limits,
)

# --- Tests of correlated observations against what they claim: the estimate of one wrong one


M, COLUMNS = 24, 4
TIME_S = np.cumsum(np.r_[np.full(12, 3.0), 120.0, np.full(11, 4.0)])


@pytest.fixture
def adjusted(rng):
    """A line in each of two components, through 24 observations of correlated errors."""

    def adjusted(sigma, **changed):
        process = GaussMarkov(share=0.9, time_constant_s=60.0)
        slow = SlowErrors(sigma=0.9 * SIGMA, together=process.together(TIME_S))
        A = np.zeros((M, 2, COLUMNS))
        A[:, 0, 0] = A[:, 1, 2] = 1.0
        A[:, 0, 1] = A[:, 1, 3] = TIME_S / TIME_S[-1]
        v = V.copy()
        parts = {
            "v": v,
            "sigma": sigma,
            "A": A,
            "columns": np.tile(np.arange(COLUMNS), (M, 1)),
            "correlation": slow.correlation(sigma),
        } | changed
        e = Equations(kind="y", unit=np.arange(M), **parts)
        normals = PlainNormals(
            n_columns=int(parts["columns"].max()) + 1,
            free_points=np.zeros(0, dtype=bool),
            equations=[e],
        )
        dx, _ = normals.step()
        after = e.v + np.einsum("mdk,mk->md", e.A, dx[e.columns])
        at_minimum = Equations(kind="y", unit=np.arange(M), **parts | {"v": after})
        precision = PlainNormals(
            n_columns=normals.n_columns, free_points=normals.free_points, equations=[at_minimum]
        ).precision()
        return precision.groups[0], at_minimum, dx, precision.inverse.dense

    return adjusted


SIGMA = np.random.default_rng(3).uniform(0.5, 2.0, (M, 2))
V = np.random.default_rng(4).normal(size=(M, 2))


def with_own_unknown(e, row, component):
    """The equations with an unknown for the error of one observation."""
    A = np.concatenate([e.A, np.zeros((M, 2, 1))], axis=2)
    A[row, component, -1] = 1.0
    return {"A": A, "columns": np.tile(np.arange(COLUMNS + 1), (M, 1))}


def test_redundancy_numbers_add_up_to_the_degrees_of_freedom(adjusted):
    group, _, _, _ = adjusted(SIGMA)
    assert np.sum(group.redundancy) == pytest.approx(2 * M - COLUMNS, rel=1e-9)
    assert not np.allclose(group.redundancy, group.control)


def test_squares_add_up_to_the_cost(adjusted):
    group, e, _, _ = adjusted(SIGMA)
    assert np.sum(group.squares) == pytest.approx(e.cost, rel=1e-12)


@pytest.mark.parametrize(("row", "component"), [(0, 0), (7, 1), (12, 0), (23, 1)])
def test_w_squared_is_what_an_unknown_for_that_error_takes_off_the_cost(adjusted, row, component):
    group, e, _, _ = adjusted(SIGMA)
    _, with_it, dx, Q = adjusted(SIGMA, **with_own_unknown(e, row, component))
    w = group.w[row, component]
    assert w**2 == pytest.approx(e.cost - with_it.cost, rel=1e-6)
    assert abs(w) == pytest.approx(abs(dx[-1]) / np.sqrt(Q[-1, -1]), rel=1e-6)


def test_the_smallest_error_that_is_found_is_a_multiple_of_its_standard_deviation(adjusted):
    group, e, _, _ = adjusted(SIGMA)
    found = reliability(group, critical=3.0, power=0.5)  # delta_0 is the critical value
    _, _, _, Q = adjusted(SIGMA, **with_own_unknown(e, 7, 1))
    assert found.detectable[7, 1] == pytest.approx(3.0 * np.sqrt(Q[-1, -1]), rel=1e-6)


def test_its_largest_effect_is_in_sigmas_of_any_function_of_the_unknowns(adjusted):
    group, e, _, Q = adjusted(SIGMA)
    bias = reliability(group, critical=3.0, power=0.5).detectable[7, 1]
    error = np.zeros((M, 2))
    error[7, 1] = bias
    dx = Q @ np.einsum("mdk,md->k", e.A, e.weighed(error))
    found = reliability(group, critical=3.0, power=0.5).external[7, 1]
    assert found == pytest.approx(np.sqrt(dx @ np.linalg.solve(Q, dx)), rel=1e-6)


def test_a_rejected_observation_is_tested_as_if_it_alone_were_used_again(adjusted):
    """Its correlation with the others tells what its slow error must have been."""
    within, _, _, _ = adjusted(SIGMA)
    sigma = SIGMA.copy()
    sigma[7] *= OUT
    out = np.zeros((M, 1), dtype=bool)
    out[7] = True
    group, _, _, _ = adjusted(sigma)
    w, controlled = statistics(group, out)
    # both components are out; they share no unknowns
    assert_allclose(w[7], np.abs(within.w[7]), rtol=2e-3)
    assert controlled.all()


# --- Tests of single observations, on repeated measurements of one quantity: all in closed form


W_TEST_SIGMA = np.array([1.0, 2.0, 0.5, 1.5, 1.0])
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
    w, controlled = statistics(mean_of(Y, W_TEST_SIGMA), np.zeros((5, 1), dtype=bool))
    weight = W_TEST_SIGMA**-2.0
    mean = np.sum(weight * Y) / np.sum(weight)
    of_residual = np.sqrt(W_TEST_SIGMA**2 - 1 / np.sum(weight))
    assert_allclose(w[:, 0], np.abs(mean - Y) / of_residual, rtol=1e-12)
    assert controlled.all()


@pytest.mark.parametrize("row", range(5))
def test_what_is_out_has_the_w_that_it_would_have_if_it_were_put_back(row):
    out = (np.arange(5) == row)[:, None]
    weakened = W_TEST_SIGMA * np.where(out[:, 0], OUT, 1.0)
    w, controlled = statistics(mean_of(Y, weakened), out)
    back, _ = statistics(mean_of(Y, W_TEST_SIGMA), np.zeros((5, 1), dtype=bool))
    # its weight of 1e-8 is not quite zero; the residual of the prediction has the mean's sigma too
    others = np.arange(5) != row
    variance = W_TEST_SIGMA[row] ** 2 + 1 / np.sum(W_TEST_SIGMA[others] ** -2.0)
    predicted = np.average(Y[others], weights=W_TEST_SIGMA[others] ** -2.0)
    assert_allclose(w[row, 0], abs(predicted - Y[row]) / np.sqrt(variance), rtol=1e-6)
    assert_allclose(w[row, 0], back[row, 0], rtol=1e-6)
    assert controlled[row, 0]


def test_what_nothing_else_observes_is_not_controlled():
    alone = mean_of(Y[:1], W_TEST_SIGMA[:1] * OUT)
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
    group = mean_of(np.append(Y, 1e6), np.append(W_TEST_SIGMA, OUT))
    out = (np.arange(6) == 5)[:, None]
    of_others = mean_of(Y, W_TEST_SIGMA)
    sigma0 = np.sqrt(np.sum((of_others.v / of_others.sigma) ** 2) / 4)
    (limit,) = tau_limits([group], [out], 3.9)
    # the sixth has a weight of 1e-8, and is off by 1e6
    assert limit == pytest.approx(sigma0 * critical_tau(3.9, 4), rel=0.02)


# --- Many tests at one joint level: Holm's own numbers, and the level under any dependence


def test_an_example_by_hand():
    p = np.array([0.01, 0.04, 0.03, 0.005])
    assert_allclose(holm(p), [0.03, 0.06, 0.06, 0.02])


def test_one_test_keeps_its_probability_and_none_exceeds_one():
    assert holm(np.array([0.3])) == 0.3
    assert_allclose(holm(np.array([0.6, 0.9])), [1.0, 1.0])
    assert len(holm(np.zeros(0))) == 0


def test_a_test_that_was_not_made_does_not_count():
    assert_allclose(holm(np.array([np.nan, 0.01, 0.2])), [np.nan, 0.02, 0.2])


def test_it_rejects_whatever_bonferroni_rejects(rng):
    p = rng.uniform(size=(100, 7)) ** 3
    assert all(np.all(holm(row) <= np.minimum(1, 7 * row) + 1e-15) for row in p)


def test_the_level_holds_for_correlated_tests(rng):
    n, level = 4000, 0.05
    for rho in (0.0, 0.9):
        common, own = rng.standard_normal((n, 1)), rng.standard_normal((n, 10))
        z = np.sqrt(rho) * common + np.sqrt(1 - rho) * own
        p = 2 * stats.norm.sf(np.abs(z))
        alarms = np.mean([holm(row).min() < level for row in p])
        assert alarms < level + 4 * np.sqrt(level * (1 - level) / n)


# --- The same values as SciPy's distributions, to the last bit


DF = (1, 2, 3, 7.5, 30, 1000, 2_000_000)
X = (0.0, 1e-9, 0.3, 1.0, 4.7, 33.0, 1200.0, 2e6)
Q = (1e-6, 0.0005, 0.05, 0.5, 0.9, 0.9995)


@pytest.mark.parametrize("name", ["norm_cdf", "norm_sf", "norm_ppf"])
def test_normal_values_are_those_of_scipy(name):
    kind, what = name.split("_")
    for x in Q if what == "ppf" else (*X, *(-np.array(X)), np.nan):
        expected = getattr(getattr(stats, kind), what)(x)
        np.testing.assert_array_equal(getattr(least_squares_statistics, name)(x), expected)


@pytest.mark.parametrize("name", ["chi2_cdf", "chi2_sf", "chi2_ppf", "chi2_isf", "t_isf"])
def test_values_with_degrees_of_freedom_are_those_of_scipy(name):
    kind, what = name.split("_")
    for df in DF:
        for x in Q if what in ("ppf", "isf") else X:
            expected = getattr(getattr(stats, kind), what)(x, df)
            np.testing.assert_array_equal(getattr(least_squares_statistics, name)(x, df), expected)


def test_values_of_two_degrees_of_freedom_are_those_of_scipy():
    for dfn in DF:
        for dfd in DF:
            for x in X:
                np.testing.assert_array_equal(
                    least_squares_statistics.f_sf(x, dfn, dfd), stats.f.sf(x, dfn, dfd)
                )


def test_the_stages_do_without_the_package_that_is_slow_to_load():
    code = (
        "import sys\nfrom acx4files.stages import heads, mounting, rig, synthetic, validation\n"
        "assert 'scipy.stats' not in sys.modules"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


# --- Weights of correlated observations against whole covariance matrices


CORRELATED_TIME_S = np.cumsum(
    np.r_[np.full(8, 3.0), 240.0, np.full(8, 4.0), 200.0, np.full(7, 3.0)]
)
CORRELATED_M = len(CORRELATED_TIME_S)


def slow(sigma, *, share=0.95, time_constant_s=600.0):
    process = GaussMarkov(share=share, time_constant_s=time_constant_s)
    return SlowErrors(sigma=share * sigma, together=process.together(CORRELATED_TIME_S))


def covariance(sigma, *, share=0.95, time_constant_s=600.0):
    """What the formula of `GaussMarkov` says, for one component."""
    apart = np.abs(CORRELATED_TIME_S[:, None] - CORRELATED_TIME_S)
    R = share**2 * np.exp(-apart / time_constant_s) + (1 - share**2) * np.eye(CORRELATED_M)
    return sigma[:, None] * R * sigma


@pytest.fixture
def sigma(rng):
    return rng.uniform(0.01, 0.1, (CORRELATED_M, 2))


@pytest.mark.parametrize("share", [0.2, 0.95, 0.9999])
def test_weights_are_the_inverse_of_the_covariance(sigma, rng, share):
    found, x = slow(sigma, share=share).correlation(sigma), rng.normal(size=(CORRELATED_M, 2))
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
    kept = np.exp(-np.diff(CORRELATED_TIME_S) / 60.0)
    ahead = found.weight[found.second == found.first + 1]
    assert_allclose(ahead[:, 0], -kept / (1 - kept**2), rtol=1e-7)
    before, after = np.r_[0.0, kept], np.r_[kept, 0.0]
    diagonal = (1 - (before * after) ** 2) / ((1 - before**2) * (1 - after**2))
    assert_allclose(found.own, np.tile(diagonal[:, None], 2), rtol=1e-7)


def test_whitened_observations_have_the_same_squares(sigma, rng):
    found, z = slow(sigma).correlation(sigma), rng.normal(size=(CORRELATED_M, 2, 3))
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
    found, x = slow(sigma).correlation(out), rng.normal(size=(CORRELATED_M, 2))
    rest = np.delete(np.arange(CORRELATED_M), 5)
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
    together = np.ones((CORRELATED_M, CORRELATED_M))
    with pytest.raises(AdjustmentError, match="two observations are the same"):
        SlowErrors(sigma=sigma, together=together).correlation(sigma)
