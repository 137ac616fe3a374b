"""Runs of a flight, stage after stage; their results are kept.

A stage is run by its notebook, or by what this calls (``--numbers-only``); it writes its results
at its end, all of them or none. Notebooks of stages that do not need each other's results run side
by side. Without notebooks, nothing here needs their requirements.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Collection, Container, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from importlib import resources
from pathlib import Path

import numpy as np
from threadpoolctl import threadpool_limits

from acx4files.flight import reader
from acx4files.flight.reader import Flight
from acx4files.results import folder as results
from acx4files.results import provenance, read_back, whole_files
from acx4files.results.folder import NOTEBOOKS, PART_OF
from acx4files.results.provenance import EXECUTED, FAILED, KEPT
from acx4files.stages import heads, mounting, order, rig, validation
from acx4lib.errors import Acx4Error, AdjustmentError, unsolvable

NOTEBOOKS_PATH = Path(str(resources.files("acx4book.notebooks") / "sources")).resolve()
"""Folder of the notebooks."""

AT_A_TIME = 2
"""Number of notebooks that run side by side."""

Tell = Callable[[str, int, int], None]
"""Function called with the stage, the number of its finished parts, and of all its parts."""

Step = Callable[[Callable[[int, int], None]], None]
"""Function that runs a stage, with its progress."""

NOTED = ("sigma_beyond", "not_confirmed", "weak", "approximations", "notes")
"""Entries of summary.json whose sentences a run shows without failing."""


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
        Remarks on the flight's files, and of the stages on the data.
    left_out : tuple of str
        Methods that were left out, with the reasons.
    """

    ran: tuple[str, ...]
    skipped: tuple[str, ...]
    not_determined: tuple[str, ...]
    left_out: tuple[str, ...]
    notes: tuple[str, ...] = ()


def run(
    flight_path: str | Path,
    results_path: str | Path,
    *,
    notebooks: Path | None = None,
    stages: Sequence[str] = results.STAGES,
    calibration: str | Path = "",
    tell: Tell | None = None,
) -> RunOutcome:
    """Run the stages of a flight.

    A stage whose block is not in the flight is skipped, and its old results are removed.

    Parameters
    ----------
    flight_path, results_path : path
        The flight, and the folder for the results: new, empty, or that of an earlier run.
    notebooks : Path, optional
        Folder of the notebooks, as `NOTEBOOKS_PATH`; without it only the numbers, which are the
        same.
    stages : sequence of str
        Stages to run, of `folder.STAGES`; the others keep their results.
    calibration : path, optional
        Results of an earlier flight: its calibration is validated in the place of this one's. Then
        the stage validation is the only one.
    tell : callable, optional
        Function called with the progress.

    Raises
    ------
    FlightError
        The flight's files are wrong; results of an earlier stage are missing; only some stages are
        to run, and the others' results are of another flight or were changed after their run; or
        the earlier flight's cameras are others.
    OutputError
        The folder must not be used for results, or another run is writing there.
    AdjustmentError
        A stage does not converge, or is not determined.
    NotebookError
        A notebook failed for another reason. Like the two errors before it, it has the sentences
        `RunOutcome.not_determined` of earlier stages as notes.
    FileNotFoundError
        A notebook is not there.
    ValueError
        Unknown stage.
    """
    wanted = parts_of(stages)
    if str(calibration) and wanted != ("validation",):
        msg = "the calibration of an earlier flight is for stage validation alone"
        raise ValueError(msg)
    folder, tell = Path(results_path), tell or (lambda *_: None)
    flight = reader.read(flight_path)
    skipped = {stage: reason for stage in wanted if (reason := order.missing(flight, stage))}
    ran = order.ordered(flight, [stage for stage in wanted if stage not in skipped])
    earlier = read_back.read_earlier(calibration, flight).origin if str(calibration) else None
    steps = (
        _computed(flight, folder, ran, str(calibration))
        if notebooks is None
        else _executed(notebooks, flight, folder, ("flight", *ran), str(calibration))
    )
    provenance.begin(folder, flight, stages, calibration=earlier)
    for kind in (EXECUTED, FAILED):
        for stage in ("flight", *wanted):
            (folder / kind / f"{NOTEBOOKS[stage]}.ipynb").unlink(missing_ok=True)
        with suppress(OSError):  # it holds others, or is not there
            (folder / kind).rmdir()
    ends = {stage for stage in steps if order.is_end(flight, stage)}
    at_a_time = 1 if notebooks is None else AT_A_TIME
    done, failed = _run_steps(steps, ends, folder, tell, _needs(flight, steps), at_a_time)
    return RunOutcome(
        ran=ran,
        skipped=tuple(
            f"{s}: skipped, {cause}" for s, cause in skipped.items() if cause != order.NO_RIG
        ),
        not_determined=(*wrong(folder, done), *failed),
        left_out=tuple(_messages(folder, done, "left_out", done)),
        notes=(
            *flight.notes,
            *(line for key in NOTED for line in _messages(folder, done, key, done)),
        ),
    )


