"""The part of the page on coverage that shows what reports say of good and of spoilt flights."""

import re

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from acx4book.pages.benchmarks import speed, verdicts
from acx4book.pages.build import BENCHMARKS
from support import figures
from support.helpers import ROOT

ABOUT = {
    "date": "2026-01-02",
    "commit": "abcdef0123456",
    "planned": {"clean": 1000, "spoilt": 60, "third": 20},
}
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
    assert f": 5.0 ({100 * low:.1f} to {100 * high:.1f}) %." in text
    assert "is reached" in text
    assert "not reached" in verdicts.good(told(rows("clean", "flat", 200, 15)))


@pytest.mark.parametrize(("k", "said"), [(10, "None of the 1 tests"), (25, "heading (25 of 200)")])
def test_a_test_that_fails_more_often_than_its_level_is_named(k, said):
    text = verdicts.good(of_levels(k))
    low, high = (100 * x for x in stats.binomtest(k, 200).proportion_ci())
    assert f"in {k / 2:.1f} ({low:.1f} to {high:.1f}) % of its flights" in text
    assert said in text


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
    assert (clean["holds"] != 1).mean() <= verdicts.GOAL
    assert f"no more than {100 * verdicts.GOAL:g} %, is reached" in verdicts.good(stored)


def test_single_tests_keep_their_level_on_the_stored_clean_flights(stored):
    assert "None of the" in verdicts.good(stored)


def test_faults_of_the_predicted_size_are_found_on_the_stored_flights(stored):
    """What unknowns take up cannot be found; of all else, the goal is 80 % at the stated size."""
    text = verdicts.spoilt(stored)
    assert "More rarely found" not in text
    hidden = text.split("\n")[0].partition("Not found, since unknowns take it up: ")[2]
    for case in hidden.removesuffix(".").split("; "):
        k, n = map(int, re.findall(r"(\d+) of (\d+)", case)[0])
        if n >= 20:  # of fewer flights chance may hide a fault
            assert case.startswith(("positions of calibration and validation", "surveyed points"))
            # they declare their lever arms
            assert not re.search("flat ground|oblique heads", case)
        assert k < verdicts.FOUND * n
    table = figures.table(text, "tab-verdicts-faults").set_index("Fault")
    sizes = table.iloc[: len(verdicts.FAULTS)]
    assert list(sizes.index) == [text for text, _ in verdicts.FAULTS.values()]
    counts = {
        cell: [int(part) for part in re.findall(r"(\d+) of (\d+)", cell)[0]]
        for cell in sizes.to_numpy().ravel()
        if cell != "–"
    }
    seen = np.array([count for count in counts.values() if count[0] > 0.2 * count[1]])
    assert 0.77 < seen[:, 0].sum() / seen[:, 1].sum() < 0.85


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


@pytest.mark.parametrize(("correlated", "said"), [(1.0, "within"), (1.5, "outside")])
def test_the_verdict_says_whether_the_weights_are_right(correlated, said):
    text = verdicts.slow_errors(flights(correlated))
    assert text.startswith("Over 50 flights")
    assert f"{said} its two-sided bounds of 99 %" in text


def test_correlated_weights_keep_the_promise_on_the_stored_flights():
    """The goal: normalised errors of 200 flights within the 99 % bounds of chi-square."""
    errors = pd.read_csv(BENCHMARKS / "slow_errors.csv")
    assert errors["seed"].nunique() == 200
    text = verdicts.slow_errors(errors)
    assert "within its two-sided bounds" in text
    white = figures.table(text, "tab-coverage-slow").set_index("Parameter")["Taken for independent"]
    assert (white.filter(like="boresight").astype(float) > 2).all()


def test_on_the_stored_flights_declared_errors_pass_and_undeclared_ones_are_found():
    """Of 60 flights a report may fail 5 %; as many as 8 are beyond chance."""
    flown = pd.read_csv(BENCHMARKS / "slow_validations.csv")
    failed = (flown["holds"] != 1).groupby(flown["fault"]).agg(["sum", "count"])
    assert (failed["count"] == 60).all()
    assert failed.loc["declared", "sum"] < 8
    assert failed.loc["not declared", "sum"] > 48


def test_a_wrong_focal_length_that_is_held_fails_and_is_named_first():
    flown = pd.read_csv(BENCHMARKS / "held_values.csv").set_index("plan")
    assert (flown.loc["single-head", "holds"] == 0).all()
    assert (flown.loc["single-head", "rejected"].str.split().str[0] == "CAM/f_mm").all()
    heads = flown.loc["acx4"]
    assert heads["holds"].mean() > 0.8
    assert (heads["rejected"].str.count("/f_mm") >= 3).all()
    said = verdicts.held(flown.reset_index())
    assert "6 of 6 reports do not hold, and 6 name the focal length first" in said


# --- the page on speed says what the benchmark's file holds ------------------------------------


def test_what_is_stored_makes_a_page_and_what_is_missing_is_named(tmp_path):
    assert speed.text(ROOT / "data" / "benchmarks").startswith("Measured on 20")
    with pytest.raises(FileNotFoundError, match="make bench"):
        speed.text(tmp_path)
