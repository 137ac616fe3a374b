"""Cases of results: mutated, sealed anew or not, and given to a command that reads results."""

from __future__ import annotations

import csv
import io
import json
import random
import re
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

from acx4book.command import terminal
from acx4book.notebooks import runner
from acx4book.report import findings, material, page
from acx4files.exchange.outward.programs import KINDS as EXPORTS
from acx4files.results.table_files import SCHEMAS
from acx4lib.errors import UNSEEN
from support.commands import said, said_by
from support.flights import pictured
from support.fuzz import nasty
from support.fuzz.flights import spoil as spoil_flight
from support.fuzz.strangers import VALUES
from support.fuzz.strangers import spoil as spoil_file
from support.run_results import seal_again

PER = 1
"""Cases for each of those that are asked for."""

LINE = re.compile(r"(?s).+: .+")
"""What is said of results, or of a folder: where, and what is wrong."""

COMMANDS = ("record", "report", "export", "render", "run")
COMMAND_WEIGHTS = (6, 2, 4, 1, 3)


def write_good(good: Path) -> None:
    """Write a flight of two heads with results of all stages, and pictures."""
    blocks = ("heads", "calibration", "validation")
    pictured.write_flight(good / "flight", ("E0",), blocks=blocks)
    stages = ("heads", "mounting", "validation")
    runner.run(good / "flight", good / "results", stages=stages)


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
    command = rng.choices(COMMANDS, COMMAND_WEIGHTS)[0]
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
        "export": lambda: (folder, "--out", out, "--to", kind, "--allow", "1", *oriented),
        "render": lambda: (good / "flight", "--results", folder, "--out", out),
        "run": lambda: (
            *(good / "flight", "--results", folder, "--numbers-only"),
            *("--stages", ("validation", "mounting", "heads,validation")[case % 3]),
        ),
    }
    if command == "record":
        return said_by(lambda: sys.exit(terminal.status_of(lambda: _record(folder), ["record"])))
    return said(command, *arguments[command]())


def _record(folder: Path) -> None:
    """Make the report for machines, which needs no figures."""
    read = material.read(folder)
    page.text(read, findings.findings(read))


# --- ways to tamper with a results folder, each drawn from a random generator ------------------


Tamper = Callable[[Path, random.Random], None]
Rows = list[list[str]]

EXTREMES = (
    *("inf", "-inf", "nan", "1e308", "-1e308", "1e-320", "-0", "-0.0", "0", "", " ", "1e15", "-1"),
    *("x" * 100_000, "1e400", "9" * 400, "1.5", "1e11", "-1e11", "1e-30", "0.5", "180", "1e6", "x"),
)
FACTORS = (0.0, 1e-200, 1e-30, 1e-9, 1e-3, 10.0, 1e4, 1e9, 1e100)


def _table(folder: Path, rng: random.Random, name: str = "") -> tuple[Path, list[str], Rows]:
    """Return a table of the results with rows: its path, header and rows."""
    known = [folder / f"{n}.csv" for n in SCHEMAS if name in ("", n)]
    paths = [path for path in known if path.is_file() and not path.is_symlink()]
    rng.shuffle(paths)
    for path in paths:
        text = path.read_text(encoding="utf-8", errors="replace").replace("\0", "")
        rows = list(csv.reader(io.StringIO(text, newline="")))
        if len(rows) > 1:
            return path, rows[0], rows[1:]
    return folder / "parameters.csv", list(SCHEMAS["parameters"].columns), []


def _write(path: Path, header: list[str], rows: Rows) -> None:
    out = io.StringIO(newline="")
    csv.writer(out, lineterminator="\n").writerows([header, *rows])
    if not path.is_symlink() and not path.is_dir():
        path.write_text(out.getvalue(), encoding="utf-8", errors="surrogatepass")


def cells(folder: Path, rng: random.Random) -> None:
    """Put extremes, names or the cells of other rows in the place of some."""
    path, header, rows = _table(folder, rng)
    for _ in range(rng.choice((1, 1, 1, 2, 5))):
        row, column = rng.randrange(len(rows) or 1), rng.randrange(len(header))
        if row < len(rows) and column < len(rows[row]):
            other = rng.choice(rows)
            rows[row][column] = rng.choice(
                (
                    rng.choice(EXTREMES),
                    rng.choice(EXTREMES),
                    rng.choice(nasty.NAMES),
                    nasty.cell(rng),
                    other[min(column, len(other) - 1)],
                )
            )
    _write(path, header, rows)


def columns(folder: Path, rng: random.Random) -> None:
    """Put one value into a whole column, of a method or of all, or exchange two columns."""
    path, header, rows = _table(folder, rng)
    k, value = rng.randrange(len(header)), rng.choice((*EXTREMES, *nasty.NAMES[:12]))
    method = rng.choice(rows)[:2] if rows and rng.random() < 0.5 else None
    other = rng.randrange(len(header))
    exchange = rng.random() < 0.3
    for row in rows:
        if len(row) == len(header) and (method is None or row[:2] == method):
            row[k], row[other] = (row[other], row[k]) if exchange else (value, row[other])
    _write(path, header, rows)


