"""Time whole commands, from start to end: ``python -m benchmarks.bench`` (``make bench``).

The page on speed shows seconds, and the memory of all processes. Flights are made into a folder
that is kept. The results replace those in data/benchmarks when all are there.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from benchmarks import harness, large_flight

EXPOSURE = "H3-04"
NUMBERS = "run --numbers-only"
DIGITS = 7


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
    large : bool
        Each command is run once.
    """

    name: str
    make: Callable[[Path], None]
    commands: tuple[str, ...]
    large: bool = False


def _simulated(*options: str) -> Callable[[Path], None]:
    def make(out: Path) -> None:
        harness.called([harness.ACX4, "simulate", *options, "--out", str(out)])

    return make


_ALL = ("check", NUMBERS, "run", "report")
KINDS = (
    Kind(name="single-head", make=_simulated("single-head"), commands=_ALL),
    Kind(name="four heads", make=_simulated("acx4"), commands=_ALL),
    Kind(
        name="four heads with pictures",
        make=_simulated("acx4", "--images", EXPOSURE),
        commands=("check", "run --stages heads,synthetic", f"render --exposures {EXPOSURE}"),
        large=True,
    ),
    Kind(
        name="1 000 images",
        make=lambda out: large_flight.write(out, 1000),
        commands=_ALL,
        large=True,
    ),
    Kind(
        name="4 000 images",
        make=lambda out: large_flight.write(out, 4000),
        commands=("check", NUMBERS),
        large=True,
    ),
)


def main(arguments: Sequence[str] | None = None) -> None:
    """Time all commands on all flights."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=3, help="runs of each command (3)")
    parser.add_argument("--out", type=Path, default=harness.OUT, help="folder of the results")
    given = parser.parse_args(arguments)
    harness.refuse_changes(given.out)
    rows = [row for kind in KINDS for row in measured(kind, harness.FLIGHTS, given.repeat)]
    table = pd.DataFrame(rows).convert_dtypes()  # whole numbers stay whole
    harness.write(given.out, "commands", {"": table}, harness.about(), digits=DIGITS)


def measured(kind: Kind, folder: Path, repeat: int) -> Iterator[dict[str, Any]]:
    """Yield a row for every run of every command."""
    flight = folder / kind.name.replace(" ", "-")
    if not (flight / "flight.toml").is_file():
        kind.make(flight)
    sizes = {"flight": kind.name, "images": _rows(flight, "images")}
    sizes["measurements"] = _rows(flight, "image_points")
    for number in range(1, (1 if kind.large else repeat) + 1):
        with tempfile.TemporaryDirectory(dir=folder) as made:
            for text in kind.commands:
                took = harness.timed(*call(text, flight, Path(made)))
                yield {**sizes, "command": text, "run": number, **took}


def call(text: str, flight: Path, made: Path) -> list[str]:
    """Return the whole command; each kind of run has results of its own."""
    name, *options = text.split()
    numbers, full = made / "numbers", made / "results"
    return [
        *(harness.ACX4, name),
        *options,
        *{
            "check": [str(flight)],
            "run": ["--results", str(numbers if text == NUMBERS else full), str(flight)],
            "report": [str(full)],
            "render": [str(flight), "--results", str(full), "--out", str(made / "images")],
        }[name],
    ]


def _rows(flight: Path, table: str) -> int:
    """Return the number of rows of a table in all blocks of a flight."""
    return sum(len(path.read_bytes().splitlines()) - 1 for path in flight.glob(f"*/{table}.csv"))


if __name__ == "__main__":
    main()
