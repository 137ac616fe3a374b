"""Read tables by pandas, or take them from memory; every problem has its file, line and column."""

from __future__ import annotations

import csv
import hashlib
import io
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from acx4files.flight.problems import (
    ABSENT,
    NO_ROWS,
    QUOTED,
    SHOWN,
    Problem,
    Range,
    counted,
    did_you_mean,
    kind_of,
    quoted,
    whole,
)
from acx4files.flight.tables import Schema, Table, form_of, name_fault, numbers_of
from acx4lib.expected import Array


def read_columns(
    path: Path,
    file: str,
    schema: Schema,
    *,
    needed_by: str,
    as_written: Callable[[str], str] = str,
) -> Table:
    """Read a table with the columns of a schema; its `problems` list the errors.

    Parameters
    ----------
    path : Path
    file, needed_by
        As in `read_text`.
    schema : Schema
    as_written : callable, optional
        Takes the text of the file, and returns it as a table of commas and decimal points, line
        by line.
    """
    text, sha256, problems = read_text(path, file, needed_by=needed_by)
    if problems:
        return Table(file=file, problems=problems)
    text = as_written(text).replace("\r\n", "\n").replace("\r", "\n")
    header, lines, widths, problems = _shape(text, file)
    if problems:
        return Table(file=file, problems=problems, whole=False)
    problems = tuple(_header_problems(file, header, schema))
    wanted = {name: header.index(name) for name in schema.known if name in header}
    if problems and not wanted.keys() & set(schema.required):
        return Table(file=file, problems=problems, whole=False)
    used = len(widths) - next((k for k, width in enumerate(reversed(widths)) if width), len(widths))
    whole = np.array(widths[:used], dtype=np.int64) == len(header)
    cells = _cells_of(text, wanted, whole, len(widths) - used)
    table = Table(file=file, lines=np.array(lines[:used], dtype=np.int64)[whole], sha256=sha256)
    notes = [*_extra_notes(file, header, schema)]
    if blank := len(widths) - used:
        notes.append(f"{file}: {blank} blank line{'s' * (blank > 1)} at the end")
    if not text.endswith("\n"):
        notes.append(f"{file}: the last line has no line end; was the file cut off?")
    problems += tuple(width_problems(file, lines, widths[:used], len(header)))
    return replace(
        checked(replace(table, problems=problems, notes=tuple(notes)), cells, schema),
        whole=bool(whole.all()),
    )


def _shape(text: str, file: str) -> tuple[list[str], list[int], list[int], tuple[Problem, ...]]:
    """Return the header, line and number of cells of every row under it, and what is no table.

    A row of blank cells has none. pandas would take the first column for an index where every
    row has one cell more than the header, and says nothing.
    """
    reader, ends = csv.reader(io.StringIO(text, newline=""), strict=True), [1]
    widths: list[int] = []
    try:
        header = [name.strip() for name in next(reader, [])]
        ends[0] = reader.line_num
        for row in reader:
            widths.append(len(row) if row and (row[0].strip() or any(map(str.strip, row))) else 0)
            ends.append(reader.line_num)
    except csv.Error as error:
        fault = f"cannot be read as a table ({error})"
        expected = "must be comma-separated values, quotes closed"
        place = Problem(file=file, line=ends[-1] + 1, column="file", found=fault, expected=expected)
        return [], [], [], (place,)
    if any(header):
        return header, [end + 1 for end in ends[:-1]], widths, ()
    fault = "begins with a blank line" if text.strip("\r\n\t ,") else "is empty"
    place = Problem(file=file, line=1, column="file", found=fault, expected="needs a header")
    return [], [], [], (place,)


def _cells_of(
    text: str, wanted: Mapping[str, int], whole: NDArray[np.bool_], n_blank: int
) -> dict[str, list[str]]:
    """Return the cells of the wanted columns, of the rows as wide as the header."""
    if not whole.any() or not wanted:
        return {name: [] for name in wanted}
    frame = pd.read_csv(
        io.StringIO(text, newline=""),
        header=None,
        skiprows=[
            0,
            *(np.flatnonzero(~whole) + 1),
            *range(len(whole) + 1, len(whole) + n_blank + 1),
        ],
        usecols=sorted(wanted.values()),
        dtype=object,
        na_filter=False,
        skip_blank_lines=False,
    )
    return {name: frame[k].tolist() for name, k in wanted.items()}


