"""What the tags of a TIFF would take in memory, found before anything reads them.

A tag says where its values lie. Thousands of tags may name the same megabyte of a small file, and
a reader makes a copy for each of them.
"""

from __future__ import annotations

import logging
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import tifffile

MOST_BYTES = 20_000_000
"""Largest sum of the values of all tags; places of a million tiles take 16 MB."""

MOST_TAGS = 4096
"""Largest number of tags of a directory."""

SIZES = {
    **dict.fromkeys((1, 2, 6, 7), 1),
    **dict.fromkeys((3, 8), 2),
    **dict.fromkeys((4, 9, 11, 13), 4),
    **dict.fromkeys((5, 10, 12, 16, 17, 18), 8),
}
"""Bytes of a value by the type of the tag."""

EXIF, GPS = 34665, 34853
BELOW = (EXIF, GPS)
"""Tags that name a directory of others."""

UNREAD = {37724, 34377, 34675}
"""Layers and colour profiles of large size, which nothing here looks at."""

_BROKEN = (struct.error, OSError, ValueError, OverflowError)


@dataclass(frozen=True, kw_only=True)
class _Kind:
    """How numbers stand in a file: byte order, and width of places."""

    order: str
    big: bool

    @property
    def tag(self) -> struct.Struct:
        return struct.Struct(self.order + ("HHQQ" if self.big else "HHII"))

    @property
    def place(self) -> struct.Struct:
        return struct.Struct(self.order + ("Q" if self.big else "I"))

    @property
    def number(self) -> struct.Struct:
        return struct.Struct(self.order + ("Q" if self.big else "H"))


def opened(source: Path | BinaryIO) -> tifffile.TiffFile:
    """Return a TIFF that is open; formats of microscopes, which are read without a limit, are not.

    Parameters
    ----------
    source : Path or binary file
        One in whose tags `fault` finds nothing.
    """
    return tifffile.TiffFile(source, is_lsm=False, is_ndpi=False, is_scanimage=False, is_stk=False)


@contextmanager
def in_silence() -> Iterator[None]:
    """Keep the TIFF reader from remarking on what is told otherwise."""
    logger = logging.getLogger("tifffile")
    before, logger.disabled = logger.disabled, True
    try:
        yield
    finally:
        logger.disabled = before


def end_of_pixels(tiff: tifffile.TiffFile) -> int:
    """Return the bytes that a TIFF must have for the parts of its first image, as its tags say."""
    page = tiff.pages.first
    places = zip(page.dataoffsets, page.databytecounts, strict=False)
    return max((int(at) + int(n) for at, n in places), default=0)


def is_cut_off(file: BinaryIO, size: int) -> bool:
    """Tell whether a TIFF ends before its tags or its pixels do.

    Parameters
    ----------
    file : binary file
        At its beginning.
    size : int
        Of the file, bytes.
    """
    try:
        if _end_of_tags(file) > size:
            return True
        file.seek(0)
        if fault(file, size):
            return False  # which is told where it is read
        file.seek(0)
        with in_silence():
            return end_of_pixels(opened(file)) > size
    except (*_BROKEN, TypeError, LookupError):  # damaged otherwise, or no TIFF
        return False


def _end_of_tags(file: BinaryIO) -> int:
    """Return where the first directory of a TIFF ends; 0 where it is none."""
    found = _begin(file)
    if found is None:
        return 0
    kind, at = found
    file.seek(at)
    number = file.read(kind.number.size)
    n = kind.number.unpack(number)[0] if len(number) == kind.number.size else 0
    return at + kind.number.size + n * kind.tag.size + kind.place.size


def _begin(file: BinaryIO) -> tuple[_Kind, int] | None:
    """Return how numbers stand in a TIFF, and where its first directory is; None for others."""
    start = file.read(16)
    order = {b"II": "<", b"EP": "<", b"MM": ">"}.get(start[:2], "")
    if not order or len(start) < 8:
        return None
    (version,) = struct.unpack(order + "H", start[2:4])
    kind = _Kind(order=order, big=version == 43)
    (at,) = kind.place.unpack_from(start, 8 if kind.big else 4)
    return kind, at


def fault(file: BinaryIO, size: int, *, pages: int = 1, below: bool = False) -> str:
    """Return why the tags of a TIFF must not be read; empty where they may be, or it is no TIFF.

    Parameters
    ----------
    file : binary file
        At its beginning.
    size : int
        Of the file, bytes.
    pages : int
        Directories of images that are read.
    below : bool
        Whether those of EXIF and GPS are, too.
    """
    total = 0
    most = min(size, MOST_BYTES)
    try:
        for code, n_bytes in _values(file, pages, below=below):
            total += n_bytes if code not in UNREAD else 0
            if total > most:
                return f"has tags of more than {most} bytes, in {size}; they may share none"
    except _BROKEN:  # the reader says in which way it is damaged
        pass
    return ""


def _values(file: BinaryIO, pages: int, *, below: bool) -> Iterator[tuple[int, int]]:
    """Yield tags and the bytes of their values, directory after directory."""
    found = _begin(file)
    if found is None:
        return
    kind, at = found
    for _ in range(pages):
        if at == 0:
            return
        others = []
        for code, n_bytes, value in _directory(file, kind, at):
            yield code, n_bytes
            if below and code in BELOW:
                others.append(value)
        at = kind.place.unpack(file.read(kind.place.size))[0]
        for place in others:
            yield from ((code, n_bytes) for code, n_bytes, _ in _directory(file, kind, place))


def _directory(file: BinaryIO, kind: _Kind, at: int) -> Iterator[tuple[int, int, int]]:
    """Yield tag, bytes and place of its values; the file is then behind the directory."""
    file.seek(at)
    (n,) = kind.number.unpack(file.read(kind.number.size))
    if n > MOST_TAGS:
        return
    data = file.read(n * kind.tag.size)
    whole = len(data) // kind.tag.size * kind.tag.size
    for code, of, count, value in kind.tag.iter_unpack(data[:whole]):
        yield code, count * SIZES.get(of, 8), value
