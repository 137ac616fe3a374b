"""The tables of a flight as text: line and column of every value, and the problems."""

from __future__ import annotations

import csv
import io
import re
import unicodedata
from array import array
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import InitVar, dataclass, field, replace

import numpy as np

from acx4files.flight.problems import (
    NOT_NEGATIVE,
    RANGES,
    Problem,
    Range,
    quoted,
)
from acx4lib.errors import UNSEEN
from acx4lib.expected import Array, Index, Mask

# --- A table of a flight: its cells as text and as numbers


@dataclass(frozen=True, kw_only=True, eq=False)
class Table:
    """A table as it was read.

    Attributes
    ----------
    file : str
        Path of the file for the user; of a table in memory its name.
    lines : ndarray of int
        Line number of every row in the file; of a table in memory the rows themselves, from 0.
    text : dict
        Cells of every known column of the file.
    numbers : dict
        Numeric columns; NaN where a cell is no usable number.
    sha256 : str
        Checksum of the file.
    problems : tuple of Problem
    notes : tuple of str
        Strange but allowed content, one sentence each.
    in_memory : bool
        Whether it was read from no file.
    """

    file: str
    lines: Index = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    text: Mapping[str, Sequence[str]] = field(default_factory=dict)
    numbers: dict[str, Array] = field(default_factory=dict)
    sha256: str = ""
    problems: tuple[Problem, ...] = ()
    notes: tuple[str, ...] = ()
    in_memory: bool = False

    def __len__(self) -> int:
        """Count the rows."""
        return len(self.lines)

    @property
    def counts(self) -> str:
        """Unit of `lines` in messages: row or line."""
        return "row" if self.in_memory else "line"

    def problem(self, row: int, column: str, found: str, expected: str) -> Problem:
        """Return a problem of a row."""
        return Problem(
            file=self.file,
            line=int(self.lines[row]) if len(self) else 1,
            column=column,
            found=found,
            expected=expected,
            in_memory=self.in_memory,
        )

    def has(self, *columns: str) -> bool:
        """Tell whether the table has all these columns."""
        return set(columns) <= set(self.text)

    def select(self, keep: Mask) -> Table:
        """Return some of the rows."""
        rows = np.flatnonzero(keep)
        return replace(
            self,
            lines=self.lines[rows],
            text={
                name: tuple(cells[i] for i in rows.tolist()) for name, cells in self.text.items()
            },
            numbers={name: values[keep] for name, values in self.numbers.items()},
        )

    def stack(self, *columns: str) -> Array:
        """Return numeric columns side by side, shape (n, k)."""
        return np.stack([self.numbers[column] for column in columns], axis=-1)


# --- The columns of a flight's tables


SIGMA_POSITION = ("sigma_east_m", "sigma_north_m", "sigma_height_m")
SIGMA_ATTITUDE = ("sigma_roll_deg", "sigma_pitch_deg", "sigma_heading_deg")
GEOGRAPHIC = ("lat_deg", "lon_deg", "roll_deg", "pitch_deg", "heading_deg")
GRID = ("east_m", "north_m", "omega_deg", "phi_deg", "kappa_deg")


@dataclass(frozen=True, kw_only=True)
class Schema:
    """The required content of a table.

    Attributes
    ----------
    required, optional : tuple of str
        Columns.
    forms : tuple of tuple of str
        Sets of columns; one of these sets is required.
    may_be_empty : tuple of str
        Text columns whose cells may be empty.
    keys : tuple of tuple of str
        Sets of columns; no two rows may have the same cells in all columns of a set.
    ranges : Mapping
        Ranges of the numeric columns; other columns are text.
    rows : bool
        Whether the table needs at least one row.
    """

    required: tuple[str, ...]
    optional: tuple[str, ...] = ()
    forms: tuple[tuple[str, ...], ...] = ()
    may_be_empty: tuple[str, ...] = ()
    keys: tuple[tuple[str, ...], ...]
    ranges: Mapping[str, Range] = field(default_factory=lambda: RANGES)
    rows: bool = True

    @property
    def known(self) -> tuple[str, ...]:
        """All columns that the table may have."""
        return (*self.required, *(name for form in self.forms for name in form), *self.optional)


SCHEMAS = {
    "images.csv": Schema(
        required=("image", "camera", "exposure"),
        optional=("strip", "file"),
        may_be_empty=("strip", "file"),
        keys=(("image",), ("camera", "exposure")),
    ),
    "image_points.csv": Schema(
        required=("image", "point", "col_px", "row_px"),
        optional=("sigma_px",),
        keys=(("image", "point"),),
    ),
    "trajectory.csv": Schema(
        required=("exposure", "height_m"),
        forms=(GEOGRAPHIC, GRID),
        optional=("time_s", *SIGMA_POSITION, *SIGMA_ATTITUDE),
        keys=(("exposure",),),
    ),
    "control_points.csv": Schema(
        required=("point", "east_m", "north_m", "height_m"),
        optional=(*SIGMA_POSITION, "role"),
        may_be_empty=("role",),
        keys=(("point",),),
        ranges={**RANGES, **dict.fromkeys(SIGMA_POSITION, NOT_NEGATIVE)},
        rows=False,
    ),
    "distances.csv": Schema(
        required=("point_a", "point_b", "distance_m", "sigma_m"),
        keys=(),
        rows=False,
    ),
}


# --- Which names a flight may use: any text in one line that is no formula
#
# Names are compared exactly and written to tables unchanged. If a name looked like a formula, a
# spreadsheet that opens such a table would compute it.


