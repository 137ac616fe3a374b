"""The origin of results: the flight's tables, kept with them, and the software.

A results folder has a copy of every table that was read, in ``flight/``; summary.json has the
SHA-256 of every table and, for every stage, the versions of the software and the digest of the
flight. It has no date and no place, so two runs of one flight give equal bytes.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import os
import platform
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from acx4files.flight.reader import PLACE, Flight, read_kept, table_files
from acx4files.results import folder as results
from acx4files.results import whole_files
from acx4files.results.folder import AGAIN, COLUMNS, NOTEBOOKS, Record
from acx4lib.errors import FlightError

KEPT = "flight"
"""Folder of the copies in the results."""

EXECUTED, FAILED = "notebooks", "failed"
"""Folders of the executed notebooks, and of those that failed."""

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
    """Read the results of a run.

    Raises
    ------
    FlightError
        Where the folder has no results, or they or the kept flight are not as the run left them.
    """
    found = results.read(results.of_run(folder))
    origin = _origin(found.run)
    if not origin.files:
        raise FlightError([f"{folder}: summary.json says nothing of the flight; {AGAIN}"])
    kept = found.folder / KEPT
    changed = [name for name, sha256 in origin.files.items() if sha256_of(kept / name) != sha256]
    if changed:
        raise FlightError([f"{kept}: {', '.join(changed)} changed since the run; {AGAIN}"])
    return Run(found=found, flight=read_kept(kept), provenance=origin)


def read(folder: Path) -> Provenance:
    """Read the origin of the results in a folder; FlightError where summary.json is invalid."""
    return _origin(results.read_summary(folder)[1])


def _origin(run: Mapping[str, Mapping[str, str]]) -> Provenance:
    return Provenance(files=run.get("files", {}), stages=run.get("stages", {}))  # type: ignore[arg-type] # read from JSON


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file; empty without one."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""


def digest(files: Mapping[str, str]) -> str:
    """Return one SHA-256 of the names and checksums of files, in the order of the names."""
    lines = "".join(f"{files[name]}  {name}\n" for name in sorted(files))
    return hashlib.sha256(lines.encode()).hexdigest()


def checksums(flight: Flight) -> dict[str, str]:
    """Return the SHA-256 of a flight's tables and geoid, by their paths below its folder."""
    names = [name.as_posix() for name in table_files(flight)] or [*flight.sha256]
    return {n: flight.sha256.get(n) or sha256_of(flight.path / n) for n in names}


def identity(flight: Flight) -> dict[str, str]:
    """Return the name of a flight and the digest of its tables, its identity in results."""
    return {"name": flight.name, "sha256": digest(checksums(flight))}


def versions() -> dict[str, str]:
    """Return the versions of Python and of `PACKAGES`."""
    of_packages = {name: importlib.metadata.version(name) for name in PACKAGES}
    return {"python": platform.python_version(), **of_packages}


# --- results of the same flight --------------------------------------------------------------


