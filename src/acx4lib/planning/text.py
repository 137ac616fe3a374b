"""A plan as a TOML file: read, with everything that is wrong named by its line, and written."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from acx4lib import expected
from acx4lib.errors import FlightError
from acx4lib.exchange import written_toml
from acx4lib.flight.block_from_tables import BLOCKS
from acx4lib.flight.checks.oddities import of_degrees
from acx4lib.flight.problems import Problem, lines_of
from acx4lib.flight.setup import Setup, camera_of, setup_of
from acx4lib.flight.text.document import Toml, read_toml
from acx4lib.planning.checks import problems, settings
from acx4lib.planning.plan import (
    Area,
    Plan,
    PlannedBlock,
    Points,
    Strip,
    Terrain,
    image_length_m,
)

MOST_PROJECTED = 20_000_000
"""Largest product of a block's images and points: what is more takes too long and too much."""

MOST_EXPOSURES = 1_000
"""Largest number of exposures of a block: all may overlap, and the normal matrix is then full."""


def read(path: str | Path) -> Plan:
    """Return the plan in a TOML file.

    Raises
    ------
    FlightError
        With all problems, one line each.
    """
    return checked(read_toml(expected.path("path", path), needed_by="planning"))


def from_values(values: Mapping[str, Any]) -> Plan:
    """Return the plan of a nested dict with the keys of the file; FlightError as `read`."""
    return checked(Toml(folder=Path(), file="plan", values=dict(values), in_memory=True))


def checked(toml: Toml) -> Plan:
    """Return the plan of a document; FlightError as `read`."""
    flight = replace(toml, values=settings(toml.values))
    found = [*problems(toml, flight)]
    if found:
        raise FlightError(lines_of(found))
    plan = _plan(toml, setup_of(flight))
    found = [*_size_problems(toml, plan)]
    if found:
        raise FlightError(lines_of(found))
    return plan


def _plan(toml: Toml, setup: Setup) -> Plan:
    field = toml.table("field")
    plan = Plan(
        setup=setup,
        values=toml.values,
        terrain=Terrain(
            height_m=float(field["height_m"]), relief_m=float(field.get("relief_m", 0.0))
        ),
        control=_points(toml.table("control")),
        blocks={},
        truth={
            name: camera_of(name, {**toml.table("cameras", name), **table})
            for name, table in toml.table("truth").items()
        },
    )
    blocks = {name: _block(toml, plan, name) for name in BLOCKS if name in toml.values}
    return replace(plan, blocks=blocks)


def _block(toml: Toml, plan: Plan, name: str) -> PlannedBlock:
    table = toml.table(name)
    given = {**toml.table("field"), **table}
    area = Area(
        east_m=float(given["east_m"]),
        north_m=float(given["north_m"]),
        course_deg=float(given.get("course_deg", 0.0)),
    )
    check = name == "validation"
    tie_area = table.get("tie_area_m")
    return PlannedBlock(
        name=name,
        area=area,
        strips=dict(_strips(plan, name, area, table["strips"])),
        points=_points(table["check"]) if check else plan.control,
        tie_points=int(table.get("tie_points", 0)),
        tie_area_m=None if tie_area is None else (float(tie_area[0]), float(tie_area[1])),
    )


def _points(table: Mapping[str, Any]) -> Points:
    """Return surveyed points; none for an empty table."""
    number = table.get("number", 0)
    east, north, height = map(float, table.get("sigma_m", Points.sigma_m))
    forward, left = map(float, table.get("area_m", Points.area_m))
    return Points(
        layout=table.get("layout", "grid") if table else "at",
        number=tuple(map(int, number if isinstance(number, list) else [number])),
        area_m=(forward, left),
        play_m=float(table.get("play_m", 0.0)),
        at_m=tuple((float(a), float(b)) for a, b in table.get("at_m", ())),
        sigma_m=(east, north, height),
        sigma_px=float(table["sigma_px"]) if "sigma_px" in table else None,
    )


def _strips(
    plan: Plan, block: str, area: Area, tables: Mapping[str, Mapping[str, Any]]
) -> Iterator[tuple[str, Strip]]:
    """Yield strips by name; parallel ones, flown in turn both ways, get a number each."""
    camera = plan.frame(block) or plan.cameras(block)[0]
    for name, table in tables.items():
        own = {key: float(table[key]) for key in Strip.__dataclass_fields__ if key in table}
        height = own["flying_height_m"]
        if "overlap" in table:
            own["base_m"] = (1 - table["overlap"]) * image_length_m(camera, height)
        strip = Strip(**own)
        n = int(table.get("parallel", 1))
        spacing = float(table.get("spacing_m", 0.0))
        if "side_overlap" in table:
            spacing = (1 - table["side_overlap"]) * image_length_m(camera, height, across=True)
        for i in range(n):
            moved = strip.beside((0.5 * (n - 1) - i) * spacing, area.course_deg)
            yield (f"{name}-{i + 1}", moved.turned(180.0 * (i % 2))) if n > 1 else (name, strip)


def _place_problems(toml: Toml, plan: Plan, block: PlannedBlock) -> Iterator[Problem]:
    """Yield a problem where the middle of a block is nowhere, or given in degrees."""
    grid, east, north = plan.setup.grid, block.area.east_m, block.area.north_m
    key = block.name if "east_m" in toml.table(block.name) else "field"
    found = f"{east:g} east, {north:g} north"
    if not np.isfinite(grid.lonlat_from_grid(np.array([[east, north]]))).all():
        where = f"must lie where {grid.crs} maps the earth; easting first"
        yield toml.problem((key, "east_m"), found, where)
    elif of_degrees(grid, np.array([east]), np.array([north])):
        found += " (longitude, latitude in degrees?)"
        yield toml.problem((key, "east_m"), found, f"must be metres where {grid.crs} is meant for")


def _size_problems(toml: Toml, plan: Plan) -> Iterator[Problem]:
    for name, block in plan.blocks.items():
        yield from _place_problems(toml, plan, block)
        n = sum(strip.n_exposures for strip in block.strips.values())
        if n > MOST_EXPOSURES:
            found = f"{n} exposures"
            yield toml.problem((name, "strips"), found, f"must be at most {MOST_EXPOSURES}")
        elif n * len(plan.cameras(name)) * block.tie_points > MOST_PROJECTED:
            found = f"{n} exposures and {block.tie_points} tie points"
            expected_ = f"images times tie points must be at most {MOST_PROJECTED}"
            yield toml.problem((name, "tie_points"), found, expected_)
        if name == "heads" and plan.setup.synthetic is None and len(plan.setup.cameras) < 2:
            found, cure = "one camera", "heads are several; a single camera is flown in calibration"
            yield toml.problem((name,), found, cure)


# --- written ---------------------------------------------------------------------------------


def written(values: Mapping[str, Any]) -> str:
    """Return the TOML text of nested tables: those of a plan, or of flight.toml.

    A strip is one line. Values are text, numbers, truth values, dates, and lists of them.
    """
    return written_toml.written(values, inline="strips")
