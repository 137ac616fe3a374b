"""Runs the parametrised notebooks, stage after stage, and keeps what they leave.

A notebook runs beside the results folder, in a copy of it; only one that has run to its end
changes the folder. The executed notebooks say nothing of when and where they ran, so that two
runs of one flight are equal byte for byte.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from acx4lib import flight as flights
from acx4lib import notebooks, provenance, results
from acx4lib.errors import Acx4Error, AdjustmentError

NOTEBOOKS_PATH = Path(__file__).parents[2] / "notebooks"
"""Where the notebooks lie: beside ``src`` in a clone."""

NOTEBOOKS: Mapping[str, str] = {
    "flight": "00-flight",
    "heads": "01-head-calibration",
    "synthetic": "02-synthetic-image",
    "mounting": "03-mounting-calibration",
    "rig": "08-rig",
    "validation": "04-validation",
}
"""The notebook of every stage; ``flight`` only shows the data, and always runs first. ``rig`` is
the part of stage mounting that works on the block heads."""

STAGE_OF: Mapping[str, str] = {"rig": "mounting"}
"""The stage that a notebook belongs to, where it is not called by it."""

ENDS = ("synthetic",)
"""Stages whose results no later one needs: where one is not determined, the run goes on."""

DECISIVE = ("heads/bundle", "mounting/single_step")
"""Methods that must be determined; the others are left out where they are not."""

NO_RIG = "there are no heads"
"""Why a flight has no rig that nobody expects: the stage heads says so already."""

Tell = Callable[[str, int, int], None]
"""Called with the stage, the cells that are done, and the number of cells."""


@dataclass(frozen=True, kw_only=True)
class RunReport:
    """What a run did, as sentences of one line where there is something to say.

    Attributes
    ----------
    ran : tuple of str
        Names of the stages.
    skipped : tuple of str
        Stages whose block the flight does not have.
    not_determined : tuple of str
        Parameters of `DECISIVE` methods that the data do not determine, and what stopped a stage
        of `ENDS`.
    notes : tuple of str
        What else the stages have to say of the data.
    left_out : tuple of str
        Methods that were left out, and why.
    """

    ran: tuple[str, ...]
    skipped: tuple[str, ...]
    not_determined: tuple[str, ...]
    left_out: tuple[str, ...]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class _Job:
    """A stage that is to run: its notebook with the values of all its parameters."""

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
) -> RunReport:
    """Run the notebooks of a flight.

    A stage whose block is not in the flight is skipped, and its old results are removed.

    Parameters
    ----------
    flight_path, results_path : path
        The flight, and the folder for the results, made where it is not there.
    stages : sequence of str
        Those of `results.STAGES` that are to run; the others keep their results.
    parameters : mapping, optional
        Values of further parameters of the notebooks, such as ``seed``; each notebook takes
        those that it has.
    notebooks_path : Path
    tell : callable, optional
        Progress.

    Raises
    ------
    FlightError
        The flight's files are wrong, or results of an earlier stage are missing.
    AdjustmentError
        A stage does not converge, or is not determined.
    NotebookError
        A notebook failed for another reason. Like the two above, it carries the sentences
        `RunReport.not_determined` of the stages before it as notes.
    ValueError
        Unknown stage, or a parameter that no notebook has or that is of another type.
    """
    flight = flights.read(flight_path)
    chosen = _chosen(stages)
    skipped = {stage: reason for stage in chosen if (reason := _missing(flight, stage))}
    ran = ["flight", *(stage for stage in chosen if stage not in skipped)]
    given = {**(parameters or {}), "flight_path": str(flight_path)}
    jobs = [_job(stage, notebooks_path, given) for stage in ran]
    _check_known(parameters or {}, jobs)
    folder = Path(results_path)
    _tidy(folder)
    removed = [f"{STAGE_OF[s]}/{s}" if s in STAGE_OF else s for s in skipped]
    results.replace(folder, removed, tables={}, summary={})
    provenance.keep(folder, flight.path, flights.table_files(flight))
    provenance.forget(folder, list(skipped))
    for stage in skipped:
        (folder / "notebooks" / f"{NOTEBOOKS[stage]}.ipynb").unlink(missing_ok=True)
    done: list[str] = []
    failed: list[str] = []
    try:
        for job in jobs:
            try:
                _run_job(job, folder, tell or (lambda *_: None))
                stage = STAGE_OF.get(job.stage, job.stage)
                if stage in results.STAGES:
                    provenance.stamp(folder, stage)
                done.append(stage)
            except AdjustmentError as error:
                if job.stage not in ENDS:
                    raise
                failed += str(error).splitlines()
    except Acx4Error as error:
        for line in _messages(folder, done, "not_determined", DECISIVE):
            error.add_note(line)
        raise
    return RunReport(
        ran=tuple(ran[1:]),
        skipped=tuple(f"{s}: skipped, {why}" for s, why in skipped.items() if why != NO_RIG),
        not_determined=(*_messages(folder, done, "not_determined", DECISIVE), *failed),
        left_out=tuple(_messages(folder, done, "left_out", done)),
        notes=tuple(_messages(folder, done, "notes", done)),
    )


def _chosen(stages: Sequence[str]) -> tuple[str, ...]:
    """Return the stages in their order."""
    unknown = [stage for stage in stages if stage not in results.STAGES]
    if unknown:
        known = ", ".join(results.STAGES)
        msg = f"unknown stage {', '.join(map(repr, unknown))}; known: {known}"
        raise ValueError(msg)
    return tuple(name for name in NOTEBOOKS if STAGE_OF.get(name, name) in stages)


def _missing(flight: flights.Flight, stage: str) -> str:
    """Return why a stage cannot run; empty where it can."""
    block = {"mounting": "calibration", "validation": "validation"}.get(stage, "heads")
    if block not in flight.blocks:
        return NO_RIG if stage == "rig" else f"the flight has no block {block}"
    if stage == "rig" and len(flight.blocks[block].cameras) < 2:
        return f"block {block} has one camera only"
    if stage == "synthetic" and flight.synthetic is None:
        return "flight.toml has no table [synthetic]"
    checked = flight.blocks[block].check.point_idx
    if stage == "validation" and not (flight.blocks[block].rays[checked] >= 2).any():
        return "no check point of block validation is measured in two images"
    return ""


def _messages(
    folder: Path, stages: Sequence[str], key: str, methods: Sequence[str]
) -> Iterator[str]:
    """Yield the sentences that methods of the given stages left in the summary."""
    for name, entry in results.read(folder).summary.items():
        mine = any(f"{name}/".startswith(f"{method}/") for method in methods)
        if mine and name.partition("/")[0] in stages:
            yield from results.messages(entry, key)


def _job(stage: str, notebooks_path: Path, given: Mapping[str, Any]) -> _Job:
    """Return the job of a stage."""
    notebook = notebooks_path / f"{NOTEBOOKS[stage]}.ipynb"
    if not notebook.is_file():
        msg = f"{notebook}: no such notebook; run from a clone of the project"
        raise FileNotFoundError(msg)
    return _Job(stage=stage, notebook=notebook, values=notebooks.with_defaults(notebook, given))


def _check_known(given: Mapping[str, Any], jobs: Sequence[_Job]) -> None:
    known = {name for job in jobs for name in job.values} - {"flight_path", "results_path"}
    if given.keys() - known:
        unknown = ", ".join(sorted(given.keys() - known))
        msg = f"no notebook has a parameter {unknown}; known: {', '.join(sorted(known))}"
        raise ValueError(msg)


def _run_job(job: _Job, folder: Path, tell: Tell) -> None:
    """Run a notebook in a copy of the results, and keep what it left where it succeeds."""
    failed = folder / "failed" / job.notebook.name
    with tempfile.TemporaryDirectory(dir=folder, prefix=".running-") as temporary:
        staging = folder / Path(temporary).name
        for name in results.FILES:
            shutil.copyfile(folder / name, staging / name)
        executed = staging / "notebooks" / job.notebook.name
        try:
            notebooks.execute(
                job.notebook,
                executed,
                parameters={**job.values, "results_path": str(staging)},
                on_cell=lambda done, total: tell(job.stage, done, total),
            )
        except Acx4Error:
            notebooks.scrub(executed, hidden=staging.name)
            _move(executed, failed)
            raise
        notebooks.scrub(executed, hidden=staging.name)
        for path in sorted(path for path in staging.rglob("*") if path.is_file()):
            _move(path, folder / path.relative_to(staging))
    failed.unlink(missing_ok=True)
    if failed.parent.is_dir() and not any(failed.parent.iterdir()):
        failed.parent.rmdir()


def _tidy(folder: Path) -> None:
    """Remove what a run that was killed left behind."""
    for pattern in (".running-*", ".new-*"):
        for stale in folder.glob(pattern):
            shutil.rmtree(stale)


def _move(path: Path, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    path.replace(target)
