"""The tables of a results folder: their columns, read, and written.

A large flight has millions of residuals: rows are written in columns, and old ones that stay are
copied as they are.
"""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from itertools import groupby
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pandas as pd

from acx4lib.errors import FlightError
from acx4lib.expected import Index
from acx4lib.flight.text.files import opened
from acx4lib.least_squares import processors

SAID = 300
"""Characters of pandas' words that are repeated; they quote what was found in full length."""

_METHOD = ("stage", "method")
_DIFFERENCE = ("d_east_m", "d_north_m", "d_height_m")
_SIGMA = ("sigma_east_m", "sigma_north_m", "sigma_height_m")
_ATTITUDE = ("omega_deg", "phi_deg", "kappa_deg")
_SIGMA_ATTITUDE = ("sigma_omega_deg", "sigma_phi_deg", "sigma_kappa_deg")

COLUMNS: Mapping[str, tuple[str, ...]] = {
    "parameters": (*_METHOD, "camera", "parameter", "value", "sigma", "unit"),
    "validation": ("method", "point", "image_a", "image_b", *_DIFFERENCE, *_SIGMA),
    "check_points": (*_METHOD, "point", "n_images", *_DIFFERENCE, *_SIGMA),
    "exterior_orientation": (
        *(*_METHOD, "image", "east_m", "north_m", "height_m"),
        *(*_ATTITUDE, *_SIGMA, *_SIGMA_ATTITUDE),
    ),
    "residuals": (
        *(*_METHOD, "kind", "image_or_exposure", "point", "component"),
        *("v", "sigma", "redundancy", "w"),
    ),
    "covariance": (*_METHOD, "row", "column", "value"),
    "rejected": (*_METHOD, "kind", "image_or_exposure", "point", "statistic", "reason"),
    "synthetic_points": (
        *("block", "image", "point", "head"),
        *("col_px", "row_px", "sigma_col_px", "sigma_row_px"),
    ),
}
"""Columns of every table, in order; a table's file is its name with ``.csv``."""

_OF = {"validation": "validation/", "synthetic_points": "synthetic/points/"}
"""What all rows of a table are of, as far as it has no columns for that."""

_TEXT = {
    *(*_METHOD, "camera", "parameter", "unit", "point", "image_a", "image_b", "image", "kind"),
    *("image_or_exposure", "component", "row", "column", "reason", "block", "head"),
}
_COUNT = {"n_images"}
"""Columns of text and of counts; all others are numbers."""

_ALWAYS_EXACT = tuple(map(int, pd.__version__.split(".")[:2])) >= (3, 1)
_EXACT: dict[str, Any] = {} if _ALWAYS_EXACT else {"float_precision": "round_trip"}
"""What makes pandas read numbers to the last bit; new versions always do, and warn of it."""

ROWS = 50_000
"""Number of rows that one processor makes at a time."""

TOGETHER = 8
"""How often that is done before the rows are written: they wait in memory."""

_SPECIAL = ',"\n\r'
"""Characters for which a cell is quoted."""

BYTES = 4_000_000
"""Number of bytes of old rows that are copied together."""


def check_columns(name: str, columns: Iterable[str]) -> None:
    """Raise a ValueError where a table has not exactly the columns of `COLUMNS`, in any order."""
    if sorted(columns) != sorted(COLUMNS[name]):
        msg = f"{name} has columns {', '.join(COLUMNS[name])}, got {', '.join(columns)}"
        raise ValueError(msg)


def keys(name: str, frame: pd.DataFrame) -> tuple[Index, list[str]]:
    """Return which ``stage/method`` every row is of, as an index, and those that occur.

    Parameters
    ----------
    name : str
        One of `COLUMNS`.
    frame : DataFrame
        With these columns.
    """
    code, known = np.zeros(len(frame), dtype=np.intp), [_OF.get(name, "")]
    for column in [column for column in _METHOD if column in COLUMNS[name]]:
        own, texts = _coded(frame[column])
        code = code * len(texts) + own
        known = [f"{before}{text}/" for before in known for text in texts]
    occurs = np.bincount(code, minlength=len(known)) > 0
    return (np.cumsum(occurs) - 1)[code], [known[k][:-1] for k in np.flatnonzero(occurs)]


