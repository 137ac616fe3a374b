"""Cases of imports and exports: `acx4 import KIND`, or `acx4 export`, with mutated sources."""

from __future__ import annotations

import contextlib
import random
import re
import shutil
from pathlib import Path

from acx4book.notebooks import runner
from acx4lib.errors import OutputError
from acx4lib.results import own_folder
from support.fuzz.said import complaint, said
from support.fuzz.strangers import sources
from support.fuzz.strangers.spoil import copy, spoil

KINDS = tuple(sources.SOURCES)
PER = len(KINDS)
"""Cases for each of those that are asked for: one of every kind."""

OUTPUT = re.compile(r"(?s).+: .+")
"""What is said of a folder that cannot be written, or of results that were changed."""

write_good = sources.write_all


def warm(good: Path, work: Path) -> None:
    """Import all good ones, which must be accepted."""
    for kind in KINDS:
        status, out, err = _said(kind, good / kind, work, 0)
        assert status == 0, (kind, out, err)


def prepare(good: Path, work: Path, seed: int, case: int) -> tuple[tuple[str, Path], str]:
    """Write a mutated source; the same seed and case give the same one."""
    kind, rng = KINDS[case % PER], random.Random(f"{seed} {case}")
    folder = work / "source"
    shutil.rmtree(folder, ignore_errors=True)
    copy(good / kind, folder)
    name = sources.SOURCES[kind].source
    ways = spoil(folder / name if rng.random() < 0.5 else folder, rng)
    if kind == "export" and rng.random() < 0.7:
        _seal(folder / name)
    return (kind, folder), f"{kind} {ways}"


def _seal(results: Path) -> None:
    """Seal mutated results as if a run had left them so."""
    with (
        contextlib.suppress(OutputError, OSError),
        own_folder.claim(results, command=runner.COMMAND) as own,
    ):
        own.seal()


def run(target: tuple[str, Path], case: int) -> tuple[str, str]:
    """Return how a case ended, and what is wrong with that."""
    kind, folder = target
    status, out, err = _said(kind, folder, folder.parent, case // PER)
    wrong = complaint(status, out, err)
    if wrong and kind == "export" and status == 2 and all(map(OUTPUT.fullmatch, err.splitlines())):
        wrong = ""
    return ("refused" if status else "accepted"), wrong


def _said(kind: str, folder: Path, work: Path, case: int) -> tuple[int, str, str]:
    out = work / "out"
    shutil.rmtree(out, ignore_errors=True)
    of = sources.SOURCES[kind]
    options = [one.replace("{}", str(folder)) for one in of.options]
    if kind == "export":
        options += sources.export_options(case)
    begin = ["export"] if kind == "export" else ["import", of.kind or kind]
    return said(*begin, folder / of.source, "--out", out, *options)
