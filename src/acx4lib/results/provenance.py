"""What a run was made from: its flight's tables, kept in the results, and the software.

A results folder has a copy of every table that was read, in ``flight/``, and provenance.json. This
file has the SHA-256 of every table and, for every stage, the versions of the software and the
digest of the flight. It has no date and no place, so two runs of one flight give equal bytes.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import json
import platform
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from acx4lib.errors import FlightError
from acx4lib.flight.reader import Flight, read_kept, table_files
from acx4lib.results import folder as results
from acx4lib.results.own_folder import claims
from acx4lib.results.own_folder.claims import OwnFolder
from acx4lib.results.own_folder.marks import SCRATCH, is_below, written

KEPT = "flight"
"""Folder of the copies in the results."""

FILE = "provenance.json"

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
        For every stage that was run: ``flight``, the digest of the tables that it used, and
        ``versions`` by package.
    """

    files: Mapping[str, str]
    stages: Mapping[str, Mapping[str, object]]

    @property
    def digest(self) -> str:
        """SHA-256 of the names and checksums of all tables together."""
        return digest(self.files)


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """What a run left.

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
    """Read what a run left, if nobody changed it.

    Raises
    ------
    FlightError
        Where the folder has no results, or they or the kept flight were changed.
    """
    at = results.of_run(folder)
    verify(at)
    origin = read(at)
    return Run(found=results.read(at), flight=read_kept(at / KEPT), provenance=origin)


def digest(files: Mapping[str, str]) -> str:
    """Return one SHA-256 of the names and checksums of files, in the order of the names."""
    lines = "".join(f"{files[name]}  {name}\n" for name in sorted(files))
    return hashlib.sha256(lines.encode()).hexdigest()


def versions() -> dict[str, str]:
    """Return the versions of Python and of `PACKAGES`."""
    out = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            out[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            out[name] = "not installed"
    return out


def keep(own: OwnFolder, flight: Flight) -> None:
    """Copy the tables of a flight into the results, replacing those of an earlier run.

    Parameters
    ----------
    own : OwnFolder
        The results folder.
    flight : Flight
        The flight, read and checked.

    Raises
    ------
    FlightError
        Where a table was changed after it was read.
    """
    names = [name.as_posix() for name in table_files(flight)]
    before = _read(own.path)
    with tempfile.TemporaryDirectory(dir=own.path, prefix=SCRATCH) as temporary:
        new = Path(temporary)
        for name in names:
            (new / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(flight.path / name, new / name)
        files = {name: written(new / name).sha256 or "" for name in sorted(names)}
        changed = [name for name in flight.sha256 if files.get(name) != flight.sha256[name]]
        if changed:
            problems = [f"{flight.path / n}: changed while it was read; run again" for n in changed]
            raise FlightError(problems)
        own.remove([name for name in own.files if name.startswith(f"{KEPT}/")])
        own.expect(f"{KEPT}/{name}" for name in names)
        for name in names:
            (own.path / KEPT / name).parent.mkdir(parents=True, exist_ok=True)
            (new / name).replace(own.path / KEPT / name)
    _write(own.path, Provenance(files=files, stages=before.stages))


def stamp(folder: Path, stage: str) -> None:
    """Record that a stage was run with the kept flight and the present software."""
    before = _read(folder)
    entry = {"flight": before.digest, "versions": versions()}
    _write(folder, Provenance(files=before.files, stages={**before.stages, stage: entry}))


def forget(folder: Path, stages: Sequence[str]) -> None:
    """Remove stages whose results are removed."""
    before = _read(folder)
    left = {stage: entry for stage, entry in before.stages.items() if stage not in stages}
    _write(folder, Provenance(files=before.files, stages=left))


def verify(folder: Path) -> None:
    """Check that the tables of a results folder are what its run left.

    Raises
    ------
    FlightError
        A line for each that was changed, cut or removed, or for who is writing there.
    """
    claims.verify(folder, [*results.FILES, FILE], cure="run all stages again")


def read(folder: Path) -> Provenance:
    """Read the provenance of a results folder, and compare the kept tables with it.

    Raises
    ------
    FlightError
        Where the folder was made by an earlier version, or a kept table was changed.
    """
    found = _read(folder)
    if not found.files:
        problem = f"{folder / FILE}: says nothing of the flight; run all stages again"
        raise FlightError([problem])
    paths = {name: folder / KEPT / name for name in found.files}
    changed = [
        name
        for name, path in paths.items()
        if not path.is_file() or written(path).sha256 != found.files[name]
    ]
    if changed:
        problem = (
            f"{folder / KEPT}: {', '.join(changed)} changed since the run; run all stages again"
        )
        raise FlightError([problem])
    return found


def _read(folder: Path) -> Provenance:
    path = folder / FILE
    if not path.exists():
        return Provenance(files={}, stages={})
    try:
        said = json.loads(path.read_text(encoding="utf-8"))
        found = Provenance(files=dict(said["files"]), stages=dict(said["stages"]))
    except (ValueError, KeyError, TypeError, RecursionError):
        found = None
    if found is None or not _is_sound(found):
        raise FlightError([f"{path}: not what a run wrote; remove it and run again"])
    return found


def _is_sound(found: Provenance) -> bool:
    """Tell whether all names are below the folder and all values have their types."""
    texts: list[object] = [*found.files.values()]
    for stage in found.stages.values():
        versions = stage.get("versions") if isinstance(stage, dict) else None
        if not isinstance(versions, dict):
            return False
        texts += [stage.get("flight"), *versions.values()]
    return all(isinstance(text, str) for text in texts) and all(map(is_below, found.files))


def _write(folder: Path, provenance: Provenance) -> None:
    said = {"files": dict(provenance.files), "stages": dict(provenance.stages)}
    text = json.dumps(said, indent=2, sort_keys=True, ensure_ascii=False) + "\n"
    with tempfile.TemporaryDirectory(dir=folder, prefix=SCRATCH) as temporary:
        new = Path(temporary) / FILE
        new.write_text(text, encoding="utf-8")
        new.replace(folder / FILE)