def _coded(values: pd.Series) -> tuple[Index, list[str]]:
    """Return which text every cell has, and all texts; the last one is empty, for no value."""
    if isinstance(values.dtype, pd.CategoricalDtype):
        code, known = values.cat.codes.to_numpy(dtype=np.intp), values.cat.categories
    else:
        code, known = pd.factorize(values)
    return np.where(code < 0, len(known), code), [*map(str, known.tolist()), ""]


# --- read ------------------------------------------------------------------------------------


def is_there(path: Path) -> bool:
    """Tell whether there is a table; FlightError where something else is in its place."""
    if path.is_file():
        return True
    if path.exists():  # reading a pipe would wait without end
        raise FlightError([f"{path}: is no regular file; remove it and run again"])
    return False


def read(path: Path) -> pd.DataFrame:
    """Return a table; a missing file counts as one without rows.

    Parameters
    ----------
    path : Path
        Its name is one of `COLUMNS` with ``.csv``.

    Returns
    -------
    DataFrame
        Names are text, counts whole numbers, unknown numbers NaN.

    Raises
    ------
    FlightError
        Where the file is no such table.
    """
    source = path if is_there(path) else io.BytesIO(header(path.stem))
    with _refusing(path):
        return _parsed(path.stem, source)


def read_some(path: Path, begin: tuple[bytes, ...]) -> pd.DataFrame:
    """Return the rows from the first to the last that begins so, where their rows are together.

    Parameters
    ----------
    path : Path
        As `read` takes it.
    begin : tuple of bytes
        As `begins` returns it.

    Returns
    -------
    DataFrame
        As `read` returns it; all rows where none is found, as the file may be written otherwise.

    Raises
    ------
    FlightError
        Where the file is no such table.
    """
    if not is_there(path):
        return read(path)
    with _opened(path) as file, mmap(file.fileno(), 0, access=ACCESS_READ) as content:
        firsts = [content.find(b"\n" + one) for one in begin]
        if -1 in firsts or not firsts:
            return read(path)
        last = max(content.rfind(b"\n" + one, 0, len(content) - 1) for one in begin)
        end = content.find(b"\n", last + 1)
        source = io.BytesIO(content[min(firsts) + 1 : end if end >= 0 else None])
    with _refusing(path):
        return _parsed(path.stem, source, names=list(COLUMNS[path.stem]))


@contextmanager
def _refusing(path: Path) -> Iterator[None]:
    """Say of a file that it is no results table, and why."""
    try:
        yield
    except ValueError as error:
        reason = str(error).strip().splitlines()[0][:SAID]
        problem = f"{path}: not a results table ({reason}); remove it and run again"
        raise FlightError([problem]) from None


def _parsed(name: str, source: Path | io.BytesIO, **options: Any) -> pd.DataFrame:
    columns = list(COLUMNS[name])
    texts = [column for column in columns if column in _TEXT]
    numbers = [column for column in columns if column not in _TEXT | _COUNT]
    types = {**dict.fromkeys(texts, "str"), **dict.fromkeys(numbers, "float64")}
    frame = pd.read_csv(
        source,
        encoding="utf-8",
        dtype={**dict.fromkeys(_COUNT, "int64"), **types},
        keep_default_na=False,
        na_values=dict.fromkeys(numbers, ""),
        **_EXACT,
        **options,
    )
    check_columns(name, frame.columns)
    cut_off = [column for column in texts if frame[column].hasnans]
    return frame.fillna(dict.fromkeys(cut_off, ""))[columns] if cut_off else frame[columns]


# --- written ---------------------------------------------------------------------------------


def header(name: str) -> bytes:
    """Return the first line of a table's file."""
    return f"{','.join(COLUMNS[name])}\n".encode()


