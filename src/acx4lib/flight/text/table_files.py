"""Reading tables: first as text, so that every problem has its file, line and column."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from acx4lib.flight.problems import NO_ROWS, Problem
from acx4lib.flight.text.cells import cell_problems, numbers_of
from acx4lib.flight.text.files import read_text
from acx4lib.flight.text.headers import MOST_COLUMNS, extra_notes, header_problems
from acx4lib.flight.text.rows import Rows, read_header, read_rows, whole_rows, width_problems
from acx4lib.flight.text.schemas import SCHEMAS, Schema
from acx4lib.flight.text.table import Table

NO_END = "the last line has no line end; was the file cut off?"


def read_table(path: Path, file: str, *, needed_by: str = "a flight") -> Table:
    """Return a table of a flight; what is wrong is in its `problems`.

    Parameters
    ----------
    path : Path
        Its name is one of `SCHEMAS`.
    file : str
        Its name in messages.
    needed_by : str
        For the message if the file is missing.
    """
    return read_columns(path, file, SCHEMAS[path.name], needed_by=needed_by)


def read_columns(
    path: Path,
    file: str,
    schema: Schema,
    *,
    needed_by: str,
    most: int | None = None,
    as_written: Callable[[str], str] = str,
) -> Table:
    """Return a table with the columns of a schema; what is wrong is in its `problems`.

    Parameters
    ----------
    path, file, needed_by
        As in `read_table`, but the file may have any name.
    schema : Schema
    most : int, optional
        Largest size in bytes; by default what the free memory allows.
    as_written : callable, optional
        Takes the text of the file, and returns it as a table of commas and decimal points, line
        by line.
    """
    whole, sha256, problems = read_text(path, file, needed_by=needed_by, most=most)
    whole = as_written(whole)
    cells, problems = ([], problems) if problems else read_header(whole, file)
    header = [name.strip() for name in cells]
    problems = problems or _no_header(whole, header, file)
    if problems:
        return Table(file=file, problems=problems)
    wrong = header_problems(file, header, schema)
    if wrong and not set(header) & set(schema.required):
        return Table(file=file, problems=wrong)
    if len(header) > MOST_COLUMNS:
        return Table(file=file, problems=wrong)
    wanted = {name: header.index(name) for name in schema.known if name in header}
    names = wanted.keys() - schema.ranges.keys()
    rows, problems = read_rows(whole, file, width=len(header), wanted=wanted, names=names)
    if problems:
        return Table(file=file, problems=problems)
    table, n_blank = _of_rows(file, rows, schema), rows.blank_at_end
    return replace(
        table,
        sha256=sha256,
        problems=(*wrong, *_row_problems(table, rows, schema)),
        notes=(
            *extra_notes(file, header, schema),
            *([f"{file}: {n_blank} blank line{'s' * (n_blank > 1)} at the end"] if n_blank else []),
            *([] if whole.endswith(("\n", "\r")) else [f"{file}: {NO_END}"]),
        ),
    )


def _no_header(text: str, header: list[str], file: str) -> tuple[Problem, ...]:
    if any(header):
        return ()
    found = "begins with a blank line" if text.strip("\r\n\t ,") else "is empty"
    return (Problem(file=file, line=1, column="file", found=found, expected="needs a header"),)


def _of_rows(file: str, rows: Rows, schema: Schema) -> Table:
    text = {name: tuple(cells) for name, cells in rows.columns.items()}
    return Table(
        file=file,
        lines=np.array(rows.lines, dtype=np.int64),
        text=text,
        numbers={n: numbers_of(cells) for n, cells in text.items() if n in schema.ranges},
    )


def _row_problems(table: Table, rows: Rows, schema: Schema) -> Iterator[Problem]:
    if schema.rows and not len(table) and not rows.blank:
        yield table.problem(0, "file", NO_ROWS, "at least one row under the header")
    yield from width_problems(table.file, rows)
    yield from cell_problems(table, schema, whole_rows(rows))
