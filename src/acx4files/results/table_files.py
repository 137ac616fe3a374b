"""The tables of a results folder: their columns, checked, read and written.

A large flight has millions of residuals: rows are written in columns, and old ones that stay are
copied as they are.
"""

from __future__ import annotations

import csv
import io
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from itertools import groupby
from mmap import ACCESS_READ, mmap
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import pandas as pd

from acx4files.flight.problems import Problem, Range, counted, lines_of, quoted
from acx4files.opening import opened
from acx4lib.errors import FlightError
from acx4lib.expected import Index, Mask
from acx4lib.geometry.parameters import REPORTED
from acx4lib.least_squares import processors

SAID = 300
"""Largest number of characters of an error of pandas in a message; it quotes cells in full."""

LONGEST = 10_000
"""Largest number of bytes that are read of a header."""

_METHOD = ("stage", "method")


# --- Content of the tables of a results folder: columns, ranges of numbers, words, unique keys


STAGES = ("heads", "synthetic", "mounting", "validation")
"""The stages in the order of the paper, and of the rows of every table."""

COMPONENTS = {
    "image_point": ("col_px", "row_px"),
    "control_point": ("east_m", "north_m", "height_m"),
    "gnss": ("east_m", "north_m", "height_m"),
    "attitude": ("roll_deg", "pitch_deg", "heading_deg"),
    "lever_arm": ("lever_x_m", "lever_y_m", "lever_z_m"),
    "distance": ("distance_m",),
    "boresight": ("mount_omega_deg", "mount_phi_deg", "mount_kappa_deg"),
    "interior": ("f_mm", "xp_mm", "yp_mm"),
}
"""Components of the residuals of every kind; angles are about the body's x, y, z axes."""

ANY = Range(-1e12, 1e12)
SIGMA = Range(0.0, 1e12, "must be zero or positive, at most 1e12")
COVARIANCE = Range(-1e24, 1e24)
COUNT = Range(0, 1e9, "must be a whole number, zero or positive, at most 1e9", whole=True)


@dataclass(frozen=True, kw_only=True)
class Schema:
    """The required content of a table of results.

    Attributes
    ----------
    columns : tuple of str
        All columns, in the order of the file.
    ranges : mapping
        Ranges of the columns of numbers; the others are text.
    needed : tuple of str
        Columns of numbers without empty cells.
    words : mapping
        Allowed texts of some columns.
    key : tuple of str
        Columns whose cells together are unique; empty for a table with too many rows to compare,
        which are only counted.
    often : tuple of mapping
        Words of rows that may repeat a key: separately adjusted heads share points and exposures.
    later : tuple of str
        The last columns, which older files lack: their numbers are then unknown.
    """

    columns: tuple[str, ...]
    ranges: Mapping[str, Range]
    needed: tuple[str, ...] = ()
    words: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    key: tuple[str, ...] = ()
    often: tuple[Mapping[str, tuple[str, ...]], ...] = ()
    later: tuple[str, ...] = ()

    @property
    def texts(self) -> tuple[str, ...]:
        """The columns of text."""
        return tuple(name for name in self.columns if name not in self.ranges)


_OF_STAGE = {"stage": STAGES}
_POSITION = ("east_m", "north_m", "height_m")
_DIFFERENCE = tuple(f"d_{name}" for name in _POSITION)
_SIGMA = tuple(f"sigma_{name}" for name in _POSITION)
_ATTITUDE = ("omega_deg", "phi_deg", "kappa_deg")
_SIGMA_ATTITUDE = tuple(f"sigma_{name}" for name in _ATTITUDE)
_PIXELS = ("col_px", "row_px")
_SIGMA_PIXELS = ("sigma_col_px", "sigma_row_px")
_DIFFERENCES = dict.fromkeys(_DIFFERENCE, ANY) | dict.fromkeys(_SIGMA, SIGMA)
_KINDS = tuple(COMPONENTS)
_HEADS = {"stage": ("heads",)}
_OFTEN = (
    _HEADS | {"kind": tuple(kind for kind in _KINDS if kind != "image_point")},
    {"kind": ("distance",)},
)

