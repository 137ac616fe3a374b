"""The part of the page on coverage that shows what reports say of good and of spoilt flights."""

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from acx4book.pages.benchmarks import verdicts
from acx4book.pages.build import BENCHMARKS

ABOUT = {
    "date": "2026-01-02",
    "commit": "abcdef0123456",
    "planned": {"clean": 1000, "spoilt": 60, "third": 20},
}
QUESTION = "Boresight stable over time"
P = "p: A priori standard deviations: heading"


def rows(purpose, plan, n, k, *, fault="", size=0.0):
    """Rows of n flights, of which the reports of the first k fail."""
    failed = np.arange(n) < k
    return pd.DataFrame(
        {
            "purpose": purpose,
            "plan": plan,
            "fault": fault,
            "size": size,
            "seed": np.arange(n),
            "source": "abc",
            "status": 0,
            "holds": 1 - failed,
            QUESTION: np.where(failed, "fails", "holds"),
            "Parameters told apart": "note",
        }
    )


def told(*tables):
    return verdicts.Verdicts(flights=pd.concat(tables, ignore_index=True), about=ABOUT)


def of_levels(k, n=200):
    """Clean flights with k probabilities below 5 %."""
    p = np.where(np.arange(n) < k, 0.01, 0.5)
    return told(rows("clean", "flat", n, 0).assign(**{P: p}))


def test_the_share_of_failing_reports_is_told_with_its_interval_and_the_goal():
    text = verdicts.good(told(rows("clean", "flat", 200, 10)))
    low, high = stats.beta.ppf([0.025, 0.975], [10, 11], [191, 190])  # Clopper and Pearson
    assert f"5.0 % ({100 * low:.1f} to {100 * high:.1f} %)" in text
    assert "is reached" in text
    assert "not reached" in verdicts.good(told(rows("clean", "flat", 200, 15)))


def test_the_page_says_how_many_of_the_planned_flights_there_are():
    text = verdicts.good(of_levels(10))
    assert "by one state of the code" in text
    assert "200 of 1,000 clean ones; 0 of 60 with a fault" in text


def test_plans_have_their_rows_and_all_together_one():
    table = verdicts.good_table(
        told(rows("clean", "flat", 100, 3), rows("clean", "no-control", 50, 2))
    )
    assert table["Plan"].tolist() == ["flat ground", "no control", "all"]
    assert table["Do not hold"].tolist() == [3, 2, 5]


def test_a_flight_without_a_report_does_not_hold():
    lost = rows("clean", "flat", 1, 0).assign(holds=np.nan)
    assert verdicts.fails(lost).all()


def test_notes_are_no_failures():
    table = verdicts.question_table(told(rows("clean", "flat", 40, 4))).set_index("Question")
    assert table.loc[QUESTION, ["Holds", "Fails", "Note"]].tolist() == [36, 4, 0]
    assert table.loc["Parameters told apart", ["Holds", "Fails", "Note"]].tolist() == [0, 0, 40]
    assert pd.isna(table.loc["Parameters told apart", "Share of failures"])


@pytest.mark.parametrize(("k", "said"), [(10, "None of the 1 tests"), (25, "heading (25 of 200)")])
def test_a_test_that_fails_more_often_than_its_level_is_named(k, said):
    found = verdicts.levels(of_levels(k))
    assert found.loc[0, ["question", "test", "n", "k"]].tolist() == [
        *("A priori standard deviations", "heading"),
        *(200, k),
    ]
    assert said in verdicts.good(of_levels(k))


def test_sizes_that_are_found_too_rarely_or_never_are_named():
    text = verdicts.spoilt(
        told(
            rows("spoilt", "flat", 60, 48, fault="step", size=0.012),
            rows("spoilt", "one-height", 60, 20, fault="step", size=0.013),
            rows("spoilt", "no-control", 60, 60, fault="delay", size=0.002),
            rows("spoilt", "one-height", 60, 2, fault="datum in height", size=0.5),
        )
    )
    assert text.startswith("2 of 3 predicted sizes were found in 80 % of the flights or more")
    assert "More rarely found: the camera turns on its mount, by 0.013°, one height (20 of" in text
    assert "More often found: positions of the calibration late by 0.002 s, no control" in text
    assert "unknowns take it up: surveyed points shifted in height by 0.5 m, one height" in text


def test_the_tables_of_faults_have_size_and_count_by_plan():
    spoilt = told(
        rows("spoilt", "flat", 60, 48, fault="step", size=0.012),
        rows("spoilt", "no-control", 30, 15, fault="step", size=0.02),
    )
    row = verdicts.size_table(spoilt).iloc[0]
    assert row["flat ground"] == "0.012°: 48 of 60"
    assert row["no control"] == "0.02°: 15 of 30"
    finders = verdicts.finder_table(spoilt).iloc[0]
    assert finders["Flights"] == 90
    assert finders["Questions that fail"] == "Boresight stable over time 70 %"


