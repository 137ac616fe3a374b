"""What the speed page opens with: whole commands, as they were measured."""

import json

import pandas as pd
import pytest

from acx4book.pages.benchmarks import commands

ABOUT = {
    "date": "2026-01-02",
    "commit": "abc",
    "processor": "a processor",
    "cores": 2,
    "memory_gb": 8.0,
    "imports": "importing numpy",
}


def run(command, cpu_s, *, flight="small", images=10, **changed):
    row = {"flight": flight, "images": images, "measurements": 1234 * images, "command": command}
    return row | {"run": 1, "wall_s": cpu_s / 2, "cpu_s": cpu_s, "tree_mb": 300.0} | changed


ROWS = [
    *(run("imports", 1.0), run("run --numbers-only", 2.0), run("run --numbers-only", 5.0, run=2)),
    *(run("run --numbers-only", 3.0, run=3), run("report", 2.5)),
    run("imports", 1.0, flight="large", images=100),
    run("run --numbers-only", 24.0, flight="large", images=100, tree_mb=1500.0),
]


def measured(rows):
    return commands.Commands(runs=pd.DataFrame(rows), about=ABOUT)


def test_medians_and_what_is_beyond_the_imports():
    text = commands.page(measured(ROWS))
    assert "Image points: 12,340 in small, 123,400 in large." in text
    lines = [line for line in text.splitlines() if "acx4 r" in line]
    assert [cell.strip() for cell in lines[0].strip("|").split("|")] == [
        *("small", "`acx4 run --numbers-only`", "10", "1.5", "3.0", "2.0", "300")
    ]
    assert "| 1.5 |" in lines[1].replace("  ", " ")
    assert not any("acx4 imports" in line for line in lines)


def test_growth_is_that_of_the_two_largest_flights():
    text = commands.page(measured(ROWS))
    assert (
        "With 10.0 times the images `acx4 run --numbers-only` takes 8.0 times the CPU time" in text
    )
    assert "the power 0.90 of their number, and 5.0 times the memory" in text
    assert "times the CPU time" not in commands.page(measured(ROWS[:5]))
    heads = run("run --numbers-only", 4.0, flight="heads", images=200, measurements=5_000)
    assert "With 10.0 times the images" in commands.page(measured([*ROWS, heads]))


def test_a_command_that_imports_less_than_a_run_has_none_beyond():
    quick = commands.page(measured([run("imports", 1.0), run("check", 0.5)]))
    assert "| 0.5 | \N{EN DASH} |" in quick


def test_what_was_measured_is_read(tmp_path):
    with pytest.raises(FileNotFoundError, match="make bench"):
        commands.read(tmp_path)
    pd.DataFrame(ROWS).to_csv(tmp_path / "commands.csv", index=False)
    (tmp_path / "commands.json").write_text(json.dumps(ABOUT))
    assert commands.page(commands.read(tmp_path)) == commands.page(measured(ROWS))
