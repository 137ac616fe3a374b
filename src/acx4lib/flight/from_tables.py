"""A flight from tables in memory: the columns of the files, and the same checks and sentences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from acx4lib.errors import FlightError
from acx4lib.expected import given
from acx4lib.flight.block_from_tables import TABLES, BlockTables
from acx4lib.flight.problems import Problem, did_you_mean, lines_of
from acx4lib.flight.reader import Flight, checked
from acx4lib.flight.text.document import Toml
from acx4lib.flight.text.in_memory import Columns, table_in_memory
from acx4lib.flight.text.schemas import SCHEMAS
from acx4lib.flight.text.table import Table

CONTROL, DISTANCES = "control_points", "distances"
PLACE = Path("tables in memory")
"""In the place of a flight's folder, for messages; nothing is read there."""

Tables = Mapping[str, Columns]
"""The tables of a block, by the names of their files without the ending."""


def from_tables(
    settings: Mapping[str, Any],
    *,
    control_points: Columns | None = None,
    heads: Tables | None = None,
    calibration: Tables | None = None,
    validation: Tables | None = None,
) -> Flight:
    """Return the flight of tables in memory; nothing is read from files but a geoid grid.

    Parameters
    ----------
    settings : mapping
        The keys of flight.toml, nested as there: name, crs, heights, cameras and so on.
    control_points : table, optional
        Of all blocks that have none of their own.
    heads, calibration, validation : mapping of str to table, optional
        ``images``, ``image_points``, ``trajectory``; if there are some, ``distances``; if the
        block has its own, ``control_points``. A table is a DataFrame or a dict of arrays; its
        columns and units are those of the file of this name. Names may be whole numbers, a sigma
        may be infinite: not known.

    Returns
    -------
    Flight

    Raises
    ------
    FlightError
        With all problems, one line each, by table, row from 0, and column.
    """
    blocks = {"heads": heads, "calibration": calibration, "validation": validation}
    present = {name: tables for name, tables in blocks.items() if tables is not None}
    toml = Toml(folder=Path(), file="settings", values=_plain(settings), in_memory=True)
    wrong = list(_missing(present, settings))
    if wrong:
        raise FlightError(lines_of(wrong))
    read = [_block(name, tables, control_points) for name, tables in present.items()]
    flight = checked(toml, read)
    sums = {f"{b.name}/{t}.csv": getattr(b, t).sha256 for b in read for t in TABLES}
    sums |= {f"{b.name}/{DISTANCES}.csv": b.distances.sha256 for b in read if b.distances}
    return replace(flight, path=PLACE, pictures=PLACE, sha256=sums)


def _missing(blocks: Mapping[str, Tables], settings: object) -> Iterator[Problem]:
    """Yield what is no table, lacks, or has a name that no table has."""
    if not isinstance(settings, Mapping):
        yield _problem("settings", "settings", f"is {given(settings)}", "must be a dict")
    if not blocks:
        expected = "must have one at least: heads, calibration or validation"
        yield _problem("flight", "blocks", "no block at all", expected)
    for name, tables in blocks.items():
        if isinstance(tables, Mapping):
            yield from _names(name, tables)
        else:
            expected = f"must be a dict of the tables {', '.join(TABLES)}"
            yield _problem(name, "tables", f"is {given(tables)}", expected)


def _names(block: str, tables: Tables) -> Iterator[Problem]:
    """Yield the names of a block's tables that no table has, and those that are missing."""
    known = (*TABLES, CONTROL, DISTANCES)
    for table in tables:
        if table not in known:
            found = f"unknown table{did_you_mean(str(table), known)}"
            yield _problem(block, str(table), found, f"must be one of {', '.join(known)}")
    for table in TABLES:
        if table not in tables:
            yield _problem(block, table, "missing", "required")


def _problem(table: str, column: str, found: str, expected: str) -> Problem:
    return Problem(
        file=table, line=-1, column=column, found=found, expected=expected, in_memory=True
    )


def _block(name: str, tables: Tables, control_points: Columns | None) -> BlockTables:
    images, image_points, trajectory = (
        table_in_memory(tables[table], f"{name}.{table}", SCHEMAS[f"{table}.csv"])
        for table in TABLES
    )
    return BlockTables(
        name=name,
        pictures=Path(),
        images=images,
        image_points=image_points,
        trajectory=trajectory,
        control=_control(name, tables, control_points),
        distances=_distances(name, tables),
    )


def _distances(name: str, tables: Tables) -> Table | None:
    if DISTANCES not in tables:
        return None
    return table_in_memory(tables[DISTANCES], f"{name}.{DISTANCES}", SCHEMAS[f"{DISTANCES}.csv"])


def _control(name: str, tables: Tables, shared: Columns | None) -> Table:
    """Return a block's own control points, or those of the flight, or none."""
    own = tables.get(CONTROL)
    columns = shared if own is None else own
    if columns is None:
        columns = dict.fromkeys(("point", "east_m", "north_m", "height_m"), np.zeros(0))
    label = CONTROL if own is None else f"{name}.{CONTROL}"
    return table_in_memory(columns, label, SCHEMAS[f"{CONTROL}.csv"])


def _plain(value: Any) -> Any:
    """Return settings as flight.toml would hold them: None is left out, as are numpy's types."""
    if isinstance(value, Mapping):
        return {str(key): _plain(one) for key, one in value.items() if one is not None}
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    return [_plain(one) for one in value] if isinstance(value, list | tuple) else value