SCHEMAS: Mapping[str, Schema] = {
    "parameters": Schema(
        columns=(*_METHOD, "camera", "parameter", "value", "sigma", "unit", "sigma_before"),
        ranges={"value": ANY, "sigma": SIGMA, "sigma_before": SIGMA},
        needed=("value",),
        words=_OF_STAGE,
        key=(*_METHOD, "camera", "parameter"),
        later=("sigma_before",),
    ),
    "validation": Schema(
        columns=("method", "point", "image_a", "image_b", *_DIFFERENCE, *_SIGMA),
        ranges=_DIFFERENCES,
        key=("method", "point", "image_a", "image_b"),
    ),
    "check_points": Schema(
        columns=(*_METHOD, "point", "n_images", *_DIFFERENCE, *_SIGMA),
        ranges={"n_images": COUNT, **_DIFFERENCES},
        needed=("n_images",),
        words=_OF_STAGE,
        key=(*_METHOD, "point"),
        often=(_HEADS,),
    ),
    "exterior_orientation": Schema(
        columns=(*_METHOD, "image", *_POSITION, *_ATTITUDE, *_SIGMA, *_SIGMA_ATTITUDE),
        ranges={
            **dict.fromkeys((*_POSITION, *_ATTITUDE), ANY),
            **dict.fromkeys((*_SIGMA, *_SIGMA_ATTITUDE), SIGMA),
        },
        words=_OF_STAGE,
        key=(*_METHOD, "image"),
    ),
    "residuals": Schema(
        columns=(
            *(*_METHOD, "kind", "image_or_exposure", "point", "component"),
            *("v", "sigma", "redundancy", "w"),
        ),
        ranges={"v": ANY, "sigma": SIGMA, "redundancy": ANY, "w": ANY},
        words={
            **_OF_STAGE,
            "kind": _KINDS,
            "component": tuple(dict.fromkeys(name for k in _KINDS for name in COMPONENTS[k])),
        },
    ),
    "covariance": Schema(
        columns=(*_METHOD, "row", "column", "value"),
        ranges={"value": COVARIANCE},
        words=_OF_STAGE,
        key=(*_METHOD, "row", "column"),
    ),
    "rejected": Schema(
        columns=(*_METHOD, "kind", "image_or_exposure", "point", "statistic", "reason"),
        ranges={"statistic": ANY},
        words={**_OF_STAGE, "kind": _KINDS},
        key=(*_METHOD, "kind", "image_or_exposure", "point", "reason"),
        often=_OFTEN,
    ),
    "synthetic_points": Schema(
        columns=("block", "image", "point", "head", *_PIXELS, *_SIGMA_PIXELS),
        ranges=dict.fromkeys(_PIXELS, ANY) | dict.fromkeys(_SIGMA_PIXELS, SIGMA),
        needed=(*_PIXELS, *_SIGMA_PIXELS),
        key=("block", "image", "point"),
    ),
}
"""By the name of the table; its file is this name with ``.csv``."""

COLUMNS: Mapping[str, tuple[str, ...]] = {name: schema.columns for name, schema in SCHEMAS.items()}
"""Columns of every table, in order; a table's file is its name with ``.csv``."""

CURE = "remove it and run again"
"""Cure for a file that is no table of results."""

Check = Callable[[str, pd.DataFrame], Iterable[Problem]]
"""Yields the problems of the rows of a file."""

_OF = {"validation": "validation/", "synthetic_points": "synthetic/points/"}
"""Stage and method of all rows of a table, as far as it has no columns for them."""

_COUNT = {"n_images"}
"""Columns of counts."""

_ALWAYS_EXACT = tuple(map(int, pd.__version__.split(".")[:2])) >= (3, 1)
_EXACT: dict[str, Any] = {} if _ALWAYS_EXACT else {"float_precision": "round_trip"}
"""Option of pandas to read numbers to the last bit; new versions always do, and warn of it."""

ROWS = 50_000
"""Number of rows that one processor makes at a time."""

TOGETHER = 8
"""Number of such parts that wait in memory before they are written."""

_SPECIAL = ',"\n\r'
"""Characters for which a cell is quoted."""

