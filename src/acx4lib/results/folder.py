"""The results folder: its tables, written, read and looked up.

The results of a method have the name ``stage/method``, such as ``mounting/single_step``.
"""

from __future__ import annotations

import heapq
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter
from pathlib import Path

import numpy as np
import pandas as pd

from acx4lib import expected
from acx4lib.errors import FlightError
from acx4lib.expected import Mask
from acx4lib.flight.problems import Problem, Range, did_you_mean, quoted
from acx4lib.results import table_files
from acx4lib.results.summary_entries import read_summary
from acx4lib.results.table_files import (
    COLUMNS,
    FIRST,
    SCHEMAS,
    Schema,
    is_there,
    wrong_rows,
)
from acx4lib.results.whole_files import Drafts, together

STAGES = table_files.STAGES

_PLACES = {stage: place for place, stage in enumerate(STAGES)}

FILES = (*(f"{name}.csv" for name in COLUMNS), "summary.json")
"""Every file of a results folder."""

EARLIEST = tuple(file for file in FILES if file != "synthetic_points.csv")
"""Files that results of every version have."""


Rows = pd.DataFrame | Sequence[pd.DataFrame]
"""Rows of a table, in one part or in several."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Results:
    """The content of a results folder.

    Two tables, which are long in a large flight, are read at the first access; this raises a
    FlightError where their file does not have the format of `replace`.

    Attributes
    ----------
    folder : Path
    parameters, validation, check_points, exterior_orientation : DataFrame
    residuals, covariance, rejected, synthetic_points : DataFrame
        With the columns of `COLUMNS`; names are text, unknown numbers are NaN.
    summary : dict
        One object per ``stage/method``, or per ``stage/method/camera``.
    """

    folder: Path
    parameters: pd.DataFrame
    validation: pd.DataFrame
    check_points: pd.DataFrame
    exterior_orientation: pd.DataFrame
    covariance: pd.DataFrame
    rejected: pd.DataFrame
    summary: dict[str, dict[str, object]]

    @cached_property
    def residuals(self) -> pd.DataFrame:
        """Residuals of all observations."""
        return table_files.read(self.folder / "residuals.csv", _cell_problems)

    @cached_property
    def synthetic_points(self) -> pd.DataFrame:
        """Transferred points of all blocks that are measured in heads."""
        return table_files.read(self.folder / "synthetic_points.csv", _cell_problems)


def _cell_problems(file: str, frame: pd.DataFrame) -> Iterator[Problem]:
    """Yield the problems of the cells of a table, column by column."""
    schema = SCHEMAS[Path(file).stem]
    for name, allowed in schema.ranges.items():
        yield from _numbers(file, frame[name], allowed, needed=name in schema.needed)
    for name, words in schema.words.items():
        yield from _words(file, frame[name], words)
    if schema.key:
        yield from _repeated(file, frame, schema)


def _numbers(file: str, column: pd.Series, allowed: Range, *, needed: bool) -> Iterator[Problem]:
    values = column.to_numpy()
    bad = ~((values >= allowed.low) & (values <= allowed.high))
    if allowed.whole:
        bad |= np.floor(values) != values
    if not needed:
        bad &= ~np.isnan(values)

    def fault(row: int) -> str:
        return "is empty" if np.isnan(values[row]) else repr(float(values[row]))

    yield from wrong_rows(file, str(column.name), bad, fault, str(allowed))


def _words(file: str, column: pd.Series, words: tuple[str, ...]) -> Iterator[Problem]:
    """Yield cells without a known word."""
    bad = ~column.isin(words).to_numpy()

    def fault(row: int) -> str:
        cell = str(column.iloc[row])
        return f"{quoted(cell)} is unknown{did_you_mean(cell, words)}"

    yield from wrong_rows(file, str(column.name), bad, fault, f"must be one of {', '.join(words)}")


def _repeated(file: str, frame: pd.DataFrame, schema: Schema) -> Iterator[Problem]:
    """Yield rows with the key of an earlier row."""
    cells = frame[list(schema.key)]
    again = np.array(cells.duplicated())
    if again.any():
        again &= ~_often(frame, schema)

    def fault(row: int) -> str:
        alike = (cells == cells.iloc[row]).all(axis=1)
        first = int(np.flatnonzero(alike)[0])
        names = ", ".join(quoted(str(cell)) for cell in cells.iloc[row])
        return f"{names} stands in line {first + FIRST} already"

    yield from wrong_rows(file, "row", again, fault, f"every {', '.join(schema.key)} once")


def _often(frame: pd.DataFrame, schema: Schema) -> Mask:
    """Return the mask of the rows that may repeat a key, shape (n,)."""
    out = np.zeros(len(frame), dtype=bool)
    for words in schema.often:
        matches = np.ones(len(frame), dtype=bool)
        for name, allowed in words.items():
            matches &= frame[name].isin(allowed).to_numpy()
        out |= matches
    return out


SHORT = tuple(name for name in COLUMNS if name in Results.__annotations__)
"""The tables that are read immediately."""


def of_run(folder: str | Path) -> Path:
    """Return the path of a folder with results of a run; FlightError without any."""
    path = expected.folder("folder", folder, "the results of a run")
    if not any((path / name).is_file() for name in FILES):
        raise FlightError([f"{path}: no results of a run; acx4 run FLIGHT --results makes them"])
    return path


def read(folder: str | Path) -> Results:
    """Read an existing results folder; a missing file counts as a table without rows.

    Raises
    ------
    FlightError
        Where there is no such folder, or a file does not have the format of `replace`.
    """
    path = expected.folder("folder", folder, "the results of a run")
    problems: list[str] = []
    tables: dict[str, pd.DataFrame] = {}
    for name in SHORT:
        try:
            tables[name] = table_files.read(path / f"{name}.csv", _cell_problems)
        except FlightError as error:
            problems += error.problems
    summary = read_summary(path / "summary.json", problems)
    if problems:
        raise FlightError(problems)
    return Results(folder=path, summary=summary, **tables)


def entries(folder: Path) -> dict[str, dict[str, object]]:
    """Return the objects of summary.json, without the tables; FlightError if it is invalid."""
    problems: list[str] = []
    summary = read_summary(folder / "summary.json", problems)
    if problems:
        raise FlightError(problems)
    return summary


def replace(
    folder: str | Path,
    stage_methods: Sequence[str],
    *,
    tables: Mapping[str, Rows],
    summary: Mapping[str, Mapping[str, object]],
) -> None:
    """Replace old results by new ones; everything else in the folder stays.

    All files are completely written beside the old ones before the first one is replaced.

    Parameters
    ----------
    folder : path
        It is made if it does not exist.
    stage_methods : sequence of str
        Results to replace: ``mounting/single_step``, or ``mounting`` for a whole stage.
    tables : mapping of str to DataFrame, or to a sequence of them
        New rows by the names of `COLUMNS`, each table with exactly these columns; those of text are
        written fastest as categories.
    summary : mapping of str to mapping
        New objects of summary.json.

    Raises
    ------
    ValueError
        Where a row or an object belongs to none of `stage_methods`, columns are wrong, or a cell
        has more than one line.
    FlightError
        Where the files in the folder cannot be read.
    """
    path = expected.path("folder", folder)
    parts = {name: [new] if isinstance(new, pd.DataFrame) else new for name, new in tables.items()}
    _check_names(stage_methods, parts)
    kept = {key: v for key, v in entries(path).items() if not _belongs(key, stage_methods)}
    strangers = [key for key in summary if not _belongs(key, stage_methods)]
    if strangers:
        raise ValueError(f"summary of {', '.join(strangers)} is not of {', '.join(stage_methods)}")
    path.mkdir(parents=True, exist_ok=True)
    with together() as new:
        for name in COLUMNS:
            _write(name, path, new, parts.get(name, ()), stage_methods)
        with new.open(path / "summary.json") as file:
            file.write(_summary_text({**kept, **summary}).encode())


def _summary_text(summary: Mapping[str, Mapping[str, object]]) -> str:
    """Return the text of summary.json; a number that is not finite becomes null."""
    plain = _plain(summary)
    return json.dumps(plain, indent=2, sort_keys=True, allow_nan=False, ensure_ascii=False) + "\n"


def _plain(value: object) -> object:
    if isinstance(value, Mapping):
        return {str(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def has(results: Results, stage_method: str) -> bool:
    """Tell whether there are results of a stage or a ``stage/method``; ValueError if unknown."""
    expected.instance("results", results, Results)
    expected.one_of("stage", str(stage_method).partition("/")[0], STAGES)
    known = {*results.summary, *table_files.keys("parameters", results.parameters)[1]}
    return any(_belongs(key, [stage_method]) for key in known)


def rows(results: Results, table: str, stage_method: str) -> pd.DataFrame:
    """Return the rows of a stage or a ``stage/method`` in a table, numbered from 0.

    Parameters
    ----------
    results : Results
    table : str
        One of `COLUMNS`.
    stage_method : str

    Raises
    ------
    FlightError
        Where the stage has not been run; a method that was run may have no rows.
    ValueError
        For an unknown table or stage.
    """
    expected.one_of("table", table, COLUMNS)
    if not has(results, stage_method):
        stage = stage_method.partition("/")[0]
        problem = f"{results.folder}: no results of {stage_method}; run stage {stage} first"
        raise FlightError([problem])
    frame = _with(results, table, stage_method)
    selected = frame[_mask(table, frame, [stage_method])].reset_index(drop=True)
    if table == "residuals":
        _check_count(results, stage_method, len(selected))
    return selected


def _check_count(results: Results, stage_method: str, n: int) -> None:
    """Check the number of residuals against the observations counted in summary.json."""
    adjusted = [v for k, v in results.summary.items() if _belongs(k, [stage_method])]
    counts = [entry.get("n_observations") for entry in adjusted]
    counted = sum(count for count in counts if isinstance(count, int))
    if counted != n and any(count is not None for count in counts):
        problem = Problem(
            file=str(results.folder / "residuals.csv"),
            line=1,
            column="row",
            found=f"has {n} rows of {stage_method}",
            expected=f"summary.json counts {counted} observations",
        )
        raise FlightError([str(problem)])


def _with(results: Results, table: str, stage_method: str) -> pd.DataFrame:
    """Return a table; of a large one that is not loaded, only the rows of the stage."""
    if table in vars(results):
        return getattr(results, table)
    begin = table_files.begins(table, [stage_method])
    return table_files.read_some(results.folder / f"{table}.csv", begin, _cell_problems)


def cameras(results: Results, stage_method: str) -> tuple[str, ...]:
    """Return the names of the cameras with parameters of a method, in the order of the rows."""
    named = rows(results, "parameters", stage_method)["camera"].unique()
    return tuple(name for name in named if name)


def parameters(results: Results, stage_method: str, camera: str) -> pd.DataFrame:
    """Return one camera's parameters: columns value, sigma, unit; indexed by parameter.

    Raises
    ------
    FlightError
        Where the stage has not been run, or the method has no parameters of this camera.
    """
    listed = rows(results, "parameters", stage_method)
    listed = listed[listed["camera"] == camera].set_index("parameter")
    if listed.empty:
        reasons = [
            reason
            for key, entry in results.summary.items()
            if _belongs(key, [stage_method])
            for reason in [*messages(entry, "left_out"), *messages(entry, "not_determined")]
        ]
        problem = f"{results.folder}: no parameters of {stage_method} for camera {camera}"
        raise FlightError(["; ".join([problem, *reasons])])
    return listed[["value", "sigma", "unit"]]


def covariance(results: Results, stage_method: str) -> pd.DataFrame:
    """Return the covariance of a method's parameters, named ``camera/parameter``.

    A parameter that belongs to no camera, such as a shift of GNSS positions, has only its own
    name. Pairs without a row are zero, for example those of two heads adjusted separately.

    Returns
    -------
    DataFrame, shape (n, n)
        In the units of the parameters.
    """
    long = rows(results, "covariance", stage_method)
    row, names = pd.factorize(long["row"])
    column = names.get_indexer(pd.Index(long["column"]))
    square = np.zeros((len(names), len(names)))
    known = column >= 0
    square[row[known], column[known]] = long["value"].fillna(0.0)[known]
    return pd.DataFrame(square, index=names, columns=names)


def messages(entry: Mapping[str, object], key: str) -> list[str]:
    """Return the sentences under a key of an object of summary.json; empty without any."""
    sentences = entry.get(key, [])
    return [str(line) for line in sentences] if isinstance(sentences, list) else []


def _belongs(key: str, stage_methods: Sequence[str]) -> bool:
    return any(key == name or key.startswith(f"{name}/") for name in stage_methods)


def _mask(table: str, frame: pd.DataFrame, stage_methods: Sequence[str]) -> Mask:
    """Return the mask of the rows of the given stages and methods, shape (n,)."""
    code, keys = table_files.keys(table, frame)
    return np.array([_belongs(key, stage_methods) for key in keys], dtype=bool)[code]


def _check_names(
    stage_methods: Sequence[str], tables: Mapping[str, Sequence[pd.DataFrame]]
) -> None:
    """Check that new tables have known columns, and only rows of the replaced results."""
    expected.names("stage_methods", stage_methods)
    unknown = {name.partition("/")[0] for name in stage_methods} - set(STAGES)
    unknown |= tables.keys() - COLUMNS.keys()
    if unknown:
        raise ValueError(f"unknown stages or tables: {', '.join(sorted(unknown))}")
    for name, frames in tables.items():
        for frame in frames:
            _check_columns(name, frame.columns)
            _, keys = table_files.keys(name, frame)
            strangers = [key for key in keys if not _belongs(key, stage_methods)]
            if strangers:
                listed = ", ".join(sorted(strangers))
                raise ValueError(f"{name}: {listed} is not of {', '.join(stage_methods)}")


def _check_columns(name: str, columns: Iterable[str]) -> None:
    """Raise a ValueError where a table has not exactly the columns of `COLUMNS`, in any order."""
    if sorted(columns) != sorted(COLUMNS[name]):
        raise ValueError(f"{name} has columns {', '.join(COLUMNS[name])}, got {', '.join(columns)}")


def _write(
    name: str,
    folder: Path,
    new: Drafts,
    frames: Sequence[pd.DataFrame],
    stage_methods: Sequence[str],
) -> None:
    """Write a table with its remaining and its new rows, unless nothing changes."""
    old, gone = folder / f"{name}.csv", table_files.begins(name, stage_methods)
    if not frames and is_there(old) and not table_files.holds(old, gone):
        return
    parts = heapq.merge(_old(old, gone), _new(name, frames), key=itemgetter(0))
    with new.open(old) as file:
        file.write(table_files.header(name))
        file.writelines(lines for _, lines in parts)


def _old(path: Path, gone: tuple[bytes, ...]) -> Iterator[tuple[int, bytes]]:
    """Yield the remaining lines of a file, with the positions of their stages."""
    if is_there(path):
        for stage, lines in table_files.others(path, gone):
            yield _PLACES.get(stage, 0), lines


def _new(name: str, frames: Sequence[pd.DataFrame]) -> Iterator[tuple[int, bytes]]:
    """Yield new rows in the order of the stages, with the positions of these stages."""
    known = [(frame, *table_files.keys(name, frame)) for frame in frames]
    for stage, place in _PLACES.items():
        for frame, code, keys in known:
            mine = np.array([_belongs(key, [stage]) for key in keys], dtype=bool)
            if mine.any():
                part = frame if mine.all() else frame[mine[code]]
                yield from ((place, rows) for rows in table_files.lines(name, part))
