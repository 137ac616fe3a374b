"""A file that was opened once: its content, its checksum, and how what is wrong in it is told."""

from __future__ import annotations

import hashlib
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
            found = f"byte 0x{self.data[error.start]:02x} is not {code[:6].rstrip('-').upper()}"
            raise self.wrong("file", found, "must be UTF-8 text", line=line) from None
        at = text.find("\0")
        if at >= 0:
            found, line = "holds a null character", text.count("\n", 0, at) + 1
            raise self.wrong("file", found, "must be text", line=line)
        return text.replace("\r\n", "\n").replace("\r", "\n")


def of_windows(source: Opened) -> Opened:
    """Return a file as text of Windows-1252 if it is not UTF-8 nor UTF-16, else as it is."""
    try:
        source.data.decode("utf-16" if source.data[:2] in TEXT_MARKS else "utf-8")
    except UnicodeDecodeError:
        return replace(source, encoding="cp1252")
    return source


def refusal(file: str, line: int, element: str, found: str, expected: str) -> FlightError:
    """Return the error of one thing that is wrong in one place of a file."""
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
    """The files that one import reads: each of them once, and their sum is bounded as one file is.

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
                found = f"is the same file as {before}"
                raise refusal(str(path), 1, "file", found, "must be a file of its own")
        return self.add(read(path))

    def add(self, one: Opened) -> Opened:
        """Return a file after its size was counted, such as a member of an archive."""
        self.size += len(one.data)
        if not table_files.fits(self.size):
            found = f"makes {self.size} bytes of files and what is packed in them"
            raise one.wrong("file", found, "must fit into free memory together")
        return one


def checksums(sources: Iterable[Opened]) -> dict[str, str]:
    """Return the checksums of files by their names without folders."""
    return {source.name: source.sha256 for source in sources}