BYTES = 4_000_000
"""Number of bytes of old rows that are copied together."""


def keys(name: str, frame: pd.DataFrame) -> tuple[Index, list[str]]:
    """Return the index of every row's ``stage/method``, and the names that occur.

    Parameters
    ----------
    name : str
        One of `COLUMNS`.
    frame : DataFrame
        With these columns.
    """
    code, known = np.zeros(len(frame), dtype=np.intp), [_OF.get(name, "")]
    for column in [column for column in _METHOD if column in COLUMNS[name]]:
        column_code, texts = _coded(frame[column])
        code = code * len(texts) + column_code
        known = [f"{before}{text}/" for before in known for text in texts]
    occurs = np.bincount(code, minlength=len(known)) > 0
    return (np.cumsum(occurs) - 1)[code], [known[k][:-1] for k in np.flatnonzero(occurs)]


def _coded(values: pd.Series) -> tuple[Index, list[str]]:
    """Return the code of every cell, and all texts; the last text is empty, for no value."""
    if isinstance(values.dtype, pd.CategoricalDtype):
        code, known = values.cat.codes.to_numpy(dtype=np.intp), values.cat.categories
    else:
        code, known = pd.factorize(values)
    return np.where(code < 0, len(known), code), [*map(str, known.tolist()), ""]


# --- read ------------------------------------------------------------------------------------


def read(path: Path, check: Check | None = None) -> pd.DataFrame:
    """Read a table; a missing file counts as a table without rows.

    Parameters
    ----------
    path : Path
        Its name is one of `COLUMNS` with ``.csv``.
    check : callable, optional
        Yields the problems of the cells.

    Returns
    -------
    DataFrame
        Names are text, counts whole numbers, unknown numbers NaN.

    Raises
    ------
    FlightError
        With one line per problem.
    """
    if not is_there(path):
        return _parsed(path, io.BytesIO(header(path.stem)), None)
    with opened(path) as file:
        return _parsed(path, file, check)


def read_some(path: Path, begin: tuple[bytes, ...], check: Check | None = None) -> pd.DataFrame:
    """Read the rows from the first to the last with given beginnings, if these are together.

    Parameters
    ----------
    path, check
        As `read` takes them.
    begin : tuple of bytes
        As `begins` returns it.

    Returns
    -------
    DataFrame
        As `read` returns it; all rows where none is found, as the file may be written otherwise.

    Raises
    ------
    FlightError
        As `read`.
    """
    if not is_there(path):
        return read(path)
    with _opened(path) as file, mmap(file.fileno(), 0, access=ACCESS_READ) as content:
        firsts = [content.find(b"\n" + prefix) for prefix in begin]
        if -1 in firsts or not firsts:
            return read(path, check)
        last = max(content.rfind(b"\n" + prefix, 0, len(content) - 1) for prefix in begin)
        end = content.find(b"\n", last + 1)
        part = content[min(firsts) + 1 : end + 1 if end >= 0 else None]
        first = content[: content.find(b"\n") + 1]
    try:
        return _parsed(path, io.BytesIO(first + part), check)
    except FlightError:  # the whole file has the numbers of the lines
        return read(path, check)


def _parsed(path: Path, file: BinaryIO, check: Check | None) -> pd.DataFrame:
    """Return the table in an open file."""
    schema = SCHEMAS[path.stem]
    width = _check_header(path, sorted, file.readline(LONGEST))
    if not _is_even(file, width):
        raise _broken(path, file, "has rows of another width than its header")
    file.seek(0)
    try:
        frame = _typed(file, schema)
    except ValueError as error:
        raise _broken(path, file, str(error)) from None
    if not isinstance(frame.index, pd.RangeIndex):
        raise _broken(path, file, "has rows that are wider than its header")
    problems = lines_of(check(str(path), frame)) if check else ()
    if problems:
        raise FlightError(problems)
    counts = {name: "int64" for name in schema.columns if name in _COUNT}
    return frame.astype(counts)[list(schema.columns)]


