"""Checks that the results of a run agree with each other and with their flight.

Every table is read and checked by itself in `folder`. Here parameters are compared with their
covariance, all tables with summary.json, and names of cameras, images and points with the flight.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from acx4files.flight.problems import Problem, lines_of, quoted
from acx4files.flight.reader import Flight
from acx4files.results import folder as results
from acx4files.results import table_files
from acx4files.results.folder import problem_of
from acx4files.results.table_files import FIRST, OF_TRAJECTORY, STAGES, UNITS, wrong_rows
from acx4lib.errors import FlightError
from acx4lib.expected import Array, Index, Mask

SAME = 1e-6
"""Relative difference allowed between two copies of a number."""

LARGEST = 2000
"""Largest number of parameters of a method for which the eigenvalues are tested."""


def read(folder: str | Path, flight: Flight) -> results.Results:
    """Read the results of a flight, and check that all of them agree.

    Raises
    ------
    FlightError
        With one line per problem.
    """
    run_results = results.read(folder)
    check(run_results, flight)
    return run_results


def check(found: results.Results, flight: Flight, *, stages: Sequence[str] = STAGES) -> None:
    """Check that the results of some stages agree with each other and with their flight.

    Parameters
    ----------
    found : Results
    flight : Flight
    stages : sequence of str
        Stages whose results are used; others may be of an earlier state of the flight.

    Raises
    ------
    FlightError
        With a line for each contradiction.
    """
    used = _of_stages(found, stages)
    problems = [
        *_parameters(used, flight),
        *_covariances(used),
        *_entries(used),
        *_names(used, flight),
    ]
    if problems:
        raise FlightError(lines_of(problems))


def _of_stages(content: results.Results, stages: Sequence[str]) -> results.Results:
    """Select the results of some stages; rows keep their numbers in the files."""
    tables: dict[str, pd.DataFrame] = {}
    for name in results.SHORT:
        whole = getattr(content, name)
        code, keys = table_files.keys(name, whole)
        mine = np.array([key.partition("/")[0] in stages for key in keys], dtype=bool)
        tables[name] = whole[mine[code]]
    entries = {k: v for k, v in content.summary.items() if k.partition("/")[0] in stages}
    return results.Results(folder=content.folder, summary=entries, **tables)


def _wrong_cells(
    content: results.Results, table: str, column: str, rows: Mask, expected: str, remark: str = ""
) -> Iterator[Problem]:
    """Yield a problem for each of some rows of a table, with its cell in a column."""
    cells = getattr(content, table)[column]

    def there(row: int) -> str:
        cell = cells[row]
        text = quoted(cell) if isinstance(cell, str) else f"{cell:.6g}"
        return ("is empty" if pd.isna(cell) else text) + remark

    yield from wrong_rows(
        _file(content, table), column, cells.index.to_numpy()[rows], there, expected
    )


def _file(content: results.Results, table: str) -> str:
    return str(content.folder / f"{table}.csv")


# --- parameters ------------------------------------------------------------------------------


def _parameters(content: results.Results, flight: Flight) -> Iterator[Problem]:
    """Yield unknown parameters, units and cameras, empty sigma, and impossible focal lengths."""
    table = content.parameters
    allowed = {name: _units(name) for name in table["parameter"].unique()}
    known = table["parameter"].isin([n for n, units in allowed.items() if units]).to_numpy()
    yield from _wrong_cells(
        content, "parameters", "parameter", ~known, "must be a parameter of a run", " is unknown"
    )
    for units in sorted({units for units in allowed.values() if units}):
        of_unit = table["parameter"].isin(
            [n for n, known_units in allowed.items() if known_units == units]
        )
        other = (of_unit & ~table["unit"].isin(units)).to_numpy()
        yield from _wrong_cells(
            content, "parameters", "unit", other, f"must be {' or '.join(units)}"
        )
    mounted = table["parameter"].isin(UNITS).to_numpy()
    stranger = mounted & ~table["camera"].isin(flight.cameras).to_numpy()
    yield from _wrong_cells(
        content, "parameters", "camera", stranger, "must be a camera of flight.toml", " is unknown"
    )
    with_camera = known & ~mounted & (table["camera"] != "").to_numpy()
    expected = "must be empty for a parameter of the trajectory"
    yield from _wrong_cells(content, "parameters", "camera", with_camera, expected)
    empty = table["sigma"].isna().to_numpy()
    yield from _wrong_cells(content, "parameters", "sigma", empty, "must be a finite number")
    not_positive = ((table["parameter"] == "f_mm") & ~(table["value"] > 0)).to_numpy()
    yield from _wrong_cells(content, "parameters", "value", not_positive, "must be positive")


def _units(parameter: str) -> tuple[str, ...]:
    """Return the allowed units of a parameter; empty for an unknown parameter."""
    of_trajectory = (u for begin, u in OF_TRAJECTORY.items() if parameter.startswith(begin))
    return UNITS.get(parameter) or next(of_trajectory, ())


# --- covariances -----------------------------------------------------------------------------


def _covariances(content: results.Results) -> Iterator[Problem]:
    """Yield the problems of the covariance of every method."""
    table, parameters = content.covariance, content.parameters
    for method in dict.fromkeys([*_methods(table), *_methods(parameters)]):
        long = table[_of(table, method)]
        wrong = list(_square(content, method, long))
        yield from wrong or _beside(content, method, long, parameters[_of(parameters, method)])


def _methods(table: pd.DataFrame) -> list[tuple[str, str]]:
    return list(table[["stage", "method"]].drop_duplicates().itertuples(index=False, name=None))


def _of(table: pd.DataFrame, method: tuple[str, str]) -> Mask:
    return ((table["stage"] == method[0]) & (table["method"] == method[1])).to_numpy()


def _square(
    content: results.Results, method: tuple[str, str], long: pd.DataFrame
) -> Iterator[Problem]:
    """Yield the problems of a covariance that is not square, symmetric or positive."""
    row, names = pd.factorize(long["row"])
    column = pd.Index(names).get_indexer(pd.Index(long["column"]))
    if (column < 0).any():
        lines = long.index.to_numpy()[column < 0]
        yield from _of_lines(content, lines, "column", long, "must stand in column row, too")
        return
    places = np.full((len(names), len(names)), -1)
    places[row, column] = np.arange(len(long))
    unpaired = np.flatnonzero(places[column, row] < 0)
    expected = "must have a row with row and column exchanged"
    yield from _of_lines(content, long.index.to_numpy()[unpaired], "row", long, expected)
    lacking = _lacking(places, names, method)
    if len(lacking):
        i, j = lacking[0]
        pair = f"{quoted(names[i])} with {quoted(names[j])}"
        yield Problem(
            file=_file(content, "covariance"),
            line=int(long.index[np.flatnonzero(row == i)[0]]) + FIRST,
            column="column",
            found=f"{len(lacking)} rows of {'/'.join(method)} are missing, {pair}",
            expected="must have a row for every pair of its parameters",
        )
    elif not len(unpaired):
        values = np.where(places < 0, 0.0, long["value"].fillna(0.0).to_numpy()[places])
        yield from _positive(content, long, places, values)


def _lacking(places: Index, names: Collection[str], method: tuple[str, str]) -> Index:
    """Return the pairs of parameters without a row; separately adjusted heads share none."""
    camera = np.array([str(name).rpartition("/")[0] for name in names], dtype=object)
    needed = (method != ("heads", "bundle")) | (camera[:, None] == camera)
    return np.argwhere((places < 0) & (places.T < 0) & needed)


def _of_lines(
    content: results.Results, lines: Index, column: str, long: pd.DataFrame, expected: str
) -> Iterator[Problem]:
    cells = long[column]
    yield from wrong_rows(
        _file(content, "covariance"), column, lines, lambda line: quoted(cells[line]), expected
    )


def _positive(
    content: results.Results, long: pd.DataFrame, places: Index, values: Array
) -> Iterator[Problem]:
    """Yield negative variances, unequal pairs, correlations above 1, negative eigenvalues."""
    lines, file = long.index.to_numpy(), _file(content, "covariance")

    def there(line: int) -> str:
        return f"{long['value'][line]:.6g}"

    variance = np.diag(values)
    bad = lines[np.diag(places)[variance < 0]]
    yield from wrong_rows(file, "value", bad, there, "a variance must be zero or positive")
    if len(bad):
        return
    scale = np.sqrt(variance)[:, None] * np.sqrt(variance)
    i, j = np.nonzero(np.abs(values - values.T) > SAME * scale)
    yield from wrong_rows(
        file, "value", np.sort(lines[places[i, j]]), there, "must equal its counterpart"
    )
    i, j = np.nonzero(np.abs(values) > (1 + SAME) * scale)
    beyond = np.sort(lines[places[i, j]])
    expected = "must be at most the product of both standard deviations"
    yield from wrong_rows(file, "value", beyond, there, expected)
    known = np.flatnonzero(variance > 0)
    if len(i) or not 0 < len(known) <= LARGEST:
        return
    correlations = values[np.ix_(known, known)] / scale[np.ix_(known, known)]
    smallest = float(np.linalg.eigvalsh((correlations + correlations.T) / 2)[0])
    if smallest < -SAME * len(known):
        yield Problem(
            file=file,
            line=int(lines[0]) + FIRST,
            column="value",
            found=f"no covariance: its correlations have the eigenvalue {smallest:.3g}",
            expected="must have none that is negative",
        )


def _beside(
    content: results.Results, method: tuple[str, str], long: pd.DataFrame, listed: pd.DataFrame
) -> Iterator[Problem]:
    """Yield parameters whose sigma differs from the covariance of the method."""
    variances = long[long["row"] == long["column"]].set_index("row")["value"]
    camera, name = listed["camera"], listed["parameter"]
    label = name.where(camera == "", camera + "/" + name)
    variance = label.map(variances).to_numpy(dtype=float)
    squared = listed["sigma"].to_numpy() ** 2
    lines, file = listed.index.to_numpy(), _file(content, "parameters")
    missing = ~label.isin(variances.index).to_numpy()
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


def _entries(content: results.Results) -> Iterator[Problem]:
    """Yield validations whose number of pairs differs from the rows of validation.csv."""
    rows = content.validation["method"].value_counts()
    for name, entry in content.summary.items():
        stage, _, method = name.partition("/")
        stated, n_rows = entry.get("n_pairs"), int(rows.get(method, 0))
        if stage == "validation" and stated is not None and stated != n_rows:
            yield problem_of(
                content.folder / "summary.json",
                (name, "n_pairs"),
                str(stated),
                f"validation.csv has {n_rows} rows of {name}",
            )


# --- names -----------------------------------------------------------------------------------


def _names(content: results.Results, flight: Flight) -> Iterator[Problem]:
    """Yield images and points that the flight does not have."""
    blocks = flight.blocks.values()
    images = {name for block in blocks for name in block.images.names}
    images |= {name for block in blocks for name in block.trajectory.exposures}
    points = {name for block in blocks for name in block.points}
    for table, column, known, noun in (
        ("exterior_orientation", "image", images, "an image"),
        ("validation", "image_a", images, "an image"),
        ("validation", "image_b", images, "an image"),
        ("validation", "point", points, "a point"),
    ):
        unknown = ~getattr(content, table)[column].isin(known).to_numpy()
        expected = f"must be {noun} of the flight"
        yield from _wrong_cells(content, table, column, unknown, expected, " is unknown")
