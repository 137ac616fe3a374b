"""What is wrong with the cells of a results table, column by column."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pandas as pd

from acx4lib.expected import Index, Mask
from acx4lib.flight.problems import Problem, Range, counted, did_you_mean, quoted
from acx4lib.results.files.schemas import SCHEMAS, Schema

FIRST = 2
"""Line of the first row."""


def cell_problems(file: str, frame: pd.DataFrame) -> Iterator[Problem]:
    """Yield what is wrong with the cells of a table, row by row.

    Parameters
    ----------
    file : str
        Its path; the name is one of `SCHEMAS` with ``.csv``.
    frame : DataFrame
        With its columns, a row for every line after the first.
    """
    schema = SCHEMAS[Path(file).stem]
    for name, allowed in schema.ranges.items():
        yield from _numbers(file, frame[name], allowed, needed=name in schema.needed)
    for name, words in schema.words.items():
        yield from _words(file, frame[name], words)
    if schema.key:
        yield from _repeated(file, frame, schema)


def wrong_rows(
    file: str, column: str, rows: Mask | Index, found: Callable[[int], str], expected: str
) -> Iterator[Problem]:
    """Yield the problems of some rows of a table that was read without any problem of its cells.

    Parameters
    ----------
    file, column : str
    rows : ndarray
        Which rows, or of all of them whether they are wrong.
    found : callable
        What is there in a row.
    expected : str
    """
    idx: Index = np.flatnonzero(rows) if rows.dtype == bool else rows.astype(np.intp)

    def problem(row: int) -> Problem:
        return Problem(
            file=file, line=row + FIRST, column=column, found=found(row), expected=expected
        )

    yield from counted(idx, problem)


def _numbers(file: str, column: pd.Series, allowed: Range, *, needed: bool) -> Iterator[Problem]:
    values = column.to_numpy()
    bad = ~((values >= allowed.low) & (values <= allowed.high))
    if allowed.whole:
        bad |= np.floor(values) != values
    if not needed:
        bad &= ~np.isnan(values)

    def found(row: int) -> str:
        return "is empty" if np.isnan(values[row]) else repr(float(values[row]))

    yield from wrong_rows(file, str(column.name), bad, found, str(allowed))


def _words(file: str, column: pd.Series, words: tuple[str, ...]) -> Iterator[Problem]:
    """Yield cells with none of the known words."""
    bad = ~column.isin(words).to_numpy()

    def found(row: int) -> str:
        cell = str(column.iloc[row])
        return f"{quoted(cell)} is unknown{did_you_mean(cell, words)}"

    yield from wrong_rows(file, str(column.name), bad, found, f"must be one of {', '.join(words)}")


def _repeated(file: str, frame: pd.DataFrame, schema: Schema) -> Iterator[Problem]:
    """Yield rows that stand above already."""
    cells = frame[list(schema.key)]
    again = np.array(cells.duplicated())
    if again.any():
        again &= ~_often(frame, schema)

    def found(row: int) -> str:
        alike = (cells == cells.iloc[row]).all(axis=1)
        first = int(np.flatnonzero(alike)[0])
        names = ", ".join(quoted(str(cell)) for cell in cells.iloc[row])
        return f"{names} stands in line {first + FIRST} already"

    yield from wrong_rows(file, "row", again, found, f"every {', '.join(schema.key)} once")


def _often(frame: pd.DataFrame, schema: Schema) -> Mask:
    """Tell which rows may repeat others."""
    out = np.zeros(len(frame), dtype=bool)
    for words in schema.often:
        own = np.ones(len(frame), dtype=bool)
        for name, some in words.items():
            own &= frame[name].isin(some).to_numpy()
        out |= own
    return out
