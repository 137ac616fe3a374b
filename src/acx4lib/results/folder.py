"""The results folder: its tables, written, read and looked up.

The results of a method have the name ``stage/method``, such as ``mounting/single_step``.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from csv import QUOTE_NONNUMERIC
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from acx4lib import expected
from acx4lib.errors import FlightError
from acx4lib.expected import Mask
from acx4lib.results.own_folder.marks import SCRATCH
from acx4lib.results.summary_entries import read_summary, summary_text

STAGES = ("heads", "synthetic", "mounting", "validation")
"""The stages in the order of the paper, and of the rows of every table."""

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

_TEXT = {
    *(*_METHOD, "camera", "parameter", "unit", "point", "image_a", "image_b", "image", "kind"),
    *("image_or_exposure", "component", "row", "column", "reason", "block", "head"),
}
_COUNT = {"n_images"}

FILES = (*(f"{name}.csv" for name in COLUMNS), "summary.json")
"""Every file of a results folder."""

EARLIEST = tuple(file for file in FILES if file != "synthetic_points.csv")
"""Those that results of every version have."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Results:
    """The content of a results folder.

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
    residuals: pd.DataFrame
    covariance: pd.DataFrame
    rejected: pd.DataFrame
    synthetic_points: pd.DataFrame
    summary: dict[str, dict[str, object]]


def read(folder: str | Path) -> Results:
    """Read an existing results folder; a missing file counts as a table without rows.

    Raises
    ------
    FlightError
        Where there is no such folder, or a file does not have the format of `replace`.
    """
    return _read(expected.folder("folder", folder, "the results of a run"))


def _read(folder: Path) -> Results:
    """Read a results folder, which need not exist yet."""
    problems: list[str] = []
    tables = {name: _read_table(folder / f"{name}.csv", problems) for name in COLUMNS}
    summary = read_summary(folder / "summary.json", problems)
    if problems:
        raise FlightError(problems)
    return Results(folder=folder, summary=summary, **tables)


def replace(
    folder: str | Path,
    stage_methods: Sequence[str],
    *,
    tables: Mapping[str, pd.DataFrame],
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
    tables : mapping of str to DataFrame
        New rows by the names of `COLUMNS`, each table with exactly these columns.
    summary : mapping of str to mapping
        New objects of summary.json.

    Raises
    ------
    ValueError
        Where a row or an object belongs to none of `stage_methods`, or columns are wrong.
    FlightError
        Where the files in the folder cannot be read.
    """
    folder = expected.path("folder", folder)
    _check_names(stage_methods, tables)
    old = _read(folder)
    merged = {
        name: _merged(name, getattr(old, name), tables.get(name), stage_methods) for name in COLUMNS
    }
    kept = {key: v for key, v in old.summary.items() if not _belongs(key, stage_methods)}
    strangers = [key for key in summary if not _belongs(key, stage_methods)]
    if strangers:
        msg = f"summary of {', '.join(strangers)} is not of {', '.join(stage_methods)}"
        raise ValueError(msg)
    _write(folder, merged, {**kept, **summary})


def has(results: Results, stage_method: str) -> bool:
    """Tell whether there are results of a stage or a ``stage/method``; ValueError if unknown."""
    expected.instance("results", results, Results)
    expected.one_of("stage", str(stage_method).partition("/")[0], STAGES)
    known = {*results.summary, *_keys("parameters", results.parameters)}
    return any(_belongs(key, [stage_method]) for key in known)


