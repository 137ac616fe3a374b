"""The results folder: its tables and summary.json, written, read and looked up.

The results of a method have the name ``stage/method``, such as ``mounting/single_step``.
summary.json is written last. Its object ``run`` names the flight, and the SHA-256 of the tables to
which it belongs; so a folder whose writing was interrupted is noticed.
"""

from __future__ import annotations

import hashlib
import io
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from acx4files.results.whole_files import together
from acx4lib import expected
from acx4lib.errors import FlightError

STAGES = ("heads", "synthetic", "mounting", "validation")
"""The stages in the order of the paper, and of the rows of every table."""

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

PART_OF: Mapping[str, str] = {"rig": "mounting"}
"""The stage of the results folder for a stage that has none of its own."""

RELATIVE = ("Xc_mm", "Yc_mm", "Zc_mm", "omega_deg", "phi_deg", "kappa_deg")
"""Names of the parameters of a head's relative orientation, in their order."""

COMPONENTS = {
    "image_point": ("col_px", "row_px"),
    "control_point": ("east_m", "north_m", "height_m"),
    "gnss": ("east_m", "north_m", "height_m"),
    "attitude": ("roll_deg", "pitch_deg", "heading_deg"),
    "lever_arm": ("lever_x_m", "lever_y_m", "lever_z_m"),
    "boresight": ("mount_omega_deg", "mount_phi_deg", "mount_kappa_deg"),
    "interior": ("f_mm", "xp_mm", "yp_mm"),
}
"""Components of the residuals of every kind; angles are about the body's x, y, z axes."""


_METHOD = ("stage", "method")
_POSITION = ("east_m", "north_m", "height_m")
_ATTITUDE = ("omega_deg", "phi_deg", "kappa_deg")
_SIGMA = tuple(f"sigma_{name}" for name in _POSITION)
_DIFFERENCE = (*(f"d_{name}" for name in _POSITION), *_SIGMA)
_POSE = (*_POSITION, *_ATTITUDE, *_SIGMA, *(f"sigma_{name}" for name in _ATTITUDE))
_OBSERVED = (*_METHOD, "kind", "image_or_exposure", "point")
_PIXELS = ("col_px", "row_px", "sigma_col_px", "sigma_row_px")

COLUMNS: Mapping[str, tuple[str, ...]] = {
    "parameters": (*_METHOD, "camera", "parameter", "value", "sigma", "unit", "sigma_before"),
    "validation": ("method", "point", "image_a", "image_b", *_DIFFERENCE),
    "check_points": (*_METHOD, "point", "n_images", *_DIFFERENCE),
    "exterior_orientation": (*_METHOD, "image", *_POSE),
    "residuals": (*_OBSERVED, "component", "v", "sigma", "redundancy", "w"),
    "covariance": (*_METHOD, "row", "column", "value"),
    "rejected": (*_OBSERVED, "statistic", "reason"),
    "synthetic_points": ("block", "image", "point", "head", *_PIXELS),
}
"""Columns of every table, in order; a table's file is its name with ``.csv``."""

TEXTS = {
    *("stage", "method", "camera", "parameter", "unit", "point", "image", "image_a", "image_b"),
    *("kind", "image_or_exposure", "component", "row", "column", "reason", "block", "head"),
}
"""Columns of text; the others are numbers."""

COUNTS = {"n_images"}
"""Columns of whole numbers."""

OF = {"validation": "validation", "synthetic_points": "synthetic"}
"""The stage of all rows of a table that has no column for it."""

FILES = (*(f"{name}.csv" for name in COLUMNS), "summary.json")
"""Every file of a results folder."""

RUN = "run"
"""Object of summary.json on all stages: flight, software, and the SHA-256 of every table."""

FORMAT = 2
"""Version of results; 1 had its object `RUN` in the file `EARLIER`."""

EARLIER = "provenance.json"

AGAIN = "run all stages again with acx4 run, or choose another folder"

Rows = pd.DataFrame | Sequence[pd.DataFrame]
"""Rows of a table, in one part or in several."""

Summary = dict[str, dict[str, Any]]


@dataclass(frozen=True, kw_only=True)
class Record:
    """The results of one method, ready to be written.

    Attributes
    ----------
    tables : dict of str to DataFrame
        By the names of `COLUMNS`, with these columns.
    summary : dict
        Objects for summary.json, by their keys.
    """

    tables: Mapping[str, pd.DataFrame]
    summary: Summary


