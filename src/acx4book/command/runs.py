"""Runs of many flights (``acx4 run``): jobs, valid earlier results, and tables."""

from __future__ import annotations

import csv
import io
import json
import os
import re
import socket
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from pathlib import Path

from acx4book.notebooks import runner
from acx4lib import system
from acx4lib.errors import Acx4Error, FlightError, OutputError, unsolvable, visible
from acx4lib.flight import reader
from acx4lib.flight.reader import Flight
from acx4lib.flight.tables import name_fault
from acx4lib.geometry.parameters import AXES, REPORTED
from acx4lib.least_squares.processors import as_finished
from acx4lib.opening import text_of
from acx4lib.results import earlier, folder, own_folder, provenance, whole_files
from acx4lib.results.table_files import NOTEBOOKS, PART_OF
from acx4lib.stages import order

# --- what is to be run: flights, or seeds of simulated ones, each with a name and a folder


TABLE, TIMES = "flights.csv", "times.csv"
"""Files of a folder of many flights; every flight has a folder of its own beside them."""

SIMULATED = "simulated"
"""Folder of the simulated flights with their truth."""

RESERVED = (TABLE, TIMES, SIMULATED)


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Settings for the run of every flight.

    Attributes
    ----------
    stages : tuple of str
    notebooks : Path or None
        Folder of the notebooks to execute; None computes the numbers only.
    calibration : Path or None
        Results of an earlier flight with the calibration to be validated.
    """

    stages: tuple[str, ...]
    notebooks: Path | None = None
    calibration: Path | None = None


@dataclass(frozen=True, kw_only=True)
class Job:
    """A flight to be run.

    Attributes
    ----------
    name : str
        Of the flight among the others.
    flight, results : Path
        Absolute, since a worker may run in another folder.
    settings : Settings
    design : str
        The flight is simulated by the design of this name, or by the plan in this file, if it is
        not there; empty if it must be.
    seed : int
    """

    name: str
    flight: Path
    results: Path
    settings: Settings
    design: str = ""
    seed: int = 0


def of_flights(flights: Sequence[Path], folder: Path, settings: Settings) -> list[Job]:
    """Return a job for each flight, with its results in a folder below another.

    It has the name of the flight's folder. Equal names get parent folders as prefix, as many as
    tell them apart: ``north-flight`` and ``south-flight``.

    Raises
    ------
    ValueError
        A flight is given twice, or its folder has a name that cannot be used.
    """
    paths = [absolute(flight) for flight in flights]
    repeated = [path for path, times in Counter(paths).items() if times > 1]
    if repeated:
        msg = f"{repeated[0]}: is given twice"
        raise ValueError(msg)
    return [
        Job(name=name, flight=path, results=absolute(folder) / name, settings=settings)
        for name, path in zip(_told_apart(paths), paths, strict=True)
    ]


def of_seeds(
    designs: Sequence[str], seeds: Sequence[int], folder: Path, settings: Settings
) -> list[Job]:
    """Return a job for every seed of every design or plan, called ``single-head-1`` and so on.

    Raises
    ------
    ValueError
        The files of two plans have one name, or a name that cannot be used.
    """
    top = absolute(folder)
    jobs = [
        Job(
            name=(name := f"{Path(design).stem}-{seed}"),
            flight=top / SIMULATED / name,
            results=top / name,
            settings=settings,
            design=design,
            seed=seed,
        )
        for design in dict.fromkeys(designs)
        for seed in seeds
    ]
    counts = Counter(job.name for job in jobs)
    for job in jobs:
        if fault := _fault(job.name, counts, cure="rename the plan"):
            msg = f"{job.design}: {fault}"
            raise ValueError(msg)
    return jobs


def seeds_of(text: str) -> list[int]:
    """Return the seeds named in a text such as ``1-200`` or ``1,5,9-12``, in its order.

    Raises
    ------
    ValueError
        For any other text.
    """
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


def _told_apart(paths: Sequence[Path]) -> list[str]:
    """Return different names of paths, made of as few folders as possible."""
    names = [_name(path, 1) for path in paths]
    for n in range(2, 1 + max(len(path.parts) for path in paths)):
        alike = {name for name, times in Counter(names).items() if times > 1}
        names = [
            _name(path, n) if name in alike else name
            for name, path in zip(names, paths, strict=True)
        ]
    counts = Counter(names)
    for name, path in zip(names, paths, strict=True):
        if fault := _fault(name, counts):
            msg = f"{path}: {fault}"
            raise ValueError(msg)
    return names


def _name(path: Path, n: int) -> str:
    """Join the last n folders of a path to one name."""
    return "-".join(part for part in path.parts[-n:] if part != path.anchor)


def _fault(name: str, often: Counter[str], *, cure: str = "rename the flight's folder") -> str:
    """Return fault and cure of a name; empty for a good one."""
    if not name or name.startswith(".") or name in RESERVED:
        return f"a folder of results cannot be called {name!r}; {cure}"
    if often[name] > 1:
        return f"another flight would be called {name}, too; {cure}"
    fault = name_fault(name)
    return f"{fault[0]}; {cure}" if fault else ""


# --- validity of a run's results: which stages belong to the flight as it is now


def is_whole(flight: Flight, results: Path, settings: Settings) -> bool:
    """Tell whether existing results are complete and up to date.

    They are if all files are as a run wrote them, and if every stage with data was completed with
    this flight and this software, and with these notebooks if any are wanted. Pictures are not
    compared.

    Parameters
    ----------
    flight : Flight
        As it is now.
    results : Path
    settings : Settings
    """
    try:
        if own_folder.read_mark(results)[0] != provenance.COMMAND or own_folder.changes(results):
            return False
        record = provenance.read(results)
        calibration = (
            earlier.read(settings.calibration, flight).origin if settings.calibration else None
        )
    except Acx4Error:  # a run reports or mends the error
        return False
    run: dict[str, object] = {"flight": record.digest, "versions": provenance.versions()}
    run |= {"calibration": calibration} if calibration else {}
    parts = [s for s in runner.parts_of(settings.stages) if not order.missing(flight, s)]
    return (
        dict(record.files) == provenance.checksums(flight)
        and all(record.stages.get(PART_OF.get(part, part)) == run for part in parts)
        and ("rig" not in parts or "mounting/rig" in folder.entries(results))
        and all(_is_executed(settings.notebooks, results, part) for part in ("flight", *parts))
    )


def _is_executed(notebooks: Path | None, results: Path, part: str) -> bool:
    """Tell whether the results have a part's executed notebook with its present cells."""
    if notebooks is None:
        return True
    name = f"{NOTEBOOKS[part]}.ipynb"
    executed = results / provenance.EXECUTED / name
    return executed.is_file() and _cells(executed) == _cells(notebooks / name)