def _is_even(file: BinaryIO, width: int) -> bool:
    """Tell whether the number of cells fits the header, and the last row has a line end.

    Pandas refuses a row that is too wide, so none can compensate for a cut row.
    """
    file.seek(0)
    commas, lines, last, quotes = 0, 0, b"", False
    while chunk := file.read(BYTES):
        commas, lines = commas + chunk.count(b","), lines + chunk.count(b"\n")
        last, quotes = chunk[-1:], quotes or b'"' in chunk
    if quotes:
        file.seek(0)
        bare = re.sub(rb'"[^"]*"', b"", file.read())
        commas, lines = bare.count(b","), bare.count(b"\n")
    return last == b"\n" and commas == lines * (width - 1)


def _check_header(path: Path, order: Callable[[Iterable[str]], list[str]], first: bytes) -> int:
    """Return the number of columns; refuse a file that does not begin with those of its table."""
    columns, later = COLUMNS[path.stem], SCHEMAS[path.stem].later
    cells = _cells_of(first)
    if order(cells) not in (order(columns), order(columns[: len(columns) - len(later)])):
        fault = quoted(",".join(cells)) if any(cells) else "is empty"
        expected = f"must be {','.join(columns)}; {CURE}"
        problem = Problem(file=str(path), line=1, column="header", found=fault, expected=expected)
        raise FlightError([str(problem)])
    return len(cells)


def _cells_of(header: bytes) -> list[str]:
    return header.decode("utf-8-sig", errors="replace").strip().split(",")


def _typed(file: BinaryIO, schema: Schema) -> pd.DataFrame:
    """Read a table with typed columns, one row per line unless a cell has several lines."""
    numbers = list(schema.ranges)
    frame = pd.read_csv(
        file,
        encoding="utf-8",
        dtype={**dict.fromkeys(schema.texts, "str"), **dict.fromkeys(numbers, "float64")},
        keep_default_na=False,
        na_values=dict.fromkeys(numbers, ""),
        skip_blank_lines=False,
        **_EXACT,
    )
    return frame.assign(**{name: np.nan for name in schema.later if name not in frame})


# --- where a file is broken ------------------------------------------------------------------


def _broken(path: Path, file: BinaryIO, reason: str) -> FlightError:
    """Return the error of a broken table: no text, wrong widths, no numbers, no line end."""
    file.seek(0)
    content = file.read()
    faults = [*_no_text(content)] or [*_no_cells(content, SCHEMAS[path.stem])]
    faults = faults or [(1, "file", " ".join(reason.split())[:SAID], "must be a table of results")]
    problems = (
        Problem(
            file=str(path), line=line, column=column, found=fault, expected=f"{expected}; {CURE}"
        )
        for line, column, fault, expected in faults
    )
    return FlightError(lines_of(problems))


Wrong = tuple[int, str, str, str]
"""Line, column, content and expected content."""


def _no_text(content: bytes) -> Iterator[Wrong]:
    """Yield the first byte that is no text."""
    try:
        offset, fault = content.decode().find("\0"), "holds a null character"
    except UnicodeDecodeError as error:
        offset, fault = error.start, f"byte 0x{content[error.start]:02x} is not UTF-8"
    else:
        offset = content.find(b"\0") if offset >= 0 else offset
    if offset >= 0:
        yield content.count(b"\n", 0, offset) + 1, "file", fault, "must be UTF-8 text"


def _no_cells(content: bytes, schema: Schema) -> Iterator[Wrong]:
    """Yield rows that are cut or too wide, and cells that are no numbers."""
    reader = csv.reader(io.StringIO(content.decode(), newline=""))
    names = _cells_of(content.partition(b"\n")[0])
    numbers = [names.index(name) for name in schema.ranges if name in names]
    try:
        for row in reader:
            if len(row) != len(names):
                expected = f"must have {len(names)} cells, as the header"
                yield reader.line_num, "row", f"has {len(row)} cells", expected
            elif reader.line_num > 1:
                for k in numbers:
                    if row[k] and not _is_number(row[k]):
                        expected = "must be a finite number, decimal point"
                        yield reader.line_num, names[k], quoted(row[k]), expected
    except csv.Error as error:
        yield reader.line_num, "row", str(error), "must be one row"
    if not content.endswith(b"\n"):
        fault = "has no line end; was the file cut off?"
        yield reader.line_num, "row", fault, "every row must have one"


