"""Runs of the parametrised notebooks, stage after stage; their results are kept.

A notebook reads only the copy of the flight's tables in the results, and the pictures. It runs
in a copy of the results folder, beside it; only a notebook without errors changes the folder.
Executed notebooks have no date and no place, so two runs of one flight give equal bytes.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from acx4book.notebooks import execute
from acx4lib.errors import Acx4Error, AdjustmentError, FlightError
from acx4lib.flight import reader as flights
from acx4lib.results import folder as results
from acx4lib.results import provenance
from acx4lib.results.own_folder import claims, places
from acx4lib.results.own_folder.claims import OwnFolder
from acx4lib.results.own_folder.marks import SCRATCH, changes
from acx4lib.stages import order

NOTEBOOKS_PATH = Path(str(resources.files("acx4book.notebooks") / "sources")).resolve()
"""Folder of the notebooks."""

NOTEBOOKS: Mapping[str, str] = {
    "flight": "00-flight",
    "heads": "01-head-calibration",
    "synthetic": "02-synthetic-image",
    "mounting": "03-mounting-calibration",
    "rig": "08-rig",
    "validation": "04-validation",
}
"""The notebook of every stage. ``flight`` only shows the data, and always runs first. ``rig`` is
the part of the stage mounting that uses the block heads."""

COMMAND = "acx4 run"
"""The command that is named in the mark of a results folder."""

FAILED = "failed"
"""Folder of the executed notebooks that failed."""

GIVEN = {"flight_path", "pictures_path", "results_path"}
"""Parameters of the notebooks that a run sets itself."""

Tell = Callable[[str, int, int], None]
"""It is called with the stage, the number of finished cells, and the number of cells."""


@dataclass(frozen=True, kw_only=True)
class RunOutcome:
    """The outcome of a run; sentences have one line.

    Attributes
    ----------
    ran : tuple of str
        Names of the stages that were run.
    skipped : tuple of str
        Stages whose block the flight does not have.
    not_determined : tuple of str
        Sentences on groups of observations that contradict the others, in `order.CONSISTENT`
        methods, on parameters of `order.DECISIVE` methods that the data do not determine, and on
        the error that stopped a stage that is an end.
    notes : tuple of str
        Other remarks of the stages on the data.
    left_out : tuple of str
        Methods that were left out, with the reasons.
    """

    ran: tuple[str, ...]
    skipped: tuple[str, ...]
    not_determined: tuple[str, ...]
    left_out: tuple[str, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class _Job:
    """A stage to run: its notebook with the values of all its parameters."""

    stage: str
    notebook: Path
    values: dict[str, Any]


def run(
    flight_path: str | Path,
    results_path: str | Path,
    *,
    stages: Sequence[str] = results.STAGES,
    parameters: Mapping[str, Any] | None = None,
    notebooks_path: Path = NOTEBOOKS_PATH,
    tell: Tell | None = None,
) -> RunOutcome:
    """Run the notebooks of a flight.

    A stage whose block is not in the flight is skipped, and its old results are removed.

    Parameters
    ----------
    flight_path, results_path : path
        The flight, and the folder for the results: new, empty, or that of an earlier run.
    stages : sequence of str
        Stages to run, of `folder.STAGES`; the others keep their results.
    parameters : mapping, optional
        Values of further parameters of the notebooks, such as ``seed``; each notebook gets
        those that it has.
    notebooks_path : Path
    tell : callable, optional
        It is told the progress.

    Raises
    ------
    FlightError
        The flight's files are wrong; results of an earlier stage are missing; or only some
        stages are to run and files of the results were changed after the earlier run.
    OutputError
        The folder must not be used for results, or another run is writing there.
    AdjustmentError
        A stage does not converge, or is not determined.
    NotebookError
        A notebook failed for another reason. Like the two errors before it, it has the sentences
        `RunOutcome.not_determined` of earlier stages as notes.
    ValueError
        Unknown stage, or a parameter that no notebook has or that is of another type.
    """
    chosen = _chosen(stages)
    folder, tell = Path(results_path), tell or (lambda *_: None)
    places.check_place(folder, away_from=[Path(flight_path)])
    flight = flights.read(flight_path)
    skipped = {stage: reason for stage in chosen if (reason := order.missing(flight, stage))}
    ran = ["flight", *(stage for stage in chosen if stage not in skipped)]
    given = {
        **(parameters or {}),
        "flight_path": str(folder / provenance.KEPT),
        "pictures_path": str(flight_path),
    }
    jobs = [_job(stage, notebooks_path, given) for stage in ran]
    _check_known(parameters or {}, jobs)
    with claims.claim(folder, command=COMMAND, away_from=[flight.path]) as own:
        _prepare(own, flight, skipped, whole=set(stages) >= set(results.STAGES))
        done, failed = _run_jobs(jobs, flight, own, tell)
    return RunOutcome(
        ran=tuple(ran[1:]),
        skipped=tuple(f"{s}: skipped, {why}" for s, why in skipped.items() if why != order.NO_RIG),
        not_determined=(*_wrong(folder, done), *failed),
        left_out=tuple(_messages(folder, done, "left_out", done)),
        notes=tuple(
            line
            for key in ("not_confirmed", "notes")
            for line in _messages(folder, done, key, done)
        ),
    )


def _run_jobs(
    jobs: Sequence[_Job], flight: flights.Flight, own: OwnFolder, tell: Tell
) -> tuple[list[str], list[str]]:
    """Run the stages; return those that ran, and the errors that stopped one that is an end."""
    done: list[str] = []
    failed: list[str] = []
    try:
        for job in jobs:
            try:
                _run_job(job, own, tell)
                done.append(order.PART_OF.get(job.stage, job.stage))
            except AdjustmentError as error:
                if not order.is_end(flight, job.stage):
                    raise
                failed += str(error).splitlines()
    except Acx4Error as error:
        for line in _wrong(own.path, done):
            error.add_note(line)
        raise
    return done, failed


def _prepare(
    own: OwnFolder, flight: flights.Flight, skipped: Mapping[str, str], *, whole: bool
) -> None:
    """Prepare a folder for a run: keep the flight, remove results of blocks that it lacks.

    Changed files end the run, unless all results will be replaced.
    """
    notebook_files = [f"{name}.ipynb" for name in NOTEBOOKS.values()]
    tables = flights.table_files(flight)
    own.expect(
        [
            *(*results.FILES, provenance.FILE),
            *(f"{provenance.KEPT}/{name.as_posix()}" for name in tables),
            *(f"{folder}/{name}" for folder in ("notebooks", FAILED) for name in notebook_files),
        ]
    )
    read = (*results.FILES, provenance.FILE)
    changed = changes(own.path, read)
    if changed and not whole:
        raise FlightError([f"{line}; run all stages again" for line in changed])
    if changed:
        own.remove(read)
    provenance.keep(own, flight)
    removed = [f"{order.PART_OF[s]}/{s}" if s in order.PART_OF else s for s in skipped]
    results.replace(own.path, removed, tables={}, summary={})
    provenance.forget(own.path, list(skipped))
    own.remove(f"notebooks/{NOTEBOOKS[stage]}.ipynb" for stage in skipped)
    own.seal()


def _chosen(stages: Sequence[str]) -> tuple[str, ...]:
    """Return the names of the notebooks to run, in their order."""
    unknown = [stage for stage in stages if stage not in results.STAGES]
    if unknown:
        known = ", ".join(results.STAGES)
        msg = f"unknown stage {', '.join(map(repr, unknown))}; known: {known}"
        raise ValueError(msg)
    return tuple(name for name in NOTEBOOKS if order.PART_OF.get(name, name) in stages)


def _wrong(folder: Path, stages: Sequence[str]) -> Iterator[str]:
    """Yield the sentences for which a run ends with status 1."""
    yield from _messages(folder, stages, "stopped", order.CONSISTENT)
    yield from _messages(folder, stages, "not_determined", order.DECISIVE)


def _messages(
    folder: Path, stages: Sequence[str], key: str, methods: Sequence[str]
) -> Iterator[str]:
    """Yield the sentences of some methods of the given stages in the summary."""
    for name, entry in results.read(folder).summary.items():
        mine = any(f"{name}/".startswith(f"{method}/") for method in methods)
        if mine and name.partition("/")[0] in stages:
            yield from results.messages(entry, key)


def _job(stage: str, notebooks_path: Path, given: Mapping[str, Any]) -> _Job:
    """Return the job of a stage."""
    notebook = notebooks_path / f"{NOTEBOOKS[stage]}.ipynb"
    if not notebook.is_file():
        msg = f"{notebook}: no such notebook"
        raise FileNotFoundError(msg)
    return _Job(stage=stage, notebook=notebook, values=execute.with_defaults(notebook, given))


def _check_known(given: Mapping[str, Any], jobs: Sequence[_Job]) -> None:
    known = {name for job in jobs for name in job.values} - GIVEN
    if given.keys() - known:
        unknown = ", ".join(sorted(given.keys() - known))
        msg = f"no notebook has a parameter {unknown}; known: {', '.join(sorted(known))}"
        raise ValueError(msg)


def _run_job(job: _Job, own: OwnFolder, tell: Tell) -> None:
    """Run a notebook in a copy of the results, and keep its results if it succeeds."""
    folder, name = own.path, job.notebook.name
    with tempfile.TemporaryDirectory(dir=folder, prefix=SCRATCH) as temporary:
        staging = folder / Path(temporary).name
        for file in results.FILES:
            shutil.copyfile(folder / file, staging / file)
        executed = staging / "notebooks" / name
        try:
            execute.execute(
                job.notebook,
                executed,
                parameters={**job.values, "results_path": str(staging)},
                on_cell=lambda done, total: tell(job.stage, done, total),
            )
        except Acx4Error as error:
            execute.scrub(executed, hidden=staging.name)
            _move({executed: folder / FAILED / name})
            own.seal()
            if isinstance(error, FlightError):  # its paths are those of the copy
                own_names = [line.replace(f"/{staging.name}", "") for line in error.problems]
                raise FlightError(own_names) from None
            raise
        execute.scrub(executed, hidden=staging.name)
        written = {staging / file: folder / file for file in results.FILES}
        _move({**written, executed: folder / "notebooks" / name})
    stage = order.PART_OF.get(job.stage, job.stage)
    if stage in results.STAGES:
        provenance.stamp(folder, stage)
    own.remove([f"{FAILED}/{name}"])
    own.seal()


def _move(targets: Mapping[Path, Path]) -> None:
    for path, target in targets.items():
        target.parent.mkdir(parents=True, exist_ok=True)
        path.replace(target)
