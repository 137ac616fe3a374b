"""Text cut into lines and cells, each of which knows its place."""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.flight.problems import Range, quoted
from acx4lib.flight.tables import LONGEST_NUMBER, numbers_of
from acx4tools.exchange.safe.opened import Opened, refusal

LONGEST_LINE = 10_000_000
"""Largest number of characters of a line: COLMAP has all points of an image on one."""

_CELL = re.compile(r'"([^"]*+)"|\'([^\']*+)\'|(\S++)')
"""Between white space; a quotation mark without another is a letter."""

_SPACES = re.compile(r"\s*+")

COORDINATE = Range(-1e9, 1e9)
"""Of places in a program's own frame, and in images."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Line:
    """A line of a text file.

    Attributes
    ----------
    file : str
    number : int
        From 1.
    cells : tuple of str
        Without the quotes and spaces around them.
    """

    file: str
    number: int
    cells: tuple[str, ...]

    def __len__(self) -> int:
        """Count the cells."""
        return len(self.cells)

    def wrong(self, element: str, found: str, expected: str) -> FlightError:
        """Return the error that says what is wrong in this line."""
        return refusal(self.file, self.number, element, found, expected)

    def cell(self, k: int, element: str) -> str:
        """Return a cell that must be there; `element` is its name in messages."""
        if k >= len(self.cells):
            fault = f"is missing, the line has {len(self.cells)} cells"
            raise self.wrong(element, fault, f"must be cell {k + 1}")
        return self.cells[k]

    def number_at(self, k: int, element: str, allowed: Range | None = None) -> float:
        """Return a cell as a finite number, inside a range if one is given."""
        cell = self.cell(k, element)
        value = float(numbers_of([cell])[0]) if len(cell) <= LONGEST_NUMBER else float("nan")
        if not abs(value) < float("inf"):
            raise self.wrong(element, quoted(cell), "must be a finite number, decimal point")
        if allowed is not None and value not in allowed:
            raise self.wrong(element, quoted(cell), str(allowed))
        return value

    def whole_at(self, k: int, element: str) -> int:
        """Return a cell as a whole number."""
        cell = self.cell(k, element)
        if not re.fullmatch(r"[+-]?\d{1,18}", cell, re.ASCII):
            raise self.wrong(element, quoted(cell), "must be a whole number")
        return int(cell)

    def numbers(
        self, first: int, last: int | None, element: str, allowed: Range | None = None
    ) -> Array:
        """Return the cells from `first` to before `last` as finite numbers in a range."""
        if last is not None:
            self.cell(last - 1, element)
        values = numbers_of(self.cells[first:last])
        low, high = (-np.inf, np.inf) if allowed is None else (allowed.low, allowed.high)
        good = (values >= low) & (values <= high) & np.isfinite(values)
        for k in np.flatnonzero(~good)[:1]:
            self.number_at(first + int(k), element, allowed)
            raise self.wrong(element, quoted(self.cells[first + int(k)]), "must be a finite number")
        return values


def lines(source: Opened, *, separator: str | None = None, comment: str = "") -> Iterator[Line]:
    """Yield the lines of a text that are not blank, cut into cells.

    Parameters
    ----------
    source : Opened
    separator : str, optional
        A character; by default white space. Cells in quotes may contain it.
    comment : str
        What lines begin with that are left out, such as "#"; none by default.
    """
    for number, text in enumerate(source.text().split("\n"), start=1):
        if len(text) > LONGEST_LINE:
            fault = f"has {len(text)} characters"
            raise source.wrong("line", fault, f"must have at most {LONGEST_LINE}", line=number)
        if text.strip() and not (comment and text.lstrip().startswith(comment)):
            yield Line(file=source.file, number=number, cells=cut(text, separator))


def cut(text: str, separator: str | None = None) -> tuple[str, ...]:
    """Return the cells of one line, without the quotes and spaces around them."""
    if separator is None:
        if '"' not in text and "'" not in text:
            return tuple(text.split())
        return tuple("".join(match.groups("")) for match in _CELL.finditer(text))
    if '"' not in text:
        return tuple(cell.strip() for cell in text.split(separator))
    return tuple(_between(text, separator))


def _between(text: str, separator: str) -> Iterator[str]:
    """Yield the cells between separators; those inside quotes separate nothing."""
    end = -1
    while end < len(text):
        begin = _SPACES.match(text, end + 1).end()  # type: ignore[union-attr] # it always matches
        close = text.find('"', begin + 1) if text[begin : begin + 1] == '"' else -1
        end = text.find(separator, max(begin, close))
        end = len(text) if end < 0 else end
        quoted_part = text[begin + 1 : close] if close >= 0 else ""
        yield (quoted_part + text[max(begin, close + 1) : end]).strip()


# --- Binary files: records of one layout, or values one after another


LONGEST_NAME = 1000
"""Largest number of bytes of a text in a binary file."""


def records(source: Opened, layout: np.dtype[Any]) -> NDArray[Any]:
    """Return the records of a file that has one layout throughout, shape (n,).

    Parameters
    ----------
    source : Opened
    layout : dtype
        Of one record, with its byte order.

    Raises
    ------
    FlightError
        Where the file does not hold a whole number of records.
    """
    size = len(source.data)
    if size % layout.itemsize:
        expected = f"must be a multiple of {layout.itemsize}, one record; is it cut off?"
        raise source.wrong("file", f"has {size} bytes", expected)
    return np.frombuffer(source.data, dtype=layout)


class Rows:
    """The lines of a text, one after another, without lines of comment (#)."""

    def __init__(self, file: Opened) -> None:
        self._file = file
        self._rows = lines(file, comment="#")

    def maybe(self) -> Line | None:
        """Return the next line, None at the end."""
        return next(self._rows, None)

    def next(self, what: str) -> Line:
        """Return the next line; `what` is its name in the message where the text ends too early."""
        row = self.maybe()
        if row is None:
            end = self._file.data.count(b"\n") + 1
            fault = f"{what} is missing at the end of the file"
            raise self._file.wrong(what, fault, "must be complete; is the file cut off?", line=end)
        return row


def first_views(
    row: Line, start: int, n_images: int, image: str = "image"
) -> dict[float, tuple[float, float]]:
    """Return a point's pixel in each image; of several in one image the first.

    Parameters
    ----------
    row : Line
        From its cell `start` on four numbers for each view: image, feature, x, y.
    start, n_images : int
    image : str
        What a message calls an image.
    """
    views: dict[float, tuple[float, float]] = {}
    for k, _, x, y in row.numbers(start, None, "views", COORDINATE).reshape(-1, 4).tolist():
        if not (0 <= k < n_images and k.is_integer()):
            raise row.wrong("views", f"{image} {k:g}", f"must be one of {n_images}, from 0")
        views.setdefault(k, (x, y))
    return views


@dataclass(kw_only=True)
class Cursor:
    """A place in a binary file, from which values are taken.

    Attributes
    ----------
    source : Opened
    at : int
        Bytes before it.
    """

    source: Opened
    at: int = 0

    @property
    def left(self) -> int:
        """Count the bytes that follow."""
        return len(self.source.data) - self.at

    def take(self, layout: str, element: str) -> tuple[Any, ...]:
        """Return the next values, by a layout of `struct`; `element` is their name in messages."""
        begin = self._skip(struct.calcsize(layout), element)
        return struct.unpack_from(layout, self.source.data, begin)

    def array(self, layout: np.dtype[Any], n: int, element: str) -> NDArray[Any]:
        """Return the next `n` records of a layout."""
        begin = self._skip(n * layout.itemsize, element)
        return np.frombuffer(self.source.data, dtype=layout, count=n, offset=begin)

    def text(self, element: str) -> str:
        """Return the next text, which a null byte ends."""
        end = self.source.data.find(b"\0", self.at, self.at + LONGEST_NAME)
        if end < 0:
            fault = f"text at byte {self.at} has no end"
            raise self.source.wrong(element, fault, f"must have at most {LONGEST_NAME} bytes")
        begin = self._skip(end + 1 - self.at, element)
        try:
            return self.source.data[begin:end].decode("utf-8")
        except UnicodeDecodeError:
            raise self.source.wrong(element, f"text at byte {begin}", "must be UTF-8") from None

    def _skip(self, size: int, element: str) -> int:
        """Move on, and return where that began."""
        if not 0 <= size <= self.left:
            fault = f"at byte {self.at}: {max(size, 0)} bytes, {self.left} are left"
            raise self.source.wrong(element, fault, "must be complete; is the file cut off?")
        self.at += size
        return self.at - size
