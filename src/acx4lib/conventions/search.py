"""The best reading of a block, where it is much better than the given one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from acx4lib import expected
from acx4lib.conventions import mounted as conventions_mounted
from acx4lib.conventions.mounted import Mounted, measuring_noise, mounted, started
from acx4lib.conventions.readings import Reading, Sightings, sightings, velocities
from acx4lib.expected import Array, Index
from acx4lib.flight import readings as flight_readings
from acx4lib.flight.block import Block
from acx4lib.flight.block_from_tables import index_of, poses
from acx4lib.flight.reader import Flight
from acx4lib.flight.tables import Table
from acx4lib.geometry.frames import Pose, log
from acx4lib.geometry.geodesy import MappingFrame

BETTER = 2.0
"""Ratio of the given reading's misfit to another's below which no other is named."""

CERTAIN = 5.0
"""Logarithm of that ratio, in its standard deviations, below which no other is named.

Every exposure has two independent components of attitude or more, and the quantile of the misfit
needs about twice the data that a standard deviation needs: n exposures are worth n degrees of
freedom, and the logarithm of a ratio of two has the standard deviation 1 / sqrt(n).
"""

FITTED, FITTED_CERTAIN = 1.5, 2.5
"""The same for readings with a fitted number, of which there are four and not a hundred."""

GROSS = 10.0
"""Ratio of the residuals of the worst images above which a reading of some images is named."""

ALIKE = 1.25
"""Ratio of misfits below which the simpler of two readings is named."""

PROMISING, MOST_TRIED = 1.1, 12
"""Ratio of misfits before the adjustment from which a reading is adjusted, and how many are."""

FLOOR_PX = 0.25
"""Misfit that no reading can explain, px."""

NEAR = np.radians(15.0)
"""Turn from the declared boresight within which a reading is preferred to others as good."""


@dataclass(frozen=True, kw_only=True)
class Found:
    """A reading that fits much better than the given one.

    Attributes
    ----------
    name : str
        What is read otherwise, such as "pitch of opposite sign".
    quantity : str
        What the residuals are of.
    given, found : float
        Robust residuals of the given reading and of this one; NaN where the name says all.
    unit : str
        Of both: °, m, px or σ.
    """

    name: str
    quantity: str
    given: float
    found: float
    unit: str

    @property
    def sentence(self) -> str:
        """One sentence on the reading, with its figure beside the given one's."""
        found = _shown(self.found, self.unit)
        if not np.isfinite(self.given):
            return (
                f"with {self.name} the residuals of {self.quantity} are {found}; as the numbers "
                "are, rays do not meet"
            )
        if not np.isfinite(self.found):
            given = _shown(self.given, self.unit)
            return f"the residuals of {self.quantity} are {given}: {self.name}"
        change = "fall" if self.found < self.given else "rise"
        return (
            f"with {self.name} the residuals of {self.quantity} {change} "
            f"from {_shown(self.given, self.unit)} to {found}"
        )


def _shown(value: float, unit: str) -> str:
    number = f"{value:.2g}" if value < 100 else f"{value:.0f}"
    return f"{number}{unit}" if unit == "°" else f"{number} {unit}"


def best_reading(flight: Flight, block_name: str) -> Found | None:
    """Return the reading of a block that leaves much less than the given one; None without one.

    Every usual reading of trajectory, control and image measurements is tried on at most sixty
    images. Mounting and interior orientation are estimated in each: what they absorb, such as a
    delay at one speed, leaves nothing and is not found. Half a pixel is the principal point's.

    Raises
    ------
    FlightError
        Where the flight has no such block.
    """
    expected.instance("flight", flight, Flight)
    block = flight.block(block_name)
    seen = sightings(block)
    if seen is None:
        return None
    with np.errstate(all="ignore"):  # readings may be absurd
        return _searched(block, flight.trajectories[block_name], seen)


def _searched(block: Block, trajectory: Table, seen: Sightings) -> Found | None:
    T_m_b = block.trajectory.T_m_b[seen.exposures]
    given = mounted(seen, T_m_b)
    others = list(_readings(block, trajectory, seen))
    tried = [
        (reading, mounted(reading.seen, reading.T_m_b, reading.velocity))
        for reading in _promising(others, started(seen, T_m_b).misfit)
    ]
    named = _best(tried, given, seen) or _best_fitted(block, seen, given)
    return named or _of_sigma(other_unit(block, seen, given))


