"""Files written whole or not at all, folders of one command, and allowed file names.

A file is written beside its place under another name, and takes the place when it is complete. If
this fails, the old file stays. A command writes into a folder that is new, empty or its own, and
one command at a time.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import re
import secrets
import shutil
import sqlite3
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path

from acx4lib.errors import OutputError

SCRATCH = ".acx4-new-"
"""Beginning of the names of unfinished files; a killed command leaves such files behind."""

LOCK = ".acx4.lock"
"""Empty file in a folder, locked by the process that writes there."""

WAIT = 60.0
"""Seconds for which a process waits for another one that writes into the same folder."""

_FULL = (errno.ENOSPC, getattr(errno, "EDQUOT", None), errno.EFBIG)
"""Errors of a full disk, of a quota that is used up, and of the largest size of a file."""


# --- files -----------------------------------------------------------------------------------


@contextlib.contextmanager
def together() -> Iterator[Callable[[Path], Path]]:
    """Yield a function that returns the path of a new file for a place.

    All new files take their places if no error occurs, in the order in which they were begun.

    Raises
    ------
    OutputError
        Where there is no space for one of them.
    OSError
        With its place, where it cannot be written.
    """
    drafts: dict[Path, Path] = {}

    def begin(place: Path) -> Path:
        # the suffix stays, since code may depend on it
        draft = place.with_name(f"{SCRATCH}{secrets.token_hex(8)}{place.suffix[:16]}")
        drafts[draft] = place
        return draft

    try:
        yield begin
        for draft, place in drafts.items():
            draft.replace(place)
    except OSError as error:
        for draft, place in reversed(drafts.items()):  # an error without a name is the last one's
            if error.filename in (None, str(draft)):
                with naming(place, draft):
                    raise
        raise
    finally:
        for draft in drafts:
            draft.unlink(missing_ok=True)


@contextlib.contextmanager
def naming(place: Path, draft: Path | None = None) -> Iterator[None]:
    """Name the final file, not its draft, in errors of the system; OutputError of a full disk."""
    try:
        yield
    except OSError as error:
        if error.errno in _FULL or error.errno is None:  # as numpy ends where there is no space
            free = shutil.disk_usage(place.parent).free
            msg = f"{place}: {error.strerror or 'No space'}; {free / 1e6:.3g} MB are free"
            raise OutputError(msg) from None
        if draft is not None and error.filename == str(draft):
            raise type(error)(error.errno, error.strerror, str(place)) from None
        raise


@contextlib.contextmanager
def appearing(place: Path) -> Iterator[Path]:
    """Yield the path for a new file, moved to its place if no error occurs; as `together`."""
    with together() as new:
        yield new(place)


def write(place: Path, content: str | bytes) -> None:
    """Write a file, text as UTF-8 with the ends of lines that it has; raises as `together`."""
    write_all({place: content})


def write_all(contents: Mapping[Path, str | bytes]) -> None:
    """Write files, all of them or none; as `write`."""
    with together() as new:
        for place, content in contents.items():
            new(place).write_bytes(content.encode() if isinstance(content, str) else content)


def copy(source: Path, place: Path) -> None:
    """Write a copy of a file; raises as `together`."""
    with appearing(place) as draft:
        shutil.copyfile(source, draft)


def link(source: Path, place: Path) -> None:
    """Give a file a second name; where the file system cannot, write a copy."""
    with appearing(place) as draft:
        try:
            os.link(source.resolve(), draft)
        except OSError:
            shutil.copyfile(source, draft)


# --- folders ---------------------------------------------------------------------------------


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
    folder: str | Path, *, signs: Sequence[str], besides: Sequence[str] = (), wait: float = 0.0
) -> Iterator[Path]:
    """Make a folder if it does not exist, and lock it for a command.

    Parameters
    ----------
    folder : path
        New, empty, or with one of the files that such a command leaves.
    signs : sequence of str
        Names of these.
    besides : sequence of str
        Names of what may be there before them.
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
    if path.exists() and not path.is_dir():
        raise OutputError(f"{path}: is no folder; choose another name")
    path.mkdir(parents=True, exist_ok=True)
    names = {p.name for p in path.iterdir() if SCRATCH not in p.name}
    others = sorted(names - {LOCK, *besides})
    if others and not names & {*signs}:
        shown = ", ".join(others[:3]) + (", …" if len(others) > 3 else "")
        msg = f"{path}: holds files that acx4 did not write ({shown}); choose a new or empty folder"
        raise OutputError(msg)
    with locked(path, wait=wait):
        for stale in path.glob(f"{SCRATCH}*"):  # of a command that was killed
            shutil.rmtree(stale) if stale.is_dir() else stale.unlink()
        yield path


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
    """Check that a new folder may be made: its path is free or empty; OutputError."""
    path = Path(folder)
    if path.exists() and not (path.is_dir() and not any(path.iterdir())):
        raise OutputError(f"{path}: exists already; choose another name")


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
    if path.is_dir():
        raise OutputError(f"{path}: is a folder, not a file")
    if path.exists() and not (path.is_file() and mark in path.read_bytes()[:4096]):
        raise OutputError(f"{path}: is there and is not {what}; choose another name")


def working_copy() -> Path | None:
    """Return the root of the working copy with this module; None if it is installed."""
    root = Path(__file__).resolve().parents[3]
    return root if (root / "pyproject.toml").is_file() else None


# --- names -----------------------------------------------------------------------------------


FORBIDDEN = re.compile(
    r"[^\w .+=@,()-]|^[. ]|[. ]$|^(?=(?:con|prn|aux|nul|com\d|lpt\d)$).", re.IGNORECASE
)
"""Not allowed in a file name by some system: some signs, and CON, PRN, AUX, NUL, COM1, LPT1."""

LONGEST_FILE = 200
"""Largest number of bytes of a file stem; systems allow 255 with what is added to it."""


def file_stem(name: str) -> str:
    """Return the stem of a file name for a name; different names have different stems."""

    def quoted(match: re.Match[str]) -> str:
        return "".join(f"%{byte:02X}" for byte in match[0].encode())

    stem = FORBIDDEN.sub(quoted, name)
    if len(stem.encode()) <= LONGEST_FILE:
        return stem
    digest = hashlib.sha256(name.encode()).hexdigest()
    return f"{stem.encode()[: LONGEST_FILE - 17].decode(errors='ignore')}~{digest[:16]}"
