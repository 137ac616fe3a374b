"""Whole commands are timed as a user would call them."""

from pathlib import Path

import pandas as pd
import pytest

from benchmarks import harness
from benchmarks.commands import whole

pytestmark = [pytest.mark.slow, pytest.mark.repeats]

FLIGHT, MADE = Path("flight"), Path("made")


@pytest.mark.parametrize(
    ("text", "arguments"),
    [
        ("check", "check flight"),
        ("run", "run --results made/results flight"),
        ("run --numbers-only", "run --numbers-only --results made/numbers flight"),
        ("report", "report made/results"),
        (
            "render --exposures H3-04",
            "render --exposures H3-04 flight --results made/results --out made/images",
        ),
    ],
)
def test_a_command_is_spelt_out(text, arguments):
    assert whole.call(text, FLIGHT, MADE) == [harness.ACX4, *arguments.split()]


def test_a_row_for_every_run(tmp_path):
    kind = whole.Kind(name="one head", make=whole.KINDS[0].make, commands=("check",))
    rows = pd.DataFrame(whole.measured(kind, tmp_path, 2))
    assert rows["command"].tolist() == ["imports", "check"] * 2
    assert rows["run"].tolist() == [1, 1, 2, 2]
    assert set(rows["images"]) == {97}
    assert (rows[["wall_s", "cpu_s", "tree_mb"]] > 0).all(axis=None)
    assert {p.name for p in tmp_path.iterdir()} == {"one-head", "one-head.truth.json"}
