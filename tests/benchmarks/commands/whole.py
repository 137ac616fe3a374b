"""Whole commands, from start to end: seconds, and memory of all processes.

Flights are made into a folder that is kept.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks import harness
from benchmarks.commands import large_flight

IMPORTS = "import numpy, scipy.linalg, pandas, pyproj, numba"
"""What a run needs in any case, timed alone."""
EXPOSURE = "H3-04"
NUMBERS = "run --numbers-only"


Row = dict[str, Any]


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
    large: bool = False


def _simulated(*options: str) -> Callable[[Path], None]:
    return lambda folder: _run([harness.ACX4, "simulate", *options, "--out", str(folder)])


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
        make=lambda folder: large_flight.write(folder, 1000),
        commands=_ALL,
        large=True,
    ),
    Kind(
        name="1 000 images, turned",
        make=lambda folder: large_flight.write_turned(folder, 1000),
        commands=("check", NUMBERS),
        large=True,
    ),
    Kind(
        name="4 000 images",
        make=lambda folder: large_flight.write(folder, 4000),
        commands=("check", NUMBERS),
        large=True,
    ),
)


def rows(_folder: Path, repeat: int) -> tuple[list[Row], Row]:
    """Return a row for every run of every command, and what belongs to all."""
    found = [row for kind in KINDS for row in measured(kind, harness.FLIGHTS, repeat)]
    return found, {"imports": "importing numpy, scipy, pandas, pyproj and numba"}


def measured(kind: Kind, folder: Path, repeat: int) -> Iterator[Row]:
    """Yield a row for every run of every command, and for the imports alone."""
    flight = folder / kind.name.replace(",", "").replace(" ", "-")
    if not (flight / "flight.toml").is_file():
        kind.make(flight)
    sizes = {"flight": kind.name, "images": _rows(flight, "images")}
    sizes["measurements"] = _rows(flight, "image_points")
    for number in range(1, (1 if kind.large else repeat) + 1):
        yield sizes | _timed("imports", number, [sys.executable, "-c", IMPORTS])
        with tempfile.TemporaryDirectory(dir=folder) as made:
            for text in kind.commands:
                yield sizes | _timed(text, number, call(text, flight, Path(made)))


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


def _timed(text: str, number: int, arguments: Sequence[str]) -> dict[str, Any]:
    return {"command": text, "run": number, **harness.timed(*arguments)}


def _rows(flight: Path, table: str) -> int:
    """Return the number of rows of a table in all blocks of a flight."""
    return sum(len(path.read_bytes().splitlines()) - 1 for path in flight.glob(f"*/{table}.csv"))


def _run(arguments: Sequence[str]) -> None:
    sys.stderr.write(f"{' '.join(arguments[1:])}\n")
    harness.called(arguments)
