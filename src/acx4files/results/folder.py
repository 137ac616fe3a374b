"""The results folder: its tables and summary.json, written, read and looked up.

The results of a method have the name ``stage/method``, such as ``mounting/single_step``.
"""

from __future__ import annotations

import heapq
import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from acx4files.flight.problems import Problem, Range, did_you_mean, lines_of, quoted
from acx4files.flight.table_files import read_text
from acx4files.results import table_files
from acx4files.results.table_files import (
    COLUMNS,
    FIRST,
    MOST_BYTES,
    SCHEMAS,
    Schema,
    is_there,
    wrong_rows,
)
from acx4files.results.whole_files import Drafts, together
from acx4lib import expected
from acx4lib.errors import FlightError
from acx4lib.expected import Mask

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
    summary = _read_summary(path / "summary.json", problems)
    if problems:
        raise FlightError(problems)
    return Results(folder=path, summary=summary, **tables)


def entries(folder: Path) -> dict[str, dict[str, object]]:
    """Return the objects of summary.json, without the tables; FlightError if it is invalid."""
    problems: list[str] = []
    summary = _read_summary(folder / "summary.json", problems)
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


def adopt(folder: Path, other: Path, stage: str) -> None:
    """Replace the results of a stage by those in another folder of results."""
    summary = {k: v for k, v in entries(folder).items() if not _belongs(k, [stage])}
    summary |= {k: v for k, v in entries(other).items() if _belongs(k, [stage])}
    with together() as new:
        for name in COLUMNS:
            begin, file_name = table_files.begins(name, [stage]), f"{name}.csv"
            parts = heapq.merge(
                _old(folder / file_name, begin),
                _old(other / file_name, begin, these=True),
                key=itemgetter(0),
            )
            with new.open(folder / file_name) as file:
                file.write(table_files.header(name))
                file.writelines(lines for _, lines in parts)
        with new.open(folder / "summary.json") as file:
            file.write(_summary_text(summary).encode())


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


def _old(
    path: Path, gone: tuple[bytes, ...], *, these: bool = False
) -> Iterator[tuple[int, bytes]]:
    """Yield the lines of a file that remain, or `these`, with the positions of their stages."""
    if is_there(path):
        for stage, lines in table_files.others(path, gone, these=these):
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


# --- the entries of summary.json --------------------------------------------------------------


Test = Callable[[Any], bool]

Wrong = tuple[tuple[str, ...], str, str]
"""Keys in a JSON file, content, and expected content."""


def _number(value: object) -> bool:
    plain = isinstance(value, int | float) and not isinstance(value, bool)
    return plain and -1e15 < value < 1e15  # type: ignore[operator] # compared as numbers only


def _whole(value: object) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) < 1e15


def _not_negative(value: object) -> bool:
    return _number(value) and float(value) >= 0  # type: ignore[arg-type]


def _probability(value: object) -> bool:
    return _not_negative(value) and float(value) <= 1  # type: ignore[arg-type]


def _or_null(test: Test) -> Test:
    return lambda value: value is None or test(value)


def _sentences(value: object) -> bool:
    return isinstance(value, list) and all(isinstance(line, str) for line in value)


def _three(value: object) -> bool:
    return isinstance(value, list) and len(value) == 3 and all(map(_or_null(_number), value))


def _pairs(value: object) -> bool:
    return isinstance(value, list) and all(
        isinstance(pair, list) and len(pair) == 3 and _sentences(pair[:2]) and _number(pair[2])
        for pair in value
    )


def _groups(value: object) -> bool:
    return isinstance(value, list) and all(
        isinstance(group, list)
        and len(group) == 3
        and isinstance(group[0], str)
        and all(map(_number, group[1:]))
        for group in value
    )


def _named_pairs(value: Any) -> bool:
    return isinstance(value, list) and all(_sentences(pair) and len(pair) == 3 for pair in value)


