"""Accuracy classes against published tables and numbers computed elsewhere."""

from __future__ import annotations

import csv
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from scipy import stats

from acx4lib.georeferencing import accuracy

# Table 4 of the paper, east, north, height, m; n = 36
TWO_STEP = accuracy.from_summary(
    36, mean=(0.05, -0.06, -0.06), std=(0.51, 0.50, 0.49), rms=(0.44, 0.44, 0.43)
)
SINGLE_STEP = accuracy.from_summary(
    36, mean=(0.04, -0.06, 0.06), std=(0.51, 0.53, 0.52), rms=(0.44, 0.46, 0.45)
)
SURVEY = (0.01, 0.01, 0.02)
INTERVAL_SHARES = {
    "A": (0.27, 1 / 6),
    "B": (1 / 2, 1 / 3),
    "C": (3 / 5, 2 / 5),
    "D": (3 / 4, 1 / 2),
}
"""PEC and EP of heights, by class, in contour intervals; the standard's table rounds them."""


def errors(n: int, size: float) -> np.ndarray:
    """Errors of one size on every axis, alternating in sign."""
    return size * np.where(np.arange(n) % 2, 1.0, -1.0)[:, None] * np.ones(3)


# --- sizes, tests, intervals ---------------------------------------------------------------


def test_summary_of_the_papers_rms():
    assert_allclose([TWO_STEP.plan_rms, SINGLE_STEP.plan_rms], [0.62, 0.64], atol=0.005)
    assert_allclose([TWO_STEP.plan_90, SINGLE_STEP.plan_90], [0.94, 0.97], atol=0.005)
    assert_allclose([TWO_STEP.error_90[2], SINGLE_STEP.error_90[2]], [0.71, 0.74], atol=0.005)


def test_differences_by_hand():
    d = np.array([[1.0, 0.0, 2.0], [-1.0, 3.0, 2.0], [3.0, 0.0, -4.0]])
    got = accuracy.from_differences(d)
    assert_allclose(got.mean, [1.0, 1.0, 0.0])
    assert_allclose(got.std, [2.0, np.sqrt(3.0), np.sqrt(12.0)])
    assert_allclose(got.rms, np.sqrt([11 / 3, 3.0, 8.0]))
    assert got.error_90 == (3.0, 3.0, 4.0)
    assert got.plan_90 == pytest.approx(np.sqrt(10.0))


def test_ninety_percent_of_twenty_errors_are_eighteen():
    d = np.zeros((20, 3))
    d[:, 2] = np.arange(1, 21)
    assert accuracy.from_differences(d).error_90[2] == 18.0
    assert accuracy.from_differences(d[:19]).error_90[2] == 18.0  # 17 of 19 are too few


def test_many_normal_errors_agree_with_the_summary():
    rng = np.random.default_rng(1)
    d = rng.normal(size=(200_000, 3)) * [0.44, 0.44, 0.43]
    seen = accuracy.from_differences(d)
    assert_allclose(seen.error_90, TWO_STEP.error_90, rtol=0.01)  # 3 sigma of the quantile
    assert_allclose(seen.plan_90, TWO_STEP.plan_90, rtol=0.01)


@pytest.mark.parametrize("n", [0, 1])
def test_too_few_points_give_nan_and_no_class(n):
    got = accuracy.from_differences(np.full((n, 3), 0.1))
    assert np.isnan(got.std).all()
    assert np.isnan(got.rms).all() == (n == 0)
    assert accuracy.pec_pcd(got, 2000)["plan"] == f"not stated, n = {n}"


def test_bad_differences_are_refused():
    with pytest.raises(ValueError, match=r"shape \(n, 3\), got \(3,\)"):
        accuracy.from_differences(np.zeros(3))
    with pytest.raises(ValueError, match="finite"):
        accuracy.from_differences(np.full((2, 3), np.nan))


def test_bias_with_a_known_covariance():
    """1.645 sigma at 90 %: that of the normal distribution."""
    cov = np.diag([0.02, 0.05, 0.10]) ** 2
    test = accuracy.bias_test(np.array([0.03, -0.10, 0.16]), cov)
    assert_allclose(test.statistic, [1.5, -2.0, 1.6])
    assert test.critical == pytest.approx(1.645, abs=5e-4)
    assert test.accepted == (True, False, True)