def _cells(notebook: Path) -> list[str]:
    """Return the texts of all cells except parameters."""
    of_parameters = {"parameters", "injected-parameters"}
    return [
        "".join(cell["source"])
        for cell in json.loads(text_of(notebook))["cells"]
        if not of_parameters & set(cell["metadata"].get("tags", []))
    ]


# --- The table of many flights: a row for each, as text, so that equal results give equal bytes
#
# Values that differ from call to call, such as times, are in a table of their own.


METHOD = "single_step"
"""The method with parameters and check points in the table."""

VALIDATED = (f"validation/{METHOD}", "validation/given")
"""Entries with the check points, the first existing one counts; the second is for a flight without
calibration."""

_PARAMETERS = tuple(name for name, _ in REPORTED.values())
_ADJUSTMENT = ("sigma0_squared", "redundancy", "n_rejected")
_CHECKED = {"mean": "_m", "rms": "_m", "normalised_rms": ""}

COLUMNS = (
    *("flight", "status", "reason", "camera"),
    *_ADJUSTMENT,
    *(column for name in _PARAMETERS for column in (name, f"sigma_{name}")),
    "n_check_points",
    *(f"{what}_{axis}{unit}" for what, unit in _CHECKED.items() for axis in AXES),
)
"""Columns of the table of all flights."""

TIME_COLUMNS = ("flight", "seconds", "cpu_s", "peak_mb", "worker")
"""Columns of the other table: time and processor time of a run, s; peak memory of its process so
far, MB; host and number of this process."""

Row = Mapping[str, str]


def _parameters(path: Path) -> Iterator[tuple[str, str]]:
    """Yield camera, values and sigmas of the method, with the digits of the file."""
    for line in csv.DictReader(io.StringIO(text_of(path), newline="")):
        if (line["stage"], line["method"]) != ("mounting", METHOD):
            continue
        if line["camera"]:
            yield "camera", line["camera"]
        yield line["parameter"], line["value"]
        yield f"sigma_{line['parameter']}", line["sigma"]


def _checked(entry: Mapping[str, object]) -> Iterator[tuple[str, str]]:
    """Yield number of check points, and means and RMS of their differences."""
    if "n_points" in entry:
        yield "n_check_points", _text(entry["n_points"])
    points = entry.get("points")
    for statistic, unit in _CHECKED.items() if isinstance(points, dict) else ():
        for axis, value in zip(AXES, points.get(statistic) or (), strict=False):  # type: ignore[attr-defined]
            yield f"{statistic}_{axis}{unit}", _text(value)


def _text(value: object) -> str:
    return "" if value is None else json.dumps(value)


# --- one flight of many: run unless it is done, whatever goes wrong


