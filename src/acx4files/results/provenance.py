"""The origin of results: the flight's tables, kept with them, and the software.

A results folder has a copy of every table that was read, in ``flight/``, and provenance.json. This
file has the SHA-256 of every table and, for every stage, the versions of the software and the
digest of the flight. It has no date and no place, so two runs of one flight give equal bytes.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import platform
import tempfile
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from acx4files.flight import reader
from acx4files.flight.problems import lines_of, quoted
from acx4files.flight.reader import PLACE, Flight, read_kept, table_files
from acx4files.flight.toml_file import read_toml
from acx4files.results import agreement, own_folder, whole_files
from acx4files.results import folder as results
from acx4files.results.folder import Wrong, problem_of, read_object
from acx4files.results.own_folder import MARK, OwnFolder, changes, is_below
from acx4files.results.table_files import NOTEBOOKS, PART_OF, STAGES, is_there
from acx4files.results.whole_files import SCRATCH, copy, write
from acx4lib.errors import Acx4Error, FlightError, OutputError

KEPT = "flight"
"""Folder of the copies in the results."""

FILE = "provenance.json"

AGAIN = "run all stages again"
"""Cure for results of unknown origin."""

PACKAGES = ("acx4lib", "numpy", "scipy", "pyproj")
"""Packages on whose versions the numbers depend."""


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """The origin of the results in a folder.

    Attributes
    ----------
    files : dict of str to str
        SHA-256 of every table of the flight, by its path below the flight's folder.
    stages : dict of str to dict
        For every stage that was run: ``flight``, the digest of its tables, ``versions`` by
        package, and ``calibration`` if the calibration of an earlier flight was validated.
    """

    files: Mapping[str, str]
    stages: Mapping[str, Mapping[str, object]]

    @property
    def digest(self) -> str:
        """SHA-256 of the names and checksums of all tables together."""
        return digest(self.files)


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """The results of a run, with their flight and their origin.

    Attributes
    ----------
    found : Results
    flight : Flight
        The flight of the run, without pixels.
    provenance : Provenance
    """

    found: results.Results
    flight: Flight
    provenance: Provenance

    @property
    def folder(self) -> Path:
        """The folder of the results."""
        return self.found.folder


def read_run(folder: str | Path) -> Run:
    """Read the results of a run, and check that nobody changed them.

    Raises
    ------
    FlightError
        Where the folder has no results, or they or the kept flight were changed.
    """
    path = results.of_run(folder)
    verify(path)
    origin = read(path)
    flight = _read_flight(path, origin)
    return Run(found=agreement.read(path, flight), flight=flight, provenance=origin)


def _read_flight(folder: Path, origin: Provenance) -> Flight:
    """Read the flight kept in a results folder."""
    flight = read_kept(folder / KEPT)
    problems = [
        problem_of(folder / FILE, ("files",), f"without {name}", f"it stands in {KEPT}; {AGAIN}")
        for name in (path.as_posix() for path in table_files(flight))
        if name not in origin.files
    ]
    if problems:
        raise FlightError(lines_of(problems))
    return flight


def digest(files: Mapping[str, str]) -> str:
    """Return one SHA-256 of the names and checksums of files, in the order of the names."""
    lines = "".join(f"{files[name]}  {name}\n" for name in sorted(files))
    return hashlib.sha256(lines.encode()).hexdigest()


def checksums(flight: Flight) -> dict[str, str]:
    """Return the SHA-256 of a flight's tables and geoid, by their paths below its folder."""
    names = [name.as_posix() for name in table_files(flight)] or [*flight.sha256]
    read = flight.sha256
    return {
        n: read[n] if n in read else own_folder.written(flight.path / n).sha256 or "" for n in names
    }


def identity(flight: Flight) -> dict[str, str]:
    """Return the name of a flight and the digest of its tables, its identity in results."""
    return {"name": flight.name, "sha256": digest(checksums(flight))}


