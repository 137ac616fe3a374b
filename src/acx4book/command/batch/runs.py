"""One flight of many: run unless it is done, whatever goes wrong."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass, field
from pathlib import Path

from acx4book.command.batch import standing
from acx4book.command.batch.jobs import TABLE, TIMES, Job
from acx4book.notebooks import runner
from acx4book.notebooks.ways import way_of
from acx4lib import system
from acx4lib.errors import Acx4Error, FlightError, OutputError, unsolvable, visible
from acx4lib.flight import reader
from acx4lib.least_squares.processors import as_finished
from acx4lib.opening import text_of
from acx4lib.results import own_folder, whole_files

COMMAND_OF_SIMULATED = "acx4 simulate"
"""In the mark of a simulated flight."""


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The outcome for a flight.

    Attributes
    ----------
    status : int
        As `acx4 run` would end for this flight alone: 0, 1 or 2.
    reason : str
        Why it is not 0, in one line.
    kept : bool
        Whether the results were there already.
    row, times : mapping of str to str
        Of the tables of all flights, by the names of `standing.COLUMNS` and
        `standing.TIME_COLUMNS`.
    """

    status: int = 0
    reason: str = ""
    kept: bool = False
    row: Mapping[str, str] = field(default_factory=dict)
    times: Mapping[str, str] = field(default_factory=dict)


def run(job: Job) -> Outcome:
    """Run a flight, and return what came of it; no error of the flight is raised.

    What was simulated before is not simulated again, and what was run before not run again,
    unless the flight, the software or the settings have changed since.

    Parameters
    ----------
    job : Job
    """
    start = _clocks()
    try:
        kept, wrong = _run(job)
    except Exception as error:  # the others go on
        status, lines = _said(error)
        row = _row(job) if status == 1 else {}
    else:
        status, lines, row = int(bool(wrong)), list(wrong), _row(job)
        if kept:
            return Outcome(status=status, reason=_reason(job, lines), kept=True, row=row)
    return Outcome(status=status, reason=_reason(job, lines), row=row, times=_times(start))


def lost(error: BaseException) -> Outcome:
    """Return the outcome for a flight whose worker did not live to tell.

    Parameters
    ----------
    error : BaseException
        What the executor says of it.
    """
    if isinstance(error, FileNotFoundError):
        return Outcome(status=2, reason=visible(error.strerror or str(error)))
    said = " ".join(str(error).split()) or type(error).__name__
    return Outcome(status=1, reason=visible(f"{said}; short of memory? use fewer workers"))


def _run(job: Job) -> tuple[bool, Sequence[str]]:
    """Return whether the results were there, and what is wrong with them."""
    if job.design:
        _simulate(job)
    flight = reader.read(job.flight)
    if standing.is_whole(flight, job.results, job.settings):
        return True, list(runner.wrong(job.results, job.settings.stages))
    way = way_of(job.settings.notebooks)
    outcome = runner.run(
        job.flight,
        job.results,
        way=way,
        stages=job.settings.stages,
        calibration=job.settings.calibration or "",
    )
    return False, outcome.not_determined


def _simulate(job: Job) -> None:
    """Fly the design or the plan of a job, if this was not done before.

    A copy of the plan stands beside the flight: one of another plan is not taken for it.
    """
    from acx4book.notebooks import simulated  # noqa: PLC0415 most flights are not simulated
    from acx4sim.files import write  # noqa: PLC0415 as above

    plan = text_of(Path(job.design)) if simulated.is_plan(job.design) else ""
    if not job.flight.exists():
        with own_folder.placed(job.flight, command=COMMAND_OF_SIMULATED) as draft:
            write(simulated.fly(job.design, seed=job.seed), draft)
            if plan:
                whole_files.write(plan_beside(draft), plan)
    elif plan and not (
        plan_beside(job.flight).exists() and text_of(plan_beside(job.flight)) == plan
    ):
        msg = (
            f"{job.flight}: was flown by another plan than {job.design} is now; choose another "
            "folder for the results, or remove this one"
        )
        raise OutputError(msg)


def plan_beside(flight: Path) -> Path:
    """Return the path of the plan by which a flight was simulated: beside its folder."""
    return flight.with_name(f"{flight.name}.plan.toml")


def _row(job: Job) -> dict[str, str]:
    """Return what the results say of the flight as it is."""
    try:
        return standing.row_of(job.results, standing.stages_of(job.results))
    except Acx4Error:
        return {}


# --- what went wrong -------------------------------------------------------------------------


def _said(error: Exception) -> tuple[int, list[str]]:
    """Return the status of an error, and what it says, in lines."""
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
    """Return lines as one, with files named from the flight's and the results' own folder."""
    if not lines:
        return ""
    more = f" (and {len(lines) - 1} more)" if len(lines) > 1 else ""
    said = f"{lines[0]}{more}"
    for folder in (job.flight, job.results):
        said = said.replace(f"{folder}/", "")
    return visible(" ".join(said.split()))


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
"""The command that is named in the mark of the folder."""

Tell = Callable[[str, int, int], None]
"""It is called with a flight, and with 0 and 1 when it is waiting, 1 and 1 when it is done, 0 and 0
when it failed."""


def run_all(
    jobs: Sequence[Job], folder: Path, executor: Executor, tell: Tell = lambda *_: None
) -> dict[str, Outcome]:
    """Run flights, and write the tables of all of them when they are finished, or interrupted.

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
    with own_folder.claim(folder, command=COMMAND, away_from=away_from) as own:
        own.expect([TABLE, TIMES])
        try:
            for job, call in as_finished(executor, run, jobs):
                outcome = outcomes[job.name] = _outcome(call)
                tell(job.name, *((0, 0) if outcome.status else (1, 1)))
        finally:
            outcomes = {job.name: outcomes[job.name] for job in jobs if job.name in outcomes}
            _write(folder, outcomes)
            own.seal()
    return outcomes


def _outcome(call: Future[Outcome]) -> Outcome:
    try:
        return call.result()
    except Exception as error:  # of the executor: `run` raises none
        return lost(error)


def _write(folder: Path, outcomes: Mapping[str, Outcome]) -> None:
    before = standing.read(folder / TIMES)
    said = {
        name: {"flight": name, "status": str(one.status), "reason": one.reason}
        for name, one in outcomes.items()
    }
    times = {name: before.get(name, {}) if o.kept else o.times for name, o in outcomes.items()}
    standing.write(
        folder / TABLE,
        standing.COLUMNS,
        [{**one.row, **said[name]} for name, one in outcomes.items()],
    )
    standing.write(
        folder / TIMES, standing.TIME_COLUMNS, [{**t, "flight": n} for n, t in times.items()]
    )