LONGEST = 200
"""Largest number of characters of a name."""

NUMBER = re.compile(r"\s*[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?\s*", re.ASCII)

_BLANK = r"[\s\u00ad\u200b-\u200d\u2060\ufeff]*"
# Many names are searched at once; a null character separates them.
_MAY_BE_FORMULA = re.compile(rf"(?:\A|[\0;]){_BLANK}[=@+-]")
_FORMULA = re.compile(rf"{_BLANK}(?:[=@]|[+-]\s*\S)")


def name_fault(name: str) -> tuple[str, str] | None:
    """Return the fault of a name and the expected form; None for a good name.

    Parameters
    ----------
    name : str
        It must not be empty.
    """
    if len(name) > LONGEST:
        expected = f"must be a name of at most {LONGEST} characters"
        return f"{quoted(name)} has {len(name)} characters", expected
    unseen = UNSEEN.search(name)
    if unseen:
        fault = f"{quoted(name)} holds the character U+{ord(unseen[0]):04X}"
        return fault, "must be text of one line, no control characters"
    if _is_formula(name):
        fault = f"{quoted(name)} would be computed as a formula by a spreadsheet"
        return fault, "must not begin with =, @, or with + or - unless it is a number"
    return None


def _is_formula(name: str) -> bool:
    # Where the comma is the decimal sign, a semicolon separates cells.
    parts = _plain(name).split(";")
    return any(_FORMULA.match(part) and not NUMBER.fullmatch(part) for part in parts)


def _plain(text: str) -> str:
    """Return text with full-width and half-width characters replaced by normal ones."""
    return text if text.isascii() else unicodedata.normalize("NFKC", text)


def faulty(names: Collection[str]) -> dict[str, tuple[str, str]]:
    """Return the names that cannot be used, with the results of `name_fault`.

    Parameters
    ----------
    names : collection of str
        Names to check; empty ones are skipped.
    """
    joined = "\0".join(names)
    clean = (
        max(map(len, names), default=0) <= LONGEST
        and not UNSEEN.search(joined.replace("\0", ""))
        and not _MAY_BE_FORMULA.search(_plain(joined))
    )
    if clean:
        return {}
    faults = ((name, name_fault(name)) for name in names if name)
    return {name: fault for name, fault in faults if fault}


# --- Problems of the first line of a table: the names of its columns


MOST_COLUMNS = 1000
"""Largest number of columns of a table; unknown columns are not read."""


# --- Problems of the cells of a single table


LONGEST_NUMBER = 100
"""Largest number of characters of a number."""

FORMS = (
    (r"\s*-?\d+,\d+\s*", "a decimal comma"),
    (r"\s*[-+]?\d{1,3}(?:[ .,'\u2019\u00a0\u202f]\d{3})+(?:[.,]\d*)?\s*", "thousands set apart"),
    (r"\s*[-+]?\d+[°:d\s]\s*\d+['\u2032:m\s].*", "degrees, minutes and seconds"),
    (r"\s*[-+]?\d+(?:\.\d*)?\s*[^\W\d_]+\s*", "with a unit"),
)
"""Forms of numbers that are used elsewhere, and their names."""


def form_of(cell: str) -> str:
    """Return " (a decimal comma?)" and the like for a cell that may be a number, or nothing."""
    return next((f" ({name}?)" for form, name in FORMS if re.fullmatch(form, cell)), "")


_OF_NUMBERS = b"0123456789+-.eE, \t\n\r\f\v"
"""If cells have only these characters, Python's own reading of numbers is right."""


def numbers_of(cells: Sequence[str]) -> Array:
    """Return the cells as numbers, NaN where a cell is no number."""
    if not ",".join(cells).encode().translate(None, _OF_NUMBERS):
        try:
            return np.fromiter(map(float, cells), dtype=float, count=len(cells))
        except ValueError:  # then one by one
            pass
    values = [float(cell) if NUMBER.fullmatch(cell) else np.nan for cell in cells]
    return np.array(values, dtype=float)


# --- The rows of a table, read in time and memory proportional to the size of its file


AT_A_TIME = 4096
"""Number of rows that are processed together."""

_NO_MARKS = bytes(set(range(256)) - set(b',"\r\n'))
"""All bytes but the separators of cells and rows."""

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
            cells = columns[k] if columns else ()
            alike = self.alike.get(name)
            self.columns[name].extend(
                cells if alike is None else map(alike.setdefault, cells, cells)
            )

    def _even(
        self, lines: Sequence[int], rows: list[list[str]]
    ) -> tuple[Sequence[int], list[list[str]]]:
        """Return the rows without blank ones, all as wide as the header; note the changes."""
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
        The columns among them that hold names.
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
        for lines, part_rows in numbered.parts():
            rows.add(lines, part_rows)
            if len(rows.ragged) + len(rows.blank) > TOO_MANY:
                return rows, ()
    except csv.Error as error:
        return rows, (_unreadable(file, numbered.line, error),)
    rows.end()
    return rows, ()


def _plain_parts(text: str, width: int) -> list[str] | None:
    """Return the text under the header in parts; None if commas alone do not cut it into cells.

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
        fault, expected = "a cell is too long", f"must have at most {csv.field_size_limit()} bytes"
        return Problem(file=file, line=line, column="row", found=fault, expected=expected)
    return Problem(
        file=file,
        line=line,
        column="file",
        found=f"cannot be read as a table ({error})",
        expected="must be comma-separated values, quotes closed",
    )