@dataclass(frozen=True, kw_only=True, eq=False)
class Results:
    """The content of a results folder.

    Two tables, which are long in a large flight, are read at the first access; this raises a
    FlightError where their file is not as the run left it.

    Attributes
    ----------
    folder : Path
    parameters, validation, check_points, exterior_orientation : DataFrame
    residuals, covariance, rejected, synthetic_points : DataFrame
        With the columns of `COLUMNS`; names are text, unknown numbers are NaN.
    summary : dict
        One object per ``stage/method``, or per ``stage/method/camera``.
    run : dict
        The object `RUN`; empty for results of a version that had none.
    """

    folder: Path
    parameters: pd.DataFrame
    validation: pd.DataFrame
    check_points: pd.DataFrame
    exterior_orientation: pd.DataFrame
    covariance: pd.DataFrame
    rejected: pd.DataFrame
    summary: Summary
    run: Mapping[str, Any]

    @cached_property
    def residuals(self) -> pd.DataFrame:
        """Residuals of all observations."""
        return _read("residuals", self.folder, self.run)

    @cached_property
    def synthetic_points(self) -> pd.DataFrame:
        """Transferred points of all blocks that are measured in heads."""
        return _read("synthetic_points", self.folder, self.run)


SHORT = tuple(name for name in COLUMNS if name in Results.__annotations__)
"""The tables that are read immediately."""


def of_run(folder: str | Path) -> Path:
    """Return the path of a folder with results of a run; FlightError without any."""
    path = expected.folder(folder, "the results of a run")
    if not any((path / name).is_file() for name in FILES):
        raise FlightError([f"{path}: no results of a run; acx4 run FLIGHT --results makes them"])
    return path


def read(folder: str | Path) -> Results:
    """Read an existing results folder; a missing file counts as a table without rows.

    Raises
    ------
    FlightError
        Where there is no such folder, a file has other columns, or its writing was interrupted.
    """
    path = expected.folder(folder, "the results of a run")
    summary, run = read_summary(path)
    tables = {name: _read(name, path, run) for name in SHORT}
    return Results(folder=path, summary=summary, run=run, **tables)


def entries(folder: Path) -> Summary:
    """Return the objects of summary.json, without the tables; FlightError if it is invalid."""
    return read_summary(folder)[0]


def read_summary(folder: Path) -> tuple[Summary, dict[str, Any]]:
    """Return the objects of summary.json by ``stage/method``, and that of the run.

    Raises
    ------
    FlightError
        Where the file is there and not of a run.
    """
    summary = _object(folder / "summary.json")
    run = summary.pop(RUN, None) or _object(folder / EARLIER)
    for key, entry in summary.items():
        if key.partition("/")[0] not in STAGES or not isinstance(entry, dict):
            problem = f"{folder / 'summary.json'}: {key} is not of a stage of acx4 run"
            raise FlightError([f"{problem}, {', '.join(STAGES)}; choose another folder"])
    if run.get("format", FORMAT) > FORMAT:
        problem = f"{folder}: is of a later version of acx4; use that, or choose another folder"
        raise FlightError([problem])
    return summary, run


def _object(path: Path) -> dict[str, Any]:
    """Return the object in a JSON file; empty without a file, FlightError if it is none."""
    try:
        content = json.loads(path.read_text("utf-8")) if path.is_file() else {}
    except ValueError as error:
        raise FlightError([f"{path}: is not JSON ({error}); choose another folder"]) from None
    if not isinstance(content, dict):
        raise FlightError([f"{path}: must be one object; choose another folder"])
    return content


def _content(name: str, folder: Path, run: Mapping[str, Any]) -> bytes:
    """Return the content of a table's file; FlightError if it is not that of summary.json."""
    path = folder / f"{name}.csv"
    content = path.read_bytes() if path.is_file() else b""
    digest = run.get("tables", {}).get(path.name, "")
    if digest and hashlib.sha256(content).hexdigest() != digest:
        problem = f"{path}: is not the table of which summary.json has the SHA-256"
        raise FlightError(
            [f"{problem} (a stage was ended while it wrote, or it was changed); {AGAIN}"]
        )
    return content