def rows(results: Results, table: str, stage_method: str) -> pd.DataFrame:
    """Return the rows that a stage or a ``stage/method`` has in a table, numbered from 0.

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
    frame: pd.DataFrame = getattr(results, table)
    return frame[_mask(table, frame, [stage_method])].reset_index(drop=True)


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
    found = rows(results, "parameters", stage_method)
    found = found[found["camera"] == camera].set_index("parameter")
    if found.empty:
        reasons = [
            reason
            for key, entry in results.summary.items()
            if _belongs(key, [stage_method])
            for reason in [*messages(entry, "left_out"), *messages(entry, "not_determined")]
        ]
        problem = f"{results.folder}: no parameters of {stage_method} for camera {camera}"
        raise FlightError(["; ".join([problem, *reasons])])
    return found[["value", "sigma", "unit"]]


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
    names = pd.unique(long["row"])
    square = long.pivot_table(index="row", columns="column", values="value", sort=False)
    return square.reindex(index=names, columns=names).fillna(0.0)


def messages(entry: Mapping[str, object], key: str) -> list[str]:
    """Return the sentences under a key of an object of summary.json; empty without any."""
    found = entry.get(key, [])
    return [str(line) for line in found] if isinstance(found, list) else []


def _belongs(key: str, stage_methods: Sequence[str]) -> bool:
    return any(key == name or key.startswith(f"{name}/") for name in stage_methods)


def _keys(table: str, frame: pd.DataFrame) -> Iterator[str]:
    """Yield ``stage/method`` of every row."""
    if table == "synthetic_points":
        return iter(["synthetic/points"] * len(frame))
    stages = ["validation"] * len(frame) if table == "validation" else frame["stage"]
    return (f"{stage}/{method}" for stage, method in zip(stages, frame["method"], strict=True))


def _mask(table: str, frame: pd.DataFrame, stage_methods: Sequence[str]) -> Mask:
    """Tell which rows belong to the given stages and methods."""
    return np.array([_belongs(key, stage_methods) for key in _keys(table, frame)], dtype=bool)


def _check_names(stage_methods: Sequence[str], tables: Mapping[str, pd.DataFrame]) -> None:
    expected.names("stage_methods", stage_methods)
    unknown = {name.partition("/")[0] for name in stage_methods} - set(STAGES)
    unknown |= tables.keys() - COLUMNS.keys()
    if unknown:
        msg = f"unknown stages or tables: {', '.join(sorted(unknown))}"
        raise ValueError(msg)


def _merged(
    name: str, old: pd.DataFrame, new: pd.DataFrame | None, stage_methods: Sequence[str]
) -> pd.DataFrame:
    """Return the old rows that stay and the new rows, in the order of the stages."""
    parts = [old[~_mask(name, old, stage_methods)]]
    if new is not None:
        new = _typed(name, new)
        strangers = set(_keys(name, new[~_mask(name, new, stage_methods)]))
        if strangers:
            msg = f"{name}: {', '.join(sorted(strangers))} is not of {', '.join(stage_methods)}"
            raise ValueError(msg)
        parts.append(new)
    frame = pd.concat([part for part in parts if len(part)] or parts[:1], ignore_index=True)
    if "stage" not in frame:
        return frame
    place = frame["stage"].map({stage: i for i, stage in enumerate(STAGES)})
    return frame.iloc[np.argsort(place.to_numpy(), kind="stable")].reset_index(drop=True)


def _typed(name: str, frame: pd.DataFrame) -> pd.DataFrame:
    """Return a table with ordered columns of text, counts and numbers (NaN: not known)."""
    if set(frame.columns) != set(COLUMNS[name]) or len(frame.columns) != len(COLUMNS[name]):
        msg = f"{name} has columns {', '.join(COLUMNS[name])}, got {', '.join(frame.columns)}"
        raise ValueError(msg)
    columns: dict[str, pd.Series] = {}
    for column in COLUMNS[name]:
        values = frame[column].reset_index(drop=True)
        if column in _TEXT:
            columns[column] = values.astype(object).where(values.notna(), "").map(str).astype(str)
        elif column in _COUNT:
            columns[column] = values.astype("int64")
        else:
            number = values.astype("float64")
            columns[column] = number.where(np.isfinite(number))
    return pd.DataFrame(columns, columns=list(COLUMNS[name]))


def _read_table(path: Path, problems: list[str]) -> pd.DataFrame:
    expected = COLUMNS[path.stem]
    empty = _typed(path.stem, pd.DataFrame(columns=list(expected), dtype=object))
    if not path.is_file():  # reading a pipe would wait without end
        if path.exists():
            problems.append(f"{path}: is no regular file; remove it and run again")
        return empty
    try:
        frame = pd.read_csv(path, dtype=str, keep_default_na=False, encoding="utf-8")
        for column in set(frame.columns) - _TEXT:
            frame[column] = [float(text or "nan") for text in frame[column]]
        return _typed(path.stem, frame)
    except ValueError as error:
        reason = str(error).strip().splitlines()[0]
        problems.append(f"{path}: not a results table ({reason}); remove it and run again")
    return empty


def _write(
    folder: Path,
    tables: Mapping[str, pd.DataFrame],
    summary: Mapping[str, Mapping[str, object]],
) -> None:
    """Write all files completely before the first one is replaced."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=SCRATCH) as temporary:
        new = Path(temporary)
        for name, frame in tables.items():
            cells = frame.to_csv(index=False, lineterminator="\n")
            if "\r" in cells:  # without quotes it would end a row
                cells = frame.to_csv(index=False, lineterminator="\n", quoting=QUOTE_NONNUMERIC)
            (new / f"{name}.csv").write_text(cells, encoding="utf-8", newline="")
        (new / "summary.json").write_text(summary_text(summary), encoding="utf-8")
        for name in FILES:
            (new / name).replace(folder / name)