def _header_problems(file: str, header: Sequence[str], schema: Schema) -> Iterator[Problem]:
    """Yield the problems of the columns of a table."""

    def wrong(column: str, fault: str, expected: str) -> Problem:
        return Problem(file, 1, column, fault, expected)

    if len(header) == 1 and (separator := _separator(header[0], schema)):
        cure = "must be separated by commas, numbers with decimal points"
        yield wrong("header", f"is separated by {separator}", cure)
        return
    for name, count in Counter(header).items():
        if count > 1 and name in schema.known:
            yield wrong(name, f"stands {count} times in the header", "every column once")
    named = list(dict.fromkeys(header))
    begun = [form for form in schema.forms if set(form) & set(named)]
    if len(begun) > 1:
        both = [", ".join(name for name in named if name in form) for form in begun]
        yield wrong(both[0], f"beside {both[1]}", "one form of trajectory in one file")
        return
    if schema.forms and not begun:
        either = " or ".join(", ".join(form) for form in schema.forms)
        yield wrong("position and attitude", "missing in the header", f"must be {either}")
    unknown = [other for other in named if other not in schema.known]
    required = (*schema.required, *(name for form in begun for name in form))
    for name in (name for name in required if name not in named):
        lower = [other for other in unknown if other.lower() == name]
        near = did_you_mean(name, unknown).replace("did you mean", "is it")
        hint = f" (is it {lower[0]!r}?)" if lower else near
        yield wrong(name, f"missing in the header{hint}", "required")


def _separator(line: str, schema: Schema) -> str:
    """Return what separates columns in place of commas, "" for nothing known."""
    spaces = " " if set(line.split(" ")) & set(schema.known) else "\0"
    kinds = {";": "semicolons", "\t": "tabs", spaces: "spaces"}
    return next((name for separator, name in kinds.items() if separator in line), "")


def _extra_notes(file: str, header: Sequence[str], schema: Schema) -> Iterator[str]:
    """Yield a note on each unread column, up to `SHOWN`, and a note on the rest."""
    extra = [name for name in header if name and name not in schema.known]
    for name in extra[:SHOWN]:
        yield f"{file}: column {quoted(name)} is not read{did_you_mean(name, schema.known)}"
    if len(extra) > SHOWN:
        yield f"{file}: {len(extra) - SHOWN} more columns are not read"


def width_problems(
    file: str, lines: Sequence[int], widths: Sequence[int], n: int, hint: str = "a decimal comma?"
) -> Iterator[Problem]:
    """Yield blank lines between others, and rows of another width than the header.

    Parameters
    ----------
    file : str
    lines, widths : sequence of int
        Line and number of cells of every row; a blank one has no cell.
    n : int
        Number of cells of the header.
    hint : str
        Why a row may have more.
    """

    def wrong(k: int) -> Problem:
        why = "cut off?" if widths[k] < n else hint
        fault = f"has {widths[k]} cells ({why})" if widths[k] else "is blank"
        expected = f"as many as the header: {n}"
        return Problem(file, lines[k], "row", fault, expected)

    yield from counted([k for k, width in enumerate(widths) if width != n], wrong)


# --- The cells of a table, from a file or from memory


def checked(table: Table, cells: Mapping[str, Any], schema: Schema) -> Table:
    """Return a table with its names and numbers, and their problems.

    Parameters
    ----------
    table : Table
        Of the same rows; its own problems are kept.
    cells : mapping of str to sequence
        The cells of each column, text or, of a table in memory, numbers.
    schema : Schema
        Ranges of the columns of numbers, names that may be empty, keys.
    """
    numbers = {
        name: cells[name].astype(float)
        if isinstance(cells[name], np.ndarray)
        else numbers_of(cells[name])
        for name in cells
        if name in schema.ranges
    }
    text = {name: tuple(cells[name]) for name in cells if name not in schema.ranges}
    table = replace(table, text=text, numbers=numbers)
    problems = [*table.problems]
    if schema.rows and not len(table) and not problems:
        whole = "table" if table.in_memory else "file"
        problem = table.problem(0, whole, NO_ROWS, "at least one row under the header")
        problems.append(replace(problem, line=-1) if table.in_memory else problem)
    for name, values in numbers.items():
        problems += _number_problems(table, name, cells[name], values, schema.ranges[name])
    for name, names in text.items():
        problems += _name_problems(table, name, names, may_be_empty=name in schema.may_be_empty)
    for key in schema.keys:
        problems += _repeated(table, key)
    return replace(table, problems=tuple(problems))


