"""A file that was opened once: its content, its checksum, and the errors that name it."""

from __future__ import annotations

import hashlib
import io
import struct
import zipfile
import zlib
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from acx4lib.errors import FlightError
from acx4lib.flight import table_files
from acx4lib.flight.problems import Problem

TEXT_MARKS = (b"\xff\xfe", b"\xfe\xff")
"""Byte-order marks of UTF-16, which spreadsheets on Windows write."""


@dataclass(frozen=True, kw_only=True)
class Opened:
    """The content of a file.

    Attributes
    ----------
    file : str
        Its path, as messages name it.
    data : bytes
    encoding : str
        Of its text, where it is neither UTF-8 nor UTF-16 with its mark; empty otherwise.
    """

    file: str
    data: bytes
    encoding: str = ""

    @property
    def name(self) -> str:
        """Its name without folders."""
        return Path(self.file).name

    @property
    def sha256(self) -> str:
        """Its checksum."""
        return hashlib.sha256(self.data).hexdigest()

    def wrong(self, element: str, found: str, expected: str, *, line: int = 1) -> FlightError:
        """Return the error that says what is wrong at an element, and what should be there."""
        return refusal(self.file, line, element, found, expected)

    def text(self) -> str:
        r"""Return the content as text, ends of lines as ``\n``.

        Raises
        ------
        FlightError
            Where it is neither UTF-8 nor, with its mark, UTF-16.
        """
        code = self.encoding or ("utf-16" if self.data[:2] in TEXT_MARKS else "utf-8-sig")
        try:
            text = self.data.decode(code)
        except UnicodeDecodeError as error:
            line = self.data.count(b"\n", 0, error.start) + 1
            fault = f"byte 0x{self.data[error.start]:02x} is not {code[:6].rstrip('-').upper()}"
            raise self.wrong("file", fault, "must be UTF-8 text", line=line) from None
        null = text.find("\0")
        if null >= 0:
            fault, line = "holds a null character", text.count("\n", 0, null) + 1
            raise self.wrong("file", fault, "must be text", line=line)
        return text.replace("\r\n", "\n").replace("\r", "\n")


def of_windows(source: Opened) -> Opened:
    """Return a file as text of Windows-1252 if it is not UTF-8 nor UTF-16, else as it is."""
    try:
        source.data.decode("utf-16" if source.data[:2] in TEXT_MARKS else "utf-8")
    except UnicodeDecodeError:
        return replace(source, encoding="cp1252")
    return source


def refusal(file: str, line: int, element: str, found: str, expected: str) -> FlightError:
    """Return the error for a problem at one place of a file."""
    problem = Problem(file=file, line=line, column=element, found=found, expected=expected)
    return FlightError([str(problem)])


def read(path: Path, *, most: int | None = None) -> Opened:
    """Return the content of a regular file.

    Parameters
    ----------
    path : Path
    most : int, optional
        Largest size, bytes; by default what the free memory allows.

    Raises
    ------
    FlightError
        Where it is not there, no regular file, or too large.
    """
    data, problems = table_files.read_bytes(path, str(path), needed_by="the import", most=most)
    if problems:
        raise FlightError([str(problem) for problem in problems])
    if not data:
        raise refusal(str(path), 1, "file", "is empty", "must have content")
    return Opened(file=str(path), data=data)


@dataclass(kw_only=True)
class Together:
    """The files of one import: each is read once, and their sum is limited as one file is.

    A file that names others may name one of them a thousand times, by a thousand links.

    Attributes
    ----------
    size : int
        Bytes that were read so far, unpacked ones among them.
    """

    size: int = 0
    _known: dict[tuple[int, int], Path] = field(default_factory=dict)

    def read(self, path: Path) -> Opened:
        """Return the content of a file, as `read` does; FlightError where it was read before."""
        with suppress(OSError, ValueError):  # `read` says what is wrong with it
            status = path.stat()
            before = self._known.setdefault((status.st_dev, status.st_ino), path)
            if before is not path:
                fault = f"is the same file as {before}"
                raise refusal(str(path), 1, "file", fault, "must be a file of its own")
        return self.add(read(path))

    def add(self, one: Opened) -> Opened:
        """Return a file after its size was counted, such as a member of an archive."""
        self.size += len(one.data)
        if not table_files.fits(self.size):
            fault = f"makes {self.size} bytes of files and what is packed in them"
            raise one.wrong("file", fault, "must fit into free memory together")
        return one


def checksums(sources: Iterable[Opened]) -> dict[str, str]:
    """Return the checksums of files by their names without folders."""
    return {source.name: source.sha256 for source in sources}


# --- A member of a ZIP archive, read in memory; nothing is unpacked onto the disk


MOST_MEMBERS = 10_000
"""Largest number of members of an archive."""

MOST_BYTES = 300_000_000
"""Largest size of a member, bytes; the XML of 100 000 images has that."""

LARGEST_RATIO = 200
"""Largest ratio of a member's size to its packed size; text has about 10, a bomb 1000."""

AT_A_TIME = 50_000
"""Packed bytes between two looks at this ratio."""

UNREADABLE = (
    *(zipfile.BadZipFile, zlib.error, struct.error),
    *(NotImplementedError, RuntimeError, OSError, EOFError, ValueError),
)
"""Errors of `zipfile` for damaged archives."""


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
        fault = f"is no ZIP archive that can be read ({reason})"
        raise source.wrong("archive", fault, "must be a whole ZIP archive") from None
    return Opened(file=f"{source.file}/{name}", data=data)


def _unpacked(source: Opened, entry: zipfile.ZipInfo, begin: int) -> bytes:
    """Return a member's content; bytes are counted, since the header may say anything of them."""
    packed = memoryview(source.data)[begin : begin + entry.compress_size]
    if entry.compress_type == zipfile.ZIP_STORED:
        data = bytes(packed)
    elif entry.compress_type == zipfile.ZIP_DEFLATED:
        data = _inflated(source, entry, packed)
    else:
        raise NotImplementedError("neither deflated nor stored")
    if len(data) != entry.file_size or zlib.crc32(data) != entry.CRC:
        raise zipfile.BadZipFile("other bytes than its header says")
    return data


def _inflated(source: Opened, entry: zipfile.ZipInfo, packed: memoryview) -> bytes:
    stream, data = zlib.decompressobj(-zlib.MAX_WBITS), bytearray()
    for begin in range(0, len(packed), AT_A_TIME):
        part: bytes | memoryview = packed[begin : begin + AT_A_TIME]
        while part and not stream.eof:
            data += stream.decompress(part, LARGEST_RATIO * AT_A_TIME)
            part = stream.unconsumed_tail
            taken = begin + AT_A_TIME - len(part)
            _require_size(source, entry, len(data), taken)
    return bytes(data + stream.flush())


def _require_size(source: Opened, entry: zipfile.ZipInfo, size: int, packed: int) -> None:
    """Raise FlightError for a member too large, packed too densely, or with a password."""
    most = min(MOST_BYTES, LARGEST_RATIO * max(packed, 1))
    if size > most or not table_files.fits(size) or entry.flag_bits & 1:
        fault = f"{entry.filename!r} has {size} bytes packed into {packed}"
        expected = (
            f"must have at most {LARGEST_RATIO} times as many, fit into memory with "
            f"{MOST_BYTES} at most, and have no password"
        )
        raise source.wrong("archive", fault, expected)