def rows(folder: Path, rng: random.Random) -> None:
    """Drop, double, repeat or shuffle rows."""
    path, header, own = _table(folder, rng)
    some = set(rng.sample(range(len(own)), min(len(own), rng.choice((1, 1, 2, 10, 100)))))
    way = rng.choice(("drop", "double", "shuffle", "keep", "method"))
    if way == "drop":
        own = [row for k, row in enumerate(own) if k not in some]
    elif way == "double":
        own = [row for k, row in enumerate(own) for _ in range(1 + (k in some))]
    elif way == "keep":
        own = [row for k, row in enumerate(own) if k in some]
    elif way == "method" and own:
        begin = rng.choice(own)[: rng.choice((1, 2, 3))]
        own = [row for row in own if row[: len(begin)] != begin]
    else:
        rng.shuffle(own)
    _write(path, header, own)


def names(folder: Path, rng: random.Random) -> None:
    """Put another name in the place of one, in one table or in all."""
    path, _, own = _table(folder, rng)
    texts = sorted({cell for row in own for cell in row if cell and not cell[-1].isdigit()})
    if not texts:
        return
    old, new = rng.choice(texts), rng.choice((*texts, rng.choice(nasty.NAMES), "UNKNOWN", ""))
    paths = sorted(folder.glob("*.csv")) if rng.random() < 0.4 else [path]
    for one in paths:
        _, header, of_one = _table(folder, rng, one.stem)
        _write(one, header, [[new if cell == old else cell for cell in row] for row in of_one])


def scaled(folder: Path, rng: random.Random) -> None:
    """Multiply the sigma of a method by a factor, and its covariance by the square."""
    factor = rng.choice(FACTORS)
    path, header, own = _table(folder, rng, "parameters")
    if not own:
        return
    method = rng.choice(own)[:2]
    for table, column, by in (("parameters", "sigma", factor), ("covariance", "value", factor**2)):
        path, header, own = _table(folder, rng, table)
        k = header.index(column) if column in header else 0
        for row in own:
            if row[:2] == method and len(row) == len(header):
                row[k] = _times(row[k], by)
        _write(path, header, own)


def _times(cell: str, factor: float) -> str:
    try:
        return repr(float(cell) * factor)
    except ValueError:
        return cell


def entries(folder: Path, rng: random.Random) -> None:
    """Put any JSON in the place of values of summary.json, or remove keys or whole entries."""
    path = folder / "summary.json"
    try:
        summary = json.loads(path.read_text(encoding="utf-8"))
        names_ = list(summary)
    except (OSError, ValueError, TypeError):
        return
    for _ in range(rng.choice((1, 1, 2, 3))):
        name = rng.choice(names_)
        entry = summary.get(name)
        if not isinstance(entry, dict) or not entry or rng.random() < 0.1:
            summary.pop(name, None)
        elif rng.random() < 0.25:
            del entry[rng.choice(list(entry))]
        else:
            _change(entry, rng)
    _dump(path, summary)


def _change(entry: dict[str, Any], rng: random.Random) -> None:
    """Change a value of an entry, or one inside of it."""
    node: Any = entry
    key: Any = rng.choice(list(entry))
    while isinstance(node[key], dict | list) and node[key] and rng.random() < 0.8:
        node = node[key]
        key = rng.choice(list(node) if isinstance(node, dict) else range(len(node)))
    old = node[key]
    near = (1e300, -1, 0, 1, 0.5, 1e14, 2, -0.5, old, str(old))
    node[key] = rng.choice(near) if rng.random() < 0.5 else rng.choice(VALUES)


def _dump(path: Path, value: object) -> None:
    text = json.dumps(value, indent=2)
    path.write_text(text, encoding="utf-8", errors="surrogatepass")


def kept(folder: Path, rng: random.Random) -> None:
    """Mutate the kept flight."""
    if (folder / "flight" / "flight.toml").is_file():
        spoil_flight(folder / "flight", rng)


def files(folder: Path, rng: random.Random) -> None:
    """Mutate any file as that of a stranger."""
    spoil_file(folder, rng)


TAMPERS: dict[str, Tamper] = {
    "cells": cells,
    "columns": columns,
    "rows": rows,
    "names": names,
    "scaled": scaled,
    "entries": entries,
    "kept": kept,
    "files": files,
}
WEIGHTS = {"cells": 4.0, "entries": 4.0, "rows": 2.0, "files": 2.0}


def spoil(folder: Path, rng: random.Random) -> str:
    """Tamper with a results folder in place, once or more; return in which ways."""
    weights = [WEIGHTS.get(kind, 1.0) for kind in TAMPERS]
    kinds = rng.choices(list(TAMPERS), weights, k=rng.choice((1, 1, 1, 2, 3)))
    for kind in kinds:
        TAMPERS[kind](folder, rng)
    return "+".join(kinds)