def _number_problems(
    table: Table, name: str, cells: Sequence[Any], values: Array, allowed: Range
) -> Iterator[Problem]:
    finite, lon = np.isfinite(values), table.numbers.get("lon_deg")
    good = (values >= allowed.low) & (values <= allowed.high)
    if allowed.whole:
        good &= values == np.round(values)
    if table.in_memory and name.startswith("sigma"):
        good |= np.isposinf(values)  # not known
        finite |= np.isposinf(values)

    def outside(row: int) -> Problem:
        swapped = name == "lat_deg" and lon is not None and abs(lon[row]) <= 90
        hint = " (latitude and longitude swapped?)" if swapped else ""
        return table.problem(row, name, str(cells[row]).strip()[:QUOTED] + hint, str(allowed))

    def none(row: int) -> Problem:
        cell = str(cells[row])
        fault = f"{quoted(cell)}{form_of(cell)}" if cell.strip() else "is empty"
        point = "" if table.in_memory else ", decimal point"
        return table.problem(row, name, fault, f"must be a finite number{point}")

    yield from counted(np.flatnonzero(finite & ~good), outside)
    yield from counted(np.flatnonzero(~finite), none)


def _name_problems(
    table: Table, name: str, names: Sequence[str], *, may_be_empty: bool
) -> Iterator[Problem]:
    faults = {cell: fault for cell in set(names) if cell and (fault := name_fault(cell))}
    if not may_be_empty:
        faults |= {cell: ("is empty", "must be a name") for cell in set(names) if not cell.strip()}

    def wrong(row: int) -> Problem:
        return table.problem(row, name, *faults[names[row]])

    for expected in dict.fromkeys(expected for _, expected in faults.values()):
        alike = {cell for cell, (_, other) in faults.items() if other == expected}
        yield from counted([row for row, cell in enumerate(names) if cell in alike], wrong)


def _repeated(table: Table, key: tuple[str, ...]) -> Iterator[Problem]:
    """Yield rows whose names occur in an earlier row."""
    if not set(key) <= table.text.keys():
        return
    names = pd.DataFrame({name: pd.Series(table.text[name], dtype=object) for name in key})
    again = names.duplicated() & (names != "").all(axis=1)
    if not again.any():
        return
    first: dict[tuple[str, ...], int] = {}
    for row, cells in enumerate(names.itertuples(index=False, name=None)):
        first.setdefault(cells, row)

    def problem(row: int) -> Problem:
        cells = tuple(names.iloc[row])
        earlier = f"{table.counts} {table.lines[first[cells]]}"
        fault = f"{', '.join(map(quoted, cells))} stands in {earlier} already"
        return table.problem(row, ", ".join(key), fault, f"every {' and '.join(key)} once")

    yield from counted(np.flatnonzero(again), problem)


# --- The bytes of a flight's files


DEEPEST = 10
"""Largest number of folders in the name of a file."""


def read_bytes(
    path: Path, file: str, *, needed_by: str = "a flight"
) -> tuple[bytes, tuple[Problem, ...]]:
    """Return the content of a file, or the problem of reading it.

    Parameters
    ----------
    path : Path
    file : str
        Its name in messages.
    needed_by : str
        For the message if the file is missing.
    """
    try:
        return path.read_bytes(), ()
    except FileNotFoundError:
        fault, expected = ABSENT, f"{needed_by} needs it"
    except (OSError, ValueError) as error:  # ValueError: a name that no file can have
        fault = f"cannot be read ({getattr(error, 'strerror', None) or error})"
        expected = "must be a readable file"
    return b"", (Problem(file, 1, "file", fault, expected),)


