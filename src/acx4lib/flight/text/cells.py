"""Problems of the cells of a single table."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from acx4lib.expected import Array, Index, Mask
from acx4lib.flight.problems import Problem, Range, counted, quoted
from acx4lib.flight.text.names import NUMBER, faulty
from acx4lib.flight.text.schemas import Schema
from acx4lib.flight.text.table import Table

LONGEST_NUMBER = 100
"""Largest number of characters of a number."""

FORMS = (
    (r"\s*-?\d+,\d+\s*", "a decimal comma"),
    (r"\s*[-+]?\d+[°:d\s]\s*\d+['\u2032:m\s].*", "degrees, minutes and seconds"),
)
"""Forms that are taken for numbers elsewhere, and what each seems to be."""

_OF_NUMBERS = b"0123456789+-.eE, \t\n\r\f\v"
"""If cells have only these characters, Python's own reading of numbers is right."""


def numbers_of(cells: Sequence[str]) -> Array:
    """Return the cells as numbers, NaN where a cell is none."""
    if not ",".join(cells).encode().translate(None, _OF_NUMBERS):
        try:
            return np.fromiter(map(float, cells), dtype=float, count=len(cells))
        except ValueError:  # then one by one
            pass
    values = [float(cell) if NUMBER.fullmatch(cell) else np.nan for cell in cells]
    return np.array(values, dtype=float)


def cell_problems(table: Table, schema: Schema, whole: Mask) -> Iterator[Problem]:
    """Yield what is wrong with the cells of a table.

    Parameters
    ----------
    table : Table
    schema : Schema
    whole : ndarray of bool
        Rows with as many cells as the header; other rows may lack cells.
    """
    for name, texts in table.text.items():
        if name in schema.ranges:
            yield from _number_problems(table, name, schema.ranges[name], whole)
        else:
            yield from _name_problems(table, name, texts, schema, whole)
    for key in schema.keys:
        yield from _repeated(table, key)


def _number_problems(table: Table, name: str, allowed: Range, whole: Mask) -> Iterator[Problem]:
    values, cells = table.numbers[name], table.text[name]
    finite = np.isfinite(values)
    good = finite & (values >= allowed.low) & (values <= allowed.high)

    def outside(row: int) -> Problem:
        found = _shortened(cells[row].strip()) + _range_hint(table, name, row)
        return table.problem(row, name, found, str(allowed))

    def none(row: int) -> Problem:
        cell = cells[row]
        hint = next((f" ({what}?)" for form, what in FORMS if re.fullmatch(form, cell)), "")
        found = f"{quoted(cell)}{hint}" if cell.strip() else "is empty"
        point = "" if table.in_memory else ", decimal point"
        return table.problem(row, name, found, f"must be a finite number{point}")

    yield from counted(np.flatnonzero(whole & finite & ~good), outside)
    yield from counted(np.flatnonzero(whole & ~finite), none)
    if not table.in_memory and max(map(len, cells), default=0) > LONGEST_NUMBER:
        long = [row for row, cell in enumerate(cells) if len(cell) > LONGEST_NUMBER and good[row]]
        expected = f"must be a number of at most {LONGEST_NUMBER} characters"
        yield from counted(
            long,
            lambda row: table.problem(row, name, f"has {len(cells[row])} characters", expected),
        )


def _shortened(cell: str) -> str:
    return cell if len(cell) <= LONGEST_NUMBER else f"{cell[:LONGEST_NUMBER]}…"


def _range_hint(table: Table, name: str, row: int) -> str:
    lon = table.numbers.get("lon_deg")
    if name == "lat_deg" and lon is not None and abs(lon[row]) <= 90:
        return " (latitude and longitude swapped?)"
    return ""


def _name_problems(
    table: Table, name: str, texts: Sequence[str], schema: Schema, whole: Mask
) -> Iterator[Problem]:
    names = set(texts)
    faults = faulty(names)
    if name not in schema.may_be_empty:
        faults |= {cell: ("is empty", "must be a name") for cell in names if not cell.strip()}
    if not faults:
        return
    kinds: dict[str, list[int]] = {}
    for row, cell in enumerate(texts):
        if cell in faults and (cell or whole[row]):
            kinds.setdefault(faults[cell][1], []).append(row)
    for expected, rows in kinds.items():
        yield from counted(rows, _faulty_name(table, name, faults, expected))


def _faulty_name(
    table: Table, name: str, faults: dict[str, tuple[str, str]], expected: str
) -> Callable[[int], Problem]:
    """Return a function that describes a row with a faulty name."""
    return lambda row: table.problem(row, name, faults[table.text[name][row]][0], expected)


def _repeated(table: Table, key: tuple[str, ...]) -> Iterator[Problem]:
    """Yield rows whose names occur in an earlier row."""
    if not all(name in table.text for name in key):
        return
    columns = [table.text[name] for name in key]
    first = _first_alike(columns)
    again = first != np.arange(len(first))
    if not again.any():
        return
    for cells in columns:
        again &= np.fromiter(map(bool, cells), dtype=bool, count=len(cells))

    def problem(row: int) -> Problem:
        called = ", ".join(quoted(cells[row]) for cells in columns)
        found = f"{called} stands in {table.counts} {table.lines[first[row]]} already"
        return table.problem(row, ", ".join(key), found, f"every {' and '.join(key)} once")

    yield from counted(np.flatnonzero(again), problem)


def _first_alike(columns: Sequence[Sequence[str]]) -> Index:
    """Return for every row the first row with the same names."""
    code = np.zeros(len(columns[0]), dtype=np.int64)
    for cells in columns:
        index = {name: i for i, name in enumerate(dict.fromkeys(cells))}
        own = np.fromiter(map(index.__getitem__, cells), dtype=np.int64, count=len(cells))
        code = code * max(len(index), 1) + own
    _, first, inverse = np.unique(code, return_index=True, return_inverse=True)
    return first[inverse]
