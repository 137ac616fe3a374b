"""Tests of predicted standard deviations in words."""

import numpy as np
from scipy import stats

from acx4book.typesetting.verdicts import spreads
from acx4lib.georeferencing import accuracy


def ratios_of(*ratios):
    return accuracy.normalised_test(
        np.tile(ratios, (36, 1)), np.ones((36, 3)), np.stack([np.eye(36)] * 3)
    )


def test_an_rms_outside_of_its_limits_stands_with_its_numbers_and_all_with_one_verdict():
    table = accuracy.spread_table(
        {"Two-step": ratios_of(1.0, 1.0, 1.0), "Single-step": ratios_of(1.0, 1.0, 0.761)}
    )
    limit, p = np.sqrt(stats.chi2.ppf(0.025, 36) / 36), 2 * stats.chi2.cdf(36 * 0.761**2, 36)
    said = f"0.761 in height (single-step; limit {limit:.3f}, p = {p:.3f})"
    assert spreads(table) == {"n": 6, "outside": [said], "p": f"= {6 * p:.3f}", "fails": []}


def test_a_prediction_that_does_not_hold_is_named():
    found = spreads(accuracy.spread_table({"Single-step": ratios_of(1.0, 2.0, 1.0)}))
    assert found["fails"] == found["outside"]
    assert found["fails"][0].startswith("2.000 in north (single-step; limit 1.230, p = 0.000)")
    assert found["p"].startswith("<")


def test_without_points_nothing_is_said():
    assert spreads(accuracy.spread_table({})) == {"n": 0, "outside": [], "p": "", "fails": []}
