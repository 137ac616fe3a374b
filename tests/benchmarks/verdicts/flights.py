"""Fly five plans, clean and spoilt, and note what every report says (``make coverage``).

200 clean flights of each plan show how often a verdict is wrong; 60 flights of each plan with each
fault, how often that is found. Every flight is written to disk, run as by ``acx4 run
--numbers-only`` and judged by the record of its report. The table in data/benchmarks has a row for
every flight; a flight that has one is not flown again. Plans and faults take turns, so that the
flights that are there at any time are spread evenly over them. Needs PYTHONPATH=tests.

The size of a fault is predicted before: a few flights with other seeds, the pilots, tell at which
one 80 % should be found. At that size the 60 are flown.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import sys
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from scipy import stats

from acx4book.command.batch.executors import on_processes
from acx4book.notebooks import runner
from acx4book.notebooks.ways import way_of
from acx4book.report import material
from acx4book.report.page import record
from acx4book.report.verdict import verdict
from acx4lib.errors import Acx4Error
from acx4lib.least_squares.processors import as_finished
from acx4lib.results import folder as results
from acx4sim.files.writer import write_files
from benchmarks import machine, stored
from benchmarks.verdicts.faults import FAULTS, PLANS, Planted, fly

OUT = machine.ROOT / "data" / "benchmarks"
NAME = "verdicts"
N_CLEAN, N_SPOILT, N_PILOT = 200, 60, 20
SEEDS = {"clean": 0, "spoilt": 300, "third": 400, "pilot": 500}
"""Before the first seed of a plan's flights; every plan has a thousand of its own."""

THIRD = 1.5
"""True sigma over a sigma that is stated a third too small."""

LADDER = (0.5, 0.8, 1.25, 2.0)
"""Sizes of the pilots, over the guess."""

FOUND = 0.8
"""Share of the flights with a fault that are to be found at the size that is predicted."""

CRITICAL = 2.9
"""Of a normal test whose level is Holm's share of 5 %, for about a dozen tests, two-sided."""

HOUSES = ("acx4lib", "acx4sim", "acx4book/notebooks", "acx4book/report")
"""Code on which a verdict depends, below src."""

EVERY = 40
"""Flights after which the table is written."""

DIGITS = 4
"""Of the numbers written down."""

Row = dict[str, Any]


@dataclass(frozen=True, kw_only=True)
class Order:
    """A flight to be flown.

    Attributes
    ----------
    purpose : str
        Key of `SEEDS`: ``third`` is a sigma that is a third too small.
    plan, fault : str
        Without a fault the flight is clean.
    size : float
    seed : int
    """

    purpose: str
    plan: str
    fault: str
    size: float
    seed: int


KEYS = [field.name for field in fields(Order)]
TEXTS = ("purpose", "plan", "fault", "source", "error")
"""Columns that are text, and empty where there is none."""


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--clean", type=int, default=N_CLEAN, help="flights of a plan")
    parser.add_argument("--spoilt", type=int, default=N_SPOILT, help="flights of a plan and fault")
    parser.add_argument("--pilots", type=int, default=N_PILOT, help="flights of a plan and fault")
    parser.add_argument("--jobs", type=int, default=2, help="flights at a time")
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the results")
    options = parser.parse_args()
    rows = fly_all(pilots(options.pilots), options.out, options.jobs)
    orders = in_turns([*clean(options.clean), *spoilt(sizes(rows), options.spoilt)])
    fly_all(orders, options.out, options.jobs)


# --- what is flown ---------------------------------------------------------------------------


def clean(n: int) -> Iterator[list[Order]]:
    """Yield the clean flights, plan by plan."""
    for plan in PLANS:
        yield of_kind("clean", plan, "", 0.0, n)


def pilots(n: int) -> list[Order]:
    """Return the flights that predict the sizes: every fault in some sizes about its guess."""
    kinds = []
    for fault, of in FAULTS.items():
        for plan in of.plans:
            beyond = of.begin(plan) - of.least
            by_size = [
                of_kind("pilot", plan, fault, of.least + step * beyond, n) for step in LADDER
            ]
            kinds.append([by_size[k % len(LADDER)][k] for k in range(n)])
    return in_turns(kinds)


def spoilt(sizes: Mapping[tuple[str, str], float], n: int) -> Iterator[list[Order]]:
    """Yield the flights of every plan with every fault, of the size that is predicted."""
    for (plan, fault), size in sizes.items():
        yield of_kind("spoilt", plan, fault, size, n)
    for plan in PLANS:
        for fault in (name for name in FAULTS if name.startswith("sigma")):
            yield of_kind("third", plan, fault, THIRD, n)


def of_kind(purpose: str, plan: str, fault: str, size: float, n: int) -> list[Order]:
    """Return flights of one kind, with the seeds that were fixed for them."""
    first = 1 + 1000 * PLANS.index(plan) + SEEDS[purpose]
    size = float(f"{size:.{DIGITS}g}")
    return [
        Order(purpose=purpose, plan=plan, fault=fault, size=size, seed=first + k) for k in range(n)
    ]


def in_turns(kinds: Sequence[Sequence[Order]]) -> list[Order]:
    """Return the flights of all kinds, spread evenly, whatever their numbers."""
    placed = [((k + 0.5) / len(kind), order) for kind in kinds for k, order in enumerate(kind)]
    return [order for _, order in sorted(placed, key=lambda pair: pair[0])]


# --- one flight ------------------------------------------------------------------------------


