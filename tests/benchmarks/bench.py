"""Time what the page on speed shows: ``python -m benchmarks.bench [NAME ...]`` (``make bench``).

Each benchmark gives rows, one for each run of a program in a process of its own, and what belongs
to all of them. The results replace those in data/benchmarks when all of a benchmark are there.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from benchmarks import commands, harness
from benchmarks.adjusting import adjustment

Rows = Callable[[Path, int], tuple[list[dict[str, Any]], dict[str, Any]]]
"""Takes an empty folder and the number of runs of each program."""

BENCHMARKS: Mapping[str, Rows] = {"commands": commands.rows, "adjustment": adjustment.rows}
DIGITS = 7


def main(arguments: Sequence[str] | None = None) -> None:
    """Time what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(BENCHMARKS))
    parser.add_argument("--repeat", type=int, default=3, help="runs of each program (3)")
    parser.add_argument("--out", type=Path, default=harness.OUT, help="folder of the results")
    given = parser.parse_args(arguments)
    if unknown := {*given.names} - BENCHMARKS.keys():
        parser.error(f"{', '.join(sorted(unknown))}: not one of {', '.join(BENCHMARKS)}")
    harness.refuse_changes(given.out)
    for name in given.names or BENCHMARKS:
        with tempfile.TemporaryDirectory() as folder:
            rows, about = BENCHMARKS[name](Path(folder), given.repeat)
        table = pd.DataFrame(rows).convert_dtypes()  # whole numbers stay whole
        harness.write(given.out, name, {"": table}, harness.about() | about, digits=DIGITS)


if __name__ == "__main__":
    main()
