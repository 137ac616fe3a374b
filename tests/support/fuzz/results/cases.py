"""Cases of results: mutated, sealed anew or not, and given to a command that reads results."""

from __future__ import annotations

import random
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

from acx4book.command import endings
from acx4book.notebooks import functions, runner
from acx4book.report import findings, material, page
from acx4lib.errors import UNSEEN
from acx4tools.exchange.outward.programs import KINDS as EXPORTS
from support.flights import pictured, written
from support.fuzz.results.spoil import spoil
from support.fuzz.said import said, said_by
from support.run_results import seal_again

PER = 1
"""Cases for each of those that are asked for."""

LINE = re.compile(r"(?s).+: .+")
"""What is said of results, or of a folder: where, and what is wrong."""

COMMANDS = ("record", "report", "compare", "rigidity", "export", "render", "run")
WEIGHTS = (6, 2, 3, 1, 4, 1, 3)


def write_good(good: Path) -> None:
    """Write a flight of two heads with results of all stages, one to compare with, and pictures."""
    blocks = ("heads", "calibration", "validation")
    pictured.write_flight(good / "flight", ("E0",), blocks=blocks)
    written.write_flight(good / "other_flight", blocks=("calibration",), form="geographic")
    way = functions.Functions()
    stages = ("heads", "mounting", "validation")
    runner.run(good / "flight", good / "results", way=way, stages=stages)
    runner.run(good / "other_flight", good / "other", way=way, stages=("mounting",))


def warm(good: Path, work: Path) -> None:
    """Give all good ones to every command, which must accept them."""
    for k in range(len(COMMANDS)):
        target = work / "results"
        shutil.rmtree(target, ignore_errors=True)
        shutil.copytree(good / "results", target)
        status, out, err = _said(COMMANDS[k % len(COMMANDS)], good, target, k)
        assert status == 0, (COMMANDS[k % len(COMMANDS)], out, err)


def prepare(good: Path, work: Path, seed: int, case: int) -> tuple[tuple[str, Path, Path], str]:
    """Write mutated results; the same seed and case give the same."""
    rng = random.Random(f"{seed} {case}")
    command = rng.choices(COMMANDS, WEIGHTS)[0]
    folder = work / "results"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(good / "results", folder)
    ways = spoil(folder, rng)
    if rng.random() < 0.85:
        seal_again(folder)
    return (command, good, folder), f"{command} {ways}"


def run(target: tuple[str, Path, Path], case: int) -> tuple[str, str]:
    """Return how a case ended, and what is wrong with that."""
    command, good, folder = target
    status, out, err = _said(command, good, folder, case)
    return ("refused" if status else "accepted"), _complaint(status, out, err)


def _complaint(status: int, out: str, err: str) -> str:
    """Return what is wrong with what a command said, empty for nothing."""
    if UNSEEN.search((out + err).replace("\n", "")):
        return f"control characters: {out + err!r}"
    lines = [line for line in err.splitlines() if not re.fullmatch(r"[a-z]+: done", line)]
    if "mistake in acx4" in err or "Traceback" in err or status not in {0, 1, 2}:
        return f"status {status}: {out + err}"
    if status and not lines:
        return f"status {status} without a reason: {out}"
    wrong = [line for line in lines if not LINE.fullmatch(line)]
    return f"not a line of its own: {wrong[0]!r}" if wrong else ""


def _said(command: str, good: Path, folder: Path, case: int) -> tuple[int, str, str]:
    out = folder.parent / "out"
    shutil.rmtree(out, ignore_errors=True)
    page = folder.parent / "report.html"
    page.unlink(missing_ok=True)
    kinds = sorted(EXPORTS)
    kind = kinds[case % len(kinds)]
    oriented = ("--orientations", "validation") if EXPORTS[kind].oriented else ()
    arguments: dict[str, Callable[[], tuple[object, ...]]] = {
        "report": lambda: (folder, "--out", page),
        "compare": lambda: (folder, good / "other", "--out", out),
        "rigidity": lambda: (folder, "--out", out),
        "export": lambda: (folder, "--out", out, "--to", kind, "--allow", "1", *oriented),
        "render": lambda: (good / "flight", "--results", folder, "--out", out),
        "run": lambda: (
            *(good / "flight", "--results", folder, "--numbers-only"),
            *("--stages", ("validation", "mounting", "heads,validation")[case % 3]),
        ),
    }
    if command == "record":
        return said_by(lambda: sys.exit(endings.status_of(lambda: _record(folder), ["record"])))
    name = "compare" if command == "rigidity" else command
    return said(name, *arguments[command]())


def _record(folder: Path) -> None:
    """Make the report for machines, which needs no figures."""
    read = material.read(folder)
    page.text(read, findings.findings(read))