def _run_steps(
    steps: Mapping[str, Step],
    ends: Container[str],
    folder: Path,
    tell: Tell,
    after: Mapping[str, Collection[str]],
    at_a_time: int,
) -> tuple[list[str], list[str]]:
    """Run the stages; return those that ran, and errors of stages that no later one needs."""
    done: list[str] = []
    failed: list[str] = []

    def run_step(stage: str) -> None:
        try:
            steps[stage](partial(tell, stage))
            done.append(PART_OF.get(stage, stage))
        except AdjustmentError as error:
            if stage not in ends:
                raise
            failed.extend(str(error).splitlines())

    try:
        if at_a_time == 1:
            for stage in steps:
                run_step(stage)
        else:
            side_by_side({stage: partial(run_step, stage) for stage in steps}, after, at_a_time)
    except Acx4Error as error:
        for line in wrong(folder, done):
            error.add_note(line)
        raise
    return done, failed


def _needs(flight: Flight, stages: Collection[str]) -> dict[str, set[str]]:
    """Return the stages that must have been run before each of the given ones."""
    before = {
        "synthetic": {"heads", *(["rig"] if order.rig_leads(flight) else [])},
        "mounting": {"heads", "synthetic"} if flight.transferred else set(),
        "rig": {"heads"} if order.rig_leads(flight) else {"heads", "mounting"},
        "validation": {"heads", "synthetic", "mounting"},
    }
    return {stage: before.get(stage, set()) & {*stages} for stage in stages}


def side_by_side(
    tasks: Mapping[str, Callable[[], None]],
    after: Mapping[str, Collection[str]],
    at_a_time: int = AT_A_TIME,
) -> None:
    """Run tasks that execute notebooks; after one that fails, none is begun.

    Parameters
    ----------
    tasks : mapping of str to callable
        In the order in which they are begun.
    after : mapping of str to collection of str
        The tasks that must have ended before each.
    at_a_time : int
        Number of tasks that run at the same time.
    """
    from acx4book.notebooks import execute  # noqa: PLC0415 needs the extra book

    waiting, running = dict(tasks), dict[Future[None], str]()
    with ThreadPoolExecutor(at_a_time) as pool:
        try:
            while waiting or running:
                unfinished = {*waiting, *running.values()}
                ready = [name for name in waiting if not unfinished & {*after.get(name, ())}]
                for name in ready[: at_a_time - len(running)]:
                    running[pool.submit(waiting.pop(name))] = name
                for future in wait(running, return_when=FIRST_COMPLETED).done:
                    del running[future]
                    future.result()
        except (KeyboardInterrupt, SystemExit):
            while wait(running, timeout=0.5).not_done:  # one may be about to begin
                execute.end_all()
            raise


def parts_of(stages: Sequence[str]) -> tuple[str, ...]:
    """Return the parts of some stages, by the names of `NOTEBOOKS`, in their order.

    Raises
    ------
    ValueError
        Unknown stage.
    """
    unknown = [stage for stage in stages if stage not in results.STAGES]
    if unknown:
        known = ", ".join(results.STAGES)
        msg = f"unknown stage {', '.join(map(repr, unknown))}; known: {known}"
        raise ValueError(msg)
    return tuple(name for name in NOTEBOOKS if PART_OF.get(name, name) in stages)


