"""The results folder: its tables and summary.json, written, read and looked up.

The results of a method have the name ``stage/method``, such as ``mounting/single_step``.
summary.json is written last. Its object ``run`` names the flight, and the SHA-256 of the tables to
which it belongs; so a folder whose writing was interrupted is noticed.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, groupby
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from acx4files.results import table_files
from acx4files.results.table_files import COLUMNS, OF
from acx4files.results.whole_files import together
from acx4lib import expected
from acx4lib.errors import FlightError

STAGES = table_files.STAGES

FILES = (*(f"{name}.csv" for name in COLUMNS), "summary.json")
"""Every file of a results folder."""

RUN = "run"
"""Object of summary.json on all stages: flight, software, and the SHA-256 of every table."""

FORMAT = 2
"""Version of results; 1 had its object `RUN` in the first file of `EARLIER`."""

EARLIER = ("provenance.json", ".acx4.json")

AGAIN = "run all stages again"

Rows = pd.DataFrame | Sequence[pd.DataFrame]
"""Rows of a table, in one part or in several."""

Summary = dict[str, dict[str, Any]]


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


def read(folder: str | Path, *, rewriting: Sequence[str] = ()) -> Results:
    """Read an existing results folder; a missing file counts as a table without rows.

    Parameters
    ----------
    folder : path
    rewriting : sequence of str
        Stages whose results are not needed, since they are run again.

    Raises
    ------
    FlightError
        Where there is no such folder, a file has other columns, or its writing was interrupted.
    """
    path = expected.folder(folder, "the results of a run")
    summary, run = read_summary(path)
    check_ended(path, run, rewriting)
    tables = {name: _read(name, path, run) for name in SHORT}
    return Results(folder=path, summary=summary, run=run, **tables)


def check_ended(folder: Path, run: Mapping[str, Any], rewriting: Sequence[str] = ()) -> None:
    """Raise a FlightError where a stage ended while it wrote, unless it is run again."""
    stage = run.get("writing")
    if stage and stage not in rewriting:
        problem = f"{folder}: stage {stage} was ended while it wrote; run stage {stage} again"
        raise FlightError([f"{problem}: acx4 run FLIGHT --results {folder} --stages {stage}"])


def _content(name: str, folder: Path, run: Mapping[str, Any]) -> bytes:
    """Return the content of a table's file, as the run left it; FlightError otherwise."""
    path = folder / f"{name}.csv"
    content = path.read_bytes() if path.is_file() else b""
    digest = run.get("tables", {}).get(path.name, "")
    if digest and "writing" not in run and hashlib.sha256(content).hexdigest() != digest:
        problem = f"{path}: is not the table of which summary.json has the SHA-256; {AGAIN}"
        raise FlightError([problem])
    return content


def _read(name: str, folder: Path, run: Mapping[str, Any]) -> pd.DataFrame:
    return table_files.read(folder / f"{name}.csv", _content(name, folder, run))


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
    run = summary.pop(RUN, None) or _object(folder / EARLIER[0])
    strange = [key for key, entry in summary.items() if not _is_entry(key, entry)]
    if strange:
        problem = f"{folder / 'summary.json'}: {strange[0]} is not of a stage of acx4 run"
        raise FlightError([f"{problem}, {', '.join(STAGES)}; {AGAIN}"])
    if run.get("format", FORMAT) > FORMAT:
        raise FlightError([f"{folder}: is of a later version of acx4; use that, or {AGAIN}"])
    return summary, run


def _is_entry(key: str, entry: object) -> bool:
    return key.partition("/")[0] in STAGES and "/" in key and isinstance(entry, dict)


def _object(path: Path) -> dict[str, Any]:
    """Return the object in a JSON file; empty without a file, FlightError if it is none."""
    try:
        content = json.loads(path.read_text("utf-8")) if path.is_file() else {}
    except ValueError as error:
        raise FlightError([f"{path}: is not JSON ({error}); {AGAIN}"]) from None
    if not isinstance(content, dict):
        raise FlightError([f"{path}: must be one object; {AGAIN}"])
    return content