def test_rms_of_36_points_is_known_to_24_percent():
    lower, upper = accuracy.rms_interval(1.0, 36)
    assert (upper - lower) / 2 == pytest.approx(0.24, abs=0.005)
    # chi-square of 36 at 97.5 % and 2.5 % from a printed table: 54.437, 21.336
    assert_allclose([36 / lower**2, 36 / upper**2], [54.437, 21.336], atol=5e-4)
    assert np.isnan(accuracy.rms_interval(1.0, 0)).all()


@pytest.mark.parametrize("rho", [0.0, 0.3, 1.0])
def test_correlated_errors_count_as_fewer(rho):
    """All correlated by rho, n of them: n / (1 + (n - 1) rho^2), between n and one."""
    cov = 4e-4 * (rho * np.ones((25, 25)) + (1 - rho) * np.eye(25))
    assert accuracy.effective_number(cov) == pytest.approx(25 / (1 + 24 * rho**2))
    assert accuracy.effective_number(np.zeros((0, 0))) == 0.0


def test_rms_of_correlated_errors_stays_within_its_limits(rng):
    """A shift shared by 25 points: 95 % of 20 000 RMS, to the 2 % that the approximation leaves."""
    own, shared = rng.normal(size=(20_000, 25)), 0.5 * rng.normal(size=(20_000, 1))
    rms = np.sqrt(np.mean((own + shared) ** 2, axis=1) / 1.25)
    n = accuracy.effective_number(np.eye(25) + 0.25)
    low, high = accuracy.rms_limits(n)
    assert np.mean((low < rms) & (rms < high)) == pytest.approx(0.95, abs=0.02)
    independent_low, independent_high = accuracy.rms_limits(25)
    assert np.mean((independent_low < rms) & (rms < independent_high)) < 0.935


def test_normalised_errors_are_tested_with_as_many_points_as_they_are_worth():
    """Fully correlated errors are one error: chi-square of 1 at 2.5 and 97.5 % from a table."""
    d, sigma = np.full((25, 3), 2.0), np.ones((25, 3))
    shared, own = np.ones((25, 25)), np.eye(25)
    test = accuracy.normalised_test(d, sigma, np.stack([shared, own, own]))
    assert_allclose(test.rms, 2.0)
    assert_allclose(test.effective, [1.0, 25.0, 25.0])
    assert_allclose(test.limits[0], np.sqrt([0.000982, 5.024]), rtol=1e-3)
    assert test.accepted.tolist() == [True, False, False]
    assert list(test.table()["limits"]) == ["inside", "above", "above"]
    # printed tables: chi-square of 1 exceeds 3.841 in 5 % and 5.024 in 2.5 % of all cases
    assert_allclose(accuracy.rms_p(np.sqrt(3.841), 1), 0.10, rtol=2e-3)
    assert_allclose(test.p[0], 2 * stats.norm.sf(2.0) * 2)
    assert repr(test) == "RMS of d / sigma 2.00, 2.00, 2.00; 1 of 3 inside their limits"
    small = accuracy.normalised_test(0.1 * d, sigma, np.stack([own] * 3))
    assert list(small.table()["limits"]) == ["below"] * 3


def test_one_rms_of_nine_outside_of_its_limits_is_chance_and_a_far_one_is_not(rng):
    """Chi-square of 36 at 2.2 % and at 1e-6: 9 tests make the first no reason to doubt, by Holm."""
    own = np.stack([np.eye(36)] * 3)

    def tested(*ratios):
        d = np.ones((36, 3)) * np.array(ratios) * rng.choice([-1, 1], (36, 3))
        return accuracy.normalised_test(d, np.ones((36, 3)), own)

    odd = np.sqrt(stats.chi2.ppf(0.022, 36) / 36)
    tests = {"a": tested(1.0, 1.05, 0.95), "b": tested(1.1, 1.0, odd), "c": tested(0.9, 1.0, 1.0)}
    table = accuracy.spread_table(tests)
    assert list(table["limits"] != "inside") == [False] * 5 + [True] + [False] * 3
    assert table["p"].min() == pytest.approx(0.044)
    assert table["p joint"].min() == pytest.approx(9 * 0.044)
    assert set(table["state"]) == {"holds"}
    far = np.sqrt(stats.chi2.isf(1e-6, 36) / 36)
    states = accuracy.spread_table(tests | {"d": tested(1.0, far, 1.0)})["state"]
    assert states["d"].tolist() == ["holds", "fails", "holds"]