def _read(name: str, folder: Path, run: Mapping[str, Any]) -> pd.DataFrame:
    """Return a table: names are text, counts whole numbers, unknown numbers NaN.

    Raises
    ------
    FlightError
        Where its columns are others, or a cell is no number.
    """
    path, columns = folder / f"{name}.csv", COLUMNS[name]
    content = _content(name, folder, run) or _header(name)
    numbers = [column for column in columns if column not in TEXTS]
    try:
        frame = pd.read_csv(
            io.BytesIO(content),
            dtype={column: "str" if column in TEXTS else "float64" for column in columns},
            keep_default_na=False,
            na_values=dict.fromkeys(numbers, ""),
            skip_blank_lines=False,
        )
    except ValueError as error:
        raise _broken(path, " ".join(str(error).split())) from None
    if (*frame.columns,) != columns:
        raise _broken(path, f"has the columns {','.join(map(str, frame))}, not {','.join(columns)}")
    if not isinstance(frame.index, pd.RangeIndex):
        raise _broken(path, "has rows of another width than its header")
    return frame.astype(dict.fromkeys(COUNTS & {*columns}, "int64"))


def _broken(path: Path, fault: str) -> FlightError:
    return FlightError([f"{path}:1: file: {fault}; must be a table of results; {AGAIN}"])


def is_whole(folder: Path) -> bool:
    """Tell whether all tables are there as the run left them."""
    tables = read_summary(folder)[1].get("tables", {})
    return {*tables, "summary.json"} == {*FILES} and all(
        (folder / file).is_file()
        and hashlib.sha256((folder / file).read_bytes()).hexdigest() == digest
        for file, digest in tables.items()
    )


# --- written ---------------------------------------------------------------------------------


def replace(
    folder: str | Path,
    stage_methods: Sequence[str],
    *,
    tables: Mapping[str, Rows],
    summary: Mapping[str, Mapping[str, object]],
    run: Mapping[str, object] | None = None,
    kept: Mapping[str, bytes] | None = None,
) -> None:
    """Replace old results by new ones; everything else in the folder stays.

    All files are completely written beside the old ones before the first one is replaced; the last
    is summary.json.

    Parameters
    ----------
    folder : path
        It is made if it does not exist; whoever may write at the same time holds its lock.
    stage_methods : sequence of str
        Results to replace: ``mounting/single_step``, or ``mounting`` for a whole stage.
    tables : mapping of str to DataFrame, or to a sequence of them
        New rows of the first one's stage by the names of `COLUMNS`, with these columns; those of
        text are written fastest as categories.
    summary : mapping of str to mapping
        New objects of summary.json.
    run : mapping, optional
        What becomes of the object `RUN`, besides the tables; by default it stays.
    kept : mapping of str to bytes, optional
        Further files by their names below the folder.

    Raises
    ------
    FlightError
        Where the folder has files of something else, or its tables are not as a run left them.
    """
    path = Path(folder)
    path.mkdir(parents=True, exist_ok=True)
    before, old_run = read_summary(path)
    digests = {}
    with together() as new:
        for name, content in (kept or {}).items():
            (path / name).parent.mkdir(parents=True, exist_ok=True)
            new(path / name).write_bytes(content)
        for name in COLUMNS:
            old = b"" if {*STAGES} <= {*stage_methods} else _content(name, path, old_run)
            parts = tables.get(name, ())
            frames = [parts] if isinstance(parts, pd.DataFrame) else parts
            rows = [line for frame in frames for line in _lines(name, frame)]
            content = b"".join(_merged(path / f"{name}.csv", old, stage_methods, rows))
            new(path / f"{name}.csv").write_bytes(content)
            digests[f"{name}.csv"] = hashlib.sha256(content).hexdigest()
        stay = {key: entry for key, entry in before.items() if not _belongs(key, stage_methods)}
        about = {**(old_run if run is None else run), "format": FORMAT, "tables": digests}
        new(path / "summary.json").write_bytes(_summary_text({**stay, **summary}, about))
    (path / EARLIER).unlink(missing_ok=True)


def _merged(
    path: Path, old: bytes, stage_methods: Sequence[str], new: Sequence[bytes]
) -> Iterator[bytes]:
    """Yield header and rows of a table, in the order of `STAGES`."""
    name = path.stem
    first, *rows = old.splitlines(keepends=True) or [_header(name)]
    if first != _header(name):
        raise _broken(path, "has the columns of another version")
    gone = tuple(_beginnings(name, stage_methods))
    place = STAGES.index(stage_methods[0].partition("/")[0]) if stage_methods else 0
    later = () if name in OF else tuple(f"{stage},".encode() for stage in STAGES[place + 1 :])
    rows = [row for row in rows if not row.startswith(gone)]
    yield first
    yield from (row for row in rows if not row.startswith(later))
    yield from new
    yield from (row for row in rows if row.startswith(later))