def _readings(block: Block, trajectory: Table, seen: Sightings) -> Iterator[Reading]:
    """Yield the usual readings of a block, the simplest first."""
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


def _promising(others: list[Reading], usual: float) -> list[Reading]:
    """Return the readings that fit best before an adjustment, in their order, and the clock's."""
    misfits = np.array([started(reading.seen, reading.T_m_b).misfit for reading in others])
    limit = min(PROMISING * usual, np.sort(misfits)[:MOST_TRIED].max(initial=0.0))
    return [r for r, m in zip(others, misfits, strict=True) if m <= limit or r.velocity is not None]


def _of_sigma(unit: Unit | None) -> Found | None:
    if unit is None:
        return None
    return Found(
        name=unit.name, quantity=unit.quantity, given=unit.given, found=unit.found, unit="σ"
    )


def notes(flight: Flight) -> Iterator[str]:
    """Yield a sentence for every block that another reading fits much better."""
    expected.instance("flight", flight, Flight)
    for name in flight.blocks:
        found = best_reading(flight, name)
        if found is not None:
            yield f"{name}: {found.sentence}"


def _best(tried: list[tuple[Reading, Mounted]], given: Mounted, seen: Sightings) -> Found | None:
    """Return the simplest of the best readings, if it is much better than the given one."""
    camera = seen.cameras[0]
    floor = FLOOR_PX * camera.pixel_mm / camera.interior.f
    for reading, found in tried:
        mends = GROSS * (found.worst + floor) < given.worst + floor
        if reading.of_some and mends and found.misfit < ALIKE * given.misfit:
            return _found(
                reading, replace(given, misfit=given.worst), replace(found, misfit=found.worst)
            )
    better = max(BETTER, np.exp(CERTAIN / np.sqrt(len(seen.exposures))))
    good = [(r, m) for r, m in tried if better * (m.misfit + floor) < given.misfit + floor]
    if not good:
        return None
    least = min(m.misfit for _, m in good) + floor
    alike = [(r, m) for r, m in good if m.misfit + floor < ALIKE * least]
    near = [(r, m) for r, m in alike if _turn(m, seen) < NEAR]
    reading, found = (near or alike)[0]
    return _found(_named(reading, found), given, found)


def _best_fitted(block: Block, seen: Sightings, given: Mounted) -> Found | None:
    """Return the reading with a fitted number that leaves least, if that is clearly less."""
    camera = seen.cameras[0]
    floor = FLOOR_PX * camera.pixel_mm / camera.interior.f
    tried = list(conventions_mounted.readings(block, seen, given))
    if not tried:
        return None
    reading, found = min(tried, key=lambda one: one[1].misfit)
    better = max(FITTED, np.exp(FITTED_CERTAIN / np.sqrt(len(seen.exposures))))
    clearly = better * (found.misfit + floor) < given.misfit + floor
    return _found(reading, given, found) if clearly else None


def _turn(found: Mounted, seen: Sightings) -> float:
    """Return the largest turn of a camera from its declared boresight, radians."""
    return max(
        float(np.linalg.norm(log(given.T_b_c.R.T @ own.T_b_c.R)))
        for own, given in zip(found.cameras, seen.cameras, strict=True)
    )


def _named(reading: Reading, found: Mounted) -> Reading:
    """Return a reading whose name says the delay that was found."""
    if reading.velocity is None:
        return reading
    late = "late" if found.delay_s < 0 else "early"
    name = f"positions recorded {abs(found.delay_s):.2g} s {late}"
    return replace(reading, name=name)


def _found(reading: Reading, given: Mounted, found: Mounted) -> Found:
    """Return misfits as the attitude, position or measurement that would make them."""
    seen, camera = reading.seen, found.cameras[0]
    away = found.x_m[seen.point_idx] - reading.T_m_b.r[seen.exposure_idx]
    scale, unit, quantity = {
        "attitude": (np.degrees(1.0), "°", "attitude"),
        "position": (float(np.nanmedian(np.linalg.norm(away, axis=1))), "m", "position"),
        "image": (camera.interior.f / camera.pixel_mm, "px", "image measurements"),
    }[reading.quantity]
    return Found(
        name=reading.name,
        quantity=quantity,
        given=given.misfit * scale,
        found=found.misfit * scale,
        unit=unit,
    )


