"""Runs of many flights (``acx4 run``): one job each, on processes or on a Dask cluster.

Equal flights, software and settings leave equal bytes, wherever they run.
"""

from __future__ import annotations

import importlib
import json
import os
import re
import signal
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing import get_context
from pathlib import Path

import pandas as pd

from acx4book.command import terminal
from acx4book.notebooks import runner
from acx4files.flight import reader
from acx4files.flight.reader import Flight
from acx4files.flight.tables import name_fault
from acx4files.results import folder, provenance, read_back, whole_files
from acx4files.results.folder import NOTEBOOKS, PART_OF
from acx4files.stages import order
from acx4lib.errors import Acx4Error, FlightError, OutputError, not_installed, visible
from acx4lib.geometry.parameters import AXES, REPORTED
from acx4lib.least_squares.processors import as_finished

TABLE, SIMULATED, METHOD = "flights.csv", "simulated", "single_step"
"""Table and folder of simulated flights beside those of all flights; method of the table's rows."""

_ADJUSTMENT = ("sigma0_squared", "redundancy", "n_rejected")
_CHECKED = {"mean": "_m", "rms": "_m", "normalised_rms": ""}

COLUMNS = (
    *("flight", "status", "reason", "camera"),
    *_ADJUSTMENT,
    *(column for name, _ in REPORTED.values() for column in (name, f"sigma_{name}")),
    "n_check_points",
    *(f"{what}_{axis}{unit}" for what, unit in _CHECKED.items() for axis in AXES),
)
"""Columns of the table of all flights."""

Tell = Callable[[str, int, int], None]


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Stages, folder of notebooks (None: numbers only), results whose calibration is validated."""

    stages: tuple[str, ...]
    notebooks: Path | None = None
    calibration: Path | None = None


@dataclass(frozen=True, kw_only=True)
class Job:
    """A flight, simulated first by a `design` or a plan's file; paths are absolute for workers."""

    name: str
    flight: Path
    results: Path
    settings: Settings
    design: str = ""
    seed: int = 0


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Status and reason as `acx4 run` of the flight alone has them, and its row of the table."""

    status: int = 0
    reason: str = ""
    kept: bool = False
    row: Mapping[str, str] = field(default_factory=dict)


# --- what is to be run, and where


def of_flights(flights: Sequence[Path], folder: Path, settings: Settings) -> list[Job]:
    """Return a job for each flight, called as the flight's folder; ValueError for equal names."""
    top = absolute(folder)
    return _named(
        Job(name=path.name, flight=path, results=top / path.name, settings=settings)
        for path in map(absolute, flights)
    )


def of_seeds(
    designs: Sequence[str], seeds: Sequence[int], folder: Path, settings: Settings
) -> list[Job]:
    """Return a job for every seed of every design or plan, ``single-head-1`` and so on."""
    top = absolute(folder)
    flown = [(f"{Path(d).stem}-{seed}", d, seed) for d in dict.fromkeys(designs) for seed in seeds]
    return _named(
        Job(
            name=name,
            flight=top / SIMULATED / name,
            results=top / name,
            settings=settings,
            design=design,
            seed=seed,
        )
        for name, design, seed in flown
    )


def _named(jobs: Iterable[Job]) -> list[Job]:
    listed = list(jobs)
    often = Counter([TABLE, SIMULATED, "", *(job.name for job in listed)])
    for job in listed:
        if often[job.name] > 1 or job.name.startswith(".") or name_fault(job.name):
            where = job.design or job.flight
            msg = f"{where}: {job.name!r} cannot be the one name of a flight's results; rename it"
            raise ValueError(msg)
    return listed


def seeds_of(text: str) -> list[int]:
    """Return the seeds named in a text such as ``1-200`` or ``1,5,9-12``; ValueError for others."""
    seeds: list[int] = []
    for part in text.split(","):
        ends = re.fullmatch(r"\s*(\d{1,18})\s*(?:-\s*(\d{1,18})\s*)?", part, re.ASCII)
        first, last = (int(end or ends[1]) for end in ends.groups()) if ends else (1, 0)
        if first > last:
            msg = f"{part.strip()!r} names no seeds; give whole numbers, as in 1-200 or 1,5,9-12"
            raise ValueError(msg)
        seeds += range(first, last + 1)
    return list(dict.fromkeys(seeds))


def absolute(path: Path) -> Path:
    """Return an absolute path without following links."""
    return Path(os.path.abspath(path))  # noqa: PTH100 `resolve` would follow links


@contextmanager
def executor(jobs: int, cluster: str | None) -> Iterator[Executor]:
    """Yield processes of this computer, or the workers of a Dask cluster at an address.

    Raises
    ------
    FlightError
        Where Dask is not installed, or no scheduler answers.
    """
    if cluster is None:
        context = get_context("spawn")
        with ProcessPoolExecutor(jobs, mp_context=context, initializer=_begin) as pool:
            try:
                yield pool
            finally:  # nothing waits, but after an interruption
                pool.shutdown(cancel_futures=True)
        return
    try:
        distributed = importlib.import_module("distributed")  # it is optional
        client = distributed.Client(cluster, timeout=10, set_as_default=False)
    except ImportError:
        says = str(not_installed("--cluster", "distributed", "cluster"))
        raise FlightError([says]) from None
    except (OSError, ValueError) as error:
        says = f"--cluster {cluster}: no Dask scheduler answers ({error})"
        raise FlightError([" ".join(says.split())]) from None
    with client:
        yield client.get_executor(pure=False)