def read_text(
    path: Path, file: str, *, needed_by: str = "a flight"
) -> tuple[str, str, tuple[Problem, ...]]:
    """Return a file's text without byte-order mark, its SHA-256, and its problems."""
    content, problems = read_bytes(path, file, needed_by=needed_by)
    if problems:
        return "", "", problems
    fault, place, is_wide = "", 0, content.startswith((BOM_UTF16_LE, BOM_UTF16_BE))
    try:
        text = content.decode("utf-8-sig")
        if "\0" in text:
            fault, place = "holds a null character", content.index(b"\0")
    except UnicodeDecodeError as error:
        place = error.start
        fault = f"byte 0x{content[place]:02x} is not UTF-8{' (UTF-16?)' if is_wide else ''}"
    if not fault:
        return text, hashlib.sha256(content).hexdigest(), ()
    line, expected = content.count(b"\n", 0, place) + 1, "must be UTF-8 text"
    return "", "", (Problem(file, line, "file", fault, expected),)


def named_file(flight: Path, folder: Path, name: str) -> tuple[Path | None, str]:
    """Return the resolved path of a flight's file, or None and the fault of its name.

    Parameters
    ----------
    flight : Path
        Folder in which the file must lie; without links.
    folder : Path
        Folder to which the name is relative; without links.
    name : str
    """
    if name.count("/") > DEEPEST:
        return None, f"has more than {DEEPEST} folders"
    try:
        path = Path(folder, name)
        there, path = path.exists(), path.resolve()
    except (OSError, RuntimeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        return None, f"is no file name that can be used ({str(reason).splitlines()[0]})"
    if flight not in path.parents:
        return None, "lies outside the flight"
    if not there:
        return None, ABSENT
    return (path, "") if path.is_file() else (None, "is no regular file")


# --- Tables in memory: a DataFrame, or arrays by their columns, checked as a file would be


PICTURES = ("file",)
"""Columns that a table in memory does not have: it has no folder in which files could lie."""


Columns = Mapping[str, Any] | pd.DataFrame
"""A table in memory: arrays or lists by the names of their columns, or a DataFrame."""


def table_in_memory(columns: Columns, name: str, schema: Schema) -> Table:
    """Build a table from columns; its `problems` list the errors.

    Parameters
    ----------
    columns : mapping of str to array, or DataFrame
        Names may be text or whole numbers. A standard deviation may be infinite: not known.
    name : str
        Its name in messages.
    schema : Schema
        Schema of the file that it replaces, without `PICTURES`.
    """
    schema = replace(schema, optional=tuple(c for c in schema.optional if c not in PICTURES))
    names = columns if isinstance(columns, Mapping) else getattr(columns, "columns", None)
    table = Table(file=name, in_memory=True, whole=False)
    if names is None:
        fault, cure = f"is {kind_of(columns)}", "must be a DataFrame, or a dict of arrays"
        return replace(table, problems=(whole(name, "table", fault, cure),))
    header = [str(column) for column in names] or [""]
    problems = [
        whole(name, p.column, p.found, p.expected) for p in _header_problems(name, header, schema)
    ]
    arrays: dict[str, NDArray[Any]] = {
        c: np.asarray(columns[c], dtype=object if isinstance(columns[c], list | tuple) else None)
        for c in dict.fromkeys(names)
        if c in schema.known
    }
    n = max((len(values) for values in arrays.values() if values.ndim == 1), default=0)
    cure = f"must be one value for each row, shape ({n},)"
    problems += [
        whole(name, column, f"has shape {values.shape}", cure)
        for column, values in arrays.items()
        if values.shape != (n,)
    ]
    if problems:
        return replace(table, problems=tuple(problems))
    notes = tuple(_extra_notes(name, header, schema))
    table = replace(table, lines=np.arange(n), notes=notes, whole=True)
    cells: dict[str, Any] = {}
    for column, values in arrays.items():
        if column in schema.ranges and values.dtype.kind in "fiu":
            cells[column] = values
        else:
            text = pd.Series(values, dtype=object)
            cells[column] = text.mask(text.isna(), "").map(str).tolist()
    table = checked(table, cells, schema)
    sums = hashlib.sha256()
    for column, names_of in table.text.items():
        sums.update("\0".join((column, *names_of)).encode())
    for column, numbers in table.numbers.items():
        sums.update(column.encode() + numbers.tobytes())
    return replace(table, sha256=sums.hexdigest())
