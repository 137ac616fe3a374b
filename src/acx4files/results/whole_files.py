"""Files written whole or not at all, and allowed file names.

A file is written beside its place under another name, and takes the place when it is complete. If
this fails, the old file stays.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import re
import secrets
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import BinaryIO

from acx4lib.errors import OutputError

SCRATCH = ".acx4-new-"
"""Beginning of the names of unfinished files; a killed command leaves such files behind."""

_FULL = (errno.ENOSPC, getattr(errno, "EDQUOT", None), errno.EFBIG)
"""Errors of a full disk, of a quota that is used up, and of the largest size of a file."""


class Drafts:
    """Unfinished files, each with the path that it will take."""

    def __init__(self) -> None:
        self._pairs: list[tuple[Path, Path]] = []

    @contextlib.contextmanager
    def path(self, place: Path) -> Iterator[Path]:
        """Yield a path beside a file, for the file that will replace it.

        Raises
        ------
        OutputError
            Where there is no space for it.
        OSError
            With its name, where it cannot be written.
        """
        draft = _beside(place)
        self._pairs.append((draft, place))
        with naming(place, draft):
            yield draft

    @contextlib.contextmanager
    def open(self, place: Path) -> Iterator[BinaryIO]:
        """Yield an open new file that will replace a file; raises as `path`."""
        with self.path(place) as draft, draft.open("wb") as file:
            yield file

    def write(self, place: Path, content: bytes) -> None:
        """Write a file that will replace a file; raises as `path`."""
        with self.open(place) as file:
            file.write(content)

    def place(self) -> None:
        """Move all files to their final paths, in the order in which they were begun."""
        for draft, place in self._pairs:
            with naming(place, draft):
                draft.replace(place)

    def remove(self) -> None:
        """Remove the files not moved to their final paths."""
        for draft, _ in self._pairs:
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
    """Yield the path for a new file, moved to its place if no error occurs; as `Drafts.path`."""
    with together() as drafts, drafts.path(place) as draft:
        yield draft


def write(place: Path, content: str | bytes) -> None:
    """Write a file, text as UTF-8 with the ends of lines that it has; raises as `Drafts.path`."""
    write_all({place: content})


def write_all(contents: Mapping[Path, str | bytes]) -> None:
    """Write files, all of them or none; as `write`."""
    with together() as drafts:
        for place, content in contents.items():
            drafts.write(place, content.encode() if isinstance(content, str) else content)


def copy(source: Path, place: Path) -> None:
    """Write a copy of a file; raises as `Drafts.path`."""
    with appearing(place) as draft:
        shutil.copyfile(source, draft)


def link(source: Path, place: Path) -> None:
    """Give a file a second name; where the file system cannot, write a copy."""
    draft = _beside(place)
    try:
        os.link(source.resolve(), draft)
        draft.replace(place)
    except OSError:
        copy(source, place)
    finally:
        draft.unlink(missing_ok=True)  # a link that replaces one to the same file stays


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


def _beside(place: Path) -> Path:
    """Return a new path beside a file with its suffix, on which code may depend."""
    return place.with_name(f"{SCRATCH}{secrets.token_hex(8)}{place.suffix[:16]}")


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