def _begin() -> None:
    """Begin a process: an interruption is for its parent, and it ends what it has begun."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)


# --- one flight: run unless its results are whole, whatever goes wrong


def is_whole(flight: Flight, results: Path, settings: Settings) -> bool:
    """Tell by digests whether results are as a run of this flight and software left them."""
    try:
        if not folder.is_whole(results):
            return False
        record, given = provenance.read_run(results).provenance, settings.calibration
        calibration = read_back.read_earlier(given, flight).origin if given else None
    except Acx4Error:  # a run reports or mends the error
        return False
    wanted: dict[str, object] = {"flight": record.digest, "versions": provenance.versions()}
    wanted |= {"calibration": calibration} if calibration else {}
    parts = [s for s in runner.parts_of(settings.stages) if not order.missing(flight, s)]
    executed = [results / provenance.EXECUTED / f"{NOTEBOOKS[p]}.ipynb" for p in ("flight", *parts)]
    return (
        dict(record.files) == provenance.checksums(flight)
        and all(record.stages.get(PART_OF.get(part, part)) == wanted for part in parts)
        and (settings.notebooks is None or all(path.is_file() for path in executed))
    )


def _run(job: Job) -> Outcome:
    """Run a flight, and return its outcome; no error of the flight is raised, others go on."""
    kept, given = False, job.settings
    try:
        if job.design:
            _simulate(job)
        if kept := is_whole(reader.read(job.flight), job.results, given):
            lines = list(runner.wrong(job.results, given.stages))
        else:
            ended = runner.run(
                job.flight,
                job.results,
                notebooks=given.notebooks,
                stages=given.stages,
                calibration=given.calibration or "",
            )
            lines = list(ended.not_determined)
        status = int(bool(lines))
    except Exception as error:  # each has its line
        lines, status = terminal.said_of(error, ["run", str(job.flight)])
    line = lines[0] + f" (and {len(lines) - 1} more)" * (len(lines) > 1) if lines else ""
    for place in (job.flight, job.results):
        line = line.replace(f"{place}/", "")
    row: dict[str, str] = {}
    with suppress(Acx4Error):  # results that cannot be read
        row = _row(job.results) if status < 2 else {}
    return Outcome(status=status, reason=visible(" ".join(line.split())), kept=kept, row=row)


def _simulate(job: Job) -> None:
    """Simulate the design or plan of a job, unless its flight exists; a copy of the plan tells."""
    from acx4book.notebooks import simulated  # noqa: PLC0415 most flights are not simulated
    from acx4sim.files import write  # noqa: PLC0415 as above

    plan = Path(job.design).read_text("utf-8-sig") if simulated.is_plan(job.design) else ""
    beside = f"{job.flight.name}.plan.toml"
    if not job.flight.exists():
        with whole_files.placed(job.flight) as draft:
            write(simulated.fly(job.design, seed=job.seed), draft)
            if plan:
                whole_files.write(draft.with_name(beside), plan)
    elif plan and job.flight.with_name(beside).read_text("utf-8-sig") != plan:
        says = f"was flown by another plan than {job.design} is now; choose another folder"
        raise OutputError(f"{job.flight}: {says} for the results, or remove this one")


def _row(results: Path) -> dict[str, str]:
    """Return what the results say of their flight, by `COLUMNS`, as text."""
    summary, row = folder.entries(results), dict[str, str]()
    entry = summary.get(f"mounting/{METHOD}", {})
    row |= {name: json.dumps(entry[name]) for name in _ADJUSTMENT if name in entry}
    table = pd.read_csv(results / "parameters.csv", dtype=str, keep_default_na=False)
    mine = table[(table["stage"] == "mounting") & (table["method"] == METHOD)]
    for camera, name, value, sigma in mine[["camera", "parameter", "value", "sigma"]].to_numpy():
        row |= {name: value, f"sigma_{name}": sigma, **({"camera": camera} if camera else {})}
    entry = summary.get(f"validation/{METHOD}") or summary.get("validation/given", {})
    if "n_points" in entry:
        row["n_check_points"] = json.dumps(entry["n_points"])
        for name, unit in _CHECKED.items():
            found = zip(AXES, entry["points"][name], strict=True)
            row |= {f"{name}_{at}{unit}": json.dumps(x) for at, x in found if x is not None}
    return row


# --- all of them


def run_all(
    jobs: Sequence[Job], folder: Path, pool: Executor, tell: Tell = lambda *_: None
) -> dict[str, Outcome]:
    """Run flights into a folder, and write their table at the end or after an interruption.

    `tell` gets a name with 0 and 1 while it waits, 1 and 1 when it is done, 0 and 0 when it failed.
    OutputError: the folder must not be used.
    """
    found: dict[str, Outcome] = {}
    for job in jobs:
        tell(job.name, 0, 1)
    with whole_files.claim(folder, signs=[TABLE]):
        whole_files.write(folder / TABLE, _table({}))  # by which the folder is known, if this ends
        try:
            for job, call in as_finished(pool, _run, jobs):
                found[job.name] = _outcome(call)
                tell(job.name, *((0, 0) if found[job.name].status else (1, 1)))
        finally:
            found = {job.name: found[job.name] for job in jobs if job.name in found}
            whole_files.write(folder / TABLE, _table(found))
    return found


def _outcome(call: Future[Outcome]) -> Outcome:
    try:
        return call.result()
    except Exception as error:  # a process was killed: `_run` raises none
        says = f"{type(error).__name__}: {error}; short of memory? Run the command again"
        return Outcome(status=1, reason=visible(" ".join(says.split())))


def _table(outcomes: Mapping[str, Outcome]) -> str:
    rows = [
        {"flight": name, "status": one.status, "reason": one.reason, **one.row}
        for name, one in outcomes.items()
    ]
    return pd.DataFrame(rows, columns=list(COLUMNS)).to_csv(index=False, lineterminator="\n")