COMMAND_OF_SIMULATED = "acx4 simulate"
"""Command in the mark of a simulated flight."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The outcome for a flight.

    Attributes
    ----------
    status : int
        Exit status of `acx4 run` for this flight alone: 0, 1 or 2.
    reason : str
        Reason for a status other than 0, in one line.
    kept : bool
        Whether existing results were kept.
    row, times : mapping of str to str
        Of the tables of all flights, by the names of `COLUMNS` and
        `TIME_COLUMNS`.
    """

    status: int = 0
    reason: str = ""
    kept: bool = False
    row: Mapping[str, str] = field(default_factory=dict)
    times: Mapping[str, str] = field(default_factory=dict)


def _kept_or_run(job: Job) -> tuple[bool, Sequence[str]]:
    """Keep valid results or run the flight; return whether kept, and messages of failure."""
    if job.design:
        _simulate(job)
    flight = reader.read(job.flight)
    if is_whole(flight, job.results, job.settings):
        return True, list(runner.wrong(job.results, job.settings.stages))
    outcome = runner.run(
        job.flight,
        job.results,
        notebooks=job.settings.notebooks,
        stages=job.settings.stages,
        calibration=job.settings.calibration or "",
    )
    return False, outcome.not_determined


def _simulate(job: Job) -> None:
    """Simulate the design or plan of a job, unless its flight exists.

    A copy of the plan beside the flight tells whether the flight was simulated by this plan.
    """
    from acx4book.notebooks import simulated  # noqa: PLC0415 most flights are not simulated
    from acx4sim.files import write  # noqa: PLC0415 as above

    plan = text_of(Path(job.design)) if simulated.is_plan(job.design) else ""
    if not job.flight.exists():
        with own_folder.placed(job.flight, command=COMMAND_OF_SIMULATED) as draft:
            write(simulated.fly(job.design, seed=job.seed), draft)
            if plan:
                whole_files.write(_plan_beside(draft), plan)
    elif plan and not (
        _plan_beside(job.flight).exists() and text_of(_plan_beside(job.flight)) == plan
    ):
        msg = (
            f"{job.flight}: was flown by another plan than {job.design} is now; choose another "
            "folder for the results, or remove this one"
        )
        raise OutputError(msg)


def _plan_beside(flight: Path) -> Path:
    """Return the path of the plan beside a simulated flight."""
    return flight.with_name(f"{flight.name}.plan.toml")


def _row(job: Job) -> dict[str, str]:
    """Return the table row of the flight's valid results; empty if unreadable."""
    try:
        return _row_of(job.results, _stages_of(job.results))
    except Acx4Error:
        return {}


def _stages_of(results: Path) -> list[str]:
    """Return the stages that were run with the flight now kept in the results."""
    if not (results / provenance.FILE).is_file():
        return []
    record = provenance.read(results)
    return [name for name, run in record.stages.items() if run["flight"] == record.digest]


def _row_of(results: Path, stages: Sequence[str]) -> dict[str, str]:
    """Return the results of given stages, by the names of `COLUMNS`."""
    row: dict[str, str] = {}
    summary = folder.entries(results)
    if "mounting" in stages:
        entry = summary.get(f"mounting/{METHOD}", {})
        row |= {name: _text(entry[name]) for name in _ADJUSTMENT if name in entry}
        row |= _parameters(results / "parameters.csv")
    if "validation" in stages:
        row |= _checked(next((summary[name] for name in VALIDATED if name in summary), {}))
    return row


# --- what went wrong -------------------------------------------------------------------------


def _said(error: Exception) -> tuple[int, list[str]]:
    """Return exit status and message lines of an error."""
    if isinstance(error, Acx4Error):
        lines = [*getattr(error, "__notes__", ()), *str(error).splitlines()]
        return (2 if isinstance(error, FlightError | OutputError) else 1), lines
    if isinstance(error, OSError):
        named = f"{error.filename}: " if error.filename is not None else ""
        return 2, [f"{named}{error.strerror or error}"]
    if type(error).__name__ == "LinAlgError":
        return 1, [str(unsolvable(str(error)))]
    return 1, [f"this is a mistake in acx4: {type(error).__name__}: {error}"]


def _reason(job: Job, lines: Sequence[str]) -> str:
    """Return the first of several lines, with paths relative to the flight or the results."""
    if not lines:
        return ""
    more = f" (and {len(lines) - 1} more)" if len(lines) > 1 else ""
    line = f"{lines[0]}{more}"
    for place in (job.flight, job.results):
        line = line.replace(f"{place}/", "")
    return visible(" ".join(line.split()))


# --- what it took ----------------------------------------------------------------------------


def _clocks() -> tuple[float, float]:
    return time.perf_counter(), sum(os.times()[:4])


