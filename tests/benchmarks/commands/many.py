"""Time `acx4 run` of many seeds: one process, two, and a cluster of two workers (``make bench``).

All three must leave the same bytes. The results replace those in data/benchmarks when all are
there.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pandas as pd

from benchmarks import machine, stored
from benchmarks.commands import command
from benchmarks.commands.whole import ACX4, OUT

COMMAND = Path(command.__file__)
DESIGN = "single-head"
N_FLIGHTS = 200
WORKERS = {"one process": 1, "two processes": 2, "cluster": 2}
"""Ways to run flights, and how many at a time."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Time what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--flights", type=int, default=N_FLIGHTS, help=f"seeds 1 to {N_FLIGHTS}")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the results")
    given = parser.parse_args(arguments)
    with tempfile.TemporaryDirectory() as made:
        rows = list(measured(Path(made), given.flights))
    versions = machine.package_versions([*machine.PACKAGES, "distributed"])
    about = {**machine.computer(), "versions": versions, "design": DESIGN}
    stored.write(given.out, "many", {"": pd.DataFrame(rows)}, about, digits=5)


def measured(made: Path, n: int) -> Iterator[dict[str, Any]]:
    """Yield a row for every way to run the first n seeds, after a flight that is not timed.

    It compiles what is not compiled yet.
    """
    machine.called([ACX4, "run", DESIGN, "--seeds", "1", "--results", str(made / "compiled")])
    first = made / next(iter(WORKERS))
    for way, workers in WORKERS.items():
        folder = made / way
        seeds = ("--seeds", f"1-{n}", "--results", str(folder))
        with options(way) as where:
            took = machine.reported(COMMAND, ACX4, "run", DESIGN, *seeds, *where)
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


if __name__ == "__main__":
    main()