def _is_condition(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0 < value < 1e300


def _by_name(test: Test) -> Test:
    return lambda value: isinstance(value, dict) and all(map(test, value.values()))


_WORDS: Mapping[str, tuple[str, ...]] = {
    "nssda": ("statement",),
    "asprs_2014": ("horizontal", "vertical"),
    "asprs_2023": ("horizontal", "vertical", "three_d"),
}


def _classes(value: Any) -> bool:
    """Tell whether the classes of every standard are texts."""
    if not _by_name(_is_object)(value):
        return False
    of_scales = value.get("pec_pcd", {}).values()
    return all(_has_words(classes, ("plan", "height")) for classes in of_scales) and all(
        _has_words(value[name], keys) for name, keys in _WORDS.items() if name in value
    )


def _is_object(value: object) -> bool:
    return isinstance(value, dict)


def _is_compared(value: Any) -> bool:
    return (
        isinstance(value, dict)
        and _three(value.get("difference"))
        and _or_null(_number)(value.get("p"))
        and isinstance(value.get("confirmed"), bool)
        and all(isinstance(value.get(key, ""), str) for key in ("told", "mistake"))
    )


_OF_TURNS = ("f", "dof", "redundancy", "p")


def _turns(value: Any) -> bool:
    """Tell whether a test of turns of the cameras against the body is complete."""
    if not (isinstance(value, dict) and _sentences(value.get("names"))):
        return False
    by_name = (value.get("turns_deg"), value.get("sigma_deg"))
    return all(_number(value.get(key)) for key in _OF_TURNS) and all(
        isinstance(rows, list) and len(rows) == len(value["names"]) and all(map(_three, rows))
        for rows in by_name
    )


def _is_sigma_test(value: Any) -> bool:
    return (
        isinstance(value, dict)
        and all(_not_negative(value.get(key)) for key in ("ratio", "redundancy", "effective"))
        and _probability(value.get("p"))
    )


def _is_held(value: Any) -> bool:
    """Tell whether a held parameter has its numbers, and the moves of others."""
    return (
        isinstance(value, dict)
        and _number(value.get("value"))
        and _or_null(_number)(value.get("estimate"))
        and all(_or_null(_not_negative)(value.get(key)) for key in ("sigma", "cost"))
        and _or_null(_probability)(value.get("p"))
        and _by_name(_number)(value.get("moves"))
    )


def _has_words(value: Any, keys: tuple[str, ...]) -> bool:
    return isinstance(value, dict) and all(isinstance(value.get(key), str) for key in keys)


_OF_POINTS = ("mean", "std", "rms", "mean_sigma", "normalised_rms", "effective_number")


def _points(value: object) -> bool:
    return (
        isinstance(value, dict)
        and all(_or_null(_three)(value.get(key)) for key in _OF_POINTS)
        and _classes(value.get("classes", {}))
    )


def _checksums(value: object) -> bool:
    return isinstance(value, dict) and all(isinstance(checksum, str) for checksum in value.values())


def _is_named(value: Any) -> bool:
    """Tell whether a flight has its name and its digest."""
    return isinstance(value, dict) and _has_words(value, ("name", "sha256"))


def _is_earlier(value: Any) -> bool:
    """Tell whether the calibration of an earlier flight is fully identified."""
    texts = ("results", "sha256", "computed", "method")
    return _has_words(value, texts) and _is_named(value.get("flight"))


_COUNT = ("iterations", "n_observations", "n_unknowns", "redundancy", "n_rejected", "n_left_out")
_OF_PAIRS = ("n_pairs", "n_points", "n_failed_pairs")
_NOT_NEGATIVE = ("sigma0_squared", "joint_chi_square", "expected_rejections")

TESTS: Mapping[str, tuple[Test, str]] = {
    "converged": (lambda value: isinstance(value, bool), "true or false"),
    **dict.fromkeys(
        (*_COUNT, *_OF_PAIRS, "n_exposures"), (_or_null(_whole), "a whole number or null")
    ),
    **dict.fromkeys(
        ("height_scale_error", "height_scale_sigma", "height_offset_share", "joint_dof"),
        (_or_null(_number), "a number or null"),
    ),
    **dict.fromkeys(_NOT_NEGATIVE, (_or_null(_not_negative), "zero, positive or null")),
    **dict.fromkeys(
        ("chi_square_p", "joint_chi_square_p", "held_p"),
        (_or_null(_probability), "between 0 and 1, or null"),
    ),
    "condition": (_or_null(_is_condition), "a positive number or null"),
    **dict.fromkeys(
        (
            *("left_out", "not_determined", "weak", "stopped", "exchanged", "not_confirmed"),
            *("approximations", "sigma_beyond", "notes", "held_rejected"),
        ),
        (_sentences, "a list of sentences"),
    ),
    "declared": (_by_name(_is_compared), "difference, p and confirmed by part of a mounting"),
    "exchanged_names": (_named_pairs, "a list of a kind and two names each"),
    "boresight_stability": (
        _by_name(_or_null(_turns)),
        "strips and drift, each null or with names, turns_deg, sigma_deg, f, dof, redundancy and p",
    ),
    "stopped_groups": (_groups, "a list of a group and two numbers each"),
    "correlated": (_pairs, "a list of two parameters and a number each"),
    **dict.fromkeys(
        ("weakest", "largest_correlations", "left_out_points"),
        (_by_name(_or_null(_number)), "numbers by name"),
    ),
    "held": (_by_name(_is_held), "value, estimate, sigma, cost, p and moves by parameter"),
    "sigma_of_heads": (_by_name(_not_negative), "numbers by parameter, zero or positive"),
    "weak_parameters": (_by_name(_by_name(_or_null(_number))), "numbers by parameter and name"),
    "sigma_tests": (_by_name(_is_sigma_test), "ratio, redundancy, effective and p by group"),
    "sigma_factors": (_by_name(_by_name(_or_null(_number))), "numbers by name and group"),
    "rays_rms_px": (_or_null(_not_negative), "zero, positive or null"),
    **dict.fromkeys(
        ("picture_turns_deg", "held_effect_m", "held_effect_sigma"),
        (_three, "a list of three numbers"),
    ),
    "held_effect_px": (_by_name(_not_negative), "numbers by head, zero or positive"),
    **dict.fromkeys(("mean", "std", "rms", "position_rms_m"), (_three, "a list of three numbers")),
    "points": (_points, "mean, std, rms and classes over the points"),
    "flight": (_is_named, "name and sha256 of a flight"),
    "calibration": (_is_earlier, "what names the calibration of an earlier flight"),
    "measured": (_checksums, "checksums by file"),
}
"""Tests of the known entries by name, each with the expected content; others are not read."""

_ADJUSTED = ("n_observations", "n_unknowns", "redundancy", "n_rejected", "chi_square_p")
_VALIDATED = (*_OF_PAIRS, "mean", "std", "rms", "points")


def _read_summary(path: Path, problems: list[str]) -> dict[str, dict[str, object]]:
    """Read summary.json, empty where it is missing; problems are added as lines."""
    try:
        summary = read_object(path, "one object per stage/method") if is_there(path) else {}
    except FlightError as error:
        problems += error.problems
        return {}
    faults = list(_wrong_entries(summary))
    problems += lines_of(problem_of(path, *fault) for fault in faults)
    return {} if faults else summary


def read_object(path: Path, what: str) -> dict[str, Any]:
    """Return the object in a JSON file; a repeated key is refused.

    Parameters
    ----------
    path : Path
        An existing file.
    what : str
        Expected content, for messages.

    Raises
    ------
    FlightError
    """
    text = _text_of(path)

    def wrong(line: int, fault: str) -> FlightError:
        expected = f"must be {what}; remove it and run again"
        problem = Problem(file=str(path), line=line, column="file", found=fault, expected=expected)
        return FlightError([str(problem)])

    try:
        content = json.loads(text, object_pairs_hook=_once)
    except json.JSONDecodeError as error:
        raise wrong(error.lineno, f"not JSON ({error.msg}, character {error.colno})") from None
    except (ValueError, RecursionError) as error:
        raise wrong(1, f"not JSON ({' '.join(str(error).split())})") from None
    if not isinstance(content, dict):
        raise wrong(1, _quoted(content))
    return content


def _text_of(path: Path) -> str:
    """Return the text of a file; FlightError if it cannot be read."""
    text, _, problems = read_text(path, str(path), needed_by="a report", most=MOST_BYTES)
    if problems:
        raise FlightError([f"{problem}; remove it and run again" for problem in problems])
    return text


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    entries = dict(pairs)
    if len(entries) < len(pairs):
        again = next(key for k, (key, _) in enumerate(pairs) if key in dict(pairs[:k]))
        raise ValueError(f"{_quoted(again)} stands twice in one object")
    return entries


def problem_of(path: Path, keys: Sequence[str], found: str, expected: str) -> Problem:
    """Return a problem of a key in a JSON file, with the line of the key if it is found."""
    text, offset = _text_of(path) if path.is_file() else "", 0
    for key in keys:
        position = text.find(f"{json.dumps(key, ensure_ascii=False)}:", offset)
        offset = position if position >= 0 else offset
    line = text.count("\n", 0, offset) + 1
    name = ": ".join(keys) or "file"
    return Problem(file=str(path), line=line, column=name, found=found, expected=expected)


def _wrong_entries(summary: Mapping[str, object]) -> Iterator[Wrong]:
    """Yield keys, content and expected content of each problem in a summary."""
    for name, entry in summary.items():
        if name.partition("/")[0] not in STAGES or "/" not in name:
            yield (name,), "is unknown", f"must be of a stage: {', '.join(STAGES)}"
            continue
        if not isinstance(entry, dict):
            yield (name,), _quoted(entry), "must be an object"
            continue
        for key, (test, wanted) in TESTS.items():
            if key in entry and not test(entry[key]):
                yield (name, key), _quoted(entry[key]), f"must be {wanted}"
        for key in _required(name, entry):
            if entry.get(key) is None:
                yield (name, key), "is missing", "an adjustment has it"


def _required(name: str, entry: Mapping[str, object]) -> tuple[str, ...]:
    """Return the required entries of an object, if it is an adjustment or a validation."""
    if name.startswith("validation/") and "n_points" in entry:
        return _VALIDATED
    sigma0_sq = entry.get("sigma0_squared")
    adjusted = name.startswith(("heads/bundle", "mounting/"))
    return _ADJUSTED if adjusted and _number(sigma0_sq) else ()


def _quoted(value: object) -> str:
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:60]}…"