# --- Standard deviations in another unit: what the residuals are in terms of them


OFF = 2.0
"""Ratio of residuals to sigma, or its inverse, from which another unit is looked for."""

RIGHT = 1.6
"""The same within which a unit is right: neighbouring units differ by ten and more."""

ANGLE_UNITS = {"seconds of arc": 1 / 3600, "minutes of arc": 1 / 60, "radians": 180 / np.pi}
LENGTH_UNITS = {"mm": 1e-3, "cm": 1e-2}

ALONE_M = 0.5, 15.0
"""Standard deviations of positions that a receiver without corrections states."""

SHARED = (
    "this sigma is rather that of an error which neighbouring exposures share, as of a receiver "
    "without corrections; gnss in flight.toml makes a common shift an unknown"
)
"""What is said in the place of another unit: such an error leaves small residuals."""


@dataclass(frozen=True, kw_only=True)
class Unit:
    """Another unit of some standard deviations.

    Attributes
    ----------
    name : str
        As in "sigma of attitude in seconds of arc", or `SHARED`.
    quantity : str
    given, found : float
        Residuals in terms of sigma, as given and in this unit; NaN where it is no unit.
    """

    name: str
    quantity: str
    given: float
    found: float


def other_unit(block: Block, seen: Sightings, given: Mounted) -> Unit | None:
    """Return the unit in which standard deviations agree with residuals; None if they do anyway.

    Nothing is said where no plausible mounting fits: residuals are no errors of observation then.

    Parameters
    ----------
    block : Block
    seen : Sightings
        Of this block.
    given : Mounted
        The block as it is given.
    """
    if given.held:
        return None
    T_m_b = block.trajectory.T_m_b[seen.exposures]
    noise = measuring_noise(seen, T_m_b, given)
    camera = given.cameras[0]
    px = camera.pixel_mm / camera.interior.f
    measured = px * _usual(block.image_points.sigma_px)
    units = [("image measurements", {"mm": 1 / camera.pixel_mm}, noise / measured, 0.0)]
    away = given.x_m[seen.point_idx] - T_m_b.r[seen.exposure_idx]
    range_m = float(np.nanmedian(np.linalg.norm(away, axis=1)))
    position = _usual(block.trajectory.sigma_position[seen.exposures]) / range_m
    attitude = _usual(block.trajectory.sigma_attitude[seen.exposures, :2])
    for quantity, known, sigma, other in (
        ("attitude", ANGLE_UNITS, attitude, position),
        ("position", LENGTH_UNITS, position, attitude),
    ):
        units.append((quantity, known, given.misfit / sigma, np.hypot(other, noise) / sigma))
    if ALONE_M[0] <= position * range_m <= ALONE_M[1]:
        _, _, misfit, rest = units.pop()
        units.append(("position", {SHARED: np.nan}, misfit, rest))
    return next((unit for row in units for unit in _right(*row)), None)


def _usual(sigma: Array) -> float:
    """Return the median of the standard deviations that are known, NaN for none."""
    known = sigma[np.isfinite(sigma)]
    return float(np.median(known)) if len(known) else np.nan


def _right(quantity: str, units: dict[str, float], misfit: float, rest: float) -> Iterator[Unit]:
    """Yield the units in which a misfit agrees with sigma.

    Parameters
    ----------
    quantity : str
    units : dict of str to float
        What a standard deviation must be multiplied by.
    misfit, rest : float
        In terms of sigma: the residuals, and the part of them that is expected of other
        observations.
    """
    before = misfit / np.hypot(1.0, rest)
    if not (before > OFF or before < 1 / OFF):
        return
    for unit, factor in units.items():
        if np.isnan(factor) and before < 1 / OFF:
            yield Unit(name=unit, quantity=quantity, given=before, found=np.nan)
        after = misfit / np.hypot(factor, rest)
        if 1 / RIGHT < after < RIGHT:
            name = f"sigma of {quantity} in {unit}"
            yield Unit(name=name, quantity=quantity, given=before, found=after)
