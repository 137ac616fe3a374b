"""The tables of a flight: their columns, declared once, and the names and numbers in them."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from acx4files.flight.problems import NOT_NEGATIVE, RANGES, Problem, Range, quoted
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
        Every known column of names.
    numbers : dict
        Every known column of numbers; NaN where a cell is no usable number.
    sha256 : str
        Checksum of the file.
    problems : tuple of Problem
    notes : tuple of str
        Strange but allowed content, one sentence each.
    in_memory : bool
        Whether it was read from no file.
    whole : bool
        Whether all its rows could be read; if not, others may lack names in it.
    """

    file: str
    lines: Index = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    text: Mapping[str, Sequence[str]] = field(default_factory=dict)
    numbers: dict[str, Array] = field(default_factory=dict)
    sha256: str = ""
    problems: tuple[Problem, ...] = ()
    notes: tuple[str, ...] = ()
    in_memory: bool = False
    whole: bool = True

    def __len__(self) -> int:
        """Count the rows."""
        return len(self.lines)

    @property
    def counts(self) -> str:
        """Unit of `lines` in messages: row or line."""
        return "row" if self.in_memory else "line"

    def problem(self, row: int, column: str, found: str, expected: str) -> Problem:
        """Return a problem of a row."""
        line = int(self.lines[row]) if len(self) else 1
        return Problem(self.file, line, column, found, expected, in_memory=self.in_memory)

    def has(self, *columns: str) -> bool:
        """Tell whether the table has all these columns."""
        return set(columns) <= {*self.text, *self.numbers}

    def select(self, keep: Mask) -> Table:
        """Return some of the rows."""
        rows = np.flatnonzero(keep)
        return replace(
            self,
            lines=self.lines[rows],
            text={name: [cells[i] for i in rows.tolist()] for name, cells in self.text.items()},
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
}


# --- Which names a flight may use: any text in one line that is no formula
#
# Names are compared exactly and written to tables unchanged. If a name looked like a formula, a
# spreadsheet that opens such a table would compute it.


LONGEST = 200
"""Largest number of characters of a name."""

NUMBER = re.compile(r"\s*[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?\s*", re.ASCII)

_BLANK = r"[\s\u00ad\u200b-\u200d\u2060\ufeff]*"
_FORMULA = re.compile(rf"{_BLANK}(?:[=@]|[+-]\s*\S)")


def name_fault(name: str) -> tuple[str, str] | None:
    """Return the fault of a name and the expected form; None for a good name.

    Parameters
    ----------
    name : str
        It must not be empty.
    """
    plain = name.isascii() and name.isprintable() and name[:1].isalnum() and ";" not in name
    if plain and len(name) <= LONGEST:
        return None
    if len(name) > LONGEST:
        expected = f"must be a name of at most {LONGEST} characters"
        return f"{quoted(name)} has {len(name)} characters", expected
    if unseen := UNSEEN.search(name):
        fault = f"{quoted(name)} holds the character U+{ord(unseen[0]):04X}"
        return fault, "must be text of one line, no control characters"
    # Where the comma is the decimal sign, a semicolon separates cells; full-width signs count.
    parts = unicodedata.normalize("NFKC", name).split(";")
    if any(_FORMULA.match(part) and not NUMBER.fullmatch(part) for part in parts):
        fault = f"{quoted(name)} would be computed as a formula by a spreadsheet"
        return fault, "must not begin with =, @, or with + or - unless it is a number"
    return None


# --- Numbers as text


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
