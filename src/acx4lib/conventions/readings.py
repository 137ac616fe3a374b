"""The readings of a block: its sightings and body poses, each in another meaning of its numbers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from acx4lib.expected import Array, Index, Mask
from acx4lib.flight import readings as flight_readings
from acx4lib.flight.block import Block, ImagePoints
from acx4lib.flight.block_from_tables import index_of, poses
from acx4lib.flight.design import strip_of_exposure
from acx4lib.flight.tables import Table
from acx4lib.geometry.camera import Camera
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
    others = list(flight_readings.readings(table, block.frame.grid))
    if len(block.cameras) == 1:
        others += flight_readings.of_cameras(table, block.cameras[0].T_b_c.R)
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
        for meaning, height in flight_readings.height_readings(enh[:, 2], lonlat, frame.grid)
    ]
    others += [
        (f"east, north of control points {meaning}", np.column_stack([east_north, enh[:, 2]]))
        for meaning, east_north in flight_readings.plane_readings(enh[:, :2])
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
    for columns, meaning, colrow in flight_readings.pixel_readings(seen.colrow, size, pixel_mm):
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


# --- A part of a block's measurements, enough to compare readings of the flight by


MOST_IMAGES = 60
"""Number of images that are looked at, spread over the block."""

MOST_MEASUREMENTS = 900
"""Number of their measurements, spread likewise."""

RUN = 10
"""Number of neighbouring exposures that are looked at together where tie points are needed."""

FEWEST_RAYS = 3
"""Of a tie point: two rays of one strip say nothing of the angles across it."""

FEWEST_EXPOSURES = 6
"""Number of exposures below which a reading may fit by chance."""

FEWEST_MEASUREMENTS = 30
"""Number of measurements of surveyed points below which tie points are taken as well."""

BEYOND = 300_000.0
"""Distance from the median of the surveyed points, m, that no point of a block can have."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sightings:
    """Measurements of points, most of them surveyed.

    Attributes
    ----------
    cameras : tuple of Camera
        As declared.
    exposures : ndarray, shape (n_exposures,)
        Places of the exposures in the block's trajectory.
    camera_idx, exposure_idx, point_idx : ndarray, shape (n,)
        Of every measurement: places in `cameras`, `exposures` and `x_m`.
    colrow : ndarray, shape (n, 2)
        Pixels.
    x_m : ndarray, shape (n_points, 3)
        Surveyed coordinates, mapping frame, m; NaN for tie points.
    """

    cameras: tuple[Camera, ...]
    exposures: Index
    camera_idx: Index
    exposure_idx: Index
    point_idx: Index
    colrow: Array
    x_m: Array

    def __len__(self) -> int:
        """Count the measurements."""
        return len(self.colrow)


def sightings(block: Block) -> Sightings | None:
    """Return measurements of at most sixty images; None where they cannot tell readings apart.

    Surveyed points are enough where there are some in every image; else tie points are added.

    Parameters
    ----------
    block : Block
    """
    x_m = _surveyed(block)
    points = block.image_points[np.isfinite(block.image_points.sigma_px)]
    few = _of_some_images(block, points[np.isfinite(x_m[points.point_idx, 0])])
    if not _enough(block, few):
        few = _with_ties(block, points, np.isfinite(x_m[:, 0]))
    if not _enough(block, few):
        return None
    shown, point_idx = np.unique(few.point_idx, return_inverse=True)
    exposures, exposure_idx = np.unique(
        block.images.exposure_idx[few.image_idx], return_inverse=True
    )
    return Sightings(
        cameras=block.cameras,
        exposures=exposures,
        camera_idx=block.images.camera_idx[few.image_idx],
        exposure_idx=exposure_idx,
        point_idx=point_idx,
        colrow=few.colrow,
        x_m=x_m[shown],
    )


def _enough(block: Block, points: ImagePoints) -> bool:
    exposures = np.unique(block.images.exposure_idx[points.image_idx])
    return len(exposures) >= FEWEST_EXPOSURES and len(points) >= FEWEST_MEASUREMENTS


def _surveyed(block: Block) -> Array:
    """Return the coordinates of surveyed points on the earth, NaN for all other points."""
    x_m = np.full((len(block.points), 3), np.nan)
    for surveyed in (block.control, block.check):
        x_m[surveyed.point_idx] = surveyed.x_m
    known = np.isfinite(x_m[:, 0])
    if known.any():
        far = np.abs(x_m[known] - np.median(x_m[known], axis=0)).max(axis=1) > BEYOND
        x_m[np.flatnonzero(known)[far]] = np.nan
    return x_m


def _of_some_images(block: Block, points: ImagePoints) -> ImagePoints:
    """Return the measurements of whole exposures, evenly spaced, and not too many of them."""
    exposure = block.images.exposure_idx[points.image_idx]
    kept = _spaced(np.unique(exposure), _most_exposures(block))
    points = points[np.isin(exposure, kept)]
    return points[_spaced(np.arange(len(points)), MOST_MEASUREMENTS)]


def _with_ties(block: Block, points: ImagePoints, is_surveyed: Mask) -> ImagePoints:
    """Return the measurements of neighbouring exposures, of surveyed and of some tie points."""
    exposure = block.images.exposure_idx[points.image_idx]
    measured = np.unique(exposure)
    first = _spaced(np.arange(len(measured)), _most_exposures(block) // RUN)
    runs = np.unique(np.minimum(first[:, None] + np.arange(RUN), len(measured) - 1))
    points = points[np.isin(exposure, measured[runs])]
    rays = np.bincount(points.point_idx, minlength=len(is_surveyed))
    ties = np.flatnonzero((rays >= FEWEST_RAYS) & ~is_surveyed)
    most = int(MOST_MEASUREMENTS / max(1.0, rays[ties].mean())) if len(ties) else 0
    kept = is_surveyed.copy()
    kept[_spaced(ties, most)] = True
    return points[kept[points.point_idx]]


def _most_exposures(block: Block) -> int:
    return int(MOST_IMAGES * len(block.trajectory) / max(1, len(block.images)))


def _spaced(values: Index, most: int) -> Index:
    """Return at most so many values, evenly spaced."""
    every = np.linspace(0, len(values) - 1, min(len(values), max(most, 1)))
    return values[np.round(every).astype(np.intp)]
