"""Where a command may write: into a folder that is new, empty or its own, one at a time."""

from __future__ import annotations

import contextlib
import shutil
import sqlite3
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path

from acx4files.results.whole_files import SCRATCH, naming
from acx4lib.errors import OutputError

LOCK = ".acx4.lock"
"""Empty file in a folder, locked by the process that writes there."""

WAIT = 60.0
"""Seconds for which a process waits for another one that writes into the same folder."""

SOURCES = (".ci", ".git", "book", "data", "notebooks", "src", "tests")
"""Folders of a working copy that are not to be written into."""

FREE = ("data/flights", "data/reference/files")
"""Folders for the output of make."""


@contextlib.contextmanager
def locked(folder: Path, *, wait: float = WAIT) -> Iterator[None]:
    """Hold the lock of a folder; the system releases it when the process ends, however it ends.

    The file of a lock for which others may wait stays.

    Raises
    ------
    OutputError
        Where another process holds it for longer than `wait`, s.
    """
    with contextlib.closing(sqlite3.connect(folder / LOCK, wait, isolation_level=None)) as lock:
        try:
            lock.execute("PRAGMA journal_mode = MEMORY")  # no further file
            lock.execute("BEGIN EXCLUSIVE")
        except sqlite3.OperationalError as error:
            msg = f"{folder}: another process is writing there; try again later ({error})"
            raise OutputError(msg) from None
        try:
            yield
        finally:
            if not wait:
                with contextlib.suppress(PermissionError):  # of systems that keep open files
                    (folder / LOCK).unlink(missing_ok=True)


@contextlib.contextmanager
def claim(
    folder: str | Path,
    *,
    signs: Sequence[str],
    away_from: Sequence[Path] = (),
    becomes_flight: bool = False,
    wait: float = 0.0,
) -> Iterator[Path]:
    """Make a folder if it does not exist, and lock it for a command.

    Parameters
    ----------
    folder : path
        New, empty, or with one of the files that such a command leaves.
    signs : sequence of str
        Names of these.
    away_from, becomes_flight
        As `check_place` takes them.
    wait : float
        As `locked` takes it.

    Raises
    ------
    OutputError
        Where the folder must not be used, or another process is writing.
    OSError
        Where the folder cannot be made.
    """
    path = Path(folder)
    check_place(path, away_from=away_from, becomes_flight=becomes_flight)
    made = [place for place in (path, *path.parents) if not place.exists()]
    path.mkdir(parents=True, exist_ok=True)
    others = sorted(p.name for p in path.iterdir() if p.name != LOCK and SCRATCH not in p.name)
    if others and not {*others} & {*signs}:
        shown = ", ".join(others[:3]) + (", …" if len(others) > 3 else "")
        msg = f"{path}: holds files that acx4 did not write ({shown}); choose a new or empty folder"
        raise OutputError(msg)
    try:
        with locked(path, wait=wait):
            for stale in path.glob(f"{SCRATCH}*"):  # of a command that was killed
                shutil.rmtree(stale) if stale.is_dir() else stale.unlink()
            yield path
    finally:
        if made and {p.name for p in path.iterdir()} <= {LOCK}:
            (path / LOCK).unlink(missing_ok=True)
            for place in made:
                place.rmdir()


@contextlib.contextmanager
def placed(folder: str | Path) -> Iterator[Path]:
    """Yield a temporary path for a new folder, which takes its place complete, or never.

    Parameters
    ----------
    folder : path
        New or empty. Files made beside the temporary folder are moved beside this one.
    """
    path = Path(folder).resolve()
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=path.parent, prefix=SCRATCH) as temporary:
        draft = Path(temporary) / path.name
        with naming(path, draft.parent):
            yield draft
        beside = [other for other in draft.parent.iterdir() if other != draft]
        if path.exists():
            path.rmdir()
        for child in (*beside, draft):
            child.replace(path.with_name(child.name))


def check_new(folder: str | Path) -> None:
    """Check that a new folder may be made: its path is free or empty, and allowed; OutputError."""
    path = Path(folder)
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        raise OutputError(f"{path}: exists already; choose another name")
    check_place(path)


def check_place(
    path: Path, *, away_from: Sequence[Path] = (), becomes_flight: bool = False
) -> None:
    """Check that a folder may be written at a path, whatever its content.

    Parameters
    ----------
    path : Path
    away_from : sequence of Path
        Flights, which must not lie in it.
    becomes_flight : bool
        Whether it may itself be a flight.

    Raises
    ------
    OutputError
        Where it is no folder, in the way of a flight, or among the project's sources.
    """
    if path.exists() and not path.is_dir():
        raise OutputError(f"{path}: is no folder; choose another name")
    whole = path.resolve()
    flight = _flight_around(whole.parent if becomes_flight else whole)
    if flight is not None:
        raise OutputError(f"{path}: lies in the flight {flight}; choose a folder outside")
    for flight in away_from:
        if flight.resolve().is_relative_to(whole):
            raise OutputError(f"{path}: holds the flight {flight}; choose a folder beside it")
    root = working_copy()
    if root is None or any(whole.is_relative_to(root / n) and whole != root / n for n in FREE):
        return
    if root.is_relative_to(whole) or any(whole.is_relative_to(root / name) for name in SOURCES):
        raise OutputError(f"{path}: is among the project's own files; choose a folder outside")


def check_file(file: str | Path, *, mark: bytes, what: str) -> None:
    """Check that a single file may be written: it is new, or marked by its command.

    Parameters
    ----------
    file : path
    mark : bytes
        Stands in the first 4096 bytes of every such file.
    what : str
        What the file is, such as "a report of acx4".

    Raises
    ------
    OutputError
    """
    path = Path(file)
    flight = _flight_around(path.resolve())
    if path.is_dir():
        raise OutputError(f"{path}: is a folder, not a file")
    if path.exists() and not (path.is_file() and mark in path.read_bytes()[:4096]):
        raise OutputError(f"{path}: is there and is not {what}; choose another name")
    if flight is not None:
        raise OutputError(f"{path}: lies in the flight {flight}; choose a place outside")


def working_copy() -> Path | None:
    """Return the root of the working copy with this module; None if it is installed."""
    root = Path(__file__).resolve().parents[3]
    return root if (root / "pyproject.toml").is_file() else None


def _flight_around(whole: Path) -> Path | None:
    """Return the folder of the flight at or above a path; None outside of flights."""
    return next((p for p in (whole, *whole.parents) if (p / "flight.toml").is_file()), None)
