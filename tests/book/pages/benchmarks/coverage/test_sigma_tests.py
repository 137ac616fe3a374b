"""Statistics of errors over their sigma, against printed tables and published examples."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4book.pages.benchmarks.coverage import sigma_tests


def test_normal_errors_stay_within_sigma_as_often_as_everyone_knows():
    found = [sigma_tests.nominal(level) for level in sigma_tests.LEVELS]
    assert_allclose(found, [0.6827, 0.9545, 0.9973], atol=5e-5)  # the digits printed


def test_holms_method_adjusts_as_in_the_textbook_example():
    """Four p values, of which alpha 0.05 rejects two (Holm 1979's method, by hand)."""
    assert_allclose(sigma_tests.holm([0.01, 0.04, 0.03, 0.005]), [0.03, 0.06, 0.06, 0.02])


def test_an_adjusted_p_value_is_at_most_one():
    assert sigma_tests.holm([0.9, 0.8]).tolist() == [1.0, 1.0]


def test_the_mean_is_tested_against_students_table():
    """With 10 values and t = 2.262, the probability of more is 5 % (any table of t)."""
    z = np.array([-1.0, 1.0] * 5)
    shift = 2.262 * z.std(ddof=1) / np.sqrt(10)
    assert sigma_tests.mean_p(z + shift) == pytest.approx(0.05, abs=1e-4)
    assert sigma_tests.mean_p(z - shift) == pytest.approx(0.05, abs=1e-4)


@pytest.mark.parametrize("chi_square", [2.700, 19.023])
def test_the_spread_is_tested_against_the_table_of_chi_square(chi_square):
    """2.5 % of each side with 9 degrees of freedom; a mean that is off does not matter."""
    z = np.arange(10.0)
    z *= np.sqrt(chi_square / np.sum((z - z.mean()) ** 2))
    assert sigma_tests.spread_p(z + 5) == pytest.approx(0.05, abs=1e-4)


def test_the_sum_has_the_freedoms_of_all_flights():
    """34.170 is the 97.5 % point of 20 degrees of freedom."""
    squares = np.full(4, 34.170 / 4)
    assert sigma_tests.sum_p(squares, 5) == pytest.approx(0.05, abs=1e-4)


def test_chi_squares_that_are_all_alike_have_the_wrong_distribution(rng):
    """Their sum says nothing against them."""
    alike = np.full(200, 14.0)
    assert sigma_tests.sum_p(alike, 14) > 0.9
    assert sigma_tests.distribution_p(alike, 14) < 1e-6
    assert sigma_tests.distribution_p(rng.chisquare(14, 200), 14) > 0.01


def test_a_binomial_interval_is_clopper_and_pearsons():
    """None of ten: up to 30.85 % (Clopper and Pearson 1934)."""
    share = sigma_tests.share_within(np.full(10, 1.5), 1)
    assert (share.value, share.low) == (0.0, 0.0)
    assert share.high == pytest.approx(0.3085, abs=5e-5)


def test_an_error_of_just_one_sigma_is_within_it():
    assert sigma_tests.share_within(np.array([1.0, -1.0]), 1).value == 1.0


# --- bootstrap over flights ------------------------------------------------------------------


def test_of_many_normal_flights_the_bootstrap_says_what_student_says(rng):
    shifts = np.array([0.0, 0.05, 0.1, 0.15, -0.15])
    of_flights = rng.standard_normal((200, 5)) + shifts
    found = sigma_tests.flight_mean_p(of_flights, np.zeros(5))
    # the two differ by some 1/n of the sample, and by sqrt(p / 20 000) of chance
    assert_allclose(found, stats.ttest_1samp(of_flights, 0.0).pvalue, atol=0.02)


def test_a_mean_is_compared_with_what_is_expected(rng):
    of_flights = 1.0 + 0.1 * rng.standard_normal((100, 1))
    assert sigma_tests.flight_mean_p(of_flights, np.array([1.0]))[0] > 0.01
    assert sigma_tests.flight_mean_p(of_flights, np.array([0.0]))[0] < 1e-4


def test_points_that_repeat_each_other_add_nothing(rng):
    """36 errors of a flight that are one error leave the interval that one has."""
    single = rng.standard_normal((100, 1))
    one = sigma_tests.share_within_by_flights(single, 1)
    assert sigma_tests.share_within_by_flights(np.repeat(single, 36, axis=1), 1) == one
    many = sigma_tests.share_within_by_flights(rng.standard_normal((100, 36)), 1)
    assert one.high - one.low > 4 * (many.high - many.low)  # 6 times as wide, sqrt(36)


def test_the_interval_of_single_errors_is_nearly_the_binomial_one(rng):
    z = rng.standard_normal(400)
    exact, drawn = (
        sigma_tests.share_within(z, 1),
        sigma_tests.share_within_by_flights(z[:, None], 1),
    )
    assert drawn.value == exact.value
    # Clopper and Pearson is wider by 1 / (2 n) on each side, about
    assert_allclose([drawn.low, drawn.high], [exact.low, exact.high], atol=0.006)


def test_points_that_a_flight_does_not_have_are_not_counted():
    z = np.array([[0.5, np.nan], [0.5, 1.5]])
    assert sigma_tests.share_within_by_flights(z, 1).value == 0.75


def test_what_is_said_to_be_found_is_found_in_19_of_20_samples():
    n, alpha = 50, 1e-3
    z = np.random.default_rng(1).normal(size=(1000, n))
    low, high = sigma_tests.found_scales(n, alpha)
    for samples, p in (
        (z + sigma_tests.found_bias(n, alpha), sigma_tests.mean_p),
        (z * low, sigma_tests.spread_p),
        (z * high, sigma_tests.spread_p),
    ):
        share = np.mean([p(sample) < alpha for sample in samples])
        assert share == pytest.approx(0.95, abs=0.03)  # 4 sigma of 1000 trials
