"""Tables in memory: a DataFrame, or arrays by their columns, checked as a file would be."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Protocol, overload

import numpy as np
from numpy.typing import NDArray

from acx4lib.expected import Array, given
from acx4lib.flight.problems import NO_ROWS, Problem, counted, quoted
from acx4lib.flight.text.cells import cell_problems
from acx4lib.flight.text.headers import extra_notes, header_problems
from acx4lib.flight.text.schemas import Schema
from acx4lib.flight.text.table import Table

PICTURES = ("file",)
"""Columns that a table in memory does not have: it has no folder in which files could lie."""


class Frame(Protocol):
    """What a DataFrame of pandas and others have in common."""

    @property
    def columns(self) -> Any:
        """Names of the columns."""

    def __getitem__(self, column: str, /) -> Any:
        """Return a column."""


Columns = Mapping[str, Any] | Frame
"""A table in memory: arrays or lists by the names of their columns, or a DataFrame."""


class Written(Sequence[str]):
    """The cells of a numeric column as text, written when somebody asks."""

    def __init__(self, values: NDArray[Any]) -> None:
        self._values = values

    def __len__(self) -> int:
        """Count the cells."""
        return len(self._values)

    @overload
    def __getitem__(self, row: int) -> str: ...
    @overload
    def __getitem__(self, row: slice) -> Sequence[str]: ...
    def __getitem__(self, row: int | slice) -> str | Sequence[str]:
        """Return a cell, or some of them."""
        if isinstance(row, slice):
            return Written(self._values[row])
        value = self._values[row]
        return "" if _is_missing(value) else str(value)


def table_in_memory(columns: Columns, name: str, schema: Schema) -> Table:
    """Return a table made from columns; what is wrong is in its `problems`.

    Parameters
    ----------
    columns : mapping of str to array, or DataFrame
        Names may be text or whole numbers. A standard deviation may be infinite: not known.
    name : str
        What messages call it.
    schema : Schema
        Of the file that it stands for, without `PICTURES`.
    """
    schema = replace(schema, optional=tuple(c for c in schema.optional if c not in PICTURES))
    table = Table(file=name, in_memory=True)
    names = columns if isinstance(columns, Mapping) else getattr(columns, "columns", None)
    if names is None:
        expected = "must be a DataFrame, or a dict of arrays"
        return replace(table, problems=(_whole(name, "table", f"is {given(columns)}", expected),))
    header = [str(column) for column in names] or [""]
    wrong = tuple(
        replace(problem, line=-1, in_memory=True)
        for problem in header_problems(name, header, schema)
    )
    found = {c: _cells(columns[c]) for c in dict.fromkeys(names) if c in schema.known}
    misshapen = tuple(_shape_problems(name, found))
    if wrong or misshapen:
        return replace(table, problems=(*wrong, *misshapen))
    notes = tuple(extra_notes(name, header, schema))
    return _checked(replace(table, notes=notes), found, schema)


def _cells(column: Any) -> NDArray[Any]:
    """Return a column as an array; a list keeps the types of its cells."""
    return np.asarray(column, dtype=object if isinstance(column, list | tuple) else None)


def _whole(name: str, column: str, found: str, expected: str) -> Problem:
    return Problem(
        file=name, line=-1, column=column, found=found, expected=expected, in_memory=True
    )


def _shape_problems(name: str, columns: Mapping[str, NDArray[Any]]) -> Iterator[Problem]:
    """Yield the columns that are no column, or not as long as the longest."""
    n = max((len(cells) for cells in columns.values() if cells.ndim == 1), default=0)
    longest = next((c for c, cells in columns.items() if cells.shape == (n,)), "")
    for column, cells in columns.items():
        if cells.ndim == 0:
            expected = f"must be one for each row: np.full({n}, {cells.item()!r})"
            yield _whole(name, column, f"the single value {cells.item()!r}", expected)
        elif cells.ndim > 1:
            expected = f"must be one value for each row, shape ({n},)"
            yield _whole(name, column, f"an array of shape {cells.shape}", expected)
        elif len(cells) != n:
            yield _whole(name, column, f"{len(cells)} values", f"must be {n}, as {longest} has")


def _checked(table: Table, columns: Mapping[str, NDArray[Any]], schema: Schema) -> Table:
    """Return the table with its cells, and what is wrong with them."""
    n = len(next(iter(columns.values())))
    text: dict[str, Sequence[str]] = {}
    numbers: dict[str, Array] = {}
    no_names: list[Problem] = []
    table = replace(table, lines=np.arange(n))
    for column, cells in columns.items():
        if column in schema.ranges:
            numbers[column], text[column] = _numbers(cells), Written(cells)
        else:
            text[column], wrong = _names(cells)
            no_names += counted(wrong, _no_name(table, column, cells))
    if no_names:
        return replace(table, problems=tuple(no_names))
    table = replace(table, text=text, numbers=numbers)
    problems = list(cell_problems(_with_known(table), schema, np.ones(n, dtype=bool)))
    if schema.rows and not n:
        problems = [_whole(table.file, "table", NO_ROWS, "must have one at least")]
    return replace(table, problems=tuple(problems), sha256=_checksum(table))


def _with_known(table: Table) -> Table:
    """Return the table with a usual value for standard deviations that are not known."""
    numbers = {
        column: np.where(np.isposinf(values), 1.0, values) if column.startswith("sigma") else values
        for column, values in table.numbers.items()
    }
    return replace(table, numbers=numbers)


def _numbers(cells: NDArray[Any]) -> Array:
    """Return cells as numbers, NaN where one is none; text is none, whatever it says."""
    if cells.dtype.kind in "fiu":
        return cells.astype(float)
    return np.fromiter(map(_number, cells), dtype=float, count=len(cells))


def _number(value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        return np.nan
    try:
        return float(value)
    except OverflowError:  # an integer of Python may have any number of digits
        return np.nan


def _names(cells: NDArray[Any]) -> tuple[tuple[str, ...], list[int]]:
    """Return cells as names, and the rows of those that are neither text nor a whole number."""
    values = cells.tolist()
    if cells.dtype.kind in "iu":
        return tuple(map(str, values)), []
    empty = [_is_missing(one) or (isinstance(one, float) and np.isnan(one)) for one in values]
    names = ["" if none else str(one) for none, one in zip(empty, values, strict=True)]
    good = [none or _is_name(one) for none, one in zip(empty, values, strict=True)]
    return tuple(names), np.flatnonzero(np.logical_not(good)).tolist()


def _is_name(value: object) -> bool:
    return isinstance(value, str | int | np.integer) and not isinstance(value, bool)


def _is_missing(value: object) -> bool:
    """Tell whether a cell is empty: pandas' own value for that cannot be compared."""
    return value is None or type(value).__name__ in ("NAType", "NaTType")


def _no_name(table: Table, column: str, cells: NDArray[Any]) -> Callable[[int], Problem]:
    def problem(row: int) -> Problem:
        found = quoted(cells[row].item() if isinstance(cells[row], np.generic) else cells[row])
        return table.problem(row, column, found, "must be a name: text, or a whole number")

    return problem


def _checksum(table: Table) -> str:
    """Return the SHA-256 of all cells."""
    whole = hashlib.sha256()
    for column, cells in table.text.items():
        whole.update(column.encode())
        values = table.numbers.get(column)
        data = "\0".join(cells).encode() if values is None else values.tobytes()
        whole.update(data)
    return whole.hexdigest()