def test_gross_errors_are_counted_by_what_was_taken_out():
    gross = rows("spoilt", "flat", 10, 0, fault="gross errors", size=1.0)
    table = verdicts.gross_table(told(gross.assign(**{"found: gnss": [1] * 8 + [0] * 2})))
    assert table.set_index("Gross error").loc["a GNSS height", "flat ground"] == "8 of 10"


# --- what is stored --------------------------------------------------------------------------


@pytest.fixture(scope="module")
def stored():
    return verdicts.read(BENCHMARKS)


def test_reports_of_the_stored_clean_flights_hold(stored):
    """The goal: at most 7 % of the flights of five plans, every one determined."""
    clean = stored.of("clean")
    assert set(clean["plan"]) == set(verdicts.PLANS)
    assert not clean.duplicated(["plan", "seed"]).any()
    assert (clean["status"] == 0).all()
    assert verdicts.fails(clean).mean() <= verdicts.GOAL


def test_single_tests_keep_their_level_on_the_stored_clean_flights(stored):
    assert "None of the" in verdicts.good(stored)


def test_faults_of_the_predicted_size_are_found_on_the_stored_flights(stored):
    """What unknowns take up cannot be found; of all else, the goal is 80 % at the stated size."""
    found = verdicts.shares(stored)
    assert set(found["fault"]) == set(verdicts.FAULTS)
    many = found[found["n"] >= 20]  # of fewer flights chance may hide a fault
    hidden = many[many["is_hidden"]]
    assert set(hidden["fault"]) <= {"delay in both", "datum in height"}
    assert not hidden["plan"].isin(["flat", "oblique-heads"]).any()  # they declare their lever arms
    seen = found[~found["is_hidden"]]
    assert 0.77 < seen["k"].sum() / seen["n"].sum() < 0.85
    assert "More rarely found" not in verdicts.spoilt(stored)


# --- The part of the page on coverage that shows errors which change slowly


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
    value, n = verdicts.chi_square(flights(), "correlated")
    assert n == 100
    assert verdicts.chi_square(flights(), "white")[0] == pytest.approx(9 * value)


@pytest.mark.parametrize(("correlated", "said"), [(1.0, "within"), (1.5, "outside")])
def test_the_verdict_says_whether_the_weights_are_right(correlated, said):
    text = verdicts.page(flights(correlated))
    assert text.startswith("Over 50 flights")
    assert f"{said} its two-sided bounds of 99 %" in text


def test_the_table_has_both_weights_side_by_side():
    table = verdicts.table(flights())
    assert list(table["Parameter"]) == ["$f$", "boresight $\\kappa$"]
    rms = verdicts.ratios(flights(), "correlated")["f_mm"]
    assert table[verdicts.HEADINGS["correlated"]][0] == f"{rms:.2f}"
    assert table[verdicts.HEADINGS["white"]][0] == f"{3 * rms:.2f}"


def test_correlated_weights_keep_the_promise_on_the_stored_flights():
    """The goal: normalised errors of 200 flights within the 99 % bounds of chi-square."""
    errors = verdicts.slow_errors_read(BENCHMARKS)
    assert errors["seed"].nunique() == 200
    assert "within its two-sided bounds" in verdicts.page(errors)
    boresight = verdicts.ratios(errors, "white").filter(like="boresight")
    assert (boresight > 2).all()


def test_failing_validations_are_counted_by_what_is_declared():
    asked = verdicts.CHECKED
    rows = [("declared", "holds", 1)] * 9 + [("declared", "fails", 0)]
    rows += [("not declared", "fails", 0)] * 4 + [("not declared", "holds", 0)]
    text = verdicts.validated(pd.DataFrame(rows, columns=["fault", asked, "holds"]))
    assert "fails in 1 of 10 flights where σ, share and time constant are declared" in text
    assert "in 4 of 5 where" in text
    assert "| not declared | 5 | 4 | 5 |" in text


def test_on_the_stored_flights_declared_errors_pass_and_undeclared_ones_are_found():
    """Of 60 flights a report may fail 5 %; as many as 8 are beyond chance."""
    flown = verdicts.read_validated(BENCHMARKS)
    failed = (flown["holds"] != 1).groupby(flown["fault"]).agg(["sum", "count"])
    assert (failed["count"] == 60).all()
    assert failed.loc["declared", "sum"] < 8
    assert failed.loc["not declared", "sum"] > 48
