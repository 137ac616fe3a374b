"""Runs of many seeds by `acx4 run`: one process, and two, which must leave the same bytes."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from benchmarks import harness

DESIGN = "single-head"
N_FLIGHTS = 200
WORKERS = {"one process": 1, "two processes": 2}
"""Ways to run flights, and how many at a time."""


def rows(folder: Path, _repeat: int) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Return a row for every way, and what belongs to all."""
    return [*measured(folder, N_FLIGHTS)], {"design": DESIGN}


def measured(made: Path, n: int) -> Iterator[dict[str, Any]]:
    """Yield a row for every way to run the first n seeds, after a flight that is not timed.

    It compiles what is not compiled yet.
    """
    harness.called(
        [harness.ACX4, "run", DESIGN, "--seeds", "1", "--results", str(made / "compiled")]
    )
    first = made / next(iter(WORKERS))
    for way, workers in WORKERS.items():
        folder = made / way
        seeds = ("--seeds", f"1-{n}", "--results", str(folder))
        took = harness.timed(harness.ACX4, "run", DESIGN, *seeds, "--jobs", str(workers))
        if left(folder) != left(first):
            sys.exit(f"{way} leaves other bytes than {first.name}")
        row = {
            "way": way,
            "workers": workers,
            "flights": n,
            "wall_s": took["wall_s"],
            "cpu_s": took["cpu_s"],
            "worker_mb": took["peak_mb"],
        }
        sys.stderr.write(f"{way}: {row['wall_s']:.1f} s\n")
        yield row


def left(folder: Path) -> dict[str, bytes]:
    """Return the table, and the mark of every flight, which has the checksums of its files."""
    paths = [folder / "flights.csv", *folder.glob("*/.acx4.json")]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}