def results_before(folder: str | Path, stages: Sequence[str], flight: Flight) -> results.Results:
    """Read the results of earlier stages for a stage of a flight, and check their flight.

    Results that do not name their flight, of an earlier version, are taken as they are.

    Parameters
    ----------
    folder : path
    stages : sequence of str
        Of `folder.STAGES`, those that must have been run; without any, the folder may be new.
    flight : Flight

    Raises
    ------
    FlightError
        Where results of a stage are missing, with the stage to run first, or the folder has
        results of another flight, with both flights.
    """
    path = Path(folder)
    if not stages:
        path.mkdir(parents=True, exist_ok=True)
    elif not path.is_dir():
        raise FlightError([_not_run(path, stages, flight)])
    run_results, mine = results.read(path), identity(flight)
    lacking = [stage for stage in stages if not results.has(run_results, stage)]
    if lacking:
        raise FlightError([_not_run(path, lacking, flight)])
    last = max(map(STAGES.index, stages), default=len(STAGES) - 2)
    for stage in STAGES[: last + 1]:  # a run of all stages has not yet replaced those after it
        other = _named(run_results.summary, stage, flight_identity=mine)
        if other:
            cure = f"run stage {stage} of this flight first"
            if stage == "mounting":
                cure += ", or name the calibration of an earlier flight by calibration_path"
            raise FlightError([_of_another(path, [stage], other, flight, cure=cure)])
    agreement.check(run_results, flight, stages=stages)
    return run_results


def _not_run(folder: Path, stages: Sequence[str], flight: Flight) -> str:
    """Return the message on stages without results, with the notebooks or command to run."""
    notebooks = " and ".join(NOTEBOOKS[stage] for stage in stages)
    command = f"acx4 run {flight.pictures} --results {folder} --stages {','.join(stages)}"
    return (
        f"{folder}: no results of stage {' and '.join(stages)}; run first: "
        f"notebook {notebooks}, or {command}"
    )


def check_kept(run: Run, stage: str) -> None:
    """Check that a stage was run with the flight kept beside its results.

    Raises
    ------
    FlightError
        With both flights.
    """
    mine = {"name": run.flight.name, "sha256": run.provenance.digest}
    other = _named(run.found.summary, stage, flight_identity=mine)
    stamped = str(run.provenance.stages.get(stage, {}).get("flight", mine["sha256"]))
    if not other and stamped != mine["sha256"]:
        other = {"name": "", "sha256": stamped}
    if other:
        cure = "run all stages of one flight again"
        raise FlightError([_of_another(run.folder, [stage], other, run.flight, cure=cure)])


def _named(
    summary: Mapping[str, Mapping[str, object]], stage: str, *, flight_identity: Mapping[str, str]
) -> dict[str, str]:
    """Return the identity of another flight in a stage's results; empty without any."""
    for name, entry in summary.items():
        named = entry.get("flight")
        if (
            name.startswith(f"{stage}/")
            and isinstance(named, dict)
            and named["sha256"] != flight_identity["sha256"]
        ):
            return named
    return {}


def _stamped(
    folder: Path, kept: Provenance, stage: str, *, flight_identity: Mapping[str, str]
) -> dict[str, str]:
    """Return the identity of another flight of a stage in provenance.json; empty without any."""
    sha256 = str(kept.stages.get(stage, {}).get("flight", flight_identity["sha256"]))
    if sha256 == flight_identity["sha256"]:
        return {}
    toml = folder / KEPT / "flight.toml"
    is_kept = sha256 == kept.digest and toml.is_file()
    return {"name": read_toml(toml).values.get("name", "") if is_kept else "", "sha256": sha256}


def _differing(before: Mapping[str, str], now: Mapping[str, str]) -> str:
    """Return a remark on the tables that differ; empty if none, or nothing is known."""
    names = sorted(n for n in before.keys() | now.keys() if before.get(n) != now.get(n))
    if not names or not before:
        return ""
    more = f" and {len(names) - 2} more differ" if len(names) > 2 else " differ"
    return f" ({', '.join(names[:2])}{more if len(names) > 1 else ' differs'})"


def _of_another(
    folder: Path,
    stages: Sequence[str],
    other: Mapping[str, str],
    flight: Flight,
    *,
    cure: str,
    differ: str = "",
) -> str:
    """Return the message on results of another flight, with the identities of both."""
    mine = identity(flight)
    stage_names = f"stage{'s' if len(stages) > 1 else ''} {', '.join(stages)}"
    theirs = f"{other['name']!r} (SHA-256 {other['sha256'][:12]})"
    if not other["name"]:
        theirs = f"another one (SHA-256 {other['sha256'][:12]})"
    this = f"{mine['name']!r} (SHA-256 {mine['sha256'][:12]}, {flight.path})"
    return (
        f"{folder}: the results of {stage_names} are of the flight {theirs}, not of "
        f"{this}{differ}; {cure}"
    )


