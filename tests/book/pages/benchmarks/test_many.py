"""What the page on many flights shows, as it was measured."""

import json

import pandas as pd
import pytest

from acx4book.pages.benchmarks import many

ABOUT = {
    "date": "2026-01-02",
    "commit": "abc",
    "processor": "a processor",
    "cores": 2,
    "memory_gb": 8.0,
    "design": "single-head",
}
ROWS = pd.DataFrame(
    {
        "way": ["one process", "two processes", "cluster"],
        "workers": [1, 2, 2],
        "flights": [10, 10, 10],
        "wall_s": [30.0, 16.0, 20.0],
        "cpu_s": [28.0, 29.0, 31.0],
        "worker_mb": [300.4, 310.0, 350.0],
    }
)


def test_times_are_compared_with_those_of_one_process():
    lines = many.page(many.Many(runs=ROWS, about=ABOUT)).splitlines()
    cells = [[c.strip() for c in line.strip("|").split("|")] for line in lines if "| 2 " in line]
    assert cells == [
        ["two processes", "2", "10", "16", "1.88", "2.90", "310"],
        ["cluster", "2", "10", "20", "1.50", "3.10", "350"],
    ]


def test_what_was_measured_is_read(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"no benchmark of many in .*: make bench"):
        many.read(tmp_path)
    ROWS.to_csv(tmp_path / "many.csv", index=False)
    (tmp_path / "many.json").write_text(json.dumps(ABOUT))
    assert many.page(many.read(tmp_path)) == many.page(many.Many(runs=ROWS, about=ABOUT))
