"""Whether the results of a run agree with each other and with the flight that they are of.

Every table is read and checked by itself in `folder`. Here parameters are compared with their
covariance, all tables with summary.json, and names of cameras, images and points with the flight.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from acx4lib.errors import FlightError
from acx4lib.expected import Array, Index, Mask
from acx4lib.flight.problems import Problem, lines_of, quoted
from acx4lib.flight.reader import Flight
from acx4lib.results import folder as results
from acx4lib.results import table_files
from acx4lib.results.summary_entries import problem_of
from acx4lib.results.table_files import FIRST, OF_TRAJECTORY, STAGES, UNITS, wrong_rows

SAME = 1e-6
"""Share by which numbers that are written twice may differ."""

LARGEST = 2000
"""Number of parameters of a method up to which its covariance is tested for being one."""


def read(folder: str | Path, flight: Flight) -> results.Results:
    """Read the results of a flight, and check that all of them belong together.

    Raises
    ------
    FlightError
        With a line for each thing that is wrong.
    """
    found = results.read(folder)
    check(found, flight)
    return found


def check(found: results.Results, flight: Flight, *, stages: Sequence[str] = STAGES) -> None:
    """Check that the results of some stages belong together, and to their flight.

    Parameters
    ----------
    found : Results
    flight : Flight
    stages : sequence of str
        Whose results are used; others may be of the flight as it was before.

    Raises
    ------
    FlightError
        With a line for each contradiction.
    """
    own = _of_stages(found, stages)
    problems = [
        *_parameters(own, flight),
        *_covariances(own),
        *_entries(own),
        *_names(own, flight),
    ]
    if problems:
        raise FlightError(lines_of(problems))


def _of_stages(found: results.Results, stages: Sequence[str]) -> results.Results:
    """Return the results of some stages, in rows that keep their numbers in the files."""
    tables: dict[str, pd.DataFrame] = {}
    for name in results.SHORT:
        whole = getattr(found, name)
        code, keys = table_files.keys(name, whole)
        mine = np.array([key.partition("/")[0] in stages for key in keys], dtype=bool)
        tables[name] = whole[mine[code]]
    entries = {k: v for k, v in found.summary.items() if k.partition("/")[0] in stages}
    return results.Results(folder=found.folder, summary=entries, **tables)


def _wrong_cells(
    found: results.Results, table: str, column: str, rows: Mask, expected: str, said: str = ""
) -> Iterator[Problem]:
    """Yield the problems of some rows of a table, with what stands in a column."""
    cells = getattr(found, table)[column]

    def there(row: int) -> str:
        cell = cells[row]
        text = quoted(cell) if isinstance(cell, str) else f"{cell:.6g}"
        return ("is empty" if pd.isna(cell) else text) + said

    yield from wrong_rows(
        _file(found, table), column, cells.index.to_numpy()[rows], there, expected
    )


def _file(found: results.Results, table: str) -> str:
    return str(found.folder / f"{table}.csv")


# --- parameters ------------------------------------------------------------------------------


def _parameters(found: results.Results, flight: Flight) -> Iterator[Problem]:
    """Yield unknown parameters, units and cameras, and numbers that no parameter has."""
    table = found.parameters
    allowed = {name: _units(name) for name in table["parameter"].unique()}
    known = table["parameter"].isin([n for n, units in allowed.items() if units]).to_numpy()
    yield from _wrong_cells(
        found, "parameters", "parameter", ~known, "must be a parameter of a run", " is unknown"
    )
    for units in sorted({units for units in allowed.values() if units}):
        own = table["parameter"].isin([n for n, some in allowed.items() if some == units])
        other = (own & ~table["unit"].isin(units)).to_numpy()
        yield from _wrong_cells(found, "parameters", "unit", other, f"must be {' or '.join(units)}")
    mounted = table["parameter"].isin(UNITS).to_numpy()
    stranger = mounted & ~table["camera"].isin(flight.cameras).to_numpy()
    yield from _wrong_cells(
        found, "parameters", "camera", stranger, "must be a camera of flight.toml", " is unknown"
    )
    alone = known & ~mounted & (table["camera"] != "").to_numpy()
    expected = "must be empty for a parameter of the trajectory"
    yield from _wrong_cells(found, "parameters", "camera", alone, expected)
    empty = table["sigma"].isna().to_numpy()
    yield from _wrong_cells(found, "parameters", "sigma", empty, "must be a finite number")
    short = ((table["parameter"] == "f_mm") & ~(table["value"] > 0)).to_numpy()
    yield from _wrong_cells(found, "parameters", "value", short, "must be positive")


def _units(parameter: str) -> tuple[str, ...]:
    """Return the units that a parameter of results may have; none of an unknown one."""
    of_trajectory = (u for begin, u in OF_TRAJECTORY.items() if parameter.startswith(begin))
    return UNITS.get(parameter) or next(of_trajectory, ())


# --- covariances -----------------------------------------------------------------------------


def _covariances(found: results.Results) -> Iterator[Problem]:
    """Yield what is wrong with the covariance of every method."""
    table, parameters = found.covariance, found.parameters
    for method in dict.fromkeys([*_methods(table), *_methods(parameters)]):
        long = table[_of(table, method)]
        wrong = list(_square(found, method, long))
        yield from wrong or _beside(found, method, long, parameters[_of(parameters, method)])


def _methods(table: pd.DataFrame) -> list[tuple[str, str]]:
    return list(table[["stage", "method"]].drop_duplicates().itertuples(index=False, name=None))


def _of(table: pd.DataFrame, method: tuple[str, str]) -> Mask:
    return ((table["stage"] == method[0]) & (table["method"] == method[1])).to_numpy()


def _square(
    found: results.Results, method: tuple[str, str], long: pd.DataFrame
) -> Iterator[Problem]:
    """Yield rows of a method that make no symmetric, positive matrix."""
    row, names = pd.factorize(long["row"])
    column = pd.Index(names).get_indexer(pd.Index(long["column"]))
    if (column < 0).any():
        lines = long.index.to_numpy()[column < 0]
        yield from _of_lines(found, lines, "column", long, "must stand in column row, too")
        return
    at = np.full((len(names), len(names)), -1)
    at[row, column] = np.arange(len(long))
    alone = np.flatnonzero(at[column, row] < 0)
    expected = "must have a row with row and column exchanged"
    yield from _of_lines(found, long.index.to_numpy()[alone], "row", long, expected)
    lacking = _lacking(at, names, method)
    if len(lacking):
        i, j = lacking[0]
        pair = f"{quoted(names[i])} with {quoted(names[j])}"
        yield Problem(
            file=_file(found, "covariance"),
            line=int(long.index[np.flatnonzero(row == i)[0]]) + FIRST,
            column="column",
            found=f"{len(lacking)} rows of {'/'.join(method)} are missing, {pair}",
            expected="must have a row for every pair of its parameters",
        )
    elif not len(alone):
        values = np.where(at < 0, 0.0, long["value"].fillna(0.0).to_numpy()[at])
        yield from _positive(found, long, at, values)


def _lacking(at: Index, names: Collection[str], method: tuple[str, str]) -> Index:
    """Return the pairs without a row; heads that are adjusted by themselves share none."""
    camera = np.array([str(name).rpartition("/")[0] for name in names], dtype=object)
    needed = (method != ("heads", "bundle")) | (camera[:, None] == camera)
    return np.argwhere((at < 0) & (at.T < 0) & needed)


def _of_lines(
    found: results.Results, lines: Index, column: str, long: pd.DataFrame, expected: str
) -> Iterator[Problem]:
    cells = long[column]
    yield from wrong_rows(
        _file(found, "covariance"), column, lines, lambda line: quoted(cells[line]), expected
    )


def _positive(
    found: results.Results, long: pd.DataFrame, at: Index, values: Array
) -> Iterator[Problem]:
    """Yield variances that are negative, pairs that differ, and a matrix that is no covariance."""
    lines, file = long.index.to_numpy(), _file(found, "covariance")

    def there(line: int) -> str:
        return f"{long['value'][line]:.6g}"

    variance = np.diag(values)
    bad = lines[np.diag(at)[variance < 0]]
    yield from wrong_rows(file, "value", bad, there, "a variance must be zero or positive")
    if len(bad):
        return
    scale = np.sqrt(variance)[:, None] * np.sqrt(variance)
    i, j = np.nonzero(np.abs(values - values.T) > SAME * scale)
    yield from wrong_rows(
        file, "value", np.sort(lines[at[i, j]]), there, "must equal its counterpart"
    )
    i, j = np.nonzero(np.abs(values) > (1 + SAME) * scale)
    beyond = np.sort(lines[at[i, j]])
    expected = "must be at most the product of both standard deviations"
    yield from wrong_rows(file, "value", beyond, there, expected)
    known = np.flatnonzero(variance > 0)
    if len(i) or not 0 < len(known) <= LARGEST:
        return
    related = values[np.ix_(known, known)] / scale[np.ix_(known, known)]
    least = float(np.linalg.eigvalsh((related + related.T) / 2)[0])
    if least < -SAME * len(known):
        yield Problem(
            file=file,
            line=int(lines[0]) + FIRST,
            column="value",
            found=f"no covariance: its correlations have the eigenvalue {least:.3g}",
            expected="must have none that is negative",
        )


def _beside(
    found: results.Results, method: tuple[str, str], long: pd.DataFrame, listed: pd.DataFrame
) -> Iterator[Problem]:
    """Yield parameters of a method whose sigma is not that of the covariance."""
    own = long[long["row"] == long["column"]].set_index("row")["value"]
    camera, name = listed["camera"], listed["parameter"]
    label = name.where(camera == "", camera + "/" + name)
    variance = label.map(own).to_numpy(dtype=float)
    squared = listed["sigma"].to_numpy() ** 2
    lines, file = listed.index.to_numpy(), _file(found, "parameters")
    missing = ~label.isin(own.index).to_numpy()
    yield from wrong_rows(
        file,
        "parameter",
        lines[missing],
        lambda line: f"{quoted(label[line])} of {'/'.join(method)} is not in covariance.csv",
        "must have its covariance there",
    )
    largest = np.maximum(variance, squared)
    with np.errstate(invalid="ignore"):
        other = np.abs(variance - squared) > SAME * largest
    yield from wrong_rows(
        file,
        "sigma",
        lines[other],
        lambda line: f"{listed['sigma'][line]:.6g}",
        "must be the square root of the variance in covariance.csv",
    )


# --- entries of summary.json -----------------------------------------------------------------


def _entries(found: results.Results) -> Iterator[Problem]:
    """Yield validations that count other pairs than there are rows of them."""
    rows = found.validation["method"].value_counts()
    for name, entry in found.summary.items():
        stage, _, method = name.partition("/")
        said, there = entry.get("n_pairs"), int(rows.get(method, 0))
        if stage == "validation" and said is not None and said != there:
            yield problem_of(
                found.folder / "summary.json",
                (name, "n_pairs"),
                str(said),
                f"validation.csv has {there} rows of {name}",
            )


# --- names -----------------------------------------------------------------------------------


def _names(found: results.Results, flight: Flight) -> Iterator[Problem]:
    """Yield images and points that the flight does not have."""
    blocks = flight.blocks.values()
    images = {name for block in blocks for name in block.images.names}
    images |= {name for block in blocks for name in block.trajectory.exposures}
    points = {name for block in blocks for name in block.points}
    for table, column, known, what in (
        ("exterior_orientation", "image", images, "an image"),
        ("validation", "image_a", images, "an image"),
        ("validation", "image_b", images, "an image"),
        ("validation", "point", points, "a point"),
    ):
        unknown = ~getattr(found, table)[column].isin(known).to_numpy()
        expected = f"must be {what} of the flight"
        yield from _wrong_cells(found, table, column, unknown, expected, " is unknown")
