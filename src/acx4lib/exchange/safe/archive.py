"""A member of a ZIP archive, read in memory; nothing is unpacked onto the disk."""

from __future__ import annotations

import io
import lzma
import struct
import zipfile
import zlib

from acx4lib.exchange.safe.opened import Opened

MOST_MEMBERS = 10_000
"""Largest number of members of an archive."""

MOST_BYTES = 1_000_000_000
"""Largest size of a member, bytes."""

LARGEST_RATIO = 200
"""Of a member's size to what it takes in the archive; text has about 10, a bomb 1000."""

UNREADABLE = (
    *(zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error),
    *(NotImplementedError, RuntimeError, OSError, EOFError, ValueError),
)
"""What `zipfile` raises for damaged archives."""


def member(source: Opened, name: str) -> Opened:
    """Return a member of a ZIP archive.

    Parameters
    ----------
    source : Opened
        The archive.
    name : str
        Of the member, as the archive has it.

    Raises
    ------
    FlightError
        Where it is no archive, has no such member, or one that is too large or encrypted.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(source.data)) as archive:
            entries = {entry.filename: entry for entry in archive.infolist()[: MOST_MEMBERS + 1]}
            if len(entries) > MOST_MEMBERS:
                expected = f"must have at most {MOST_MEMBERS}"
                raise source.wrong("archive", "has too many members", expected)
            if name not in entries:
                raise source.wrong("archive", f"has no member {name!r}", "required")
            entry = entries[name]
            most = min(MOST_BYTES, LARGEST_RATIO * max(entry.compress_size, 1))
            if entry.file_size > most or entry.flag_bits & 1:
                found = f"{name!r} has {entry.file_size} bytes packed into {entry.compress_size}"
                expected = f"must have at most {LARGEST_RATIO} times as many, and no password"
                raise source.wrong("archive", found, expected)
            with archive.open(entry) as opened:
                data = opened.read(most + 1)
    except UNREADABLE as error:
        reason = str(error).split("\n")[0] or type(error).__name__
        found = f"is no ZIP archive that can be read ({reason})"
        raise source.wrong("archive", found, "must be a whole ZIP archive") from None
    return Opened(file=f"{source.file}/{name}", data=data)
