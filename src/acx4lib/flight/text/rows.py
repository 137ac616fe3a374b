"""The rows of a table, read in time and memory proportional to the size of its file."""

from __future__ import annotations

import csv
import io
from array import array
from collections.abc import Collection, Iterator, Sequence
from dataclasses import InitVar, dataclass, field

import numpy as np

from acx4lib.expected import Mask
from acx4lib.flight.problems import Problem, counted

AT_A_TIME = 4096
"""Number of rows that are processed together."""

_NO_MARKS = bytes(set(range(256)) - set(b',"\r\n'))
"""All bytes but those that can cut a text into cells and rows."""

TOO_MANY = 10_000
"""Number of rows of a wrong width after which reading stops: such a file is no table."""


@dataclass(kw_only=True, eq=False)
class Rows:
    """The rows under a header, column by column.

    Attributes
    ----------
    width : int
        Number of columns of the header.
    wanted : dict of str to int
        The columns that are kept, with their positions.
    names : collection of str
        The columns of names: equal cells are one object, which is quickly found and compared.
    columns : dict of str to list of str
        Their cells. Rows of another width are filled up or cut.
    lines : array of int
        Line number of every row in the file.
    blank : array of int
        Numbers of the blank lines.
    ragged, n_cells : array of int
        Rows of another width than the header, and their numbers of cells.
    used : int
        Number of rows up to the last one that is not empty.
    blank_at_end : int
        Number of blank lines after it.
    """

    width: int
    wanted: dict[str, int]
    names: InitVar[Collection[str]] = ()
    columns: dict[str, list[str]] = field(init=False)
    alike: dict[str, dict[str, str]] = field(init=False, repr=False)
    lines: array[int] = field(default_factory=lambda: array("q"))
    blank: array[int] = field(default_factory=lambda: array("q"))
    ragged: array[int] = field(default_factory=lambda: array("q"))
    n_cells: array[int] = field(default_factory=lambda: array("q"))
    used: int = 0
    blank_at_end: int = 0

    def __post_init__(self, names: Collection[str]) -> None:
        self.columns = {name: [] for name in self.wanted}
        self.alike = {name: {} for name in names}

    def add(self, lines: Sequence[int], rows: list[list[str]]) -> None:
        """Add further rows."""
        if set(map(len, rows)) != {self.width}:
            lines, rows = self._even(lines, rows)
        self.add_columns(lines, list(zip(*rows, strict=True)))

    def add_columns(self, lines: Sequence[int], columns: Sequence[Sequence[str]]) -> None:
        """Add further rows, each of the header's width, column by column."""
        for k in range(len(lines) - 1, -1, -1):
            if any(column[k].strip() for column in columns):
                self.used = max(self.used, len(self.lines) + k + 1)
                break
        self.lines.extend(lines)
        for name, k in self.wanted.items():
            own = columns[k] if columns else ()
            alike = self.alike.get(name)
            self.columns[name].extend(own if alike is None else map(alike.setdefault, own, own))

    def _even(
        self, lines: Sequence[int], rows: list[list[str]]
    ) -> tuple[Sequence[int], list[list[str]]]:
        """Return the rows, not blank and as wide as the header; remember what was changed."""
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
        """Remove empty rows at the end."""
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
    first = text.partition("\n")[0]
    reader = csv.reader(io.StringIO(text if '"' in first else first, newline=""), strict=True)
    try:
        return next(reader, []), ()
    except csv.Error as error:
        return [], (_unreadable(file, 1, error),)


def read_rows(
    text: str, file: str, *, width: int, wanted: dict[str, int], names: Collection[str] = ()
) -> tuple[Rows, tuple[Problem, ...]]:
    """Return the rows under the header, or why they cannot be read.

    Parameters
    ----------
    text : str
        Text of the whole file.
    file : str
        Its name in messages.
    width : int
        Number of columns of the header.
    wanted : dict of str to int
        The columns to keep, with their positions.
    names : collection of str
        Those of them that hold names.
    """
    body = text.rstrip("\r\n")
    tail = text[len(body) :]
    n_ends = max(tail.count("\n"), tail.count("\r"))
    rows = Rows(width=width, wanted=wanted, names=names, blank_at_end=max(n_ends - 1, 0))
    plain = _plain_parts(body, width)
    if plain is not None:
        for part in plain:
            cells, first = part.replace("\n", ",").split(","), 2 + len(rows.lines)
            columns = [cells[k::width] for k in range(width)]
            rows.add_columns(range(first, first + len(columns[0])), columns)
        rows.end()
        return rows, ()
    numbered = _Numbered(body)
    try:
        for lines, some in numbered.parts():
            rows.add(lines, some)
            if len(rows.ragged) + len(rows.blank) > TOO_MANY:
                return rows, ()
    except csv.Error as error:
        return rows, (_unreadable(file, numbered.line, error),)
    rows.end()
    return rows, ()


def _plain_parts(text: str, width: int) -> list[str] | None:
    """Return the lines under the header in parts; None unless commas alone cut all into cells.

    No cell of these is longer than the module csv allows.
    """
    text = text.replace("\r\n", "\n")
    marks = text.encode().translate(None, _NO_MARKS) + b"\n"
    row = b"," * (width - 1) + b"\n"
    if width == 1 or marks != row * (text.count("\n") + 1):
        return None
    parts, begin, longest = [], len(text.partition("\n")[0]) + 1, csv.field_size_limit()
    while begin < len(text):
        last = len(text) - begin <= longest
        end = len(text) if last else text.rfind("\n", begin, begin + longest)
        if end < 0:
            return None
        parts.append(text[begin:end])
        begin = end + 1
    return parts


class _Numbered:
    """Rows with the numbers of their first lines, some thousand at a time, without the header."""

    def __init__(self, text: str) -> None:
        self.reader = csv.reader(io.StringIO(text, newline=""), strict=True)
        self.line = 1
        """Line on which the last row began."""

    def parts(self) -> Iterator[tuple[Sequence[int], list[list[str]]]]:
        next(self.reader, None)
        while True:
            lines, rows = self._part()
            if not rows:
                return
            yield lines, rows

    def _part(self) -> tuple[Sequence[int], list[list[str]]]:
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