def results_before(folder: str | Path, stages: Sequence[str], flight: Flight) -> results.Results:
    """Read the results of earlier stages for a stage of a flight, and check their flight.

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
    can_write = os.access(path, os.W_OK)  # so another notebook may be writing
    with whole_files.locked(path) if can_write else nullcontext():
        found = results.read(path)
    lacking = [stage for stage in stages if not results.has(found, stage)]
    if lacking:
        raise FlightError([_not_run(path, lacking, flight)])
    _check_flight(path, _origin(found.run).stages, flight)
    return found


def _not_run(folder: Path, stages: Sequence[str], flight: Flight) -> str:
    """Return the message on stages without results, with the notebooks or command to run."""
    notebooks = " and ".join(NOTEBOOKS[stage] for stage in stages)
    command = f"acx4 run {flight.pictures} --results {folder} --stages {','.join(stages)}"
    return (
        f"{folder}: no results of stage {' and '.join(stages)}; run first: "
        f"notebook {notebooks}, or {command}"
    )


def _check_flight(folder: Path, stages: Mapping[str, Mapping[str, object]], flight: Flight) -> None:
    """Raise a FlightError where some stages were run with another flight, with both flights."""
    mine = identity(flight)
    foreign = [stage for stage, entry in stages.items() if entry["flight"] != mine["sha256"]]
    if foreign:
        theirs = str(stages[foreign[0]]["flight"])[:12]
        this = f"{mine['name']!r} (SHA-256 {mine['sha256'][:12]}, {flight.path})"
        problem = (
            f"{folder}: the results of stage {', '.join(foreign)} are of another flight (SHA-256 "
            f"{theirs}), not of {this}; run all stages of this flight, or choose another folder; "
            "the calibration of an earlier flight is validated by --calibration"
        )
        raise FlightError([problem])


# --- how stages change the results folder of a flight ----------------------------------------


def begin(
    folder: Path,
    flight: Flight,
    stages: Sequence[str],
    *,
    calibration: Mapping[str, object] | None = None,
) -> None:
    """Prepare a results folder for a run: keep the flight, remove the results of its stages.

    Parameters
    ----------
    folder : Path
    flight : Flight
    stages : sequence of str
        Of `folder.STAGES`, those that will be run.
    calibration : mapping, optional
        Origin of the calibration of an earlier flight that will be validated.

    Raises
    ------
    FlightError
        Other stages are of another flight.
    OutputError
        The folder must not be used for results, or another process is writing there.
    """
    with _claimed(folder):
        left = {s: entry for s, entry in read(folder).stages.items() if s not in stages}
        _check_flight(folder, left, flight)
        earlier = calibration or left.get("validation", {}).get("calibration")
        _check_calibration(folder, {*left, *stages}, earlier)
        _replace(folder, stages, (), flight, left)


def write(
    folder: str | Path,
    stage: str,
    records: Iterable[Record],
    *,
    flight: Flight,
    calibration: Mapping[str, object] | None = None,
    methods: Sequence[str] = (),
) -> None:
    """Write the results of a stage in place of its old ones.

    Parameters
    ----------
    folder : path
    stage : str
        All its old rows are removed, even those of methods without a new record.
    records : iterable of Record
    flight : Flight
    calibration : mapping, optional
        Origin of the validated calibration of an earlier flight, `read_back.Earlier.origin`.
    methods : sequence of str
        Methods of the stage that are replaced; by default all.

    Raises
    ------
    FlightError
        Other stages left results of another flight, or a file is not as its run left it.
    OutputError
        The folder must not be used for results, or another process is writing there.
    """
    path, mine = Path(folder), identity(flight)
    with _claimed(path):
        old = read(path).stages
        others = {s: entry for s, entry in old.items() if s != stage or methods}
        _check_flight(path, others, flight)
        entry: dict[str, object] = {"flight": mine["sha256"], "versions": versions()}
        entry |= {"calibration": dict(calibration)} if calibration else {}
        stages = {**old, stage: entry}
        _check_calibration(path, stages, stages.get("validation", {}).get("calibration"))
        replaced = [f"{stage}/{method}" for method in methods] or [stage]
        _replace(path, replaced, records, flight, stages)


def _claimed(folder: Path) -> AbstractContextManager[Path]:
    executed = [path.name for path in folder.glob("*.ipynb*")]  # papermill begins its file first
    besides = [EXECUTED, FAILED, *executed]
    return whole_files.claim(folder, signs=["summary.json"], besides=besides, wait=whole_files.WAIT)


def _check_calibration(folder: Path, stages: Iterable[str], calibration: object) -> None:
    """Check that results have one calibration: the flight's own, or an earlier flight's."""
    if calibration and "mounting" in stages:
        problem = (
            f"{folder}: has the flight's own calibration beside a validation of an earlier one's; "
            "choose another folder for one of them"
        )
        raise FlightError([problem])


def _replace(
    folder: Path,
    replaced: Sequence[str],
    records: Iterable[Record],
    flight: Flight,
    stages: Mapping[str, Mapping[str, object]],
) -> None:
    """Replace results, and the copies of the flight's tables beside them."""
    tables: dict[str, list[pd.DataFrame]] = {name: [] for name in COLUMNS}
    summary: dict[str, dict[str, object]] = {}
    for record in records:
        for name, frame in record.tables.items():
            tables[name].append(frame)
        summary |= {key: {**of, "flight": identity(flight)} for key, of in record.summary.items()}
    files, kept = checksums(flight), folder / KEPT
    before = read(folder).files
    new = [name for name, sha256 in files.items() if sha256_of(kept / name) != sha256]
    if flight.path == PLACE:
        new = []
    contents = {f"{KEPT}/{name}": (flight.path / name).read_bytes() for name in new}
    run = {"flight": identity(flight), "files": files, "stages": stages}
    results.replace(
        folder,
        replaced,
        tables=tables,
        summary=summary,
        run=run,
        kept=contents,
    )
    for name in before.keys() - files.keys():
        (kept / name).unlink(missing_ok=True)
