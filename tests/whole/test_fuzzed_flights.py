"""Mutated flights are read or refused by lines with their place, in 10 s and 1 GB each."""

import pytest

from support.fuzz import run
from support.helpers import repeats


@pytest.mark.parametrize("cases", [10, repeats(500)])
def test_no_mutated_flight_crashes_hangs_or_fills_the_memory(tmp_path, cases):
    """`make fuzz` draws others."""
    report = run.run(tmp_path.resolve() / "fuzz", cases=cases, seed=1)
    assert not report.findings, "\n".join(report.findings)
    assert sum(report.outcomes.values()) == cases
    outcomes = {outcome for _, outcome in report.outcomes}
    assert {"accepted", "refused", "computed"} <= outcomes