def judged(order: Order) -> Row:
    """Return what becomes of a flight.

    Returns
    -------
    dict
        The order; ``source``, a digest of the code; ``status`` as of ``acx4 run``; ``error`` of a
        flight without results; ``taken_out``, the share of planted gross errors that were rejected;
        ``n_rejected``; the state of every question of the report, and ``p`` of those that have one.
    """
    row: Row = {**asdict(order), "source": source(), "status": 0, "error": ""}
    simulated, planted = fly(order.plan, order.seed, order.fault, order.size)
    with tempfile.TemporaryDirectory(dir=memory()) as scratch:
        flight, found = Path(scratch, "flight"), Path(scratch, "results")
        write_files(simulated, flight)
        try:
            outcome = runner.run(flight, found, way=way_of(None))
        except Acx4Error as error:
            return row | {"status": 2, "error": str(error).splitlines()[0].replace(scratch, "")}
        row["status"] = int(bool(outcome.not_determined))
        return row | said(found) | taken_out(found, planted)


def memory() -> str | None:
    """Return a folder in memory, if this computer has one."""
    return "/dev/shm" if os.access("/dev/shm", os.W_OK) else None


def said(found: Path) -> Row:
    """Return the state of every question of a report, and its p, from the report's record."""
    whole = material.read(found)
    statement = record.record(whole, verdict.findings(whole))["statement"]
    out: Row = {"holds": int(statement["holds"])}
    for finding in statement["findings"]:
        out[finding["question"]] = finding["state"]
        if finding.get("p") is not None:
            out[f"p: {finding['question']}"] = finding["p"]
    return out


def taken_out(found: Path, planted: Sequence[Planted]) -> Row:
    """Return how many observations the calibration rejected, and the share of the planted ones."""
    own = results.rows(results.read(found), "rejected", "mounting/single_step")
    names = ("kind", "image_or_exposure", "point")
    keys = set(zip(*(own[name].fillna("").astype(str) for name in names), strict=True))
    share = np.mean([mistake in keys for mistake in planted]) if planted else np.nan
    return {"n_rejected": len(own), "taken_out": float(share)}


@cache
def source() -> str:
    """Return a digest of the code and the plans on which verdicts depend."""
    src, here = machine.ROOT / "src", Path(__file__).parent
    digest = hashlib.sha256()
    for folder in (*(src / house for house in HOUSES), here):
        for path in sorted(p for p in folder.rglob("*") if p.suffix in {".py", ".toml"}):
            if path.name not in {Path(__file__).name, "test_flights.py"}:
                digest.update(path.read_bytes())
    return digest.hexdigest()[:10]


# --- all flights -----------------------------------------------------------------------------


def fly_all(orders: Sequence[Order], folder: Path, jobs: int) -> pd.DataFrame:
    """Fly what has no row yet; return the table, which is written again and again meanwhile."""
    path = folder / f"{NAME}.csv"
    rows = rows_of(path)
    done = {tuple(row[key] for key in KEYS) for row in rows}
    missing = [order for order in orders if tuple(asdict(order).values()) not in done]
    with on_processes(jobs) as pool:
        try:
            for k, (order, call) in enumerate(as_finished(pool, judged, missing), 1):
                rows.append(call.result())
                what = f"{order.plan}, {order.fault or 'clean'}"
                sys.stderr.write(f"\r{k} of {len(missing)}: {what}\33[K")
                if k % EVERY == 0:
                    write(folder, rows)
        finally:
            if missing:
                write(folder, rows)
    return pd.DataFrame(rows)


def rows_of(path: Path) -> list[Row]:
    """Return the rows that are there."""
    if not path.exists():
        return []
    texts = dict.fromkeys(TEXTS, "")
    table = pd.read_csv(path, dtype=dict.fromkeys(TEXTS, str)).fillna(texts)
    rows: list[Row] = table.to_dict("records")
    return rows


def write(folder: Path, rows: Sequence[Row]) -> None:
    """Write the table, and what it hangs on."""
    about = {key: value for key, value in machine.described(None).items() if "ceres" not in key}
    stored.write(folder, NAME, {"": pd.DataFrame(rows)}, about, digits=DIGITS)


# --- sizes -----------------------------------------------------------------------------------


def sizes(rows: pd.DataFrame) -> dict[tuple[str, str], float]:
    """Return for every plan and fault the size of which 80 % should be found, by the pilots."""
    own = rows[rows["purpose"] == "pilot"]
    return {
        (plan, fault): predicted(of, FAULTS[fault].least, FAULTS[fault].begin(plan))
        for (plan, fault), of in own.groupby(["plan", "fault"], sort=False)
    }


def is_found(rows: pd.DataFrame) -> pd.Series:
    """Tell in which flights the fault was found: taken out if it can be, or the report fails."""
    return (rows["holds"] != 1) | (rows["taken_out"] == 1)


def predicted(pilots: pd.DataFrame, least: float, guess: float) -> float:
    """Return the size of which 80 % should be found; the guess if it was never found.

    Notes
    -----
    The probability to find a size s is taken as that of a normal test, Phi(a s - c), with the
    critical value c; a is the likeliest for the pilots. With several degrees of freedom it rises
    much alike.
    """
    size, found = pilots["size"].to_numpy() - least, is_found(pilots).to_numpy()
    if not found.any():
        return guess

    def cost(log_a: float) -> float:
        power = stats.norm.cdf(np.exp(log_a) * size - CRITICAL)
        share = np.clip(np.where(found, power, 1 - power), 1e-3, None)
        return -float(np.sum(np.log(share)))

    near = np.log(CRITICAL / (guess - least))
    grid = near + np.linspace(-2.5, 2.5, 501)
    log_a = grid[int(np.argmin([cost(at) for at in grid]))]
    beyond = float(f"{(CRITICAL + stats.norm.ppf(FOUND)) / np.exp(log_a):.2g}")
    return least + beyond


if __name__ == "__main__":
    main()