def is_whole(folder: Path) -> bool:
    """Tell whether all tables are there as the run left them."""
    _, run = read_summary(folder)
    tables = run.get("tables", {})
    return (
        {*tables, "summary.json"} == {*FILES}
        and "writing" not in run
        and all(
            (folder / file).is_file()
            and hashlib.sha256((folder / file).read_bytes()).hexdigest() == digest
            for file, digest in tables.items()
        )
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

    All files are completely written beside the old ones before the first one is replaced. Until the
    last one, summary.json says which stage is being written.

    Parameters
    ----------
    folder : path
        It is made if it does not exist; whoever may write at the same time holds its lock.
    stage_methods : sequence of str
        Results to replace: ``mounting/single_step``, or ``mounting`` for a whole stage.
    tables : mapping of str to DataFrame, or to a sequence of them
        New rows by the names of `COLUMNS`, each table with exactly these columns; those of text are
        written fastest as categories.
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
    all_stages = {*STAGES} <= {*stage_methods}
    before, old_run = ({}, {}) if all_stages else read_summary(path)
    new_run = dict(old_run if run is None else run) | {"format": FORMAT}
    new_run.pop("writing", None)
    stage = stage_methods[0].partition("/")[0] if stage_methods else ""
    check_ended(path, old_run, stage_methods)
    entries = {key: v for key, v in before.items() if not _belongs(key, stage_methods)}
    with together() as new:
        writing = {**new_run, "tables": {}, "writing": stage}
        new.write(path / "summary.json", _summary_text(entries, writing))
        for name, content in (kept or {}).items():
            (path / name).parent.mkdir(parents=True, exist_ok=True)
            new.write(path / name, content)
        digests = {}
        for name in COLUMNS:
            old = b"" if all_stages else _content(name, path, old_run)
            parts: dict[str, list[bytes]] = {part: [] for part in STAGES}
            for part, rows in _remaining(path / f"{name}.csv", old, stage_methods):
                parts[part].append(rows)
            for part, frame in _by_stage(name, tables.get(name, ())):
                parts[part].extend(table_files.lines(name, frame))
            content = b"".join([table_files.header(name), *chain(*parts.values())])
            new.write(path / f"{name}.csv", content)
            digests[f"{name}.csv"] = hashlib.sha256(content).hexdigest()
        done = {**new_run, "tables": digests}
        new.write(path / "summary.json", _summary_text({**entries, **summary}, done))
    for file in EARLIER:
        (path / file).unlink(missing_ok=True)


def _remaining(
    path: Path, content: bytes, stage_methods: Sequence[str]
) -> Iterator[tuple[str, bytes]]:
    """Yield the rows of a file that are not replaced, with their stages."""
    if not content:
        return
    first, *rows = content.splitlines(keepends=True)
    if first != table_files.header(path.stem):
        raise FlightError([f"{path}: has the columns of another version; {AGAIN}"])
    of = OF.get(path.stem, "")
    n_cells = len({"stage", "method"} & {*COLUMNS[path.stem]})  # that name stage and method
    for key, alike in groupby(rows, lambda row: row.split(b",", n_cells)[:n_cells]):
        name = "/".join(filter(None, [of, *(cell.decode() for cell in key)]))
        if not _belongs(name, stage_methods):
            yield name.partition("/")[0], b"".join(alike)


def _by_stage(name: str, frames: Rows) -> Iterator[tuple[str, pd.DataFrame]]:
    """Yield new rows with their stages."""
    for frame in [frames] if isinstance(frames, pd.DataFrame) else frames:
        if not len(frame):
            continue
        if name in OF:
            yield OF[name], frame
            continue
        for stage in STAGES:
            mine = frame["stage"] == stage
            if mine.all():
                yield stage, frame
            elif mine.any():
                yield stage, frame[mine]


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
