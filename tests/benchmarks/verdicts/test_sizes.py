"""Predicted sizes of faults: the power of tests by counting, and what pilots tell of a fault."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from benchmarks.verdicts import flights, sizes
from benchmarks.verdicts.sizes import Pilot, Statistic

N = 400_000


def test_a_shift_is_found_as_often_as_noncentral_sums_of_squares_fail(rng):
    test = Statistic(name="lever arm of CAM", value=0.0, dof=3)
    shift = np.array([1.0, -2.0, 2.5])
    squares = np.sum((rng.normal(size=(N, 3)) + shift) ** 2, axis=1)
    counted = np.mean(squares > stats.chi2.isf(0.0025, 3))
    assert test.found(0.0025, shift=shift @ shift) == pytest.approx(counted, abs=0.003)


def test_a_turn_is_found_as_often_as_ratios_of_variances_fail(rng):
    test = Statistic(name="strips", value=0.0, dof=9, beside=40.0)
    noise = rng.normal(size=(N // 4, 49))
    noise[:, 0] += 5.0
    f = np.mean(noise[:, :9] ** 2, axis=1) / np.mean(noise[:, 9:] ** 2, axis=1)
    counted = np.mean(f > stats.f.isf(0.0025, 9, 40))
    assert test.found(0.0025, shift=25.0) == pytest.approx(counted, abs=0.006)


def test_noise_is_found_on_both_sides_and_only_where_it_matters(rng):
    squares = np.sum(rng.normal(size=(N // 4, 40)) ** 2, axis=1)
    low, high = stats.chi2.ppf(0.0125, 40), stats.chi2.isf(0.0125, 40)
    for factor in (0.4, 1.0, 2.2):
        counted = np.mean((factor * squares < low) | (factor * squares > high))
        found = Statistic(name="all together", value=0.0, dof=40).found(0.025, factor=factor)
        assert found == pytest.approx(counted, abs=0.006)
    rejected = np.where(np.abs(noise := 1.6 * rng.normal(size=(N // 4, 40))) > 3.9, 0.0, noise)
    counted = np.mean(np.sum(rejected**2, axis=1) > stats.chi2.isf(0.00125, 40))
    snooped = Statistic(name="sigma of heading", value=0.0, dof=40)
    assert snooped.found(0.0025, factor=1.6**2) == pytest.approx(counted, abs=0.01)
    many = Statistic(name="rays", value=0.0, dof=5000)
    assert many.found(0.05, factor=1.12) < 1e-3  # significant, but by less than a tenth of sigma


def row(values, *, dof=3.0, name="lever arm of CAM", n_tests=20):
    return [
        pd.Series(
            {sizes.VALUE + name: v, sizes.DOF + name: dof, sizes.BESIDE + name: np.inf}
            | {"n_tests": n_tests}
        )
        for v in values
    ]


def test_pilots_tell_the_noncentrality_without_their_noise(rng):
    noise, shift = rng.normal(size=3), np.array([0.4, 0.1, -0.3])
    squares = [np.sum((noise + k * shift) ** 2) for k in (0, 1, -1)]
    ((_, growth),) = sizes.shifted(*row(squares), size=0.5).tests
    assert growth == pytest.approx(shift @ shift / 0.25, rel=1e-12)


def test_the_size_is_that_of_which_80_percent_are_found():
    """One normal test at 5 % of 20: the quantiles of its level and of its power are added."""
    pilot = sizes.shifted(*row([0.0, 9.0, 9.0], dof=1.0), size=0.15)  # three sigma
    beyond = (stats.norm.isf(0.05 / 20 / 2) + stats.norm.ppf(0.8)) / 3 * 0.15
    assert sizes.predicted([pilot, pilot], 0.15) == pytest.approx(beyond, rel=0.005)


def test_independent_tests_find_more_and_those_of_the_same_residuals_do_not():
    def of(*names):
        tests = tuple((Statistic(name=n, value=0.0, dof=4), 10.0) for n in names)
        return Pilot(tests=tests, n_tests=20.0, scales=False).found(1.0)

    rays, arm = of("rays"), of("lever arm of CAM")
    assert of("rays", "lever arm of CAM") == pytest.approx(1 - (1 - rays) * (1 - arm))
    assert of("mean east", "mean north") == pytest.approx(of("mean east"))


def test_a_fault_that_no_test_sees_has_no_size():
    assert np.isnan(sizes.predicted([sizes.shifted(*row([2.0, 2.0, 2.0]), size=0.15)], 0.15))


def test_larger_noise_enlarges_sums_of_squares_of_residuals_by_the_known_share(rng):
    """v = W e with the projector W; the noise of one group is s times what is stated."""
    W = np.eye(60) - (q := np.linalg.qr(rng.normal(size=(60, 25)))[0]) @ q.T
    own = np.arange(60) < 20
    r, square = np.trace(W[:20, :20]), np.sum(W[:20, :20] ** 2)
    s = 1.7
    v = W @ (rng.normal(size=(60, 40_000)) * np.where(own, s, 1.0)[:, None])
    counted = np.mean(np.sum(v[:20] ** 2, axis=0))
    dof = r**2 / square
    name = "sigma of GNSS, plan"
    noisy = row([0.0], dof=dof, name=name)[0]
    noisy[sizes.BESIDE + name] = r
    ((_, growth),) = sizes.scaled(noisy, noisy, noisy, groups=("GNSS, plan",)).tests
    assert (dof + (s**2 - 1) * growth) * r / dof == pytest.approx(counted, rel=0.01)


@pytest.mark.slow
def test_the_statistics_of_a_flight_are_those_of_the_report():
    """Every p of the report but of the groups is the tail of the statistic's own distribution."""
    made = flights.Order(purpose="pilot", plan="oblique-heads", fault="", size=0.0, seed=3501)
    again = flights.Order(purpose="clean", plan="oblique-heads", fault="", size=0.0, seed=3501)
    report = flights.judged(again)
    p = [v for k, v in report.items() if k.startswith("p: ") and "Gross errors" not in k]
    found = []
    for test in sizes.from_row(pd.Series(flights.judged(made))):
        of = stats.chi2(test.dof)
        if test.family == "boresight":
            of = stats.f(test.dof, test.beside, scale=test.dof)
        above, below = of.sf(test.value), of.cdf(test.value)
        found.append(2 * min(above, below) if test.two_sided else above)
    assert len(found) == len(p)
    exact = [a for a, b in zip(sorted(found), sorted(p), strict=True) if abs(a / b - 1) < 0.2]
    assert len(exact) == len(p)