def lines(name: str, frame: pd.DataFrame) -> Iterator[bytes]:
    """Yield the rows of a table as they stand in its file, many at a time.

    Numbers are written as by Python's ``repr``, text as by its module csv. The cell of a value that
    is not known, or not finite, is empty.

    Parameters
    ----------
    name : str
        One of `COLUMNS`.
    frame : DataFrame
        With these columns; those of text are written fastest as categories.

    Raises
    ------
    ValueError
        Where a cell is no number.
    """
    # tables are read without what writes them
    from acx4lib.results.files.compiled.lines import LONGEST, put_lines  # noqa: PLC0415

    texts = [column for column in COLUMNS[name] if column in _TEXT | _COUNT]
    numbers = [column for column in COLUMNS[name] if column not in texts]
    order = [texts.index(c) if c in texts else -1 - numbers.index(c) for c in COLUMNS[name]]
    coded = [_coded(frame[column]) for column in texts]
    values = [frame[column].to_numpy(dtype=float) for column in numbers]
    cells = [_cells(known) for _, known in coded]
    lengths = [length for _, own in cells for length in own]
    longest = sum(max(own) for _, own in cells) + LONGEST * len(numbers) + len(order)
    first = np.cumsum([0, *(len(own) for _, own in cells)])
    starts = np.cumsum([0, *lengths])
    content = np.frombuffer(b"".join(text for text, _ in cells), dtype=np.uint8)

    def text(begin: int) -> bytes:
        some = slice(begin, begin + ROWS)
        codes = np.array([k + code[some] for k, (code, _) in zip(first, coded, strict=False)])
        bits = np.array([column[some] for column in values]).view(np.uint64)
        out = np.empty(codes.shape[1] * longest, dtype=np.uint8)
        return out[: put_lines(out, np.array(order), codes, content, starts, bits)].tobytes()

    begins = range(0, len(frame), ROWS)
    for k in range(0, len(begins), TOGETHER):
        yield from processors.in_order(text, begins[k : k + TOGETHER])


def _cells(texts: list[str]) -> tuple[bytes, list[int]]:
    """Return texts as they stand in a file, one behind the other, and the length of each."""
    joined = "".join(texts)
    if joined.isascii() and not any(special in joined for special in _SPECIAL):
        return joined.encode(), list(map(len, texts))
    cells = list(map(_cell, texts))
    return b"".join(cells), list(map(len, cells))


def _cell(text: str) -> bytes:
    if any(special in text for special in _SPECIAL):
        text = '"{}"'.format(text.replace('"', '""'))
    return text.encode()


# --- old rows --------------------------------------------------------------------------------


def begins(name: str, stage_methods: Sequence[str]) -> tuple[bytes, ...]:
    """Return what the rows of some stages, or ``stage/method``, begin with in a table's file."""
    of = _OF.get(name, "")
    asked = [f"{one}/" for one in stage_methods if one.count("/") < 2]
    found = [one.removeprefix(of) for one in asked if one.startswith(of)]
    found += ["" for one in asked if of.startswith(one) and one != of]  # any row
    return tuple(one.replace("/", ",").encode() for one in found)


def holds(path: Path, begin: tuple[bytes, ...]) -> bool:
    """Tell whether a table may have rows that begin so; FlightError as `others`."""
    with _opened(path) as file, mmap(file.fileno(), 0, access=ACCESS_READ) as content:
        return any(content.find(b"\n" + one, 0, len(content) - 1) >= 0 for one in begin)


def others(path: Path, begin: tuple[bytes, ...]) -> Iterator[tuple[str, bytes]]:
    """Yield the rows that do not begin so, many at a time, with their first cell.

    Raises
    ------
    FlightError
        Where the file does not begin with the header of such a table.
    """
    with _opened(path) as file:
        while some := _rows(file):
            kept = [row for row in some if not row.startswith(begin)]
            for cell, alike in groupby(kept, lambda row: row.partition(b",")[0]):
                yield cell.decode(), b"".join(alike)


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    """Open a table after its header."""
    with opened(path) as file:
        first = file.readline()
        with _refusing(path):
            if first.rstrip() != header(path.stem).rstrip():
                msg = f"its header is not {header(path.stem).decode().rstrip()}"
                raise ValueError(msg)
        yield file


def _rows(file: BinaryIO) -> list[bytes]:
    """Return the next rows; lines with an odd number of quotes end or begin inside of a cell."""
    found = file.readlines(BYTES)
    if not any(b'"' in line for line in found):
        return found
    rows: list[bytes] = []
    row: list[bytes] = []
    is_open = False
    for line in found:
        row.append(line)
        is_open ^= line.count(b'"') % 2 == 1
        if not is_open:
            rows.append(b"".join(row))
            row = []
    while is_open and (line := file.readline()):
        row.append(line)
        is_open ^= line.count(b'"') % 2 == 1
    return [*rows, b"".join(row)] if row else rows
