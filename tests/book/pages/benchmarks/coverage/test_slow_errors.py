"""The part of the page on coverage that shows errors which change slowly."""

import numpy as np
import pandas as pd
import pytest

from acx4book.pages.benchmarks.coverage import slow_errors
from acx4book.pages.build import BENCHMARKS


def flights(correlated=1.0, white=3.0):
    """Fifty flights of two parameters, errors of known size over their sigma."""
    rng, rows = np.random.default_rng(2), []
    for seed in range(1, 51):
        z = rng.normal(size=2)
        for weights, factor in (("white", white), ("correlated", correlated)):
            for name, sigma, one in (("f_mm", 0.002, z[0]), ("boresight_kappa_deg", 1e-3, z[1])):
                row = {"seed": seed, "weights": weights, "parameter": name, "sigma": sigma}
                rows.append(row | {"error": factor * one * sigma, "decorrelated": factor * one})
    return pd.DataFrame(rows)


def test_chi_square_sums_up_all_parameters_and_flights():
    value, n = slow_errors.chi_square(flights(), "correlated")
    assert n == 100
    assert slow_errors.chi_square(flights(), "white")[0] == pytest.approx(9 * value)


@pytest.mark.parametrize(("correlated", "said"), [(1.0, "within"), (1.5, "outside")])
def test_the_verdict_says_whether_the_weights_are_right(correlated, said):
    text = slow_errors.verdict(flights(correlated))
    assert text.startswith("Over 50 flights")
    assert f"{said} its two-sided bounds of 99 %" in text


def test_the_table_has_both_weights_side_by_side():
    table = slow_errors.table(flights())
    assert list(table["Parameter"]) == ["$f$", "boresight $\\kappa$"]
    rms = slow_errors.ratios(flights(), "correlated")["f_mm"]
    assert table[slow_errors.HEADINGS["correlated"]][0] == f"{rms:.2f}"
    assert table[slow_errors.HEADINGS["white"]][0] == f"{3 * rms:.2f}"


def test_correlated_weights_keep_the_promise_on_the_stored_flights():
    """The goal: normalised errors of 200 flights within the 99 % bounds of chi-square."""
    errors = slow_errors.read(BENCHMARKS)
    assert errors["seed"].nunique() == 200
    assert "within its two-sided bounds" in slow_errors.verdict(errors)
    boresight = slow_errors.ratios(errors, "white").filter(like="boresight")
    assert (boresight > 2).all()


def test_failing_validations_are_counted_by_what_is_declared():
    asked = slow_errors.CHECKED
    rows = [("declared", "holds", 1)] * 9 + [("declared", "fails", 0)]
    rows += [("not declared", "fails", 0)] * 4 + [("not declared", "holds", 0)]
    text = slow_errors.validated(pd.DataFrame(rows, columns=["fault", asked, "holds"]))
    assert "fails in 1 of 10 flights where σ, share and time constant are declared" in text
    assert "in 4 of 5 where" in text
    assert "| not declared | 5 | 4 | 5 |" in text


def test_on_the_stored_flights_declared_errors_pass_and_undeclared_ones_are_found():
    """Of 60 flights a report may fail 5 %; as many as 8 are beyond chance."""
    flown = slow_errors.read_validated(BENCHMARKS)
    failed = (flown["holds"] != 1).groupby(flown["fault"]).agg(["sum", "count"])
    assert (failed["count"] == 60).all()
    assert failed.loc["declared", "sum"] < 8
    assert failed.loc["not declared", "sum"] > 48
