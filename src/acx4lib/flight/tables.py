"""The tables of a flight: text first, so that every problem has its file, line and column."""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from acx4lib._typing import Array, Mask
from acx4lib.flight.problems import Problem, Range, did_you_mean
from acx4lib.flight.schemas import SCHEMAS, Schema

NO_END = "the last line has no line end; was the file cut off?"


@dataclass(frozen=True, kw_only=True, eq=False)
class Table:
    """A table as it was read.

    Attributes
    ----------
    file : str
        As the user reaches it.
    lines : tuple of int
        Of every row in the file.
    text : dict
        Cells of every known column that is there.
    numbers : dict
        The same of the numeric columns; NaN where a cell holds no usable number.
    problems : tuple of Problem
    notes : tuple of str
        What is odd but allowed.
    """

    file: str
    lines: tuple[int, ...] = ()
    text: dict[str, tuple[str, ...]] = field(default_factory=dict)
    numbers: dict[str, Array] = field(default_factory=dict)
    problems: tuple[Problem, ...] = ()
    notes: tuple[str, ...] = ()

    def __len__(self) -> int:
        """Count the rows."""
        return len(self.lines)

    def problem(self, row: int, column: str, found: str, expected: str) -> Problem:
        """Return a problem of a row."""
        line = self.lines[row] if len(self) else 1
        return Problem(file=self.file, line=line, column=column, found=found, expected=expected)

    def has(self, *columns: str) -> bool:
        """Tell whether all these columns are there."""
        return set(columns) <= set(self.text)

    def select(self, keep: Mask) -> Table:
        """Return some of the rows."""
        rows = np.flatnonzero(keep)
        return replace(
            self,
            lines=tuple(self.lines[i] for i in rows),
            text={name: tuple(cells[i] for i in rows) for name, cells in self.text.items()},
            numbers={name: values[keep] for name, values in self.numbers.items()},
        )

    def stack(self, *columns: str) -> Array:
        """Return numeric columns side by side, shape (n, k)."""
        return np.stack([self.numbers[column] for column in columns], axis=-1)


def read_table(path: Path, file: str, *, needed_by: str = "a flight") -> Table:
    """Return a table of a flight, whatever is wrong with it.

    Parameters
    ----------
    path : Path
        Its name is one of `SCHEMAS`.
    file : str
        What to call it.
    needed_by : str
        Said where it is not there.
    """
    schema = SCHEMAS[path.name]
    whole, problems = read_text(path, file, needed_by=needed_by)
    if problems:
        return Table(file=file, problems=problems)
    lines, cells, problems = _rows(whole, file)
    if problems:
        return Table(file=file, problems=problems)
    if not cells or not any(cells[0]):
        found = "begins with a blank line" if any(map(any, cells)) else "is empty"
        problem = Problem(file=file, line=1, column="file", found=found, expected="needs a header")
        return Table(file=file, problems=(problem,))
    header = [name.strip() for name in cells[0]]
    wrong = _separator_problems(file, header, schema) or tuple(
        _header_problems(file, header, schema)
    )
    if wrong and not set(header) & set(schema.required):
        return Table(file=file, problems=wrong)
    blank, lines, cells = _without_blank_end(lines[1:], cells[1:])
    table = _columns(file, header, schema, lines, cells)
    extra = [name for name in header if name and name not in schema.known]
    return Table(
        file=file,
        lines=table.lines,
        text=table.text,
        numbers=table.numbers,
        problems=(*wrong, *table.problems, *_row_problems(table, len(header), cells, schema)),
        notes=(
            *(_extra_note(file, name, schema) for name in extra),
            *([f"{file}: {blank} blank lines at the end"] if blank else []),
            *([] if whole.endswith(("\n", "\r")) else [f"{file}: {NO_END}"]),
        ),
    )


def read_text(
    path: Path, file: str, *, needed_by: str = "a flight"
) -> tuple[str, tuple[Problem, ...]]:
    """Return a file's text without byte-order mark, or what is wrong with it."""

    def wrong(line: int, found: str, expected: str) -> tuple[str, tuple[Problem, ...]]:
        return "", (Problem(file=file, line=line, column="file", found=found, expected=expected),)

    if path.exists() and not (path.is_file() or path.is_dir()):  # reading a pipe would wait
        return wrong(1, "cannot be read (no regular file)", "must be a readable file")
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return wrong(1, "is not there", f"{needed_by} needs it")
    except OSError as error:
        return wrong(1, f"cannot be read ({error.strerror})", "must be a readable file")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        bad = f"byte 0x{data[error.start]:02x} is not UTF-8"
        return wrong(data.count(b"\n", 0, error.start) + 1, bad, "must be UTF-8 text")
    if "\0" in text:
        line = text.count("\n", 0, text.index("\0")) + 1
        return wrong(line, "holds a null character", "must be UTF-8 text")
    return text, ()


def _rows(text: str, file: str) -> tuple[list[int], list[list[str]], tuple[Problem, ...]]:
    """Return the line on which every row begins, and its cells."""
    reader = csv.reader(io.StringIO(text, newline=""), strict=True)
    lines, cells, start = [], [], 1
    try:
        for row in reader:
            lines.append(start)
            cells.append(row)
            start = reader.line_num + 1
    except csv.Error as error:
        problem = Problem(
            file=file,
            line=start,
            column="file",
            found=f"cannot be read as a table ({error})",
            expected="must be comma-separated values, quotes closed",
        )
        return [], [], (problem,)
    return lines, cells, ()


