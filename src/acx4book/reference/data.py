"""Measurements of other people: their index, their folder, and how to fetch them.

They are no part of the repository, but for the thinned flight of `four_heads`. For every file
`data/reference/index.csv` has the public repository, the commit, the path, the SHA-256 and the
licence.
"""

from __future__ import annotations

import csv
import hashlib
import logging
import os
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from acx4files.results import whole_files
from acx4files.results.whole_files import working_copy
from acx4lib.errors import Acx4Error

FOLDER = Path(str(resources.files("acx4book.reference") / "measurements")).resolve()
"""Folder of the index, of stored results, and, in a working copy, of the files themselves."""

BASE_URL = "https://raw.githubusercontent.com"
"""Files are fetched from ``{base}/{repository}/{commit}/{path}``."""

TIE_POINTS = ("ign-uce-m3/tie_points.mes", "ign-uce-m3/tie_points_world.mes")
"""Selections from files of a whole flight; they are made when the files are fetched."""

VARIABLE = "ACX4_REFERENCE_DATA"
"""Environment variable with the path of a folder that has the files."""

HINT = f"run `make reference-data`, or let {VARIABLE} name a folder that has it"


class ReferenceDataError(Acx4Error):
    """A reference file is missing, or is not the file that the index describes."""


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One row of the index.

    Attributes
    ----------
    file : str
        Path below the folder of the reference data, such as ``nist-strd/BoxBOD.dat``.
    repository, commit, path : str
        Its origin; empty if it cannot be fetched.
    sha256, licence : str
    note : str
        How it was made, if it is not the file at `path` itself.
    """

    file: str
    repository: str
    commit: str
    path: str
    sha256: str
    licence: str
    note: str


def index() -> tuple[Entry, ...]:
    """Return all rows of the index."""
    with (FOLDER / "index.csv").open(encoding="utf-8", newline="") as rows:
        return tuple(Entry(**row) for row in csv.DictReader(rows))


def folder() -> Path:
    """Return the folder of the reference data: ACX4_REFERENCE_DATA or that of the working copy."""
    given = os.environ.get(VARIABLE, "")
    return Path(given) if given else FOLDER / "files"


@contextmanager
def at(place: str) -> Iterator[None]:
    """Set ACX4_REFERENCE_DATA for the duration of a context; an empty path changes nothing."""
    before = os.environ.get(VARIABLE)
    if place:
        os.environ[VARIABLE] = place
    try:
        yield
    finally:
        if before is None:
            os.environ.pop(VARIABLE, None)
        else:
            os.environ[VARIABLE] = before


def is_here(name: str) -> bool:
    """Tell whether all files of a set, such as ``nist-strd``, are in the folder."""
    files = [entry.file for entry in index() if entry.file.startswith(f"{name}/")]
    return bool(files) and all((folder() / file).is_file() for file in files)


def path(file: str) -> Path:
    """Return the path of a reference file.

    Parameters
    ----------
    file : str
        Its name in the index.

    Raises
    ------
    ReferenceDataError
        Where the file is missing, or is not the indexed one.
    ValueError
        Where the index has no such file.
    """
    entry = next((entry for entry in index() if entry.file == file), None)
    if entry is None:
        msg = f"the index of reference data has no file {file!r}"
        raise ValueError(msg)
    stored = folder() / file
    if not stored.is_file():
        msg = f"{file} is missing in {folder()}: {HINT}"
        raise ReferenceDataError(msg)
    if _sha256(stored) != entry.sha256:
        msg = f"{stored} is not the file that was indexed (SHA-256): delete it, and {HINT}"
        raise ReferenceDataError(msg)
    return stored


def _sha256(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


# --- fetching --------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Fetched:
    """The outcome of fetching one file.

    Attributes
    ----------
    is_here : bool
    text : str
        One line.
    """

    is_here: bool
    text: str


def fetch(*, base: str = BASE_URL) -> Iterator[Fetched]:
    """Fetch all files that are not in the folder yet.

    It needs the network and pooch.

    Parameters
    ----------
    base : str
        Address of a server with the repositories.

    Yields
    ------
    Fetched
        One outcome per file.
    """
    for entry in index():
        target = folder() / entry.file
        if target.is_file() and _sha256(target) == entry.sha256:
            yield Fetched(is_here=True, text=f"{entry.file} is here")
        elif not entry.repository:
            yield Fetched(is_here=False, text=f"{entry.file} cannot be fetched: {entry.note}")
        else:
            yield _fetched(entry, target, base)


def _fetched(entry: Entry, target: Path, base: str) -> Fetched:
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        _bring(entry, target, base)
    except (OSError, ValueError) as error:
        reason = " ".join(str(error).split())
        return Fetched(is_here=False, text=f"{entry.file} cannot be fetched: {reason}")
    text = f"{entry.file} from {entry.repository} ({entry.licence})"
    return Fetched(is_here=True, text=text)


def _bring(entry: Entry, target: Path, base: str) -> None:
    if entry.file not in TIE_POINTS:
        _retrieve(_url(entry, base), target, f"sha256:{entry.sha256}")
        return
    content = "".join(f"{row}\n" for row in _selected(entry.file, base)).encode()
    if hashlib.sha256(content).hexdigest() != entry.sha256:
        msg = f"what was selected from {entry.path} is not the file that was indexed (SHA-256)"
        raise ValueError(msg)
    whole_files.write(target, content)


def _selected(file: str, base: str) -> list[str]:
    """Return the rows of a tie point file for points in at least two of the seven images."""
    with tempfile.TemporaryDirectory() as temporary:
        rows = {}
        for entry in (entry for entry in index() if entry.file in TIE_POINTS):
            source = Path(temporary) / Path(entry.file).name
            _retrieve(_url(entry, base), source, None)
            rows[entry.file] = _rows(source)
    images = {row.split()[0] for row in _rows(folder() / "ign-uce-m3/images.OPK")}
    measured, located = (rows[name] for name in TIE_POINTS)
    measured = [row for row in measured if row.split()[1] in images]
    rays = Counter(row.split()[0] for row in measured)
    points = {point for point in (row.split()[0] for row in located) if rays[point] >= 2}
    return [row for row in (measured, located)[TIE_POINTS.index(file)] if row.split()[0] in points]


def _rows(file: Path) -> list[str]:
    """Return the lines of a text file that are not empty, with single spaces."""
    lines = (" ".join(line.split()) for line in file.read_text(encoding="utf-8").splitlines())
    return [line for line in lines if line]


def _url(entry: Entry, base: str) -> str:
    return f"{base}/{entry.repository}/{entry.commit}/{entry.path}"


def _retrieve(url: str, target: Path, known_hash: str | None) -> None:
    import pooch  # type: ignore[import-untyped]  # noqa: PLC0415 (an extra of few users)

    pooch.get_logger().setLevel(logging.WARNING)
    pooch.retrieve(url, known_hash=known_hash, fname=target.name, path=target.parent)


def _main() -> int:
    """Fetch the reference data; the exit status is 1 if a file could not be fetched."""
    if working_copy() is None and not os.environ.get(VARIABLE):
        sys.stderr.write(f"let {VARIABLE} name a folder for the files: this is no working copy\n")
        return 2
    status = 0
    for fetched in fetch():
        (sys.stdout if fetched.is_here else sys.stderr).write(f"{fetched.text}\n")
        status = status if fetched.is_here else 1
    return status


if __name__ == "__main__":
    sys.exit(_main())