def test_a_rejected_sigma_that_is_wrong_by_less_than_a_tenth_does_not_matter():
    d, own = np.full((2000, 3), 1.08), np.stack([np.eye(2000)] * 3)
    test = accuracy.normalised_test(d, np.ones((2000, 3)), own)
    assert list(accuracy.spread_table({"": test})["state"]) == ["minor"] * 3
    test = accuracy.normalised_test(d / 1.08 / 1.11, np.ones((2000, 3)), own)
    assert list(accuracy.spread_table({"": test})["state"]) == ["fails"] * 3


# --- PEC-PCD -------------------------------------------------------------------------------


@pytest.mark.parametrize("found", [TWO_STEP, SINGLE_STEP])
@pytest.mark.parametrize(
    ("scale", "plan", "by_axis", "height"),
    [
        (1000, "none", "C", "D"),
        (2000, "C", "B", "D"),
        (5000, "A", "A", "B"),
        (10000, "A", "A", "A"),
    ],
)
def test_table_4_under_pec_pcd(found, scale, plan, by_axis, height):
    assert accuracy.pec_pcd(found, scale) == {
        "scale": scale,
        "plan": plan,
        "plan_by_axis": by_axis,
        "height": height,
    }


@pytest.mark.parametrize(("letter", "scale"), [("A", 10000), ("none", None)])
def test_the_largest_scale_is_the_first_with_the_class_in_plan_and_height(letter, scale):
    assert accuracy.largest_scale(TWO_STEP, letter) == scale


def test_table_4s_sigmas_reach_no_height_class_at_1_to_2000():
    sigmas = accuracy.from_summary(36, mean=TWO_STEP.mean, std=TWO_STEP.std, rms=TWO_STEP.std)
    assert sigmas.error_90[2] == pytest.approx(0.81, abs=0.005)
    assert accuracy.pec_pcd(sigmas, 2000)["height"] == "none"


@pytest.mark.parametrize(
    ("rms", "error_90", "reached"),
    [(0.34, 0.56, "A"), (0.341, 0.56, "B"), (0.34, 0.561, "B"), (1.2, 2.01, "none")],
)
def test_both_limits_must_hold(rms, error_90, reached):
    at = replace(TWO_STEP, rms=(rms, rms, rms), error_90=(error_90, error_90, error_90))
    assert accuracy.pec_pcd(at, 2000)["plan_by_axis"] == reached


def test_one_gross_error_in_twenty_spoils_the_rms_but_not_the_90_percent():
    d = errors(20, 0.1)
    d[0, 2] = 1.5
    got = accuracy.from_differences(d)
    assert got.error_90[2] == pytest.approx(0.1)
    assert accuracy.pec_pcd(got, 2000)["height"] == "C"  # RMS 0.35 m
    assert accuracy.pec_pcd(accuracy.from_differences(errors(20, 0.1)), 2000)["height"] == "A"


def test_limits_of_the_printed_table_follow_the_rules_but_for_rounding(pytestconfig):
    """0.28/0.17 ... 1.0/0.6 mm at map scale; shares of the contour interval."""
    rules = {"A": (0.28, 0.17), "B": (0.5, 0.3), "C": (0.8, 0.5), "D": (1.0, 0.6)}
    for scale in accuracy.scales():
        for limit in accuracy.limits(scale, "plan"):
            assert_allclose((limit.pec, limit.ep), 1e-3 * scale * np.array(rules[limit.letter]))
    with (pytestconfig.rootpath / "data" / "standards" / "pec_pcd.csv").open() as file:
        intervals = {int(row["scale"]): float(row["interval_m"]) for row in csv.DictReader(file)}
    odd = set()
    for scale, interval in intervals.items():
        for limit in accuracy.limits(scale, "height"):
            shares = INTERVAL_SHARES[limit.letter]
            for tabulated, share in zip((limit.pec, limit.ep), shares, strict=True):
                if abs(tabulated - share * interval) > 0.0051:
                    odd.add((scale, limit.letter, tabulated))
    assert odd == {(5000, "A", 0.34), (10000, "A", 0.84), (50000, "A", 5.5), (100000, "A", 13.7)}


