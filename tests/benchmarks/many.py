"""Runs of many seeds by `acx4 run`: one process, two, and a cluster of two workers.

All three must leave the same bytes.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pandas as pd

from benchmarks import harness

DESIGN = "single-head"
N_FLIGHTS = 200
WORKERS = {"one process": 1, "two processes": 2, "cluster": 2}
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
        with options(way) as where:
            took = harness.timed(harness.ACX4, "run", DESIGN, *seeds, *where)
        if left(folder) != left(first):
            sys.exit(f"{way} leaves other bytes than {first.name}")
        times = pd.read_csv(folder / "times.csv")
        row = {
            "way": way,
            "workers": workers,
            "flights": n,
            "wall_s": took["wall_s"],
            "cpu_s": times["cpu_s"].sum(),
            "worker_mb": times["peak_mb"].max(),
        }
        sys.stderr.write(f"{way}: {row['wall_s']:.1f} s\n")
        yield row


@contextmanager
def options(way: str) -> Iterator[list[str]]:
    """Yield the options of a way, as long as what they name is there."""
    if way != "cluster":
        yield ["--jobs", str(WORKERS[way])]
        return
    from distributed import LocalCluster  # noqa: PLC0415 the other ways do without

    with LocalCluster(
        n_workers=WORKERS[way], threads_per_worker=1, processes=True, dashboard_address=":0"
    ) as started:
        yield ["--cluster", started.scheduler_address]


def left(folder: Path) -> dict[str, bytes]:
    """Return the table, and the mark of every flight, which has the checksums of its files."""
    paths = [folder / "flights.csv", *folder.glob("*/.acx4.json")]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}
