"""Strange positions of a flight's points that are no reason to refuse the flight."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from textwrap import shorten

import numpy as np
import pyproj

from acx4lib.expected import Array
from acx4lib.flight.block import Block
from acx4lib.flight.block_from_tables import (
    BlockTables,
    index_of,
    lonlat_of,
    measured_control,
    used_exposures,
)
from acx4lib.flight.checks.fit import misfit
from acx4lib.geometry.geodesy import GridSystem
from acx4lib.least_squares.covariance import medians

ABSURD = 4.0
"""Distance from the measurements, in quarters of the image diagonal: far outside the image."""

SHARE, ENOUGH = 10, 3
"""Single rows are at most one in `SHARE`, or one alone, and at least `ENOUGH` others remain."""

NAMED = 5
"""Number of points that a note names."""

BESIDE_DEG = 3.0
"""Allowed distance from the area of use of a CRS: zones are used beyond their borders."""


def without_single_rows(tables: BlockTables, grid: GridSystem) -> BlockTables:
    """Return tables without single control points off the CRS, or above all exposures seeing them.

    A mistake in one row of many is a gross error; the adjustment will find it. Mistakes in many
    rows are a mistake of the table; then all rows stay.

    Parameters
    ----------
    tables : BlockTables
    grid : GridSystem
    """
    rows = np.flatnonzero(measured_control(tables))
    lonlat = lonlat_of(tables.control, grid)[rows]
    on_earth = np.flatnonzero(np.isfinite(lonlat).all(axis=1))
    wrong = np.ones(len(rows), dtype=bool)
    wrong[on_earth] = ~np.isfinite(grid.undulation(lonlat[on_earth]))
    height = tables.control.numbers["height_m"][rows]
    lowest = tables.trajectory.numbers["height_m"][used_exposures(tables)].min(initial=np.inf)
    if np.any(height >= lowest):
        wrong |= height >= _highest_below(tables)[rows]
    n = int(wrong.sum())
    if n > max(1, len(rows) // SHARE) or len(rows) - n < ENOUGH:
        return tables
    keep = np.ones(len(tables.control), dtype=bool)
    keep[rows[wrong]] = False
    return replace(tables, control=tables.control.select(keep))


def _highest_below(tables: BlockTables) -> Array:
    """Return for every control point the lowest height that cannot be right.

    It is above all exposures that see the point, and above half of the block's exposures,
    because a single exposure may be too low itself.
    """
    trajectory = tables.trajectory
    used = trajectory.numbers["height_m"][used_exposures(tables)]
    height = dict(zip(trajectory.text["exposure"], trajectory.numbers["height_m"], strict=True))
    exposure = dict(zip(tables.images.text["image"], tables.images.text["exposure"], strict=True))
    highest = dict.fromkeys(tables.control.text["point"], float(np.median(used)))
    text = tables.image_points.text
    for i in np.flatnonzero(index_of(text["point"], [*highest]) >= 0).tolist():
        point = text["point"][i]
        highest[point] = max(highest[point], float(height[exposure[text["image"][i]]]))
    return np.array(list(highest.values()))


def control_notes(tables: BlockTables, block: Block) -> Iterator[str]:
    """Yield notes on surveyed points that project far from their measurements.

    Parameters
    ----------
    tables : BlockTables
    block : Block
        The block made from these tables.
    """
    found = misfit(block)
    ratio = medians(found.distance_px / found.allowed_px, found.point_idx, len(block.points))
    absurd = {block.points[i] for i in np.flatnonzero(ratio > ABSURD)}
    line = dict(zip(tables.control.text["point"], tables.control.lines, strict=True))
    far = [name for name in line if name in absurd]
    if far:
        listed = ", ".join(
            f"{name!r} ({tables.control.counts} {line[name]})" for name in far[:NAMED]
        )
        more = ", …" if len(far) > NAMED else ""
        yield (
            f"{tables.name}: {len(far)} of {len(np.unique(found.point_idx))} surveyed points of "
            f"{tables.control.file} lie nowhere near where they were measured, and will be "
            f"rejected as gross errors if the others fit: {listed}{more}"
        )


def area_notes(grid: GridSystem, blocks: dict[str, Block]) -> Iterator[str]:
    """Yield a note where a block is far outside the area of use of its CRS, if it has one.

    Parameters
    ----------
    grid : GridSystem
    blocks : dict of str to Block
    """
    crs = pyproj.CRS.from_user_input(grid.crs)
    area = crs.area_of_use
    if area is None:
        return
    for name, block in blocks.items():
        lon, lat = block.frame.origin
        lon += 0.0 if crs.prime_meridian is None else crs.prime_meridian.longitude
        if not holds(area.bounds, lon, lat):
            called = shorten(area.name.rstrip("."), 80, placeholder=" …")
            yield (
                f"{name}: the exposures are at {_place(lon, lat)}, but {grid.crs} ({crs.name}) is "
                f"meant for {_place(area.west, area.south)} to {_place(area.east, area.north)}, "
                f"{called}: is it the right CRS?"
            )


def of_degrees(grid: GridSystem, east: Array, north: Array) -> bool:
    """Tell whether longitudes and latitudes stand in the place of metres in a map.

    All are as small, and the CRS is not meant for where that would be.

    Parameters
    ----------
    grid : GridSystem
    east, north : ndarray, shape (n,)
        As they were given.
    """
    area = pyproj.CRS.from_user_input(grid.crs).area_of_use
    if area is None or not len(east) or np.any(np.abs(east) > 180) or np.any(np.abs(north) > 90):
        return False
    lon, lat = grid.lonlat_from_grid(np.array([[east[0], north[0]]]))[0]
    return not holds(area.bounds, lon, lat, beside_deg=0.0)


def holds(
    bounds: tuple[float, float, float, float],
    lon: float,
    lat: float,
    *,
    beside_deg: float = BESIDE_DEG,
) -> bool:
    """Tell whether a position lies in an area or near it; the area may cross the date line."""
    west, south, east, north = bounds
    wide = (east - west) % 360 or 360.0
    along = (lon - west + beside_deg) % 360
    near_north = south - beside_deg <= lat <= north + beside_deg
    return near_north and along <= wide + 2 * beside_deg


def _place(lon: float, lat: float) -> str:
    """Return a position as text, such as 25.4 S 49.3 W."""
    return f"{abs(lat):.1f} {'S' if lat < 0 else 'N'} {abs(lon):.1f} {'W' if lon < 0 else 'E'}"
