"""The size of a JPEG or PNG by its header, before any pixel is unpacked."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from os import SEEK_END
from pathlib import Path

from acx4lib.flight.table_files import free_memory
from acx4lib.opening import opened
from acx4lib.production import tiff

LARGEST_RATIO = 200
"""Of a picture's bytes to those of its file; pictures of the ground have 2 to 50."""

SMALL = 100_000_000
"""Bytes of a picture that are unpacked whatever this ratio is: it may be empty."""

SCAN, END = 0xDA, 0xD9
FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}
"""Markers of JPEG's frame headers."""

LARGE = 65_536
"""Bytes at the end of a large JPEG; previews with an end of their own stand at its beginning."""

LAST = 4096
"""Bytes at the end of a PNG among which its last chunk begins."""

_JPEG, _PNG = b"\xff\xd8", b"\x89PNG\r\n\x1a\n"


def segments(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield markers and contents of a JPEG's segments up to its pixels."""
    at = 2
    while at + 4 <= len(data) and data[at] == 0xFF:
        marker = data[at + 1]
        if marker in (SCAN, END):
            return
        (length,) = struct.unpack(">H", data[at + 2 : at + 4])
        yield marker, data[at + 4 : at + 2 + length]
        at += 2 + length


def is_whole(data: bytes) -> bool:
    """Tell whether a JPEG or a PNG has its end; one that was cut off is decoded with grey there."""
    if data[:8] == _PNG:
        return b"IEND" in data[-LAST:]
    start = 2 + sum(4 + len(part) for _, part in segments(data))
    return data.find(b"\xff\xd9", start) >= 0  # which no pixels have: 0 follows their 255


def is_cut_off(path: Path) -> bool:
    """Tell whether a file is a JPEG, a PNG or a TIFF without its end.

    A large JPEG that has one among its last bytes is not read to find it.
    """
    kind = path.suffix.lower()
    if kind not in (".jpg", ".jpeg", ".png", ".tif", ".tiff"):
        return False
    with opened(path) as file:
        size = file.seek(0, SEEK_END)
        if kind in (".tif", ".tiff"):
            file.seek(0)
            return tiff.is_cut_off(file, size)
        file.seek(max(size - LARGE, 0))
        if size > 2 * LARGE and b"\xff\xd9" in file.read():
            return False
        file.seek(0)
        return not is_whole(file.read())


def size_of(data: bytes) -> tuple[int, int] | None:
    """Return width and height of a JPEG or a PNG, px; None where its header does not say them."""
    if data[:8] == _PNG and data[12:16] == b"IHDR" and len(data) >= 24:
        width, height = struct.unpack(">II", data[16:24])
        return width, height
    if data[:2] == _JPEG:
        for marker, part in segments(data):
            if marker in FRAMES and len(part) >= 6:
                height, width = struct.unpack(">HH", part[1:5])
                return width, height
    return None


def fault(n_bytes: int, size: int, needed: int | None = None) -> str:
    """Return why a picture must not be unpacked; empty where it may be.

    Parameters
    ----------
    n_bytes : int
        Of its pixels.
    size : int
        Of its file, bytes.
    needed : int, optional
        Bytes of memory while it is unpacked; by default those of its pixels.
    """
    if n_bytes > SMALL and n_bytes > LARGEST_RATIO * size:
        return f"has {n_bytes} bytes of pixels in {size}; {LARGEST_RATIO} times as many at most"
    needed, free = n_bytes if needed is None else needed, free_memory()
    if needed > free:
        return f"needs {needed} bytes of memory to be unpacked; {free} are free"
    return ""
