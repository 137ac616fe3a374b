"""Time whole commands, from start to end (``make bench``): seconds, and memory of all processes.

Flights are made into a folder that is kept. The results replace those in data/benchmarks when all
are there.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from benchmarks import machine, stored
from benchmarks.commands import command, large_flight

OUT = machine.ROOT / "data" / "benchmarks"
FLIGHTS = machine.ROOT / "build" / "benchmarks"
ACX4 = str(Path(sys.executable).with_name("acx4"))
COMMAND = Path(command.__file__)
IMPORTS = "import numpy, scipy.linalg, pandas, pyproj, numba"
"""What a run needs in any case, timed alone."""
EXPOSURE = "H3-04"
NUMBERS = "run --numbers-only"


@dataclass(frozen=True, kw_only=True)
class Kind:
    """A flight to time commands on.

    Attributes
    ----------
    name : str
    make : callable
        Takes the folder to make.
    commands : tuple of str
        A `render` follows a `run`.
    repeat : int
    """

    name: str
    make: Callable[[Path], None]
    commands: tuple[str, ...]
    repeat: int


def _simulated(*options: str) -> Callable[[Path], None]:
    return lambda folder: _run([ACX4, "simulate", *options, "--out", str(folder)])


_ALL = ("check", NUMBERS, "run", "report")
KINDS = {
    kind.name: kind
    for kind in (
        Kind(name="single-head", make=_simulated("single-head"), commands=_ALL, repeat=3),
        Kind(name="four heads", make=_simulated("acx4"), commands=_ALL, repeat=3),
        Kind(
            name="four heads with pictures",
            make=_simulated("acx4", "--images", EXPOSURE),
            commands=("check", "run --stages heads,synthetic", f"render --exposures {EXPOSURE}"),
            repeat=1,
        ),
        Kind(
            name="1 000 images",
            make=lambda folder: large_flight.write(folder, 1000),
            commands=_ALL,
            repeat=1,
        ),
        Kind(
            name="1 000 images, turned",
            make=lambda folder: large_flight.write_turned(folder, 1000),
            commands=("check", NUMBERS),
            repeat=1,
        ),
        Kind(
            name="4 000 images",
            make=lambda folder: large_flight.write(folder, 4000),
            commands=("check", NUMBERS),
            repeat=1,
        ),
    )
}


def main(arguments: Sequence[str] | None = None) -> None:
    """Time what the command line asks for."""
    given = _parser().parse_args(arguments)
    rows = []
    for name in given.flights:
        for row in measured(KINDS[name], given.folder):
            took = "{wall_s:.1f} s, {tree_mb:.0f} MB".format(**row)
            sys.stderr.write(f"{row['flight']}, {row['command']}: {took}\n")
            rows.append(row)
    about = {
        **machine.computer(),
        "versions": machine.package_versions(machine.PACKAGES),
        "imports": "importing numpy, scipy, pandas, pyproj and numba",
    }
    stored.write(given.out, "commands", {"": pd.DataFrame(rows)}, about, digits=5)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flights", nargs="+", default=list(KINDS), choices=KINDS)
    parser.add_argument("--folder", type=Path, default=FLIGHTS, help="where flights are kept")
    parser.add_argument("--out", type=Path, default=OUT)
    return parser


def measured(kind: Kind, folder: Path) -> Iterator[dict[str, Any]]:
    """Yield a row for every run of every command, and for the imports alone."""
    flight = folder / kind.name.replace(",", "").replace(" ", "-")
    if not (flight / "flight.toml").is_file():
        kind.make(flight)
    sizes = {"flight": kind.name, "images": _rows(flight, "images")}
    sizes["measurements"] = _rows(flight, "image_points")
    for number in range(1, kind.repeat + 1):
        yield sizes | _timed("imports", number, [sys.executable, "-c", IMPORTS])
        with tempfile.TemporaryDirectory(dir=folder) as made:
            for text in kind.commands:
                yield sizes | _timed(text, number, call(text, flight, Path(made)))


def call(text: str, flight: Path, made: Path) -> list[str]:
    """Return the whole command; each kind of run has results of its own."""
    name, *options = text.split()
    numbers, full = made / "numbers", made / "results"
    return [
        *(ACX4, name),
        *options,
        *{
            "check": [str(flight)],
            "run": ["--results", str(numbers if text == NUMBERS else full), str(flight)],
            "report": [str(full)],
            "render": [str(flight), "--results", str(full), "--out", str(made / "images")],
        }[name],
    ]


def _timed(text: str, number: int, arguments: Sequence[str]) -> dict[str, Any]:
    return {"command": text, "run": number, **machine.reported(COMMAND, *arguments)}


def _rows(flight: Path, table: str) -> int:
    """Return the number of rows of a table in all blocks of a flight."""
    return sum(len(path.read_bytes().splitlines()) - 1 for path in flight.glob(f"*/{table}.csv"))


def _run(arguments: Sequence[str]) -> None:
    sys.stderr.write(f"{' '.join(arguments[1:])}\n")
    machine.called(arguments)


if __name__ == "__main__":
    main()