def _separator_problems(file: str, header: list[str], schema: Schema) -> tuple[Problem, ...]:
    """Return the one problem of a table whose names are separated by something else."""
    (name, *others) = header
    separators = {";": "semicolons", "\t": "tabs"}
    if set(name.split(" ")) & set(schema.known):
        separators[" "] = "spaces"
    called = [says for separator, says in separators.items() if separator in name]
    if others or not called:
        return ()
    expected = "must be separated by commas, numbers with decimal points"
    found = f"is separated by {called[0]}"
    return (Problem(file=file, line=1, column="header", found=found, expected=expected),)


def _header_problems(file: str, header: list[str], schema: Schema) -> Iterator[Problem]:
    def wrong(column: str, found: str, expected: str) -> Problem:
        return Problem(file=file, line=1, column=column, found=found, expected=expected)

    for name, count in Counter(header).items():
        if count > 1 and name in schema.known:
            yield wrong(name, f"stands {count} times in the header", "every column once")
    begun = [form for form in schema.forms if set(form) & set(header)]
    if len(begun) > 1:
        both = [", ".join(name for name in header if name in form) for form in begun]
        yield wrong(both[0], f"beside {both[1]}", "one form of trajectory in one file")
        return
    form = begun[0] if begun else ()
    if schema.forms and not begun:
        either = " or ".join(", ".join(form) for form in schema.forms)
        yield wrong("position and attitude", "missing in the header", f"must be {either}")
    for name in (*schema.required, *form):
        if name not in header:
            hint = _header_hint(name, header, schema)
            yield wrong(name, f"missing in the header{hint}", "required")


def _header_hint(name: str, header: list[str], schema: Schema) -> str:
    unknown = [other for other in header if other not in schema.known]
    lower = {other.lower(): other for other in unknown}
    if name in lower:
        return f" (is it {lower[name]!r}?)"
    hint = did_you_mean(name, unknown)
    return hint.replace("did you mean", "is it")


def _extra_note(file: str, name: str, schema: Schema) -> str:
    return f"{file}: column {name!r} is not read{did_you_mean(name, schema.known)}"


def _without_blank_end(
    lines: list[int], cells: list[list[str]]
) -> tuple[int, list[int], list[list[str]]]:
    n = len(cells)
    while n and not any(cell.strip() for cell in cells[n - 1]):
        n -= 1
    return len(cells) - n, lines[:n], cells[:n]


def _columns(
    file: str, header: list[str], schema: Schema, lines: list[int], cells: list[list[str]]
) -> Table:
    """Return the known columns, short rows filled up, and what is wrong with their cells."""
    width = len(header)
    if any(len(row) != width for row in cells):
        cells = [(row + [""] * (width - len(row)))[:width] for row in cells]
    columns = list(zip(*cells, strict=True)) if cells else [()] * width
    text = {n: tuple(columns[header.index(n)]) for n in schema.known if n in header}
    numbers = {n: _numbers(cells) for n, cells in text.items() if n in schema.ranges}
    return Table(file=file, lines=tuple(lines), text=text, numbers=numbers)


NUMBER = re.compile(r"\s*[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?\s*", re.ASCII)


def _numbers(cells: Sequence[str]) -> Array:
    """Return the numbers, NaN where there is none."""
    values = [float(cell) if NUMBER.fullmatch(cell) else np.nan for cell in cells]
    return np.array(values, dtype=float)


def _row_problems(
    table: Table, width: int, cells: list[list[str]], schema: Schema
) -> Iterator[Problem]:
    if schema.rows and not len(table):
        yield table.problem(0, "file", "has no rows", "at least one row under the header")
    whole = [len(row) == width for row in cells]
    for row in (i for i, good in enumerate(whole) if not good):
        n = len(cells[row])
        found = "is blank" if not any(cells[row]) else f"has {n} cells{_cells_hint(n, width)}"
        yield table.problem(row, "row", found, f"as many as the header: {width}")
    for name, texts in table.text.items():
        if name in schema.ranges:
            yield from _number_problems(table, name, schema.ranges[name], whole)
        elif name not in schema.may_be_empty:
            for row in (i for i, cell in enumerate(texts) if not cell.strip() and whole[i]):
                yield table.problem(row, name, "is empty", "must be a name")
    for key in schema.keys:
        yield from _repeated(table, key)


def _cells_hint(n: int, width: int) -> str:
    return " (cut off?)" if n < width else " (a decimal comma?)"


def _number_problems(
    table: Table, name: str, allowed: Range, whole: list[bool]
) -> Iterator[Problem]:
    values = table.numbers[name]
    good = np.isfinite(values) & (values >= allowed.low) & (values <= allowed.high)
    for row in map(int, np.flatnonzero(~good)):
        cell = table.text[name][row]
        if not whole[row]:
            continue
        if np.isfinite(values[row]):
            found = cell.strip() + _range_hint(table, name, row)
            yield table.problem(row, name, found, str(allowed))
        else:
            hint = " (a decimal comma?)" if re.fullmatch(r"\s*-?\d+,\d+\s*", cell) else ""
            found = f"{cell!r}{hint}" if cell.strip() else "is empty"
            yield table.problem(row, name, found, "must be a finite number, decimal point")


def _range_hint(table: Table, name: str, row: int) -> str:
    lon = table.numbers.get("lon_deg")
    if name == "lat_deg" and lon is not None and abs(lon[row]) <= 90:
        return " (latitude and longitude swapped?)"
    return ""


def _repeated(table: Table, key: tuple[str, ...]) -> Iterator[Problem]:
    if not all(name in table.text for name in key):
        return
    first: dict[tuple[str, ...], int] = {}
    for row, names in enumerate(zip(*(table.text[name] for name in key), strict=True)):
        before = first.setdefault(names, row)
        if before != row and all(names):
            called = ", ".join(map(repr, names))
            found = f"{called} stands in line {table.lines[before]} already"
            yield table.problem(row, ", ".join(key), found, f"every {' and '.join(key)} once")