def versions() -> dict[str, str]:
    """Return the versions of Python and of `PACKAGES`."""
    out = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            out[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            out[name] = "not installed"
    return out


def verify(folder: Path) -> None:
    """Check that the tables of a results folder are as its run left them.

    Raises
    ------
    FlightError
        A line for each file that was changed, cut or removed, or for the process writing there.
    """
    is_there(folder / MARK)
    own_folder.verify(folder, [*results.FILES, FILE], cure=AGAIN)


def read(folder: Path) -> Provenance:
    """Read the provenance of a results folder, and compare the kept tables with it.

    Raises
    ------
    FlightError
        Where the folder was made by an earlier version, or a kept table was changed.
    """
    provenance = _read(folder)
    if not provenance.files:
        nothing = problem_of(folder / FILE, (), "says nothing of the flight", AGAIN)
        raise FlightError([str(nothing)])
    paths = {name: folder / KEPT / name for name in provenance.files}
    changed = [
        name
        for name, path in paths.items()
        if not is_there(path, folder) or own_folder.written(path).sha256 != provenance.files[name]
    ]
    if changed:
        problem = (
            f"{folder / KEPT}: {', '.join(changed)} changed since the run; run all stages again"
        )
        raise FlightError([problem])
    return provenance


def _read(folder: Path) -> Provenance:
    path = folder / FILE
    if not is_there(path):
        return Provenance(files={}, stages={})
    content = read_object(path, "what a run wrote")
    if problems := [problem_of(path, *fault) for fault in _wrong(content)]:
        raise FlightError(lines_of(problems))
    return Provenance(files=content["files"], stages=content["stages"])


def _wrong(content: Mapping[str, object]) -> Iterator[Wrong]:
    """Yield the problems of the content of provenance.json."""
    for key, test in (("files", _wrong_file), ("stages", _wrong_stage)):
        values = content.get(key)
        if isinstance(values, dict):
            for name, value in values.items():
                if fault := test(name, value):
                    yield (key, name), fault[0], f"{fault[1]}; {AGAIN}"
        else:
            yield (key,), quoted(values), f"must be an object; {AGAIN}"


def _wrong_file(name: str, sha256: object) -> tuple[str, str] | None:
    if not is_below(name):
        return "leads out of the flight", f"must be a file in {KEPT}"
    return None if isinstance(sha256, str) else (quoted(sha256), "must be a checksum")


def _wrong_stage(name: str, stage: object) -> tuple[str, str] | None:
    if name not in STAGES:
        return "is unknown", f"must be one of {', '.join(STAGES)}"
    entry = stage if isinstance(stage, dict) else {}
    versions = entry.get("versions")
    texts = [entry.get("flight"), *versions.values()] if isinstance(versions, dict) else [None]
    sound = all(isinstance(text, str) for text in texts)
    return None if sound else (quoted(stage), "must have a flight and versions")


def _write(folder: Path, provenance: Provenance) -> None:
    content = {"files": dict(provenance.files), "stages": dict(provenance.stages)}
    text = json.dumps(content, indent=2, sort_keys=True, ensure_ascii=False) + "\n"
    write(folder / FILE, text)


# --- How stages change the results folder of a flight, one by one: all of a stage, or nothing
#
# A run claims the folder for all its stages; a notebook by itself, or a function of
# `acx4files.stages`, claims it when it writes its own. The folder is prepared for the flight, whose
# tables it keeps. Every stage writes into a copy of the results, which replaces the old ones when
# the stage has ended, and provenance.json records their origin.


COMMAND = "acx4 run"
"""The command that is named in the mark of a results folder."""

EXECUTED, FAILED = "notebooks", "failed"
"""Folders of the executed notebooks, and of those that failed."""

_ALONE = threading.Lock()
"""Held by the stage of a run that reads or changes the folder: some run side by side."""

COPY = ".acx4.copy"
"""File that marks a folder as the copy in which a stage of a run works."""


@contextmanager
def written(
    folder: str | Path,
    stage: str,
    flight: Flight,
    *,
    calibration: Mapping[str, object] | None = None,
) -> Iterator[Path]:
    """Yield the folder in which the results of a stage are replaced.

    In a stage of a run this is the copy prepared by the run, and for a flight without files the
    folder itself. Otherwise it is a copy of the results, which then replaces them.

    Parameters
    ----------
    folder : path
    stage : str
        ``mounting``, or ``mounting/rig`` for a part that leaves the others.
    flight : Flight
    calibration : mapping, optional
        Origin of the validated calibration of an earlier flight, `earlier.Earlier.origin`.

    Raises
    ------
    FlightError
        Other stages left results of another flight, or their files were changed since.
    OutputError
        The folder must not be used for results, or another process is writing there.
    """
    path = Path(folder)
    if (path / COPY).is_file() or flight.path == PLACE:
        yield path
        return
    whole, _, part = stage.partition("/")
    with own_folder.claim(path, command=COMMAND, away_from=[flight.path]) as claimed:
        check_calibration(path, [whole], calibration)
        prepare(claimed, flight, [] if part else [whole])
        with replaced(claimed, "rig" if part else whole, calibration=calibration) as copied:
            yield copied


def prepare(
    own: OwnFolder, flight: Flight, stages: Sequence[str], *, skipped: Iterable[str] = ()
) -> None:
    """Prepare a results folder: keep the flight's tables, remove the results of skipped stages.

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
        A file to be written exists and is not the command's.
    """
    own.expect(
        [
            *(*results.FILES, FILE),
            *(f"{KEPT}/{name.as_posix()}" for name in reader.table_files(flight)),
            *(name for stage in NOTEBOOKS for name in beside(stage)),
        ]
    )
    read = (*results.FILES, FILE)
    changed = changes(own.path, read)
    if changed and not set(stages) >= set(results.STAGES):
        raise FlightError([f"{line}; run all stages again" for line in changed])
    if changed:
        own.remove(read)
    _check_left(own.path, flight, stages)
    _keep(own, flight)
    skipped = list(skipped)
    removed = [f"{PART_OF[s]}/{s}" if s in PART_OF else s for s in skipped]
    results.replace(own.path, removed, tables={}, summary={})
    _forget(own.path, skipped)
    own.remove(name for stage in skipped for name in beside(stage))
    own.seal()


def _check_left(folder: Path, flight: Flight, stages: Sequence[str]) -> None:
    """Check that the results of stages not run again are of the same flight."""
    kept, summary, mine = _read(folder), results.entries(folder), identity(flight)
    others = {
        stage: _named(summary, stage, flight_identity=mine)
        or _stamped(folder, kept, stage, flight_identity=mine)
        for stage in results.STAGES
        if stage not in stages
    }
    foreign = {stage: other for stage, other in others.items() if other}
    if foreign:
        cure = (
            "run all stages, or choose another folder; the calibration of an earlier flight is "
            "validated by --calibration"
        )
        other = next(iter(foreign.values()))
        differ = _differing(kept.files, checksums(flight))
        raise FlightError(
            [_of_another(folder, [*foreign], other, flight, differ=differ, cure=cure)]
        )


def _keep(claimed: OwnFolder, flight: Flight) -> None:
    """Copy the tables of a flight into the results, in place of earlier ones."""
    names = [name.as_posix() for name in table_files(flight)]
    before = _read(claimed.path)
    with tempfile.TemporaryDirectory(dir=claimed.path, prefix=SCRATCH) as temporary:
        new = Path(temporary)
        for name in names:
            (new / name).parent.mkdir(parents=True, exist_ok=True)
            copy(flight.path / name, new / name)
        files = {name: own_folder.written(new / name).sha256 or "" for name in sorted(names)}
        changed = [name for name in flight.sha256 if files.get(name) != flight.sha256[name]]
        if changed:
            problems = [f"{flight.path / n}: changed while it was read; run again" for n in changed]
            raise FlightError(problems)
        claimed.remove([name for name in claimed.files if name.startswith(f"{KEPT}/")])
        claimed.expect(f"{KEPT}/{name}" for name in names)
        for name in names:
            (claimed.path / KEPT / name).parent.mkdir(parents=True, exist_ok=True)
            (new / name).replace(claimed.path / KEPT / name)
    _write(claimed.path, Provenance(files=files, stages=before.stages))


def _forget(folder: Path, stages: Sequence[str]) -> None:
    """Remove stages from provenance.json."""
    before = _read(folder)
    kept = {stage: entry for stage, entry in before.stages.items() if stage not in stages}
    _write(folder, Provenance(files=before.files, stages=kept))


def check_calibration(
    folder: Path, stages: Sequence[str], told: Mapping[str, object] | None
) -> None:
    """Check that a run leaves only one calibration: the flight's own, or an earlier flight's.

    Parameters
    ----------
    folder : Path
    stages : sequence of str
        Of `folder.STAGES`, those that will be replaced.
    told : mapping or None
        Origin of the calibration to be validated, if it is that of an earlier flight.

    Raises
    ------
    FlightError
    """
    kept = {s: e for s, e in _read(folder).stages.items() if s not in stages}
    has_own = "mounting" in (kept if told else stages)
    if has_own and (told or "calibration" in kept.get("validation", {})):
        problem = (
            f"{folder}: has the flight's own calibration beside a validation of an earlier one's; "
            "choose another folder for one of them"
        )
        raise FlightError([problem])


def beside(stage: str) -> tuple[str, str]:
    """Return the paths of a stage's executed and failed notebooks below a results folder.

    The paths hold for a copy of the folder as well; the stage is one of `table_files.NOTEBOOKS`.
    """
    name = f"{NOTEBOOKS[stage]}.ipynb"
    return f"{EXECUTED}/{name}", f"{FAILED}/{name}"


@contextmanager
def replaced(
    own: OwnFolder, stage: str, *, calibration: Mapping[str, object] | None = None
) -> Iterator[Path]:
    """Yield a copy of the results for a stage, which replaces them if the stage succeeds.

    If the stage fails, only its notebook is kept.

    Parameters
    ----------
    own : OwnFolder
        Prepared.
    stage : str
        Of `table_files.NOTEBOOKS`.
    calibration : mapping, optional
        Origin of the validated calibration of an earlier flight, `earlier.Earlier.origin`.
    """
    folder = own.path
    with tempfile.TemporaryDirectory(dir=folder, prefix=whole_files.SCRATCH) as temporary:
        copied = folder / Path(temporary).name
        with _ALONE:
            for file in results.FILES:
                whole_files.copy(folder / file, copied / file)
        whole_files.write(copied / COPY, "")
        try:
            yield copied
        except Acx4Error as error:
            with _ALONE, suppress(OutputError):  # the first error is reported
                _move(copied, folder, [name for name in beside(stage) if (copied / name).is_file()])
                own.seal()
            if isinstance(error, FlightError | OutputError):  # its paths are those of the copy
                message = str(error).replace(f"/{copied.name}", "")
                if isinstance(error, OutputError):
                    raise OutputError(message) from None
                raise FlightError(message.splitlines()) from None
            raise
        with _ALONE:
            _take(own, copied, stage, calibration)


def _take(
    own: OwnFolder, copied: Path, stage: str, calibration: Mapping[str, object] | None
) -> None:
    """Take over what a stage has done in a copy; stages that ran meanwhile keep their results."""
    notebooks = [name for name in beside(stage) if (copied / name).is_file()]
    own.remove([name for name in beside(stage) if name not in notebooks])
    _move(copied, own.path, notebooks)
    of_folder = PART_OF.get(stage, stage)
    if of_folder in results.STAGES:
        results.adopt(own.path, copied, of_folder)
        _stamp(own.path, of_folder, calibration)
    own.seal()


def _stamp(folder: Path, stage: str, calibration: Mapping[str, object] | None) -> None:
    """Record that a stage was run with the kept flight and the present software."""
    before = _read(folder)
    entry: dict[str, object] = {"flight": before.digest, "versions": versions()}
    if calibration:
        entry["calibration"] = dict(calibration)
    _write(folder, Provenance(files=before.files, stages={**before.stages, stage: entry}))


def _move(source: Path, folder: Path, names: Iterable[str]) -> None:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (source / name).replace(folder / name)
