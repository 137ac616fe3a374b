"""How stages change the results folder of a flight, one by one: all of a stage, or nothing.

A run claims the folder for all its stages; a notebook by itself, or a function of
`acx4lib.stages`, claims it when it writes its own. The folder is prepared for the flight, whose
tables it keeps. Every stage writes into a copy of the results, which takes the place of the old
ones when the stage has come to its end, and provenance.json says with what they were made.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from acx4lib.errors import Acx4Error, FlightError, OutputError
from acx4lib.flight import reader
from acx4lib.flight.reader import PLACE, Flight
from acx4lib.results import folder as results
from acx4lib.results import own_folder, provenance, whole_files
from acx4lib.results.own_folder import OwnFolder, changes
from acx4lib.results.table_files import NOTEBOOKS, PART_OF

COMMAND = "acx4 run"
"""The command that is named in the mark of a results folder."""

EXECUTED, FAILED = "notebooks", "failed"
"""Folders of the executed notebooks, and of those that failed."""

COPY = ".acx4.copy"
"""The file that says of a folder that it is the copy in which a stage of a run works."""


@contextmanager
def written(
    folder: str | Path,
    stage: str,
    flight: Flight,
    *,
    calibration: Mapping[str, object] | None = None,
) -> Iterator[Path]:
    """Yield the folder in which the results of a stage are replaced.

    In a stage of a run it is the copy that the run has prepared, and of a flight that has no files
    the folder itself. Otherwise it is a copy of the results, which takes their place.

    Parameters
    ----------
    folder : path
    stage : str
        ``mounting``, or ``mounting/rig`` for a part that leaves the others.
    flight : Flight
    calibration : mapping, optional
        That of an earlier flight, as `provenance.stamp` takes it.

    Raises
    ------
    FlightError
        Other stages left results of another flight, or their files were changed since.
    OutputError
        The folder must not be used for results, or another process is writing there.
    """
    at = Path(folder)
    if (at / COPY).is_file() or flight.path == PLACE:
        yield at
        return
    whole, _, part = stage.partition("/")
    with own_folder.claim(at, command=COMMAND, away_from=[flight.path]) as own:
        check_calibration(at, [whole], calibration)
        prepare(own, flight, [] if part else [whole])
        with replaced(own, "rig" if part else whole, calibration=calibration) as copied:
            yield copied


def prepare(
    own: OwnFolder, flight: Flight, stages: Sequence[str], *, skipped: Iterable[str] = ()
) -> None:
    """Prepare a folder for stages: keep the flight, remove results of blocks that it lacks.

    Parameters
    ----------
    own : OwnFolder
    flight : Flight
    stages : sequence of str
        Of `folder.STAGES`, those that will be replaced.
    skipped : iterable of str
        Of `table_files.NOTEBOOKS`, those whose results are removed.

    Raises
    ------
    FlightError
        Files were changed or other stages are of another flight, unless all will be replaced.
    OutputError
        What will be written is there and is not the command's.
    """
    own.expect(
        [
            *(*results.FILES, provenance.FILE),
            *(f"{provenance.KEPT}/{name.as_posix()}" for name in reader.table_files(flight)),
            *(name for stage in NOTEBOOKS for name in beside(stage)),
        ]
    )
    read = (*results.FILES, provenance.FILE)
    changed = changes(own.path, read)
    if changed and not set(stages) >= set(results.STAGES):
        raise FlightError([f"{line}; run all stages again" for line in changed])
    if changed:
        own.remove(read)
    provenance.check_left(own.path, flight, stages)
    provenance.keep(own, flight)
    skipped = list(skipped)
    removed = [f"{PART_OF[s]}/{s}" if s in PART_OF else s for s in skipped]
    results.replace(own.path, removed, tables={}, summary={})
    provenance.forget(own.path, skipped)
    own.remove(name for stage in skipped for name in beside(stage))
    own.seal()


def check_calibration(
    folder: Path, stages: Sequence[str], told: Mapping[str, object] | None
) -> None:
    """Check that a folder has one calibration after a run: this flight's, or an earlier one's.

    Parameters
    ----------
    folder : Path
    stages : sequence of str
        Of `folder.STAGES`, those that will be replaced.
    told : mapping or None
        What is said of the earlier one that will be validated.

    Raises
    ------
    FlightError
    """
    left = {s: e for s, e in provenance.stages(folder).items() if s not in stages}
    own = "mounting" in (left if told else stages)
    if own and (told or "calibration" in left.get("validation", {})):
        problem = (
            f"{folder}: has the flight's own calibration beside a validation of an earlier one's; "
            "choose another folder for one of them"
        )
        raise FlightError([problem])


def beside(stage: str) -> tuple[str, str]:
    """Return the files that a stage may leave beside the tables: its notebook, and one that failed.

    Names are those below the results folder, and below a copy of it; the stage is one of
    `table_files.NOTEBOOKS`.
    """
    name = f"{NOTEBOOKS[stage]}.ipynb"
    return f"{EXECUTED}/{name}", f"{FAILED}/{name}"


@contextmanager
def replaced(
    own: OwnFolder, stage: str, *, calibration: Mapping[str, object] | None = None
) -> Iterator[Path]:
    """Yield a copy of the results for a stage, which replaces them if the stage succeeds.

    Of one that fails, only the notebook is kept.

    Parameters
    ----------
    own : OwnFolder
        Prepared.
    stage : str
        Of `table_files.NOTEBOOKS`.
    calibration : mapping, optional
        That of an earlier flight, as `provenance.stamp` takes it.
    """
    folder = own.path
    with tempfile.TemporaryDirectory(dir=folder, prefix=whole_files.SCRATCH) as temporary:
        copied = folder / Path(temporary).name
        for file in results.FILES:
            whole_files.copy(folder / file, copied / file)
        whole_files.write(copied / COPY, "")
        try:
            yield copied
        except Acx4Error as error:
            _move(copied, folder, [name for name in beside(stage) if (copied / name).is_file()])
            with suppress(OutputError):  # the first error is told
                own.seal()
            if isinstance(error, FlightError | OutputError):  # its paths are those of the copy
                said = str(error).replace(f"/{copied.name}", "")
                if isinstance(error, OutputError):
                    raise OutputError(said) from None
                raise FlightError(said.splitlines()) from None
            raise
        left = [name for name in beside(stage) if (copied / name).is_file()]
        own.remove([name for name in beside(stage) if name not in left])
        _move(copied, folder, [*results.FILES, *left])
    of_folder = PART_OF.get(stage, stage)
    if of_folder in results.STAGES:
        provenance.stamp(folder, of_folder, calibration=calibration)
    own.seal()


def _move(source: Path, folder: Path, names: Iterable[str]) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).replace(folder / name)
