"""Fly five plans, clean and spoilt, and note what every report says (``make coverage``).

200 clean flights of each plan show how often a verdict is wrong; 60 flights of each plan with each
fault, how often that is found. Every flight is written to disk, run as by ``acx4 run
--numbers-only`` and judged by the record of its report. The table in data/benchmarks has a row for
every flight; a flight that has one of the same code is not flown again. Plans and faults take
turns, so that the flights that are there at any time are spread evenly over them. Needs
PYTHONPATH=tests.

The size of a fault is predicted before by `sizes`: a few flights with other seeds, the pilots, tell
what it does to every test, and the theory of the tests at which size 80 % are found. At that size
the 60 are flown. Sizes of gross errors are those that ``acx4 plan`` predicts. Last come flights
whose trajectory's errors change slowly, and flights that hold a wrong focal length.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from acx4book.command.runs import executor
from acx4book.notebooks import runner
from acx4book.report import findings, held, material, page
from acx4files.results import folder as results
from acx4lib.errors import Acx4Error
from acx4lib.least_squares.processors import as_finished
from acx4sim.files import write_files
from benchmarks import harness
from benchmarks.verdicts import sizes
from benchmarks.verdicts.faults import FAULTS, HELD, PLANS, SLOW, Planted, fly

OUT = harness.OUT
NAME, PILOTS, SLOWLY = "verdicts", "verdicts_pilots", "slow_validations"
HOLDING, N_HELD = "held_values", 6
N_CLEAN, N_SPOILT, N_THIRD, N_PILOT = 200, 60, 20, 4
N_FIRST = 60
"""Clean flights of a plan that are flown before any spoilt one."""

SEEDS = {"clean": 0, "spoilt": 300, "third": 400, "pilot": 500, "slow": 600, "held": 700}
"""Before the first seed of a plan's flights; every plan has a thousand of its own."""

THIRD = 1.5
"""True sigma over a sigma that is stated a third too small."""

HOUSES = ("acx4lib", "acx4files", "acx4sim", "acx4book/notebooks", "acx4book/report")
"""Code on which a verdict depends, below src."""

TESTED = ("test_verdicts.py",)

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
TEXTS = ("purpose", "plan", "fault", "source", "error", "rejected")
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
    harness.refuse_changes(options.out)
    flown = fly_all(in_turns([*pilots(options.pilots)]), options.out, options.jobs, name=PILOTS)
    good, spoiled = [*clean(options.clean)], [*spoilt(sizes_of(flown), options.spoilt)]
    first = in_turns([kind[:N_FIRST] for kind in good])
    rest = in_turns([*(kind[N_FIRST:] for kind in good), *spoiled])
    fly_all([*first, *rest], options.out, options.jobs)
    fly_all(in_turns([*slow(options.spoilt)]), options.out, options.jobs, name=SLOWLY)
    fly_all(in_turns([*holding(N_HELD)]), options.out, options.jobs, name=HOLDING)


# --- what is flown ---------------------------------------------------------------------------


def clean(n: int) -> Iterator[list[Order]]:
    """Yield the clean flights, plan by plan."""
    for plan in PLANS:
        yield of_kind("clean", plan, "", 0.0, n)


def pilots(n: int) -> Iterator[list[Order]]:
    """Yield the flights that predict the sizes.

    Of every plan, without a fault and with every fault of the guessed size, in both directions; of
    a sigma, with reversed noise and without any.
    """
    for plan in PLANS:
        yield of_kind("pilot", plan, "", 0.0, n)
    for fault, of in FAULTS.items():
        for plan in (plan for plan in of.plans if plan not in of.known):
            sizes = (-1.0, 0.0) if of.scales else (of.begin(plan), -of.begin(plan))
            for size in sizes:
                yield of_kind("pilot", plan, fault, size, n)