def test_table_has_eight_scales_and_an_error_for_others():
    assert accuracy.scales() == (1000, 2000, 5000, 10000, 25000, 50000, 100000, 250000)
    with pytest.raises(ValueError, match="1:3000"):
        accuracy.pec_pcd(TWO_STEP, 3000)


@given(st.floats(0.01, 3.0), st.floats(1.0, 3.0))
def test_larger_errors_never_reach_a_better_class(size, factor):
    order = ("A", "B", "C", "D", "none")
    small, large = (
        accuracy.pec_pcd(accuracy.from_differences(errors(24, s)), 2000)
        for s in (size, size * factor)
    )
    for kind in ("plan", "plan_by_axis", "height"):
        assert order.index(small[kind]) <= order.index(large[kind])
    assert order.index(small["plan_by_axis"]) <= order.index(small["plan"])


# --- NSSDA, ASPRS --------------------------------------------------------------------------


def alike(*rms):
    return accuracy.from_summary(36, mean=(0, 0, 0), std=(1, 1, 1), rms=rms)


def test_nssda_of_table_4():
    got = accuracy.nssda(TWO_STEP)
    assert "1.08 m horizontal, 0.84 m vertical" in got["statement"]
    # the standard's factors
    assert got["horizontal"] / 0.44 == pytest.approx(2.4477, abs=5e-5)
    assert got["vertical"] / 0.43 == pytest.approx(1.9600, abs=5e-5)


def test_nssda_has_no_formula_for_unlike_axes():
    got = accuracy.nssda(alike(0.2, 0.5, 0.1))
    assert np.isnan(got["horizontal"])
    assert "no horizontal" in got["statement"]
    assert accuracy.nssda(alike(0.3, 0.5, 0.1))["horizontal"] == pytest.approx(0.97908, abs=4e-5)


def test_asprs_2014_of_table_4():
    got = accuracy.asprs_2014(TWO_STEP, survey_sigma=SURVEY)
    assert (got["horizontal"], got["vertical"]) == ("44 cm", "43 cm")
    assert got["horizontal_95"] == pytest.approx(2.448 * 0.44, abs=1e-3)  # of equal axes
    assert got["vertical_95"] == pytest.approx(1.96 * 0.43, abs=1e-3)
    assert got["mean_small"]
    assert got["survey_sufficient"]
    poor = accuracy.asprs_2014(TWO_STEP, survey_sigma=(0.01, 0.15, 0.02))
    assert not poor["survey_sufficient"]
    assert not accuracy.asprs_2014(replace(TWO_STEP, mean=(0.0, 0.0, -0.11)))["mean_small"]


@pytest.mark.parametrize(
    ("size", "survey", "rmse", "reached", "sufficient"),
    [
        (TWO_STEP, SURVEY, (0.62, 0.43, 0.76), ("63 cm", "44 cm", "76 cm"), True),
        # the error of the survey is added
        (alike(0.03, 0, 0.12), (0.04, 0, 0.05), (0.05, 0.13, 0.139), ("5 cm", "13 cm", "14 cm"), 0),
    ],
)
def test_asprs_2023_by_hand(size, survey, rmse, reached, sufficient):
    got = accuracy.asprs_2023(size, survey_sigma=survey)
    assert_allclose([got[name] for name in ("rmse_h", "rmse_v", "rmse_3d")], rmse, atol=0.005)
    assert tuple(got[name] for name in ("horizontal", "vertical", "three_d")) == reached
    assert got["survey_sufficient"] == bool(sufficient)


@pytest.mark.parametrize(
    ("standard", "least"),
    [("pec_pcd", 20), ("nssda", 20), ("asprs_2014", 20), ("asprs_2023", 30)],
)
def test_a_class_needs_the_standards_number_of_points(standard, least):
    few, enough = (
        str(accuracy.classes(accuracy.from_differences(errors(n, 0.1)))[standard])
        for n in (least - 1, least)
    )
    assert f"not stated, n = {least - 1}" in few
    assert "not stated" not in enough