def _times(start: tuple[float, float]) -> dict[str, str]:
    seconds, cpu = (now - before for now, before in zip(_clocks(), start, strict=True))
    return {
        "seconds": f"{seconds:.3f}",
        "cpu_s": f"{cpu:.3f}",
        "peak_mb": f"{system.peak_memory() / 2**20:.0f}",
        "worker": f"{socket.gethostname()}/{os.getpid()}",
    }


# --- Many flights run into one folder, with the tables of all of them


COMMAND = "acx4 run of many flights"
"""The command named in the mark of the folder."""

Tell = Callable[[str, int, int], None]
"""Function of a flight's name and two numbers: 0 and 1 while it waits, 1 and 1 when it is done, 0
and 0 when it failed."""


def run_all(
    jobs: Sequence[Job], folder: Path, executor: Executor, tell: Tell = lambda *_: None
) -> dict[str, Outcome]:
    """Run flights, and write the tables of all of them at the end or after an interruption.

    No error of a flight is raised. Flights are not simulated or run again unless the flight, the
    software or the settings have changed.

    Equal flights, software and settings give equal bytes in every folder of results and in the
    table `TABLE`, whatever the executor. Only `TIMES` differs.

    Parameters
    ----------
    jobs : sequence of Job
        With their results below `folder`.
    folder : Path
        New, empty, or that of an earlier call.
    executor : Executor
    tell : callable

    Returns
    -------
    dict of str to Outcome
        By the names of the jobs, in their order.

    Raises
    ------
    OutputError
        The folder must not be used, or another process is writing there.
    """
    away_from = [job.flight for job in jobs if not job.design]
    outcomes: dict[str, Outcome] = {}
    for job in jobs:
        tell(job.name, 0, 1)
    with own_folder.claim(folder, command=COMMAND, away_from=away_from) as claimed:
        claimed.expect([TABLE, TIMES])
        try:
            for job, call in as_finished(executor, _run, jobs):
                outcome = outcomes[job.name] = _outcome(call)
                tell(job.name, *((0, 0) if outcome.status else (1, 1)))
        finally:
            outcomes = {job.name: outcomes[job.name] for job in jobs if job.name in outcomes}
            _write_tables(folder, outcomes)
            claimed.seal()
    return outcomes


def _run(job: Job) -> Outcome:
    """Run a flight, and return its outcome; no error of the flight is raised."""
    start = _clocks()
    try:
        kept, wrong = _kept_or_run(job)
    except Exception as error:  # other flights go on
        status, lines = _said(error)
        row = _row(job) if status == 1 else {}
    else:
        status, lines, row = int(bool(wrong)), list(wrong), _row(job)
        if kept:
            return Outcome(status=status, reason=_reason(job, lines), kept=True, row=row)
    return Outcome(status=status, reason=_reason(job, lines), row=row, times=_times(start))


def _outcome(call: Future[Outcome]) -> Outcome:
    try:
        return call.result()
    except Exception as error:  # an error of the executor: `_run` raises none
        return _lost(error)


def _lost(error: BaseException) -> Outcome:
    """Return the outcome of a flight after the death of its worker."""
    if isinstance(error, FileNotFoundError):
        return Outcome(status=2, reason=visible(error.strerror or str(error)))
    message = " ".join(str(error).split()) or type(error).__name__
    return Outcome(status=1, reason=visible(f"{message}; short of memory? use fewer workers"))


def _write_tables(folder: Path, outcomes: Mapping[str, Outcome]) -> None:
    before = _rows_by_flight(folder / TIMES)
    statuses = {
        name: {"flight": name, "status": str(outcome.status), "reason": outcome.reason}
        for name, outcome in outcomes.items()
    }
    times = {name: before.get(name, {}) if o.kept else o.times for name, o in outcomes.items()}
    _write_rows(
        folder / TABLE,
        COLUMNS,
        [{**outcome.row, **statuses[name]} for name, outcome in outcomes.items()],
    )
    _write_rows(folder / TIMES, TIME_COLUMNS, [{**t, "flight": n} for n, t in times.items()])


def _rows_by_flight(path: Path) -> dict[str, dict[str, str]]:
    """Return the rows of a table by flight; empty without a file."""
    if not path.exists():
        return {}
    lines = io.StringIO(text_of(path), newline="")
    return {row["flight"]: row for row in csv.DictReader(lines) if row.get("flight")}


def _write_rows(path: Path, columns: Sequence[str], rows: Iterable[Row]) -> None:
    """Replace a table by another, whole or not at all; missing values are empty."""
    table = io.StringIO(newline="")
    writer = csv.DictWriter(table, columns, extrasaction="ignore", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    whole_files.write(path, table.getvalue())
