"""The verdict of a report: one level for all tests, states, and what fails first."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.report.findings import findings
from acx4book.report.material import read
from acx4book.report.verdict import (
    CONSEQUENCES,
    ChanceTest,
    Finding,
    judged,
    rows,
    statement,
)
from acx4lib.least_squares.verdict import FAILS, LEVEL
from support.run_results import stamp


def asked(question, *p, passed="It is right."):
    tests = tuple(
        ChanceTest(name=f"{question} {i}", p=one, said=f"bad {i}") for i, one in enumerate(p)
    )
    return Finding(question=question, state="holds", answer="Tested.", passed=passed, tests=tests)


def test_a_good_run_holds(run):
    found = findings(run)
    assert [f.question for f in found if f.state == FAILS] == []
    n = sum(len(f.tests) for f in found)
    said = statement(found)
    (level,) = said["sentences"]
    assert (said["holds"], said["title"]) == (True, "The results hold")
    assert level.startswith(f"None of {n} tests fails.")
    assert "error probability of 5 % (Holm)" in level
    assert n >= 15
    assert {f.question for f in found if f.tests} <= set(CONSEQUENCES)


def test_all_tests_of_a_report_share_one_level_by_holm():
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
    assert statement([sure])["title"] == "Nothing was tested"


def test_a_report_that_does_not_hold_says_first_what_fails_what_it_means_and_what_to_do():
    sure = Finding(question="All parameters determined", state="fails", answer="f is not.")
    found = judged([asked("Gross errors", 1e-9), asked("Global χ² test", 0.4), sure])
    said = statement(found)
    first, second, last = said["sentences"]
    assert (said["state"], said["title"]) == ("fails", "Not everything holds")
    assert first.startswith("“All parameters determined” fails: what is named is not known; the")
    assert "hold it at a surveyed value" in first
    assert second.startswith("“Gross errors” fails, too: look at the largest")
    assert last.startswith("1 of 2 tests fails.")


def test_what_fails_stands_first_in_the_table_with_its_probabilities():
    good = Finding(question="Good", state="holds", answer="")
    bad, other = rows(judged([good, asked("Bad thing", 0.0123, 0.6)]))
    assert (bad["question"], bad["result"], bad["p"]) == ("Bad thing", "✗ fails", "0.025")
    assert (other["question"], other["result"], other["p"]) == ("Good", "✓ holds", "")


def test_where_nothing_was_adjusted_the_report_says_that_nothing_was_tested(folder):
    run = json.loads((folder / "summary.json").read_text())["run"]
    none = {"heads/none": {"converged": True}, "run": run}
    (folder / "summary.json").write_text(json.dumps(none))
    file = folder / "check_points.csv"
    file.write_text(file.read_text().partition("\n")[0] + "\n")
    stamp(folder)
    found = findings(read(folder))
    assert not any(f.tests for f in found)
    assert statement(found)["state"] == "untested"


def test_what_is_rejected_and_too_small_to_matter_has_its_own_state_with_both_numbers():
    test = ChanceTest(name="σ₀²", p=1e-12, said="σ is 1.03 times too small", size=0.03, limit=0.1)
    found = judged([Finding(question="Q", state="holds", answer="A.", tests=(test,))])
    assert found[0].state == "minor"
    assert found[0].answer == (
        "A. Rejected, but below the size that matters: σ is 1.03 times too small "
        "(p <\N{NO-BREAK SPACE}0.0005; 3 %, limit 10 %)."
    )
    assert [row["result"] for row in rows(found)] == ["≈ rejected, below 10 %"]
    said = statement(found)
    assert said["title"] == "The results hold"
    assert said["sentences"][0].startswith("None of 1 test fails; 1 rejected, but below the")


def test_no_tick_stands_beside_a_test_that_is_rejected(rng):
    """Whatever the tests say: 200 reports with sizes on both sides of their limits."""
    for p, size in zip(
        10 ** rng.uniform(-6, 0, (200, 3)), rng.uniform(0, 0.2, (200, 3)), strict=True
    ):
        tests = tuple(
            ChanceTest(name=f"{i}", p=one, said="it", size=of, limit=0.1)
            for i, (one, of) in enumerate(zip(p, size, strict=True))
        )
        (row,) = rows(judged([Finding(question="Q", tests=tests)]))
        assert (3 * p.min() < LEVEL) == ("✓" not in row["result"])


@pytest.mark.parametrize(("size", "state"), [(0.1, "minor"), (0.3, "fails")])
def test_a_restriction_stands_with_the_verdict_where_it_applies(size, state):
    test = ChanceTest(name="held", p=1e-9, said="held", size=size, limit=0.2, unit="px")
    of = Finding(question="Q", state="holds", answer="", tests=(test,), restriction="Only a.")
    said = statement(judged([of]))
    assert said["state"] == state
    assert said["restrictions"] == (["Only a."] if state == "minor" else [])
    assert ("Only a." in said["sentences"]) == (state == "minor")
