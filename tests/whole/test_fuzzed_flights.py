"""Mutated flights are read, or refused by lines with their place."""

import pytest

from support.fuzz import run
from support.helpers import repeats


@pytest.mark.parametrize("cases", [40, repeats(500)])
def test_no_mutated_flight_ends_otherwise(tmp_path, cases):
    """`make fuzz` draws others."""
    outcomes, findings = run.run(tmp_path.resolve(), cases=cases, seed=1)
    assert not findings, "\n".join(findings)
    assert sum(outcomes.values()) == cases
    assert outcomes["accepted"]
    assert outcomes["refused"]