def wrong(folder: Path, stages: Sequence[str]) -> Iterator[str]:
    """Yield the sentences in the results of some stages for which a run ends with status 1."""
    yield from _messages(folder, stages, "stopped", order.CONSISTENT)
    yield from _messages(folder, stages, "not_determined", order.DECISIVE)


def _messages(
    folder: Path, stages: Sequence[str], key: str, methods: Sequence[str]
) -> Iterator[str]:
    """Yield the sentences of some methods of the given stages in the summary."""
    for name, entry in results.entries(folder).items():
        mine = any(f"{name}/".startswith(f"{method}/") for method in methods)
        if mine and name.partition("/")[0] in stages:
            yield from results.messages(entry, key)


# --- every stage by its notebook, or by what its notebook calls -----------------------------
#
# A notebook reads only the copy of the flight's tables in the results, and the pictures. Executed
# notebooks have no date and no place, so two runs of one flight give equal bytes.


def _executed(
    notebooks: Path, flight: Flight, folder: Path, stages: Sequence[str], calibration: str
) -> dict[str, Step]:
    """Return the step of each stage that executes its notebook."""
    paths = {stage: notebooks / f"{NOTEBOOKS[stage]}.ipynb" for stage in stages}
    for path in paths.values():
        if not path.is_file():
            msg = f"{path}: no such notebook"
            raise FileNotFoundError(msg)
    parameters = {
        "flight_path": str(folder / KEPT),
        "pictures_path": str(flight.path),
        "calibration_path": calibration,
        "results_path": str(folder),
    }
    return {stage: partial(_execute, path, parameters, folder) for stage, path in paths.items()}


def _execute(
    notebook: Path,
    parameters: Mapping[str, str],
    folder: Path,
    on_cell: Callable[[int, int], None],
) -> None:
    """Execute a notebook; a failed one is kept in the folder `FAILED`."""
    from acx4book.notebooks import execute  # noqa: PLC0415 needs the extra book

    with tempfile.TemporaryDirectory(prefix="acx4-") as temporary:
        executed = Path(temporary) / notebook.name
        failed, succeeded = (folder / kind / notebook.name for kind in (FAILED, EXECUTED))
        place = failed
        try:
            execute.execute(notebook, executed, parameters=parameters, on_cell=on_cell)
            place = succeeded
        finally:
            if executed.is_file():
                place.parent.mkdir(exist_ok=True)
                whole_files.copy(executed, place)
        failed.unlink(missing_ok=True)
        with suppress(OSError):  # it holds others
            failed.parent.rmdir()


def _synthetic(flight: Flight, staging: Path) -> object:
    from acx4files.stages import synthetic  # noqa: PLC0415 loads what works on pictures

    return synthetic.run(flight, staging)


def _computed(
    flight: Flight, folder: Path, stages: Sequence[str], calibration: str
) -> dict[str, Step]:
    """Return the step of each stage that calls its function."""
    runs: dict[str, Callable[[Flight, Path], object]] = {
        "heads": heads.run,
        "synthetic": _synthetic,
        "mounting": mounting.run,
        "rig": rig.run,
        "validation": partial(validation.run, calibration_path=calibration),
    }
    return {stage: partial(_compute, runs[stage], flight, folder) for stage in stages}


def _compute(
    run: Callable[[Flight, Path], object],
    flight: Flight,
    folder: Path,
    tell: Callable[[int, int], None],
) -> None:
    """Run a stage with linear algebra on one thread, as in a notebook, so that bytes are equal."""
    tell(0, 1)
    with threadpool_limits(1, user_api="blas"):
        try:
            run(flight, folder)
        except np.linalg.LinAlgError as error:
            raise unsolvable(str(error), "the equations of the flight") from error
    tell(1, 1)
