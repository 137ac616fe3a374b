"""A member of a ZIP archive, read in memory; nothing is unpacked onto the disk."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib

from acx4lib.flight import table_files
from acx4tools.exchange.safe.opened import Opened

MOST_MEMBERS = 10_000
"""Largest number of members of an archive."""

MOST_BYTES = 300_000_000
"""Largest size of a member, bytes; the XML of 100 000 images has that."""

LARGEST_RATIO = 200
"""Of a member's size to what it takes in the archive; text has about 10, a bomb 1000."""

AT_A_TIME = 50_000
"""Packed bytes between two looks at this ratio."""

UNREADABLE = (
    *(zipfile.BadZipFile, zlib.error, struct.error),
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
        packed = io.BytesIO(source.data)
        with zipfile.ZipFile(packed) as archive:
            entries = {entry.filename: entry for entry in archive.infolist()[: MOST_MEMBERS + 1]}
            if len(entries) > MOST_MEMBERS:
                expected = f"must have at most {MOST_MEMBERS}"
                raise source.wrong("archive", "has too many members", expected)
            if name not in entries:
                raise source.wrong("archive", f"has no member {name!r}", "required")
            entry = entries[name]
            _require_size(source, entry, entry.file_size, entry.compress_size)
            with archive.open(entry):  # it looks at the member's own header, and stops behind it
                begin = packed.tell()
            data = _unpacked(source, entry, begin)
    except UNREADABLE as error:
        reason = str(error).split("\n")[0] or type(error).__name__
        found = f"is no ZIP archive that can be read ({reason})"
        raise source.wrong("archive", found, "must be a whole ZIP archive") from None
    return Opened(file=f"{source.file}/{name}", data=data)


def _unpacked(source: Opened, entry: zipfile.ZipInfo, begin: int) -> bytes:
    """Return a member's content; bytes are counted, since the header may say anything of them."""
    packed = memoryview(source.data)[begin : begin + entry.compress_size]
    if entry.compress_type == zipfile.ZIP_STORED:
        data = bytes(packed)
    elif entry.compress_type == zipfile.ZIP_DEFLATED:
        data = _inflated(source, entry, packed)
    else:
        msg = "neither deflated nor stored"
        raise NotImplementedError(msg)
    if len(data) != entry.file_size or zlib.crc32(data) != entry.CRC:
        msg = "other bytes than its header says"
        raise zipfile.BadZipFile(msg)
    return data


def _inflated(source: Opened, entry: zipfile.ZipInfo, packed: memoryview) -> bytes:
    stream, data = zlib.decompressobj(-zlib.MAX_WBITS), bytearray()
    for at in range(0, len(packed), AT_A_TIME):
        part: bytes | memoryview = packed[at : at + AT_A_TIME]
        while part and not stream.eof:
            data += stream.decompress(part, LARGEST_RATIO * AT_A_TIME)
            part = stream.unconsumed_tail
            taken = at + AT_A_TIME - len(part)
            _require_size(source, entry, len(data), taken)
    return bytes(data + stream.flush())


def _require_size(source: Opened, entry: zipfile.ZipInfo, size: int, packed: int) -> None:
    """Raise the error of a member that has too many bytes for those that it is packed into."""
    most = min(MOST_BYTES, LARGEST_RATIO * max(packed, 1))
    if size > most or not table_files.fits(size) or entry.flag_bits & 1:
        found = f"{entry.filename!r} has {size} bytes packed into {packed}"
        expected = (
            f"must have at most {LARGEST_RATIO} times as many, fit into memory with "
            f"{MOST_BYTES} at most, and have no password"
        )
        raise source.wrong("archive", found, expected)
