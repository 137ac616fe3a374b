"""Mutated files are read or refused by sentences, in 10 s and 1 GB each."""

from __future__ import annotations

from collections import Counter

import pytest

from support.fuzz import results as cases_of_results
from support.fuzz import run
from support.fuzz import strangers as cases_of_strangers
from support.helpers import repeats


@pytest.mark.parametrize("cases", [10, repeats(500)])
def test_no_mutated_flight_crashes_hangs_or_fills_the_memory(tmp_path, cases):
    """`make fuzz` draws others."""
    report = run.run(tmp_path.resolve() / "fuzz", cases=cases, seed=1)
    assert not report.findings, "\n".join(report.findings)
    assert sum(report.outcomes.values()) == cases
    outcomes = {outcome for _, outcome in report.outcomes}
    assert {"accepted", "refused", "computed"} <= outcomes


@pytest.mark.parametrize("cases", [10, repeats(300)])
def test_no_mutated_file_of_another_program_crashes_hangs_or_fills_the_memory(tmp_path, cases):
    """So many cases of every kind of import, and of exports of mutated results."""
    report = run.run(tmp_path.resolve() / "fuzz", cases=cases, seed=1, what="strangers")
    assert not report.findings, "\n".join(report.findings)
    by_kind = Counter(kind.split()[0] for kind, _ in report.outcomes.elements())
    assert by_kind == dict.fromkeys(cases_of_strangers.KINDS, cases)
    assert {outcome for _, outcome in report.outcomes} == {"accepted", "refused"}


@pytest.mark.parametrize("cases", [repeats(25), repeats(500)])
def test_no_results_that_were_tampered_with_crash_hang_or_fill_the_memory(tmp_path, cases):
    """Most have checksums that were computed anew."""
    report = run.run(tmp_path.resolve() / "fuzz", cases=cases, seed=1, what="results")
    assert not report.findings, "\n".join(report.findings)
    assert {kind.split()[0] for kind, _ in report.outcomes} == set(cases_of_results.COMMANDS)
    assert {outcome for _, outcome in report.outcomes} == {"accepted", "refused"}


@pytest.mark.parametrize("cases", [repeats(25), repeats(500)])
def test_no_mutated_archive_crashes_hangs_or_fills_the_memory(tmp_path, cases):
    report = run.run(tmp_path.resolve() / "fuzz", cases=cases, seed=1, what="archives")
    assert not report.findings, "\n".join(report.findings)
    assert {outcome for _, outcome in report.outcomes} == {"accepted", "refused"}
