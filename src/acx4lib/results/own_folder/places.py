"""Where a command may write: into no flight, not among the project's files, through no link."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from acx4lib.errors import OutputError
from acx4lib.results.own_folder.marks import bears

SOURCES = (".ci", ".git", "book", "data", "notebooks", "src", "tests")
"""Folders of a working copy that are not to be written into."""

PACKAGES = ("acx4lib", "acx4sim", "acx4book")
"""Folders of an installed library that are not to be written into."""

FREE = ("data/flights", "data/reference/files")
"""Folders below which make puts what it makes."""


def check_new(folder: str | Path) -> None:
    """Check that a folder may be made: it is not there or empty, and in nobody's way.

    Raises
    ------
    OutputError
    """
    path = Path(folder)
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        msg = f"{path}: exists already; choose another name"
        raise OutputError(msg)
    check_place(path)


def check_place(
    path: Path, *, away_from: Sequence[Path] = (), becomes_flight: bool = False
) -> None:
    """Check that a folder may be written at a place, whatever is in it.

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
        Where it is a link or no folder, in the way of a flight, or among the project's sources.
    """
    if path.is_symlink():
        msg = f"{path}: is a link; name the folder itself"
        raise OutputError(msg)
    if path.exists() and not path.is_dir():
        msg = f"{path}: is no folder; choose another name"
        raise OutputError(msg)
    whole = path.resolve()
    flight = _flight_around(whole.parent if becomes_flight else whole)
    if flight is not None:
        msg = f"{path}: lies in the flight {flight}; choose a folder outside"
        raise OutputError(msg)
    for flight in away_from:
        if flight.resolve().is_relative_to(whole):
            msg = f"{path}: holds the flight {flight}; choose a folder beside it"
            raise OutputError(msg)
    source = _source(whole)
    if source is not None:
        msg = f"{path}: is among the project's own files, {source}; choose a folder outside"
        raise OutputError(msg)


def check_file(file: str | Path, *, mark: bytes, what: str) -> None:
    """Check that a single file may be written: it is new, or bears the mark of its command.

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
    says = ""
    if path.is_symlink():
        says = "is a link; name the file itself"
    elif path.is_dir():
        says = "is a folder, not a file"
    elif path.exists() and not (path.is_file() and bears(path, mark)):
        says = f"is there and is not {what}; choose another name"
    elif flight is not None:
        says = f"lies in the flight {flight}; choose a place outside"
    if says:
        msg = f"{path}: {says}"
        raise OutputError(msg)


def working_copy() -> Path | None:
    """Return the top of the working copy that this module lies in; None where it is installed."""
    root = Path(__file__).resolve().parents[4]
    return root if (root / "pyproject.toml").is_file() else None


def _flight_around(whole: Path) -> Path | None:
    """Return the flight that a place is or lies in."""
    return next((p for p in (whole, *whole.parents) if (p / "flight.toml").is_file()), None)


def _source(whole: Path) -> Path | None:
    """Return the part of the working copy or of the installed library that a place lies in."""
    root = working_copy()
    if root is None:
        installed = [Path(__file__).resolve().parents[3] / name for name in PACKAGES]
        return next((package for package in installed if whole.is_relative_to(package)), None)
    if root.is_relative_to(whole):
        return root
    if any(whole.is_relative_to(root / name) and whole != root / name for name in FREE):
        return None
    return next((root / n for n in SOURCES if whole.is_relative_to(root / n)), None)