def _is_number(cell: str) -> bool:
    try:
        return np.isfinite(float(cell)) and "_" not in cell
    except ValueError:
        return False


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
    from acx4files.results.compiled import LONGEST as lines_LONGEST  # noqa: PLC0415
    from acx4files.results.compiled import put_lines  # noqa: PLC0415

    numbers = [column for column in SCHEMAS[name].ranges if column not in _COUNT]
    texts = [column for column in COLUMNS[name] if column not in numbers]
    order = [texts.index(c) if c in texts else -1 - numbers.index(c) for c in COLUMNS[name]]
    coded = [_coded(frame[column]) for column in texts]
    values = [frame[column].to_numpy(dtype=float) for column in numbers]
    cells = [_cells(known) for _, known in coded]
    lengths = [length for _, cell_lengths in cells for length in cell_lengths]
    longest = (
        sum(max(cell_lengths) for _, cell_lengths in cells)
        + lines_LONGEST * len(numbers)
        + len(order)
    )
    first = np.cumsum([0, *(len(cell_lengths) for _, cell_lengths in cells)])
    starts = np.cumsum([0, *lengths])
    content = np.frombuffer(b"".join(text for text, _ in cells), dtype=np.uint8)

    def text(begin: int) -> bytes:
        part = slice(begin, begin + ROWS)
        codes = np.array([k + code[part] for k, (code, _) in zip(first, coded, strict=False)])
        bits = np.array([column[part] for column in values]).view(np.uint64)
        out = np.empty(codes.shape[1] * longest, dtype=np.uint8)
        return out[: put_lines(out, np.array(order), codes, content, starts, bits)].tobytes()

    begins = range(0, len(frame), ROWS)
    for k in range(0, len(begins), TOGETHER):
        yield from processors.in_order(text, begins[k : k + TOGETHER])


def _cells(texts: list[str]) -> tuple[bytes, list[int]]:
    """Return texts as cells of a file, joined, and the length of each, bytes."""
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
    """Return the beginnings of the rows of some stages, or ``stage/method``, in a table's file."""
    parent = _OF.get(name, "")
    asked = [f"{stage_method}/" for stage_method in stage_methods if stage_method.count("/") < 2]
    beginnings = [
        stage_method.removeprefix(parent)
        for stage_method in asked
        if stage_method.startswith(parent)
    ]
    beginnings += [
        "" for stage_method in asked if parent.startswith(stage_method) and stage_method != parent
    ]  # any row
    return tuple(stage_method.replace("/", ",").encode() for stage_method in beginnings)


def holds(path: Path, begin: tuple[bytes, ...]) -> bool:
    """Tell whether a table may have rows with these beginnings; FlightError as `others`."""
    with _opened(path) as file, mmap(file.fileno(), 0, access=ACCESS_READ) as content:
        return any(content.find(b"\n" + prefix, 0, len(content) - 1) >= 0 for prefix in begin)


def others(
    path: Path, begin: tuple[bytes, ...], *, these: bool = False
) -> Iterator[tuple[str, bytes]]:
    """Yield the rows without these beginnings, or those with one, many at a time.

    Each part comes with its rows' first cell.

    Rows of an older file get empty cells in the columns that it lacks.

    Raises
    ------
    FlightError
        Where the file does not begin with the header of such a table.
    """
    with opened(path) as file:
        lacking = len(COLUMNS[path.stem]) - _check_header(path, list, file.readline(LONGEST))
        while chunk := _rows(file):
            kept = [row for row in chunk if row.startswith(begin) is these]
            if lacking:
                kept = [row.removesuffix(b"\n") + b"," * lacking + b"\n" for row in kept]
            for cell, alike in groupby(kept, lambda row: row.partition(b",")[0]):
                yield cell.decode(), b"".join(alike)


@contextmanager
def _opened(path: Path) -> Iterator[BinaryIO]:
    """Open a table after its header."""
    with opened(path) as file:
        first = file.readline(LONGEST)
        _check_header(path, list, first)
        yield file


