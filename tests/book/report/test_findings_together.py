"""The verdict: one level for all tests of a report, and what fails stands first."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.report.findings import (
    CONSEQUENCES,
    FAILS,
    LEVEL,
    ChanceTest,
    Finding,
    all_tests,
    findings,
    judged,
    matters,
    statement,
    verdict_table,
)
from acx4book.report.material import read


def asked(question, *p, passed="It is right."):
    tests = tuple(
        ChanceTest(name=f"{question} {i}", p=one, said=f"bad {i}") for i, one in enumerate(p)
    )
    return Finding(question=question, state="holds", answer="Tested.", passed=passed, tests=tests)


def test_a_good_run_holds(run):
    found = findings(run)
    assert [f.question for f in found if f.state == FAILS] == []
    n = len(all_tests(found))
    said = statement(found)
    assert said.startswith(f"**The results hold.** None of {n} tests fails.")
    assert "error probability of 5 % (Holm)" in said
    assert n >= 15
    assert {f.question for f in found if f.tests} <= set(CONSEQUENCES)


def test_all_all_tests_a_report_share_one_level_by_holm():
    """Worked out by hand: p times 4, 3, 2, 1, never less than the one before."""
    one, two = judged([asked("One", 0.001, 0.04), asked("Two", 0.011, np.nan, 0.5)])
    assert_allclose([test.p_joint for test in one.tests], [0.004, 0.08])
    assert_allclose([test.p_joint for test in two.tests], [0.033, 0.5])
    assert [one.state, two.state] == ["fails", "fails"]
    assert one.answer == "Tested. Significant: bad 0."
    assert (two.p, two.p_joint) == (0.011, pytest.approx(0.033))
    (alone,) = judged([asked("One", 0.04, 0.2)])
    assert (alone.state, alone.answer) == ("holds", "Tested. It is right.")


def test_right_reports_fail_as_often_as_is_said(rng):
    """20 independent tests, 4 000 reports; three sigma of the count are 1 %."""
    failed = 0
    for p in rng.uniform(size=(4000, 20)):
        failed += any(f.state == FAILS for f in judged([asked("A", *p[:9]), asked("B", *p[9:])]))
    assert_allclose(failed / 4000, LEVEL, atol=0.0103)


def test_what_does_not_depend_on_chance_does_not_count():
    sure = Finding(question="Convergence", state="holds", answer="")
    assert judged([sure, sure, asked("One", 0.04)])[2].state == "fails"
    assert statement([sure]).startswith("**Nothing was tested.**")


def test_a_report_that_does_not_hold_says_first_what_fails_what_it_means_and_what_to_do():
    sure = Finding(question="All parameters determined", state="fails", answer="f is not.")
    found = judged([asked("Gross errors", 1e-9), asked("Global χ² test", 0.4), sure])
    first, second, last = statement(found).split("\n\n")
    assert first.startswith("**Not everything holds. “All parameters determined” fails: ")
    assert "what is named is not known; the other parameters can be used" in first
    assert "hold it at a surveyed value" in first
    assert second.startswith("- “Gross errors” fails, too: look at the largest")
    assert last.startswith("1 of 2 tests fails.")


def test_what_fails_stands_first_in_the_table_with_its_probabilities():
    good = Finding(question="Good", state="holds", answer="")
    table = verdict_table(judged([good, asked("Bad thing", 0.0123, 0.6)]))
    assert list(table["Question"]) == ["Bad thing", "Good"]
    assert list(table["p"]) == ["0.012", ""]
    assert list(table["p joint"]) == ["0.025", ""]


def test_where_nothing_was_adjusted_the_report_says_that_nothing_was_tested(folder):
    (folder / "summary.json").write_text(json.dumps({"heads/none": {"converged": True}}))
    file = folder / "check_points.csv"
    file.write_text(file.read_text().partition("\n")[0] + "\n")
    found = findings(read(folder))
    assert all_tests(found) == []
    assert statement(found).startswith("**Nothing was tested.**")


def test_what_is_significant_and_too_small_to_matter_is_said_and_holds():
    test = ChanceTest(name="σ₀²", p=1e-12, said="σ is 1.03 times too small", relevant=False)
    (found,) = judged([Finding(question="Q", state="holds", answer="A.", tests=(test,))])
    assert found.state == "holds"
    assert found.answer == "A. Significant, but too little to matter: σ is 1.03 times too small."
    assert [matters(ratio) for ratio in (0.9, 0.92, 1.09, 1.11)] == [True, False, False, True]
