"""Read tables, first as text, so that every problem has its file, line and column."""

from __future__ import annotations

import hashlib
import os
import stat
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Protocol, overload

import numpy as np
from numpy.typing import NDArray

from acx4files.flight.problems import NO_ROWS, SHOWN, Problem, Range, counted, did_you_mean, quoted
from acx4files.flight.tables import (
    LONGEST_NUMBER,
    MOST_COLUMNS,
    Rows,
    Schema,
    Table,
    faulty,
    form_of,
    numbers_of,
    read_header,
    read_rows,
)
from acx4lib import system
from acx4lib.expected import Array, Index, Mask, given

NO_END = "the last line has no line end; was the file cut off?"


def read_columns(
    path: Path,
    file: str,
    schema: Schema,
    *,
    needed_by: str,
    most: int | None = None,
    as_written: Callable[[str], str] = str,
) -> Table:
    """Read a table with the columns of a schema; its `problems` list the errors.

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
    wrong = _header_problems(file, header, schema)
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
            *_extra_notes(file, header, schema),
            *([f"{file}: {n_blank} blank line{'s' * (n_blank > 1)} at the end"] if n_blank else []),
            *([] if whole.endswith(("\n", "\r")) else [f"{file}: {NO_END}"]),
        ),
    )


def _header_problems(file: str, header: Sequence[str], schema: Schema) -> tuple[Problem, ...]:
    """Return the problems of the columns of a table."""
    whole = _whole_problem(header, schema)
    if whole:
        fault, expected = whole
        return (Problem(file=file, line=1, column="header", found=fault, expected=expected),)
    return tuple(_column_problems(file, header, schema))


def _whole_problem(header: Sequence[str], schema: Schema) -> tuple[str, str] | None:
    """Return the fault of a header that is no list of columns, and the expected form; or None."""
    name, *others = header
    if len(others) >= MOST_COLUMNS:
        return f"has {len(header)} columns", f"must have at most {MOST_COLUMNS}"
    separators = {";": "semicolons", "\t": "tabs"}
    if set(name.split(" ")) & set(schema.known):
        separators[" "] = "spaces"
    used = [label for separator, label in separators.items() if separator in name]
    if others or not used:
        return None
    return (
        f"is separated by {used[0]}",
        "must be separated by commas, numbers with decimal points",
    )


def _column_problems(file: str, header: Sequence[str], schema: Schema) -> Iterator[Problem]:
    def wrong(column: str, fault: str, expected: str) -> Problem:
        return Problem(file=file, line=1, column=column, found=fault, expected=expected)

    for name, count in Counter(header).items():
        if count > 1 and name in schema.known:
            yield wrong(name, f"stands {count} times in the header", "every column once")
    named = list(dict.fromkeys(header))
    begun = [form for form in schema.forms if set(form) & set(named)]
    if len(begun) > 1:
        both = [", ".join(name for name in named if name in form) for form in begun]
        yield wrong(both[0], f"beside {both[1]}", "one form of trajectory in one file")
        return
    form = begun[0] if begun else ()
    if schema.forms and not begun:
        either = " or ".join(", ".join(form) for form in schema.forms)
        yield wrong("position and attitude", "missing in the header", f"must be {either}")
    for name in (*schema.required, *form):
        if name not in named:
            hint = _hint(name, named, schema)
            yield wrong(name, f"missing in the header{hint}", "required")


def _hint(name: str, header: Sequence[str], schema: Schema) -> str:
    unknown = [other for other in header if other not in schema.known]
    lower = {other.lower(): other for other in unknown}
    if name in lower:
        return f" (is it {lower[name]!r}?)"
    return did_you_mean(name, unknown).replace("did you mean", "is it")


def _extra_notes(file: str, header: Sequence[str], schema: Schema) -> Iterator[str]:
    """Yield a note on each unread column, up to `SHOWN`, and a note on the rest."""
    extra = [name for name in header if name and name not in schema.known]
    for name in extra[:SHOWN]:
        yield f"{file}: column {quoted(name)} is not read{did_you_mean(name, schema.known)}"
    if len(extra) > SHOWN:
        yield f"{file}: {len(extra) - SHOWN} more columns are not read"


def _no_header(text: str, header: list[str], file: str) -> tuple[Problem, ...]:
    if any(header):
        return ()
    fault = "begins with a blank line" if text.strip("\r\n\t ,") else "is empty"
    return (Problem(file=file, line=1, column="file", found=fault, expected="needs a header"),)


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
    yield from _width_problems(table.file, rows)
    yield from _cell_problems(table, schema, _whole_rows(rows))


def _width_problems(file: str, rows: Rows) -> Iterator[Problem]:
    """Yield blank lines between others, and rows of another width than the header."""
    expected = f"as many as the header: {rows.width}"

    def wrong(line: int, fault: str) -> Problem:
        return Problem(file=file, line=line, column="row", found=fault, expected=expected)

    def ragged(k: int) -> Problem:
        row, n = rows.ragged[k], rows.n_cells[k]
        hint = "cut off?" if n < rows.width else "a decimal comma?"
        return wrong(rows.lines[row], f"has {n} cells ({hint})")

    yield from counted(rows.blank, lambda line: wrong(line, "is blank"))
    yield from counted(range(len(rows.ragged)), ragged)


def _whole_rows(rows: Rows) -> Mask:
    """Tell which rows were as wide as the header, shape (n,)."""
    whole = np.ones(len(rows.lines), dtype=bool)
    whole[np.array(rows.ragged, dtype=np.intp)] = False
    return whole


def _cell_problems(table: Table, schema: Schema, whole: Mask) -> Iterator[Problem]:
    """Yield the problems of the cells of a table."""
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
        fault = _shortened(cells[row].strip()) + _range_hint(table, name, row)
        return table.problem(row, name, fault, str(allowed))

    def none(row: int) -> Problem:
        cell = cells[row]
        fault = f"{quoted(cell)}{form_of(cell)}" if cell.strip() else "is empty"
        point = "" if table.in_memory else ", decimal point"
        return table.problem(row, name, fault, f"must be a finite number{point}")

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
        listed = ", ".join(quoted(cells[row]) for cells in columns)
        fault = f"{listed} stands in {table.counts} {table.lines[first[row]]} already"
        return table.problem(row, ", ".join(key), fault, f"every {' and '.join(key)} once")

    yield from counted(np.flatnonzero(again), problem)


def _first_alike(columns: Sequence[Sequence[str]]) -> Index:
    """Return for every row the first row with the same names."""
    code = np.zeros(len(columns[0]), dtype=np.int64)
    for cells in columns:
        index = {name: i for i, name in enumerate(dict.fromkeys(cells))}
        name_idx = np.fromiter(map(index.__getitem__, cells), dtype=np.int64, count=len(cells))
        code = code * max(len(index), 1) + name_idx
    _, first, inverse = np.unique(code, return_index=True, return_inverse=True)
    return first[inverse]


# --- The bytes of a flight's files: opened once, checked, and read if they fit into memory


SMALL = 10_000_000
"""Largest file, bytes, that is read without a check of the free memory."""

DEEPEST = 10
"""Largest number of folders in the name of a file."""

EXPANSION = 25
"""Memory needed to read and check a table, as a multiple of the size of its file."""


def read_bytes(
    path: Path, file: str, *, needed_by: str = "a flight", most: int | None = None
) -> tuple[bytes, tuple[Problem, ...]]:
    """Return the content of a regular file, or the problem of reading it.

    Parameters
    ----------
    path : Path
    file : str
        Its name in messages.
    needed_by : str
        For the message if the file is missing.
    most : int, optional
        Largest size in bytes; by default what the free memory allows.
    """

    def wrong(fault: str, expected: str) -> tuple[bytes, tuple[Problem, ...]]:
        problem = Problem(file=file, line=1, column="file", found=fault, expected=expected)
        return b"", (problem,)

    try:
        size, content = _content(path, most)
    except FileNotFoundError:
        if path.is_symlink():
            return wrong("is a link to nothing", "must be a readable file")
        return wrong("is not there", f"{needed_by} needs it")
    except (OSError, ValueError) as error:  # ValueError: a name that no file can have
        reason = getattr(error, "strerror", None) or error
        return wrong(f"cannot be read ({reason})", "must be a readable file")
    if content is None:
        allowed = f"must have at most {most} bytes" if most else "must fit into free memory"
        needs = "" if most else f", reading it takes {EXPANSION} times as much memory"
        return wrong(f"has {size} bytes{needs}", allowed)
    if len(content) != size:
        return wrong("changed while it was read", "must be complete before it is read")
    return content, ()


def read_text(
    path: Path, file: str, *, needed_by: str = "a flight", most: int | None = None
) -> tuple[str, str, tuple[Problem, ...]]:
    """Return a file's text without byte-order mark, its SHA-256, and its problems."""
    content, problems = read_bytes(path, file, needed_by=needed_by, most=most)
    if problems:
        return "", "", problems
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        offset, fault = error.start, f"byte 0x{content[error.start]:02x} is not UTF-8"
        fault += " (UTF-16?)" if content.startswith((BOM_UTF16_LE, BOM_UTF16_BE)) else ""
    else:
        offset, fault = content.find(b"\0"), "holds a null character"
        if offset < 0:
            return text, hashlib.sha256(content).hexdigest(), ()
    line = content.count(b"\n", 0, offset) + 1
    expected = "must be UTF-8 text"
    problem = Problem(file=file, line=line, column="file", found=fault, expected=expected)
    return "", "", (problem,)


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
    path = f"{folder}/{name}" if name[:1] != "/" else name
    try:
        mode: int | None = os.stat(path).st_mode  # noqa: PTH116 a path of each of 100 000 names is slow
        path = os.path.realpath(path)
    except FileNotFoundError:
        mode, path = None, os.path.normpath(path)
    except (OSError, RuntimeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        return None, f"is no file name that can be used ({str(reason).splitlines()[0]})"
    if not path.startswith(f"{flight}/"):
        return None, "lies outside the flight"
    if mode is None:
        return None, "is not there"
    return (Path(path), "") if stat.S_ISREG(mode) else (None, "is no regular file")


def _content(path: Path, most: int | None) -> tuple[int, bytes | None]:
    """Return size and content of a regular file; no content where it is too large."""
    with path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        if size > most if most else not fits(size):
            return size, None
        return size, file.read(size + 1) if size else b""  # reading one of /proc may never end


def fits(size: int) -> bool:
    """Tell whether files of `size` bytes in total can be read and checked in the free memory."""
    return size <= SMALL or size * EXPANSION <= free_memory()


def free_memory() -> int:
    """Return the memory that this process can still get, bytes, according to the system."""
    known = [_meminfo(), _group_limit()]
    return min(free for free in known if free is not None)


def _meminfo() -> int:
    try:
        lines = Path("/proc/meminfo").read_text("ascii").splitlines()
        return next(int(line.split()[1]) * 1024 for line in lines if line.startswith("MemAvail"))
    except (OSError, StopIteration):  # another system
        return system.memory()


def _group_limit() -> int | None:
    """Return the free memory of the container, bytes; None outside a container."""
    group = Path("/sys/fs/cgroup")
    try:
        limit, used = ((group / f"memory.{name}").read_text("ascii") for name in ("max", "current"))
        return int(limit) - int(used)
    except (OSError, ValueError):  # no such group, or "max"
        return None


# --- Tables in memory: a DataFrame, or arrays by their columns, checked as a file would be


PICTURES = ("file",)
"""Columns that a table in memory does not have: it has no folder in which files could lie."""


class Frame(Protocol):
    """Common interface of the DataFrames of pandas and other libraries."""

    @property
    def columns(self) -> Any:
        """Names of the columns."""

    def __getitem__(self, column: str, /) -> Any:
        """Return a column."""


Columns = Mapping[str, Any] | Frame
"""A table in memory: arrays or lists by the names of their columns, or a DataFrame."""


class _Written(Sequence[str]):
    """The cells of a numeric column as text, formatted on demand."""

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
            return _Written(self._values[row])
        value = self._values[row]
        return "" if _is_missing(value) else str(value)


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
    table = Table(file=name, in_memory=True)
    names = columns if isinstance(columns, Mapping) else getattr(columns, "columns", None)
    if names is None:
        expected = "must be a DataFrame, or a dict of arrays"
        return replace(table, problems=(_whole(name, "table", f"is {given(columns)}", expected),))
    header = [str(column) for column in names] or [""]
    wrong = tuple(
        replace(problem, line=-1, in_memory=True)
        for problem in _header_problems(name, header, schema)
    )
    cells = {c: _cells(columns[c]) for c in dict.fromkeys(names) if c in schema.known}
    misshapen = tuple(_shape_problems(name, cells))
    if wrong or misshapen:
        return replace(table, problems=(*wrong, *misshapen))
    notes = tuple(_extra_notes(name, header, schema))
    return _checked(replace(table, notes=notes), cells, schema)


def _cells(column: Any) -> NDArray[Any]:
    """Return a column as an array; a list keeps the types of its cells."""
    return np.asarray(column, dtype=object if isinstance(column, list | tuple) else None)


def _whole(name: str, column: str, fault: str, expected: str) -> Problem:
    return Problem(
        file=name, line=-1, column=column, found=fault, expected=expected, in_memory=True
    )


def _shape_problems(name: str, columns: Mapping[str, NDArray[Any]]) -> Iterator[Problem]:
    """Yield columns that are not one-dimensional, or shorter than the longest."""
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
    """Return the table with its cells and their problems."""
    n = len(next(iter(columns.values())))
    text: dict[str, Sequence[str]] = {}
    numbers: dict[str, Array] = {}
    no_names: list[Problem] = []
    table = replace(table, lines=np.arange(n))
    for column, cells in columns.items():
        if column in schema.ranges:
            numbers[column], text[column] = _numbers(cells), _Written(cells)
        else:
            text[column], wrong = _names(cells)
            no_names += counted(wrong, _no_name(table, column, cells))
    if no_names:
        return replace(table, problems=tuple(no_names))
    table = replace(table, text=text, numbers=numbers)
    problems = list(_cell_problems(_with_known(table), schema, np.ones(n, dtype=bool)))
    if schema.rows and not n:
        problems = [_whole(table.file, "table", NO_ROWS, "must have one at least")]
    return replace(table, problems=tuple(problems), sha256=_checksum(table))


def _with_known(table: Table) -> Table:
    """Return the table with 1 for unknown (infinite) standard deviations."""
    numbers = {
        column: np.where(np.isposinf(values), 1.0, values) if column.startswith("sigma") else values
        for column, values in table.numbers.items()
    }
    return replace(table, numbers=numbers)


def _numbers(cells: NDArray[Any]) -> Array:
    """Return cells as numbers; NaN for text and all other values."""
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
    """Return cells as names, and the rows with neither text nor a whole number."""
    values = cells.tolist()
    if cells.dtype.kind in "iu":
        return tuple(map(str, values)), []
    empty = [_is_missing(cell) or (isinstance(cell, float) and np.isnan(cell)) for cell in values]
    names = ["" if blank else str(cell) for blank, cell in zip(empty, values, strict=True)]
    good = [blank or _is_name(cell) for blank, cell in zip(empty, values, strict=True)]
    return tuple(names), np.flatnonzero(np.logical_not(good)).tolist()


def _is_name(value: object) -> bool:
    return isinstance(value, str | int | np.integer) and not isinstance(value, bool)


def _is_missing(value: object) -> bool:
    """Tell whether a cell is empty: None, or by its type pandas' NA, which cannot be compared."""
    return value is None or type(value).__name__ in ("NAType", "NaTType")


def _no_name(table: Table, column: str, cells: NDArray[Any]) -> Callable[[int], Problem]:
    def problem(row: int) -> Problem:
        fault = quoted(cells[row].item() if isinstance(cells[row], np.generic) else cells[row])
        return table.problem(row, column, fault, "must be a name: text, or a whole number")

    return problem


def _checksum(table: Table) -> str:
    """Return the SHA-256 of all cells."""
    whole = hashlib.sha256()
    for column, cells in table.text.items():
        whole.update(column.encode())
        values = table.numbers.get(column)
        content = "\0".join(cells).encode() if values is None else values.tobytes()
        whole.update(content)
    return whole.hexdigest()