def _rows(file: BinaryIO) -> list[bytes]:
    """Return the next rows; a line with an odd number of quotes ends or begins inside a cell."""
    file_lines = file.readlines(BYTES)
    if not any(b'"' in line for line in file_lines):
        return file_lines
    rows: list[bytes] = []
    row: list[bytes] = []
    is_open = False
    for line in file_lines:
        row.append(line)
        is_open ^= line.count(b'"') % 2 == 1
        if not is_open:
            rows.append(b"".join(row))
            row = []
    while is_open and (line := file.readline()):
        row.append(line)
        is_open ^= line.count(b'"') % 2 == 1
    return [*rows, b"".join(row)] if row else rows


PART_OF: Mapping[str, str] = {"rig": "mounting"}
"""The stage of the results folder for a stage that has none of its own."""

NOTEBOOKS: Mapping[str, str] = {
    "flight": "00-flight",
    "heads": "01-head-calibration",
    "synthetic": "02-synthetic-image",
    "mounting": "03-mounting-calibration",
    "rig": "08-rig",
    "validation": "04-validation",
}
"""The notebook of every stage, in the order in which they are run. ``flight`` only shows the data.
``rig`` is the part of the stage mounting that uses the block heads."""

RELATIVE = ("Xc_mm", "Yc_mm", "Zc_mm", "omega_deg", "phi_deg", "kappa_deg")
"""Names of the parameters of a head's relative orientation, in their order."""

UNITS = {
    **{name: (unit,) for name, unit in REPORTED.values()},
    **{name: (name.rpartition("_")[2],) for name in RELATIVE},
}
"""Units of the parameters of cameras and of heads."""

OF_TRAJECTORY = {
    "gnss_shift_": ("m",),
    "gnss_drift_": ("m/min", "m/exposure"),
    "gnss_delay_s": ("s",),
    "attitude_delay_s": ("s",),
    "deviation_": ("deg",),
}
"""Units of the parameters of a trajectory, which belong to no camera, by their first letters."""


# --- Problems of the cells of a results table, column by column


FIRST = 2
"""Line of the first row."""


def wrong_rows(
    file: str, column: str, rows: Mask | Index, found: Callable[[int], str], expected: str
) -> Iterator[Problem]:
    """Yield a problem for each wrong row of a table whose cells could be read.

    Parameters
    ----------
    file, column : str
    rows : ndarray
        Indices of the wrong rows, or a mask of all rows.
    found : callable
        Returns the content of a row.
    expected : str
    """
    idx: Index = np.flatnonzero(rows) if rows.dtype == bool else rows.astype(np.intp)

    def problem(row: int) -> Problem:
        return Problem(
            file=file, line=row + FIRST, column=column, found=found(row), expected=expected
        )

    yield from counted(idx, problem)


# --- Files of a results folder: regular ones, which lie in the folder itself, links resolved


MOST_BYTES = 200_000_000
"""Largest JSON file of results; a thousand heads have a hundredth of it."""


def is_there(path: Path, folder: Path | None = None) -> bool:
    """Tell whether a file of results exists.

    Parameters
    ----------
    path : Path
    folder : Path, optional
        Folder of the results; by default the parent of `path`.

    Raises
    ------
    FlightError
        Where something else is in its place, or it is a link that leads out of the folder.
    """
    # the target of a link is checked by name before anything is opened
    if not _is_inside(path, folder or path.parent):
        raise FlightError([_wrong(path, "is a link that leads out of the results")])
    if path.is_file():
        return True
    if os.path.lexists(path):  # reading a pipe would wait without end
        fault = "is a link to nothing" if path.is_symlink() else "is no regular file"
        raise FlightError([_wrong(path, fault)])
    return False


def _is_inside(path: Path, folder: Path) -> bool:
    """Tell whether a path, links resolved, lies below a folder."""
    return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder))


def _wrong(path: Path, fault: str) -> str:
    expected = "must be a file that a run wrote; remove it and run again"
    return str(Problem(file=str(path), line=1, column="file", found=fault, expected=expected))
