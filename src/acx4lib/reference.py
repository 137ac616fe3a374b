"""Other people's measurements: what they are, where they lie, and how to get them.

They are never part of the repository; `data/reference/index.csv` says of every file in which
public repository, at which commit and path it is found, its SHA-256 and its licence.
"""

from __future__ import annotations

import csv
import hashlib
import logging
import os
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from acx4lib._data import data_path
from acx4lib.errors import Acx4Error

BASE_URL = "https://raw.githubusercontent.com"
"""Files are read from ``{base}/{repository}/{commit}/{path}``."""

HINT = "run `make reference-data`, or let ACX4_REFERENCE_DATA name a folder that has it"


class ReferenceDataError(Acx4Error):
    """A reference file is missing, or is not the file that the index describes."""


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One row of the index.

    Attributes
    ----------
    file : str
        Below the folder of the reference data, such as ``nist-strd/BoxBOD.dat``.
    repository, commit, path : str
        Where it comes from; empty where it cannot be fetched.
    sha256, licence : str
    note : str
        How it was made, where it is not the file at `path` itself.
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
    with data_path("reference", "index.csv").open(encoding="utf-8", newline="") as rows:
        return tuple(Entry(**row) for row in csv.DictReader(rows))


def folder() -> Path:
    """Return the folder of the reference data: ACX4_REFERENCE_DATA, or the repository's own."""
    given = os.environ.get("ACX4_REFERENCE_DATA", "")
    return Path(given) if given else data_path("reference", "index.csv").parent / "files"


def is_here(name: str) -> bool:
    """Tell whether all files of a set, such as ``nist-strd``, are in the folder."""
    files = [entry.file for entry in index() if entry.file.startswith(f"{name}/")]
    return bool(files) and all((folder() / file).is_file() for file in files)


def path(file: str) -> Path:
    """Return the path of a reference file.

    Parameters
    ----------
    file : str
        As the index names it.

    Returns
    -------
    Path

    Raises
    ------
    ReferenceDataError
        Where it is missing, or not the file that the index describes.
    ValueError
        Where the index has no such file.
    """
    entry = next((entry for entry in index() if entry.file == file), None)
    if entry is None:
        msg = f"the index of reference data has no file {file!r}"
        raise ValueError(msg)
    found = folder() / file
    if not found.is_file():
        msg = f"{file} is missing in {folder()}: {HINT}"
        raise ReferenceDataError(msg)
    if _sha256(found) != entry.sha256:
        msg = f"{found} is not the file that was indexed (SHA-256): delete it, and {HINT}"
        raise ReferenceDataError(msg)
    return found


def _sha256(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()


# --- fetching --------------------------------------------------------------------------------


def fetch(*, base: str = BASE_URL) -> Iterator[str]:
    """Bring all files that are not in the folder yet.

    Needs the network and pooch.

    Parameters
    ----------
    base : str
        Address of a server that has the repositories.

    Yields
    ------
    str
        What was done, one line a file; a line with ``cannot`` for what was not.
    """
    for entry in index():
        target = folder() / entry.file
        if target.is_file() and _sha256(target) == entry.sha256:
            yield f"{entry.file} is here"
        elif not entry.repository:
            yield f"cannot fetch {entry.file}: {entry.note}"
        else:
            target.parent.mkdir(parents=True, exist_ok=True)
            try:
                _bring(entry, target, base)
            except (OSError, ValueError) as error:
                yield f"cannot fetch {entry.file}: {' '.join(str(error).split())}"
            else:
                yield f"{entry.file} from {entry.repository} ({entry.licence})"


def _bring(entry: Entry, target: Path, base: str) -> None:
    url = f"{base}/{entry.repository}/{entry.commit}/{entry.path}"
    select = _SELECTIONS.get(entry.file)
    if select is None:
        _retrieve(url, target, f"sha256:{entry.sha256}")
        return
    with tempfile.TemporaryDirectory() as temporary:
        source = Path(temporary) / "source"
        _retrieve(url, source, None)
        content = "".join(f"{line}\n" for line in select(_lines(source))).encode()
    if hashlib.sha256(content).hexdigest() != entry.sha256:
        msg = f"what was selected from {url} is not the file that was indexed (SHA-256)"
        raise ValueError(msg)
    target.write_bytes(content)


def _retrieve(url: str, target: Path, known_hash: str | None) -> None:
    import pooch  # type: ignore[import-untyped]  # noqa: PLC0415 (an extra of few users)

    pooch.get_logger().setLevel(logging.WARNING)
    pooch.retrieve(url, known_hash=known_hash, fname=target.name, path=target.parent)


def _lines(file: Path) -> list[str]:
    return [" ".join(line.split()) for line in file.read_text(encoding="utf-8").splitlines()]


def _first_words(file: str) -> set[str]:
    return {line.split()[0] for line in _lines(folder() / file) if line}


def _select_measurements(rows: list[str]) -> list[str]:
    """Return the rows of the seven images, of points seen twice in them that have coordinates."""
    images = _first_words("ign-uce-m3/images.OPK")
    points = _first_words("ign-uce-m3/tie_points_world.mes")
    return [row for row in rows if row.split()[1] in images and row.split()[0] in points]


_SELECTIONS: dict[str, Callable[[list[str]], list[str]]] = {}
"""How a file is made of its source, where it is not the source itself."""


def main() -> int:
    """Fetch the reference data; the exit status is 1 where a file could not be had."""
    failed = False
    for line in fetch():
        cannot = line.startswith("cannot")
        failed = failed or cannot
        (sys.stderr if cannot else sys.stdout).write(f"{line}\n")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
