"""The rows of a table, in time and memory that grow with its file."""

from __future__ import annotations

import csv
import io
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from acx4lib.expected import Mask
from acx4lib.flight.problems import Problem, counted

AT_A_TIME = 4096
"""Rows that are taken apart together."""

TOO_MANY = 10_000
"""After so many rows of another width than the header nothing more is read: it is no table."""


@dataclass(kw_only=True, eq=False)
class Rows:
    """The rows under a header, column by column.

    Attributes
    ----------
    width : int
        Columns of the header.
    wanted : dict of str to int
        The columns that are kept, and where they stand.
    columns : dict of str to list of str
        Their cells. Rows of another width are filled up or cut.
    lines : array of int
        Of every row in the file.
    blank : array of int
        Lines without anything.
    ragged, n_cells : array of int
        Rows of another width than the header, and their numbers of cells.
    used : int
        Rows up to the last that holds something.
    blank_at_end : int
        Lines after it.
    """

    width: int
    wanted: dict[str, int]
    columns: dict[str, list[str]] = field(init=False)
    lines: array[int] = field(default_factory=lambda: array("q"))
    blank: array[int] = field(default_factory=lambda: array("q"))
    ragged: array[int] = field(default_factory=lambda: array("q"))
    n_cells: array[int] = field(default_factory=lambda: array("q"))
    used: int = 0
    blank_at_end: int = 0

    def __post_init__(self) -> None:
        self.columns = {name: [] for name in self.wanted}

    def add(self, lines: Sequence[int], rows: list[list[str]]) -> None:
        """Take further rows."""
        if set(map(len, rows)) != {self.width}:
            lines, rows = self._even(lines, rows)
        for k in range(len(rows) - 1, -1, -1):
            if any(map(str.strip, rows[k])):
                self.used = max(self.used, len(self.lines) + k + 1)
                break
        self.lines.extend(lines)
        cells = list(zip(*rows, strict=True))
        for name, k in self.wanted.items():
            self.columns[name].extend(cells[k] if cells else ())

    def _even(
        self, lines: Sequence[int], rows: list[list[str]]
    ) -> tuple[Sequence[int], list[list[str]]]:
        """Return rows as wide as the header, without blank ones, and remember which were not."""
        kept_lines, kept = [], []
        for line, row in zip(lines, rows, strict=True):
            n = len(row)
            if n == self.width:
                kept.append(row)
            elif not any(row):
                self.blank.append(line)
                continue
            else:
                self.ragged.append(len(self.lines) + len(kept))
                self.n_cells.append(n)
                kept.append((row + [""] * (self.width - n))[: self.width])
                if any(map(str.strip, row)):
                    self.used = len(self.lines) + len(kept)
            kept_lines.append(line)
        return kept_lines, kept

    def end(self) -> None:
        """Leave away rows at the end whose cells hold nothing."""
        last = self.lines[self.used - 1] if self.used else 1
        self.blank_at_end += len(self.lines) - self.used
        del self.lines[self.used :]
        for cells in self.columns.values():
            del cells[self.used :]
        while self.ragged and self.ragged[-1] >= self.used:
            self.ragged.pop()
        while self.blank and self.blank[-1] > last:
            self.blank.pop()
            self.blank_at_end += 1


def read_header(text: str, file: str) -> tuple[list[str], tuple[Problem, ...]]:
    """Return the cells of the first row, or why they cannot be read."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    try:
        return next(reader, []), ()
    except csv.Error as error:
        return [], (_unreadable(file, 1, error),)


def read_rows(
    text: str, file: str, *, width: int, wanted: dict[str, int]
) -> tuple[Rows, tuple[Problem, ...]]:
    """Return what stands under the header, or why it cannot be read.

    Parameters
    ----------
    text : str
        Of the whole file.
    file : str
        What to call it.
    width : int
        Columns of its header.
    wanted : dict of str to int
        The columns to keep, and where they stand.
    """
    body = text.rstrip("\r\n")
    tail = text[len(body) :]
    n_ends = max(tail.count("\n"), tail.count("\r"))
    rows = Rows(width=width, wanted=wanted, blank_at_end=max(n_ends - 1, 0))
    numbered = _Numbered(body)
    try:
        for lines, cells in numbered.parts():
            rows.add(lines, cells)
            if len(rows.ragged) + len(rows.blank) > TOO_MANY:
                return rows, ()
    except csv.Error as error:
        return rows, (_unreadable(file, numbered.line, error),)
    rows.end()
    return rows, ()


class _Numbered:
    """Rows with the line on which each begins, some thousand at a time, without the first."""

    def __init__(self, text: str) -> None:
        self.reader = csv.reader(io.StringIO(text, newline=""), strict=True)
        self.quotes = '"' in text
        self.line = 1
        """Where the last row began."""

    def parts(self) -> Iterator[tuple[Sequence[int], list[list[str]]]]:
        part = self._slow if self.quotes else self._quick
        next(self.reader, None)
        while True:
            lines, rows = part()
            if not rows:
                return
            yield lines, rows

    def _quick(self) -> tuple[Sequence[int], list[list[str]]]:
        """Without quotes every line is a row."""
        start = self.reader.line_num + 1
        try:
            rows = list(islice(self.reader, AT_A_TIME))
        finally:
            self.line = self.reader.line_num
        return range(start, start + len(rows)), rows

    def _slow(self) -> tuple[Sequence[int], list[list[str]]]:
        lines, rows = [], []
        for _ in range(AT_A_TIME):
            self.line = self.reader.line_num + 1
            row = next(self.reader, None)
            if row is None:
                break
            lines.append(self.line)
            rows.append(row)
        return lines, rows


def _unreadable(file: str, line: int, error: csv.Error) -> Problem:
    if "field larger" in str(error):
        found, expected = "a cell is too long", f"must have at most {csv.field_size_limit()} bytes"
        return Problem(file=file, line=line, column="row", found=found, expected=expected)
    return Problem(
        file=file,
        line=line,
        column="file",
        found=f"cannot be read as a table ({error})",
        expected="must be comma-separated values, quotes closed",
    )


def width_problems(file: str, rows: Rows) -> Iterator[Problem]:
    """Yield blank lines between others, and rows of another width than the header."""
    expected = f"as many as the header: {rows.width}"

    def wrong(line: int, found: str) -> Problem:
        return Problem(file=file, line=line, column="row", found=found, expected=expected)

    def ragged(k: int) -> Problem:
        row, n = rows.ragged[k], rows.n_cells[k]
        hint = "cut off?" if n < rows.width else "a decimal comma?"
        return wrong(rows.lines[row], f"has {n} cells ({hint})")

    yield from counted(rows.blank, lambda line: wrong(line, "is blank"))
    yield from counted(range(len(rows.ragged)), ragged)


def whole_rows(rows: Rows) -> Mask:
    """Tell which rows were as wide as the header, shape (n,)."""
    whole = np.ones(len(rows.lines), dtype=bool)
    whole[np.array(rows.ragged, dtype=np.intp)] = False
    return whole
