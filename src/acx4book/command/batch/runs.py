"""Many flights run into one folder, with the tables of all of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, Future
from pathlib import Path

from acx4book.command.batch import standing, work
from acx4book.command.batch.jobs import TABLE, TIMES, Job
from acx4book.command.batch.work import Outcome
from acx4lib.least_squares.processors import as_finished
from acx4lib.results import own_folder

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
            for job, call in as_finished(executor, work.run, jobs):
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
    except Exception as error:  # of the executor: `work.run` raises none
        return work.lost(error)


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
