"""The readings of a block: its sightings and body poses, each in another meaning of its numbers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from acx4lib.conventions.sightings import Sightings
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Block
from acx4lib.flight.block_from_tables import index_of, poses
from acx4lib.flight.checks import readings as of_flight
from acx4lib.flight.design import strip_of_exposure
from acx4lib.flight.text.table import Table
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import MappingFrame


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading:
    """A block in one reading.

    Attributes
    ----------
    name : str
        What is read otherwise, such as "pitch of opposite sign".
    quantity : {"attitude", "position", "image"}
        What it changes most.
    seen : Sightings
    T_m_b : Pose
        One per exposure of the sightings.
    velocity : ndarray, shape (n_exposures, 3), or None
        m/s, where a delay is to be found.
    of_some : bool
        Whether it changes some images only, perhaps too few for the misfit of all.
    """

    name: str
    quantity: str
    seen: Sightings
    T_m_b: Pose
    velocity: Array | None = None
    of_some: bool = False


def readings(block: Block, trajectory: Table, seen: Sightings) -> Iterator[Reading]:
    """Yield the usual readings of a block, the simplest first.

    Parameters
    ----------
    block : Block
    trajectory : Table
        As the file has it, all its rows.
    seen : Sightings
        Of this block.
    """
    given = Reading(name="", quantity="", seen=seen, T_m_b=block.trajectory.T_m_b[seen.exposures])
    yield from _of_trajectory(block, trajectory, given)
    yield from _of_clock(block, given)
    yield from _of_control(block.frame, given)
    yield from _of_images(given)


def _of_trajectory(block: Block, table: Table, given: Reading) -> Iterator[Reading]:
    names = [block.trajectory.exposures[i] for i in given.seen.exposures]
    table = _with_neighbours(table, index_of(names, table.text["exposure"]))
    rows = index_of(names, table.text["exposure"])
    others = list(of_flight.readings(table, block.frame.grid))
    if len(block.cameras) == 1:
        others += of_flight.of_cameras(table, block.cameras[0].T_b_c.R)
    for other in others:
        with np.errstate(all="ignore"):  # changed positions may not be on the earth
            T_m_b = _poses(other.table, rows, block.frame)
        if np.isfinite(T_m_b.r).all() and np.isfinite(T_m_b.R).all():
            yield replace(given, name=other.name, quantity=other.quantity, T_m_b=T_m_b)


def _with_neighbours(table: Table, rows: Index) -> Table:
    """Return some rows of a table with the ones before and after each, of perhaps a million."""
    keep = np.zeros(len(table) + 2, dtype=bool)
    for step in (0, 1, 2):
        keep[rows + step] = True
    return table.select(keep[1:-1])


def _poses(table: Table, rows: Index, frame: MappingFrame) -> Pose:
    """Return the poses of some rows, in their order."""
    numbers = {name: values[rows] for name, values in table.numbers.items()}
    return poses(replace(table, lines=table.lines[rows], numbers=numbers), frame)


def _of_clock(block: Block, given: Reading) -> Iterator[Reading]:
    """Positions of another time than the pictures'."""
    velocity = velocities(block, given.seen)
    if velocity is not None:
        yield replace(given, name="the clock", quantity="position", velocity=velocity)


def velocities(block: Block, seen: Sightings) -> Array | None:
    """Return the velocity of every exposure that is seen, m/s; None where no times tell it.

    Parameters
    ----------
    block : Block
    seen : Sightings
    """
    time_s = block.trajectory.time_s
    if len(time_s) < len(block.trajectory) or not np.isfinite(time_s).all():
        return None
    velocity, strips = np.zeros((len(time_s), 3)), np.array(strip_of_exposure(block), dtype=object)
    for strip in dict.fromkeys(strips):
        own = np.flatnonzero(strips == strip)
        if len(own) > 1 and np.all(np.diff(time_s[own]) > 0):
            velocity[own] = np.gradient(block.trajectory.T_m_b.r[own], time_s[own], axis=0)
    return velocity[seen.exposures] if np.any(velocity) else None


def _of_control(frame: MappingFrame, given: Reading) -> Iterator[Reading]:
    """East, north and heights of the surveyed points in their other readings."""
    surveyed = np.flatnonzero(np.isfinite(given.seen.x_m[:, 0]))
    if not len(surveyed):
        return
    enh = frame.to_grid(given.seen.x_m[surveyed])
    lonlat = frame.grid.lonlat_from_grid(enh[:, :2])
    others = [
        (f"height of control points {meaning}", np.column_stack([enh[:, :2], height]))
        for meaning, height in of_flight.height_readings(enh[:, 2], lonlat, frame.grid)
    ]
    others += [
        (f"east, north of control points {meaning}", np.column_stack([east_north, enh[:, 2]]))
        for meaning, east_north in of_flight.plane_readings(enh[:, :2])
    ]
    for name, other in others:
        x_m = given.seen.x_m.copy()
        with np.errstate(all="ignore"):  # changed positions may not be on the earth
            x_m[surveyed] = frame.from_grid(other)
        if np.isfinite(x_m[surveyed]).all():
            yield replace(given, name=name, quantity="position", seen=replace(given.seen, x_m=x_m))


def _of_images(given: Reading) -> Iterator[Reading]:
    """Pixel coordinates with other axes, origins and units."""
    seen = given.seen
    size = np.array([[c.width_px, c.height_px] for c in seen.cameras])[seen.camera_idx]
    pixel_mm = np.array([[c.pixel_mm] for c in seen.cameras])[seen.camera_idx]
    yield from _north_up(given, size)
    for columns, meaning, colrow in of_flight.pixel_readings(seen.colrow, size, pixel_mm):
        name = f"{columns.replace('_px', '')} {meaning}"
        yield replace(given, name=name, quantity="image", seen=replace(seen, colrow=colrow))


def _north_up(given: Reading, size: Array) -> Iterator[Reading]:
    """Images of the strips in one direction turned by 180 degrees, as they are displayed north up.

    Either those against the first exposure's direction or those along it.
    """
    seen, ahead = given.seen, given.T_m_b.R[:, :2, 0]
    against = (ahead @ ahead[0] < 0)[seen.exposure_idx]
    if not against.any() or against.all():
        return
    for turned in (against, ~against):
        colrow = np.where(turned[:, None], size - 1 - seen.colrow, seen.colrow)
        name = "images of the strips in one direction turned by 180 degrees (shown north up)"
        turned_back = replace(seen, colrow=colrow)
        yield replace(given, name=name, quantity="image", seen=turned_back, of_some=True)
