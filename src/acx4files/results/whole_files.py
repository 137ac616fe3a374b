"""Files written whole or not at all, and allowed file names."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import re
import secrets
import shutil
import stat
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

from acx4files.opening import opened
from acx4lib import system
from acx4lib.errors import OutputError

# --- Files that appear whole or not at all; all lasting output is written here
#
# A file is written beside its place under another name, and takes the place when it is complete.
# If this fails, the old file stays.


SCRATCH = ".acx4-new-"
"""Beginning of the names of unfinished files; a killed command leaves such files behind."""

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Errors of a full disk, of a quota that is used up, and of the largest size of a file."""

_SUFFIX = 16
"""Longest suffix of a file that its draft keeps, for code that depends on the suffix."""


class Drafts:
    """Unfinished files, each with the path that it will take."""

    def __init__(self) -> None:
        self._at: dict[Path, Path] = {}

    @contextlib.contextmanager
    def path(self, place: Path) -> Iterator[Path]:
        """Yield the path of a new empty file that will replace a file.

        Raises
        ------
        OutputError
            Where there is no space for it: its name, and how much it needs.
        OSError
            With its name, where it cannot be written.
        """
        draft = _empty(place)
        self._at[draft] = place
        with naming(place, draft):
            yield draft

    @contextlib.contextmanager
    def open(self, place: Path, *, size: int | None = None) -> Iterator[BinaryIO]:
        """Yield an open new file that will replace a file.

        Parameters
        ----------
        place : Path
        size : int, optional
            Bytes that it will have, for the message where there is no space for them.

        Raises
        ------
        OutputError, OSError
            As `path`.
        """
        with self.path(place) as draft, naming(place, draft, size=size), draft.open("wb") as file:
            yield file

    def place(self) -> None:
        """Move all files to their final paths."""
        for draft, place in list(self._at.items()):
            with naming(place, draft):
                draft.replace(place)
            del self._at[draft]

    def remove(self) -> None:
        """Remove the files not yet moved to their final paths."""
        for draft in self._at:
            draft.unlink(missing_ok=True)


@contextlib.contextmanager
def together() -> Iterator[Drafts]:
    """Yield drafts that are moved to their final paths together if no error occurs."""
    drafts = Drafts()
    try:
        yield drafts
        drafts.place()
    finally:
        drafts.remove()


@contextlib.contextmanager
def appearing(place: Path) -> Iterator[Path]:
    """Yield the path of a new file, which is moved to its place if no error occurs.

    Raises
    ------
    OutputError, OSError
        As `Drafts.path`.
    """
    with together() as drafts, drafts.path(place) as draft:
        yield draft


@contextlib.contextmanager
def opened_new(place: Path) -> Iterator[BinaryIO]:
    """Yield an open new file, which is moved to its place if no error occurs."""
    with together() as drafts, drafts.open(place) as file:
        yield file


def write(place: Path, content: str | bytes) -> None:
    """Write a file.

    Parameters
    ----------
    place : Path
    content : str or bytes
        Text is written as UTF-8, with the ends of lines that it has.

    Raises
    ------
    OutputError, OSError
        As `Drafts.path`.
    """
    write_all({place: content})


def write_all(contents: Mapping[Path, str | bytes]) -> None:
    """Write files, all of them or none; as `write`."""
    with together() as drafts:
        for place, content in contents.items():
            encoded = content.encode() if isinstance(content, str) else content
            with drafts.open(place, size=len(encoded)) as file:
                file.write(encoded)


def copy(source: Path, place: Path) -> None:
    """Write a copy of a regular file; OutputError and OSError as `Drafts.path`."""
    with opened(source) as old, together() as drafts:
        new = drafts.open(place, size=os.fstat(old.fileno()).st_size)
        with new as file:
            shutil.copyfileobj(old, file, 2**20)


def link(source: Path, place: Path) -> None:
    """Give a file a second name; where the file system cannot, write a copy."""
    draft = place.with_name(_name(place))
    try:
        os.link(source.resolve(), draft)
        draft.replace(place)
    except OSError:
        copy(source, place)
    finally:
        draft.unlink(missing_ok=True)  # a link that replaces one to the same file stays


@contextlib.contextmanager
def naming(place: Path, draft: Path | None = None, *, size: int | None = None) -> Iterator[None]:
    """Name the final file, not its draft, in errors, and the space needed on a full disk.

    Parameters
    ----------
    place : Path
        Final path of the file or folder.
    draft : Path, optional
        Its path so far.
    size : int, optional
        Bytes that it will have; by default, more than it has so far.

    Raises
    ------
    OutputError, OSError
    """
    try:
        yield
    except OSError as error:
        number = _reason(draft) if error.errno is None and draft else error.errno
        if number in _FULL:
            raise OutputError(_no_space(number, place, draft, size)) from None
        if draft is not None and error.filename == str(draft):
            raise type(error)(error.errno, error.strerror, str(place)) from None
        raise


def _reason(draft: Path) -> int | None:
    """Return the error number of a failed write; numpy does not report it."""
    try:
        with draft.open("ab") as file:
            file.write(bytes(2**16))
    except OSError as error:
        return error.errno
    return None


def _no_space(number: int, place: Path, draft: Path | None, size: int | None) -> str:
    """Return the message on a file without enough space on the disk."""
    written = _size(draft) if draft else 0
    needs = f"more than {_bytes(written)}" if size is None else _bytes(size)
    free = ""
    if number == errno.ENOSPC:
        with contextlib.suppress(OSError):
            free_bytes = shutil.disk_usage(place.parent).free
            free = f", {_bytes(written + free_bytes)} are free"
    return f"{place}: {os.strerror(number)}; it needs {needs}{free}"


def _size(path: Path) -> int:
    """Return the size of a file, or of all files in a folder, bytes; 0 if missing."""
    try:
        if path.is_dir():
            return sum(file.lstat().st_size for file in path.rglob("*"))
        return path.stat().st_size
    except OSError:
        return 0


def _bytes(n: int) -> str:
    for unit, factor in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if n >= factor:
            return f"{n / factor:.3g} {unit}"
    return f"{n} bytes"


def _name(place: Path) -> str:
    suffix = place.suffix if len(place.suffix) <= _SUFFIX else ""
    return f"{SCRATCH}{secrets.token_hex(8)}{suffix}"


def _empty(place: Path) -> Path:
    """Make a new empty file beside a file, with the permissions of an existing file."""
    draft = place.with_name(_name(place))
    with naming(place, draft):
        number = os.open(
            draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL | system.flags("O_NOFOLLOW"), 0o666
        )
    with contextlib.closing(os.fdopen(number, "wb")):
        before = place.stat(follow_symlinks=False) if place.exists() else None
        if before is not None and stat.S_ISREG(before.st_mode):
            with contextlib.suppress(PermissionError):  # of file systems without permissions
                system.set_mode(number, draft, stat.S_IMODE(before.st_mode))
    return draft


# --- File names made from names that may have any characters


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
