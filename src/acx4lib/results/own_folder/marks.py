"""The mark of a folder: which command filled it, and with which files.

Every file is listed with its size and checksum, so that what was changed or cut later can be named.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from acx4lib.errors import OutputError
from acx4lib.opening import opened, text_of
from acx4lib.results.own_folder.whole_files import write

MARK = ".acx4.json"
"""The file of the mark."""

FORMAT = 1
"""Of the mark, and so of what commands leave in a folder."""


@dataclass(frozen=True, kw_only=True)
class Written:
    """A file that a command wrote.

    Attributes
    ----------
    size : int or None
        Bytes.
    sha256 : str or None
        None where it may change, or is not looked at.
    """

    size: int | None = None
    sha256: str | None = None


def written(path: Path) -> Written:
    """Return size and checksum of a file."""
    with opened(path) as file:
        try:
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()
        except OSError as error:  # of a damaged disk; the system does not name the file
            raise OSError(error.errno, error.strerror, str(path)) from None
        return Written(size=os.fstat(file.fileno()).st_size, sha256=sha256)


def read_mark(folder: Path) -> tuple[str, dict[str, Written]]:
    """Return whose a folder is, empty where nobody's, and what was written there.

    Raises
    ------
    OutputError
        Where the mark is damaged, or of another version.
    """
    path = folder / MARK
    if path.is_symlink() or not path.is_file():
        return "", {}
    try:
        said = json.loads(text_of(path))
        files = {str(name): _entry(entry) for name, entry in dict(said["files"]).items()}
        whose, form = said["made_by"], said.get("format")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
        whose, form, files = None, None, {}
    if not isinstance(whose, str) or not all(map(is_below, files)):
        msg = f"{path}: is damaged; remove it to read what is there, or choose another folder"
        raise OutputError(msg)
    if form != FORMAT:
        msg = f"{path}: has format {form!r}, not {FORMAT}; it is of another version of acx4"
        raise OutputError(msg)
    return whose, files


def write_mark(folder: Path, command: str, files: Mapping[str, Written]) -> None:
    """Mark a folder, whole or not at all.

    Parameters
    ----------
    folder : Path
    command : str
        Whose it is, such as ``acx4 run``.
    files : mapping of str to Written
        By names below the folder.
    """
    listed = {
        name: {"bytes": files[name].size, "sha256": files[name].sha256} for name in sorted(files)
    }
    said = {"made_by": command, "format": FORMAT, "files": listed}
    text = json.dumps(said, indent=1, ensure_ascii=False) + "\n"
    write(folder / MARK, text.encode("utf-8", "surrogateescape"))


def mark_all(folder: Path, command: str) -> None:
    """Mark a folder all of whose files were written by one command."""
    paths = sorted(path for path in folder.rglob("*") if path.is_file())
    listed = {path.relative_to(folder).as_posix(): written(path) for path in paths}
    write_mark(folder, command, {name: one for name, one in listed.items() if name != MARK})


def changes(folder: Path, names: Iterable[str] | None = None) -> list[str]:
    """Return what differs from what a command wrote into a folder, a line for each file.

    Parameters
    ----------
    folder : Path
        Where it bears no mark nothing is known, and nothing said.
    names : iterable of str, optional
        Look at these only.
    """
    whose, files = read_mark(folder)
    looked_at = files.keys() if names is None else [name for name in names if name in files]
    said = ((folder / name, _difference(folder / name, files[name])) for name in looked_at)
    return [f"{path}: {says.format(whose)}" for path, says in said if says]


def bears(path: Path, mark: bytes) -> bool:
    """Tell whether a mark stands in the first 4096 bytes of a file."""
    with opened(path) as file:
        return mark in file.read(4096)


def _difference(path: Path, before: Written) -> str:
    if before.sha256 is None:
        return ""
    if not path.is_file():
        return "is gone since {} wrote it"
    now = written(path)
    if now.sha256 == before.sha256:
        return ""
    if before.size is not None and now.size is not None and now.size < before.size:
        return f"was cut or changed since {{}} wrote it, {now.size} of {before.size} bytes"
    return "was changed since {} wrote it"


def _entry(entry: Mapping[str, object]) -> Written:
    size, sha256 = entry["bytes"], entry["sha256"]
    if not isinstance(size, int | None) or not isinstance(sha256, str | None):
        raise TypeError
    return Written(size=size, sha256=sha256)


def is_below(name: str) -> bool:
    """Tell whether the name of a file stays inside its folder."""
    parts = PurePosixPath(name).parts
    return bool(parts) and not name.startswith("/") and ".." not in parts and "\0" not in name
