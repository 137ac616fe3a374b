"""The verdict of a report holds for a good run, and what fails stands first."""

from acx4book.report.verdict import finding
from acx4book.report.verdict.verdict import findings, statement, verdict_table


def test_a_good_run_holds(run):
    found = findings(run)
    assert [f.question for f in found if f.state == finding.FAILS] == []
    n = sum(f.state == finding.HOLDS for f in found)
    said = f"**The results hold.** All {n} tests of this report are passed."
    assert statement(found) == said
    assert n >= 7


def test_what_fails_stands_first_and_in_the_sentence():
    good = finding.Finding(question="Good", state="holds", answer="")
    bad = finding.Finding(question="Bad thing", state="fails", answer="")
    note = finding.Finding(question="Odd", state="note", answer="")
    assert list(verdict_table([good, note, bad])["Question"]) == ["Bad thing", "Good", "Odd"]
    assert statement([good, note, bad]) == (
        "**Not everything holds.** 1 of 2 tests fails: bad thing."
    )
