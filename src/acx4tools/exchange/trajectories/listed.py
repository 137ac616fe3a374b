"""The rows of a text with declared columns: a list of events, of orientations, or of points."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.flight.problems import Range, quoted
from acx4lib.flight.tables import NUMBER, name_fault
from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.safe.text_lines import Line, lines
from acx4tools.exchange.trajectories.columns import (
    KNOWN,
    SKIP,
    Column,
    column,
    declared,
    position_of,
)

SEPARATORS = {"comma": ",", "semicolon": ";", "tab": "\t", "space": None}
COMMENTS = "#"
QUOTED_CELL = re.compile(r"\"[^\"]*\"")
NUMBERS = Range(-1e12, 1e12)
MOST = 10_000_000
"""Largest number of rows."""
MOST_BEFORE = 100
"""Lines among which a heading is looked for."""


@dataclass(frozen=True, kw_only=True)
class Listed:
    """Rows with the columns that they have.

    Attributes
    ----------
    source : Opened
    columns : tuple of Column
    rows : tuple of Line
    heading : Line or None
        The line that is a heading and no row, if there is one.
    before : int
        Lines before the heading, which are not read.
    """

    source: Opened
    columns: tuple[Column, ...]
    rows: tuple[Line, ...]
    heading: Line | None = None
    before: int = 0

    def has(self, *names: str) -> bool:
        """Tell whether all these columns are there."""
        return all(position_of(self.columns, name) is not None for name in names)

    def at(self, name: str) -> int:
        """Return where a column stands that is there."""
        return int(position_of(self.columns, name) or 0)

    def numbers(self, name: str) -> Array:
        """Return a column of finite numbers, shape (n,)."""
        k = self.at(name)
        return np.array([row.number_at(k, name, NUMBERS) for row in self.rows], dtype=float)

    def names(self, name: str) -> list[str]:
        """Return a column of names that a flight may use."""
        k = self.at(name)
        return [checked_name(row, row.cell(k, name), name) for row in self.rows]

    def unique(self, name: str) -> list[str]:
        """Return a column of names that are all different."""
        names = self.names(name)
        first: dict[str, Line] = {}
        for row, one in zip(self.rows, names, strict=True):
            if one in first:
                found = f"{quoted(one)} stands in line {first[one].number} already"
                raise row.wrong(name, found, "every one once")
            first[one] = row
        return names


def left_out(listed: Listed, what: str) -> tuple[str, ...]:
    """Return sentences on lines and columns that were not read; `what` is what they are not."""
    k_skipped = [k for k, one in enumerate(listed.columns) if one.name == SKIP]
    heading = listed.heading.cells if listed.heading else ()
    named = [heading[k] if k < len(heading) else f"column {k + 1}" for k in k_skipped]
    longest = max(listed.rows, key=len)
    beyond = len(longest) - len(listed.columns)
    if beyond > 0:
        named.append(f"{beyond} after the last in line {longest.number}")
    return (
        *([f"Lines before the heading: {listed.before}."] if listed.before else []),
        *([f"Columns that are no {what}: {', '.join(named)}."] if named else []),
    )


def checked_name(row: Line, name: str, element: str) -> str:
    """Return a name, refused where a flight may not use it."""
    fault = name_fault(name) if name else ("is empty", "must be a name")
    if fault:
        raise row.wrong(element, *fault)
    return name


def read_list(
    source: Opened,
    columns: str,
    *,
    separator: str = "",
    numbers: Sequence[str],
    known: Mapping[str, str] = KNOWN,
) -> Listed:
    """Return the rows of a text, by declared columns or by those that its heading names.

    Parameters
    ----------
    source : Opened
    columns : str
        As the user declares them; empty: the heading names them.
    separator : str
        One of `SEPARATORS`; empty: semicolons, tabs or commas if the first two lines have any.
    numbers : sequence of str
        Columns of numbers, by which a heading is told from a row.
    known : mapping of str to str
        Names of columns by the words for them.

    Raises
    ------
    FlightError
        Where the columns are not known, or there are no rows.
    """
    before = _before_heading(source, known)
    mark = _separator(source, separator, len(before))
    every = lines(source, separator=mark, comment=COMMENTS)
    found = [one for one in every if one.number > len(before)]
    if not found or len(found) > MOST:
        raise source.wrong("file", f"has {len(found)} rows", f"must have 1 to {MOST}")
    if columns:
        try:
            named = declared(columns, known)
        except ValueError as error:
            what, _, words = str(error).partition("; ")
            raise source.wrong("--columns", what, words or "every column once") from None
        heading = found[0] if _is_heading(found[0], named, numbers) else None
    else:
        heading, named = found[0], _of_heading(found[0], known)
    rows = tuple(found[heading is not None :])
    if not rows:
        raise source.wrong("file", "has a heading and no rows", "must have rows")
    return Listed(source=source, columns=named, rows=rows, heading=heading, before=len(before))


def _before_heading(source: Opened, known: Mapping[str, str]) -> tuple[str, ...]:
    """Return the lines before the first that names columns, if no row stands there; else none.

    Such a line has two different columns at least, and half of its words are columns. A row is a
    line that has numbers in half of its words.
    """
    text = source.text().split("\n")
    for k, line in enumerate(text[:MOST_BEFORE]):
        words = [word for word in re.split(r"[\s;,]+", line.strip()) if word]
        if not words or words[0].startswith(COMMENTS):
            continue
        columns = {one.name for word in words if (one := column(word, known))} - {SKIP}
        if len(columns) >= max(2, len(words) / 2):
            return tuple(text[:k])
        if sum(bool(NUMBER.fullmatch(word)) for word in words) >= len(words) / 2:
            break
    return ()


def _separator(source: Opened, name: str, before: int) -> str | None:
    """Return what stands between cells: a mark that the first two lines after others have."""
    if name:
        return SEPARATORS[name]
    text = (one for one in source.text().split("\n")[before:] if one.strip())
    first = list(islice((one for one in text if not one.lstrip().startswith(COMMENTS)), 2))
    bare = [QUOTED_CELL.sub("", one) for one in first]
    return next((mark for mark in (";", "\t", ",") if all(mark in one for one in bare)), None)


def _is_heading(line: Line, columns: Sequence[Column], numbers: Sequence[str]) -> bool:
    """Tell whether a line has no number where every row has one."""
    where = (k for name in numbers if (k := position_of(columns, name)) is not None)
    cells = [line.cells[k] for k in where if k < len(line.cells)]
    return bool(cells) and not any(NUMBER.fullmatch(cell) for cell in cells)


def _of_heading(line: Line, known: Mapping[str, str]) -> tuple[Column, ...]:
    found = [column(cell, known) for cell in line.cells]
    said = [one for one in found if one is not None and one.name != SKIP]
    if len(said) < 2:
        raise _undeclared(line, f"is no heading: {quoted(' '.join(line.cells))}")
    ((name, times),) = Counter(one.name for one in said).most_common(1)
    if times > 1:
        raise _undeclared(line, f"two columns may be {name!r}")
    return tuple(one or Column(name=SKIP) for one in found)


def _undeclared(line: Line, found: str) -> FlightError:
    return line.wrong("columns", found, "declare them by --columns, in their order")