def _beginnings(name: str, stage_methods: Sequence[str]) -> Iterator[bytes]:
    """Yield what the rows of some results begin with, in the file of a table."""
    of = OF.get(name)
    for key in stage_methods:
        stage, _, method = key.partition("/")
        cells = [stage, method] if of is None else [method]
        if of in (None, stage):
            yield "".join(f"{cell}," for cell in cells if cell).encode()


def _header(name: str) -> bytes:
    return f"{','.join(COLUMNS[name])}\n".encode()


def _lines(name: str, frame: pd.DataFrame, n_rows: int = 50_000) -> Iterator[bytes]:
    """Yield the rows of a table as they stand in its file, many at a time.

    Numbers are written as by Python's ``repr``, text as by its module csv. The cell of a value that
    is not known, or not finite, is empty. The writer of pandas takes twice as long.
    """
    columns = [_coded(frame[column], is_text=column in TEXTS) for column in COLUMNS[name]]
    for begin in range(0, len(frame), n_rows):
        cells = [_cells(values[begin : begin + n_rows], known) for values, known in columns]
        yield ("\n".join(map(",".join, zip(*cells, strict=True))) + "\n").encode()


def _coded(
    column: pd.Series, *, is_text: bool, first: int = 1000
) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the code of every cell of text and the cells that occur, or numbers and None.

    Numbers are coded too if they are few, as are those of the first rows: a sigma stands in many.
    """
    if is_text:
        text = column.astype("category").cat
        cells = [_quoted(str(cell)) for cell in text.categories]
        return text.codes.to_numpy(), np.array([*cells, ""], dtype=object)
    values = np.ascontiguousarray(column, dtype=None if column.name in COUNTS else float)
    if column.name in COUNTS or len(np.unique(values[:first])) > first // 10:
        return values, None
    code, bits = pd.factorize(values.view(np.int64))  # -0 is not 0
    return code, np.array([*_cells(bits.view(float), None), ""], dtype=object)


def _quoted(text: str) -> str:
    """Return text as a cell."""
    return '"{}"'.format(text.replace('"', '""')) if {*text} & {*',"\n\r'} else text


def _cells(values: np.ndarray, known: np.ndarray | None) -> list[str]:
    """Return the cells of a part of a column; no value has the last code, -1."""
    if known is not None:
        return known[values].tolist()
    cells = list(map(repr, values.tolist()))
    for k in np.flatnonzero(~np.isfinite(values)):
        cells[k] = ""
    return cells


def _summary_text(summary: Mapping[str, Mapping[str, object]], run: Mapping[str, object]) -> bytes:
    """Return the text of summary.json; a number that is not finite becomes null."""
    plain = _plain({**summary, RUN: run})
    text = json.dumps(plain, indent=2, sort_keys=True, allow_nan=False, ensure_ascii=False)
    return f"{text}\n".encode()


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


# --- looked up -------------------------------------------------------------------------------


def has(results: Results, stage_method: str) -> bool:
    """Tell whether there are results of a stage or a ``stage/method``; ValueError if unknown."""
    expected.one_of("stage", str(stage_method).partition("/")[0], STAGES)
    listed = results.parameters[["stage", "method"]].drop_duplicates()
    known = {*results.summary, *(listed["stage"] + "/" + listed["method"])}
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
    stage, _, method = stage_method.partition("/")
    if not has(results, stage_method):
        problem = f"{results.folder}: no results of {stage_method}; run stage {stage} first"
        raise FlightError([problem])
    frame: pd.DataFrame = getattr(results, table)
    if table in OF and stage != OF[table]:
        return frame[:0]
    if "stage" in frame:
        frame = frame[frame["stage"] == stage]
    if method and "method" in frame:
        frame = frame[frame["method"] == method]
    return frame.reset_index(drop=True)


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


def _belongs(key: str, stage_methods: Iterable[str]) -> bool:
    return any(key == name or key.startswith(f"{name}/") for name in stage_methods)