def spoilt(found: Mapping[tuple[str, str], float], n: int) -> Iterator[list[Order]]:
    """Yield the flights of every plan with every fault, of the size that is predicted."""
    for (plan, fault), size in found.items():
        yield of_kind("spoilt", plan, fault, size, n)
    for plan in PLANS:
        for fault in (name for name in FAULTS if name.startswith("sigma")):
            yield of_kind("third", plan, fault, THIRD, min(n, N_THIRD))


def slow(n: int) -> Iterator[list[Order]]:
    """Yield flights of the first plan whose trajectory's errors change slowly."""
    for kind, of in SLOW.items():
        yield of_kind("slow", PLANS[0], kind, of.begin(PLANS[0]), n)


def holding(n: int) -> Iterator[list[Order]]:
    """Yield flights whose adjustments hold a wrong focal length."""
    for design, off_mm in HELD.items():
        yield of_kind("held", design, "focal length" if off_mm else "", off_mm, n)


def of_kind(purpose: str, plan: str, fault: str, size: float, n: int) -> list[Order]:
    """Return flights of one kind, with the seeds that were fixed for them."""
    first = 1 + 1000 * [*PLANS, *HELD].index(plan) + SEEDS[purpose]
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
        flight without results; ``holds``, the smallest ``p_joint``, the number ``n_tests``, and the
        state of every question of the report; of clean flights p of every test; ``n_rejected``, and
        of planted gross errors, by their kind, whether they are rejected; of held values the names
        of the ``rejected`` ones; of pilots the statistics of the tests in the place of their p.
    """
    row: Row = {**asdict(order), "source": source(), "status": 0, "error": ""}
    simulated, planted = fly(order.plan, order.seed, order.fault, order.size)
    with tempfile.TemporaryDirectory(dir=memory()) as scratch:
        flight, found = Path(scratch, "flight"), Path(scratch, "results")
        write_files(simulated, flight)
        try:
            outcome = runner.run(flight, found)
        except Acx4Error as error:
            return row | {"status": 2, "error": str(error).splitlines()[0].replace(scratch, "")}
        row["status"] = int(bool(outcome.not_determined))
        whole = material.read(found)
        if order.purpose == "held":
            row["rejected"] = " ".join(held_values(whole))
        if order.purpose == "pilot":
            return row | said(whole, tests=False) | sizes.as_row([*sizes.statistics(whole)])
        return row | said(whole, tests=not order.fault) | taken_out(found, planted)


def memory() -> str | None:
    """Return a folder in memory, if this computer has one."""
    return "/dev/shm" if os.access("/dev/shm", os.W_OK) else None


def said(whole: material.Material, *, tests: bool) -> Row:
    """Return what the record of a report says, on request with every test."""
    statement = page.record(whole, findings.findings(whole))["statement"]
    each = [(f["question"], test) for f in statement["findings"] for test in f["tests"]]
    return {
        "holds": int(statement["holds"]),
        "n_tests": len(each),
        "p_joint": min((test["p_joint"] for _, test in each), default=np.nan),
        **{finding["question"]: finding["state"] for finding in statement["findings"]},
        **({f"p: {question}: {t['name']}": t["p"] for question, t in each} if tests else {}),
    }


def held_values(whole: material.Material) -> list[str]:
    """Return the held values that the certified adjustments reject, as the report names them."""
    return [key for names in held.tested(whole).values() for key in held.rejected(whole, names)]


def taken_out(found: Path, planted: Sequence[Planted]) -> Row:
    """Return how many observations the calibration rejected, and which of the planted ones."""
    own = results.rows(results.read(found), "rejected", "mounting/single_step")
    names = ("kind", "image_or_exposure", "point")
    keys = set(zip(*(own[name].fillna("").astype(str) for name in names), strict=True))
    return {"n_rejected": len(own), **{f"found: {m[0]}": int(m in keys) for m in planted}}


@cache
def source() -> str:
    """Return a digest of the code and the plans on which verdicts depend."""
    src, here = harness.ROOT / "src", Path(__file__).parent
    digest = hashlib.sha256()
    for folder in (*(src / house for house in HOUSES), here):
        for path in sorted(p for p in folder.rglob("*") if p.suffix in {".py", ".toml"}):
            if path.name not in {Path(__file__).name, Path(sizes.__file__).name, *TESTED}:
                digest.update(path.read_bytes())
    return digest.hexdigest()[:10]


# --- all flights -----------------------------------------------------------------------------


def fly_all(orders: Sequence[Order], folder: Path, jobs: int, *, name: str = NAME) -> pd.DataFrame:
    """Fly what has no row of this code yet; return the table.

    It is written again and again meanwhile. Rows of another state of the code are dropped.
    """
    path = folder / f"{name}.csv"
    rows = [row for row in rows_of(path) if row["source"] == source()]
    planned = Counter(order.purpose for order in orders)
    done = {tuple(row[key] for key in KEYS) for row in rows}
    missing = [order for order in orders if tuple(asdict(order).values()) not in done]
    with executor(jobs, None) as pool:
        try:
            for k, (order, call) in enumerate(as_finished(pool, judged, missing), 1):
                rows.append(call.result())
                what = f"{order.plan}, {order.fault or 'clean'}"
                sys.stderr.write(f"\r{k} of {len(missing)}: {what}\33[K")
                if k % EVERY == 0:
                    write(folder, rows, planned, name=name)
        finally:
            if missing:
                write(folder, rows, planned, name=name)
    return pd.DataFrame(rows)


def rows_of(path: Path) -> list[Row]:
    """Return the rows that are there."""
    if not path.exists():
        return []
    texts = dict.fromkeys(TEXTS, "")
    table = pd.read_csv(path, dtype=dict.fromkeys(TEXTS, str)).fillna(texts)
    rows: list[Row] = table.to_dict("records")
    return rows


def write(
    folder: Path, rows: Sequence[Row], planned: Mapping[str, int], *, name: str = NAME
) -> None:
    """Write the table, and what it hangs on; how many flights are planned for every purpose."""
    about = harness.about()
    about["planned"] = dict(planned)
    harness.write(folder, name, {"": pd.DataFrame(rows)}, about, digits=DIGITS)


# --- sizes -----------------------------------------------------------------------------------


def sizes_of(flown: pd.DataFrame) -> dict[tuple[str, str], float]:
    """Return for every plan and fault the size of which 80 % should be found, by the pilots.

    Where it is known, or none is found so often, it is the guess.
    """
    by_kind = {
        kind: own.set_index("seed").sort_index()
        for kind, own in flown.groupby(["plan", "fault", "size"])
    }
    found = {}
    for fault, of in FAULTS.items():
        for plan in of.plans:
            begin = of.begin(plan)
            size = np.nan
            if plan not in of.known:
                size = sizes.predicted(_pilots_of(by_kind, plan, fault), begin)
            beyond = float(f"{size - of.least:.2g}")
            found[plan, fault] = of.least + beyond if np.isfinite(size) else begin
    return found


def _pilots_of(
    by_kind: Mapping[tuple[str, str, float], pd.DataFrame], plan: str, fault: str
) -> list[sizes.Pilot]:
    """Return what a fault does to the tests, seed by seed."""
    of, without = FAULTS[fault], by_kind[plan, "", 0.0]
    if of.scales:
        reversed_, quiet = (by_kind[plan, fault, size] for size in (-1.0, 0.0))
        parts = (without, reversed_, quiet)
        seeds = _in_all(parts)
        return [sizes.scaled(*(p.loc[s] for p in parts), groups=of.groups) for s in seeds]
    begin = float(f"{of.begin(plan):.{DIGITS}g}")
    parts = (without, by_kind[plan, fault, begin], by_kind[plan, fault, -begin])
    return [sizes.shifted(*(p.loc[s] for p in parts), size=begin) for s in _in_all(parts)]


def _in_all(parts: Sequence[pd.DataFrame]) -> list[int]:
    """Return the seeds of which all flights have a report."""
    first, *others = (set(part.index[part["holds"].notna()]) for part in parts)
    return sorted(first.intersection(*others))


if __name__ == "__main__":
    main()
