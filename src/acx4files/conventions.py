"""Usual readings of a flight's numbers: which sign, order, unit, frame or datum would fit better.

Most errors in direct georeferencing are a sign or an axis. One list of readings (`of_trajectory`
and its neighbours) serves two questions. `contradictions`: do surveyed points, projected with the
declared mounting, lie near their measurements at all? If not, the flight is refused with the
reading that mends it. `best_reading`: which reading makes the residuals fall? For each, the
mounting of the cameras of some images is adjusted on a trajectory assumed exact; the remaining
distance of rays from their points is the misfit of the reading. `acx4 check` calls it, and a
command that failed; no stage does.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import pyproj

from acx4lib.block import Block, ImagePoints
from acx4lib.design import strip_of_exposure
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import Camera, Interior, correct, correct_jacobian, xy_from_colrow
from acx4lib.geometry.collinearity import pinhole, pinhole_jacobian, rays, to_camera
from acx4lib.geometry.frames import (
    Pose,
    exp,
    log,
    opk_from_rotation,
    rph_from_rotation,
    skew,
    transform,
    turn,
)
from acx4lib.geometry.geodesy import GridSystem, MappingFrame
from acx4lib.geometry.intersection import intersect

Numbers = Mapping[str, Array]
"""The numeric columns of a trajectory, in either form."""


# --- The usual readings of trajectories, control and pixels, the simplest first


ANGLES = {
    "lat_deg": ("roll_deg", "pitch_deg", "heading_deg"),
    "east_m": ("omega_deg", "phi_deg", "kappa_deg"),
}
FOOT = 0.3048
"""International foot, m."""

SIGNS = sorted(product((1, -1), repeat=3), key=lambda signs: signs.count(-1))[1:]
"""Signs of three angles, those with the fewest changes first."""

EAST_NORTH = ("east_m", "north_m")


class Moves(NamedTuple):
    """What moves by numbers that are estimated with the mounting: a shift, a scale, a delay.

    Attributes
    ----------
    what : {"colrow", "x_m", "r"}
        Pixels, surveyed points or positions.
    by : ndarray, shape (n, 2 or 3, k)
        Per unit of each number.
    says : callable
        Returns the meaning from the numbers, each multiplied by its unit.
    units : tuple of float
    starts : tuple of float
        Numbers to begin with, of which the best is taken.
    """

    what: str
    by: Array
    says: Callable[..., str]
    units: tuple[float, ...]
    starts: tuple[float, ...] = (0.0,)

    def applied(
        self, sizes: Array, seen: Sightings, T_m_b: Pose, x_m: Array
    ) -> tuple[Sightings, Pose, Array]:
        """Return sightings, poses and points with the numbers applied."""
        shift = self.by @ sizes
        if self.what == "colrow":
            return replace(seen, colrow=seen.colrow + shift), T_m_b, x_m
        if self.what == "x_m":
            return seen, T_m_b, x_m + shift
        return seen, Pose(R=T_m_b.R, r=T_m_b.r + shift), x_m


STILL = Moves("r", np.zeros((1, 3, 0)), str, ())
"""Nothing moves."""


class Reading(NamedTuple):
    """A reading of a block.

    Attributes
    ----------
    table : {"trajectory", "control_points", "image_points", "mount", ""}
        Where the numbers stand.
    columns : tuple of str
        Columns that are read otherwise.
    meaning : str
        What they were, such as "of opposite sign".
    quantity : {"attitude", "position", "image"}
        Quantity that changes most.
    changed : mapping
        Columns of trajectory or control that change; of other tables, fields of the sightings.
    moves : Moves
    """

    table: str
    columns: tuple[str, ...]
    meaning: str
    quantity: str
    changed: Mapping[str, Any]
    moves: Moves = STILL

    @property
    def name(self) -> str:
        """Columns and meaning, as in "pitch of opposite sign"."""
        plain = ", ".join(re.sub("_(deg|m|px)$", "", column) for column in self.columns)
        of_control = " of control points" if self.table == "control_points" else ""
        return f"{plain}{of_control} {self.meaning}".strip()


def _stack(numbers: Numbers, names: Sequence[str]) -> Array:
    return np.stack([numbers[name] for name in names], axis=-1)


def _columns(names: Sequence[str], values: Array) -> dict[str, Array]:
    return dict(zip(names, values.T, strict=True))


def poses(numbers: Numbers, frame: MappingFrame) -> Pose:
    """Return the poses T_m_b of a trajectory in either form, one for every row."""
    angles = np.radians(_stack(numbers, _angles_of(numbers)))
    if "lat_deg" in numbers:
        at = _stack(numbers, ("lon_deg", "lat_deg", "height_m"))
        return frame.pose_from_geographic(at, angles)
    return frame.pose_from_grid(_stack(numbers, (*EAST_NORTH, "height_m")), angles)


def _angles_of(numbers: Numbers) -> tuple[str, str, str]:
    return ANGLES["lat_deg" if "lat_deg" in numbers else "east_m"]


def lonlat_of(numbers: Numbers, grid: GridSystem) -> Array:
    """Return longitude and latitude of a trajectory in either form, degrees, shape (n, 2)."""
    if "lat_deg" in numbers:
        return _stack(numbers, ("lon_deg", "lat_deg"))
    return grid.lonlat_from_grid(_stack(numbers, EAST_NORTH))


def of_positions(numbers: Numbers, grid: GridSystem) -> Iterator[Reading]:
    """Yield readings of the longitudes and latitudes, or east and north, of a trajectory."""
    if "lat_deg" not in numbers:
        for says, xy in _plane_readings(_stack(numbers, EAST_NORTH), grid):
            yield Reading("trajectory", EAST_NORTH, says, "position", _columns(EAST_NORTH, xy))
        return
    both = lat, lon = ("lat_deg", "lon_deg")
    given = _stack(numbers, both)
    for columns, says, values in (
        (both, "swapped", given[:, ::-1]),
        (both, "in radians", np.degrees(given)),
        ((lon,), "of opposite sign", given * [1, -1]),
        ((lat,), "of opposite sign", given * [-1, 1]),
        (both, "of opposite sign", -given),
    ):
        yield Reading("trajectory", columns, says, "position", _columns(both, values))


def of_trajectory(
    numbers: Numbers, grid: GridSystem, R_b_c: Array | None = None
) -> Iterator[Reading]:
    """Yield the usual readings of a trajectory's angles, heights and rows.

    Parameters
    ----------
    numbers : mapping
    grid : GridSystem
        Of the flight, for the convergence of its meridians and the heights of its geoid.
    R_b_c : ndarray, shape (3, 3), optional
        Of the only camera, whose angles those of a trajectory in the map may be.
    """
    names, lonlat = _angles_of(numbers), lonlat_of(numbers, grid)
    given = _stack(numbers, names)
    with np.errstate(all="ignore"):  # wrong positions may have no convergence
        convergence = np.nan_to_num(np.degrees(grid.convergence(lonlat)))[:, None]
    with_north = names[2] == "heading_deg"
    from_90 = "an angle from east" if with_north else "a heading from north"
    north = "from grid north" if with_north else "from true north"
    for places, says, angles in (
        *_of_angles(given),
        ((2,), from_90, np.array([0, 0, 90]) + given * [1, 1, -1]),
        ((2,), north, given + convergence * [0, 0, 1]),
        *_of_turns(given, R_b_c, with_north=with_north),
    ):
        columns = tuple(names[i] for i in places)
        yield Reading("trajectory", columns, says, "attitude", _columns(names, angles))
    for says, height in height_readings(numbers["height_m"], lonlat, grid):
        yield Reading("trajectory", ("height_m",), says, "position", {"height_m": height})
    n = np.arange(len(given))
    for step, says in ((1, "of the next row"), (-1, "of the previous row")):
        rows = np.clip(n + step, 0, len(n) - 1)
        other = {name: values[rows] for name, values in numbers.items() if name[:4] != "time"}
        yield Reading("trajectory", ("positions", "angles"), says, "position", other)


def _of_angles(given: Array) -> Iterator[tuple[tuple[int, ...], str, Array]]:
    """Yield places that change, what they were, and three angles in degrees, shape (n, 3)."""
    for signs in SIGNS:
        yield tuple(i for i in range(3) if signs[i] < 0), "of opposite sign", given * signs
    for added, says in ((90, "90 degrees too small"), (180, "180 degrees too small")):
        yield (2,), says, np.array([0, 0, added]) + given
    yield (2,), "90 degrees too large", np.array([0, 0, -90]) + given
    crossed = given[:, [1, 0, 2]]
    yield (0, 1), "exchanged", crossed
    yield (0, 1), "exchanged, then the first of opposite sign", crossed * [-1, 1, 1]
    yield (0, 1), "exchanged, then the second of opposite sign", crossed * [1, -1, 1]
    yield (0, 1), "exchanged, then both of opposite sign", crossed * [-1, -1, 1]
    yield (0, 2), "exchanged", given[:, [2, 1, 0]]
    yield (1, 2), "exchanged", given[:, [0, 2, 1]]
    for places in ((0, 1, 2), (0, 1), (2,)):
        for unit, degrees in (("radians", 180 / np.pi), ("gon", 0.9)):
            yield places, f"in {unit}", given * np.where(np.isin(range(3), places), degrees, 1.0)


def _of_turns(
    given: Array, R_b_c: Array | None, *, with_north: bool
) -> Iterator[tuple[tuple[int, ...], str, Array]]:
    """Yield the same for turns in another order, transposed, or of the camera."""
    R1, R2, R3 = (turn(axis, np.radians(given[:, axis])) for axis in range(3))
    if with_north:
        angles_from = rph_from_rotation
        turned = {
            "in the order pitch before roll": R3 @ R1 @ R2,
            "in the order roll, pitch, heading": R1 @ R2 @ R3,
            "of the transposed rotation (heading, pitch, roll)": np.swapaxes(R3 @ R2 @ R1, 1, 2),
        }
    else:
        angles_from = opk_from_rotation
        turned = {
            "in the order phi, omega, kappa": R2 @ R1 @ R3,
            "in the order kappa, phi, omega": R3 @ R2 @ R1,
            "of the transposed rotation (omega, phi, kappa)": np.swapaxes(R1 @ R2 @ R3, 1, 2),
        }
        if R_b_c is not None:
            turned["of the camera, not of the body"] = R1 @ R2 @ R3 @ R_b_c.T
        yield (0, 1, 2), "of a body with z down", np.array([180, 0, 0]) + given * [1, -1, -1]
    for says, R in turned.items():
        yield (0, 1, 2), says, np.degrees(angles_from(R))


def height_readings(height: Array, lonlat: Array, grid: GridSystem) -> Iterator[tuple[str, Array]]:
    """Yield other readings of heights: meaning, and heights in m.

    Parameters
    ----------
    height : ndarray, shape (n,)
        As they are given, m.
    lonlat : ndarray, shape (n, 2)
        Degrees.
    grid : GridSystem
    """
    yield "in feet", height * FOOT
    undulation = grid.undulation(lonlat)
    if np.any(undulation != 0):
        yield "above the ellipsoid", height - undulation


def pixel_readings(
    colrow: Array, size: Array, pixel_mm: Array
) -> Iterator[tuple[tuple[str, ...], str, Array]]:
    """Yield other readings of image measurements: columns, their meaning, pixels.

    Half a pixel is not among them: no measurement tells it from the principal point.

    Parameters
    ----------
    colrow : ndarray, shape (n, 2)
        As they are given.
    size : ndarray, shape (n, 2)
        Width and height of the image of each, px.
    pixel_mm : ndarray, shape (n, 1)
    """
    (col, row), (right, bottom) = colrow.T, (size - 1 - colrow).T
    both = ("col_px", "row_px")
    yield both[1:], "counted from the bottom", np.column_stack([col, bottom])
    yield both[:1], "counted from the right", np.column_stack([right, row])
    yield both, "exchanged", np.column_stack([row, col])
    yield both, "in mm from the middle", (size - 1) / 2 + colrow / pixel_mm * [1, -1]
    yield both, "in mm from the corner", colrow / pixel_mm - 0.5


def _plane_readings(xy: Array, grid: GridSystem) -> Iterator[tuple[str, Array]]:
    """Yield other readings of east and north: meaning, and values, shape (n, 2)."""
    yield "swapped", xy[:, ::-1]
    crs = None if grid.is_local else pyproj.CRS.from_user_input(grid.crs)
    if crs is None or crs.utm_zone is None or crs.ellipsoid is None:
        return
    here, axes = crs.utm_zone, crs.ellipsoid
    for zone in range(max(1, int(here[:-1]) - 2), min(60, int(here[:-1]) + 2) + 1):
        for hemisphere, south in (("N", ""), ("S", " +south")):
            ellipsoid = f"+a={axes.semi_major_metre!r} +b={axes.semi_minor_metre!r}"
            other = pyproj.Proj(f"+proj=utm +zone={zone}{south} {ellipsoid}")
            lonlat = np.stack(other(xy[:, 0], xy[:, 1], inverse=True), axis=-1)
            if f"{zone}{hemisphere}" != here and np.isfinite(lonlat).all():
                yield f"of UTM zone {zone}{hemisphere}", grid.grid_from_lonlat(lonlat)


# --- The readings of a block: some of its measurements, and the poses of the body


@dataclass(frozen=True, eq=False)
class _Case:
    """What readings are made of: sightings, poses, and the numbers of the tables behind them.

    `rows` are those of the exposures in `numbers`; `control` are the columns of the surveyed points
    of the sightings, which are `known`.
    """

    frame: MappingFrame
    seen: Sightings
    T_m_b: Pose
    numbers: Numbers
    rows: Index
    known: Mask
    control: Numbers

    def tried(self, readings: Iterable[Reading]) -> Iterator[tuple[Reading, Sightings, Pose]]:
        """Yield readings with their sightings and poses, if these are on the earth."""
        for reading in readings:
            seen, T_m_b, values = self.seen, self.T_m_b, reading.changed
            with np.errstate(all="ignore"):
                if reading.table == "trajectory":
                    numbers = {**self.numbers, **values}
                    T_m_b = poses({n: v[self.rows] for n, v in numbers.items()}, self.frame)
                elif reading.table == "control_points":
                    x_m = seen.x_m.copy()
                    enh = _stack({**self.control, **values}, (*EAST_NORTH, "height_m"))
                    x_m[self.known] = self.frame.from_grid(enh)
                    seen = replace(seen, x_m=x_m)
                else:
                    seen = replace(seen, **values)
            if all(np.isfinite(x).all() for x in (T_m_b.r, T_m_b.R, seen.x_m[self.known])):
                yield reading, seen, T_m_b


def _case(block: Block, trajectory: Any, seen: Sightings, enh: Array | None = None) -> _Case:
    """Return the case of some sightings."""
    place = {name: row for row, name in enumerate(trajectory.text["exposure"])}
    rows = np.array([place[block.trajectory.exposures[i]] for i in seen.exposures], dtype=np.intp)
    known = np.isfinite(seen.x_m[:, 0])
    given = block.frame.to_grid(seen.x_m[known]) if enh is None else enh[known]
    T_m_b = block.trajectory.T_m_b[seen.exposures]
    control = _columns((*EAST_NORTH, "height_m"), given)
    return _Case(block.frame, seen, T_m_b, trajectory.numbers, rows, known, control)


def _readings(case: _Case, *, turned: bool = False) -> Iterator[Reading]:
    """Yield the usual readings of a block, the simplest first; cameras turned, too, if asked."""
    grid, cameras = case.frame.grid, case.seen.cameras
    if case.known.any():
        xy, height = _stack(case.control, EAST_NORTH), case.control["height_m"]
        for says, other in height_readings(height, grid.lonlat_from_grid(xy), grid):
            yield Reading("control_points", ("height_m",), says, "position", {"height_m": other})
        for says, other in _plane_readings(xy, grid):
            values = _columns(EAST_NORTH, other)
            yield Reading("control_points", EAST_NORTH, says, "position", values)
    yield from of_positions(case.numbers, grid)
    if turned:
        yield from _turned_cameras(case)
    R_b_c = cameras[0].T_b_c.R if len(cameras) == 1 else None
    yield from of_trajectory(case.numbers, grid, R_b_c)
    yield from _of_pixels(case)


def _of_pixels(case: _Case) -> Iterator[Reading]:
    seen, size, ahead = case.seen, _sizes(case.seen), case.T_m_b.R[:, :2, 0]
    pixel_mm = np.array([[c.pixel_mm] for c in seen.cameras])[seen.camera_idx]
    for columns, says, colrow in pixel_readings(seen.colrow, size, pixel_mm):
        yield Reading("image_points", columns, says, "image", {"colrow": colrow})
    against = (ahead @ ahead[0] < 0)[seen.exposure_idx]
    for back in (against, ~against) if 0 < against.mean() < 1 else ():
        says = "of strips in one direction turned by 180 degrees (shown north up)"
        colrow = np.where(back[:, None], size - 1 - seen.colrow, seen.colrow)
        yield Reading("image_points", ("col_px", "row_px"), says, "image", {"colrow": colrow})


def _sizes(seen: Sightings) -> Array:
    """Return width and height of the image of every measurement, px, shape (n, 2)."""
    return np.array([[c.width_px, c.height_px] for c in seen.cameras])[seen.camera_idx]


def _numbered(block: Block, seen: Sightings, T_m_b: Pose) -> Iterator[Reading]:
    """Yield the readings with numbers that are estimated."""
    velocity, surveyed = _velocities(block, seen), np.isfinite(seen.x_m[:, 0])
    from_middle = (seen.colrow - (_sizes(seen) - 1) / 2)[:, :, None]
    moves = []
    if velocity is not None:
        moves.append(Moves("r", velocity[:, :, None], _delayed, (1.0,)))
    if surveyed.sum() >= 4:
        shift = np.where(surveyed[:, None, None], np.eye(3), 0.0)
        scale = np.nan_to_num(seen.x_m - np.nanmean(seen.x_m, axis=0))[:, :, None]
        says = "control points moved by {:+.2f} m east and {:+.2f} m north, as from another epoch,"
        moves.append(Moves("x_m", shift[:, :, :2], says.format, (1.0, 1.0)))
        says = "control points moved by {:+.1f} m in height, as from another height system,"
        moves.append(Moves("x_m", shift[:, :, 2:], says.format, (1.0,)))
        says = "control points scaled by {:+.0f} ppm, as from the ground to the grid,"
        moves.append(Moves("x_m", scale * [[1], [1], [0]], says.format, (1e6,)))
    says = "image coordinates scaled by about {:+.0f} %, as by another focal_mm or pixel_um,"
    scales = (0.0, -0.4, -0.2, 0.2, 0.4)  # steps do not lead from one to another
    moves.append(Moves("colrow", from_middle, says.format, (100.0,), scales))
    says = "pixels that are {:+.2f} % wider than high"
    moves.append(Moves("colrow", from_middle * [[1], [0]], says.format, (100.0,)))
    if velocity is not None:
        px = np.array([c.interior.f / c.pixel_mm for c in seen.cameras])[seen.camera_idx]
        by_x = px[:, None, None] * _linear(seen, T_m_b, started(seen, T_m_b))[2]
        moved = by_x @ velocity[seen.exposure_idx][:, :, None] * [[1], [-1]]
        by = moved * from_middle[:, 1:] / _sizes(seen)[:, 1:, None]
        says = "rows read out one after the other, a rolling shutter of {:+.0f} ms,"
        moves.append(Moves("colrow", by, says.format, (-1000.0,)))
    for one in moves:
        yield Reading("", (), "", "image" if one.what == "colrow" else "position", {}, one)


def _delayed(delay_s: float) -> str:
    return f"positions recorded {abs(delay_s):.2g} s {'late' if delay_s < 0 else 'early'}"


def _velocities(block: Block, seen: Sightings) -> Array | None:
    """Return the velocity of every exposure in use, m/s, shape (n, 3); None without times."""
    time_s = block.trajectory.time_s
    if len(time_s) < len(block.trajectory) or not np.isfinite(time_s).all():
        return None
    velocity, strips = np.zeros((len(time_s), 3)), np.array(strip_of_exposure(block), dtype=object)
    for strip in dict.fromkeys(strips):
        rows = np.flatnonzero(strips == strip)
        if len(rows) > 1 and np.all(np.diff(time_s[rows]) > 0):
            velocity[rows] = np.gradient(block.trajectory.T_m_b.r[rows], time_s[rows], axis=0)
    return velocity[seen.exposures] if np.any(velocity) else None


# --- Whether surveyed points project near their measurements, and the likely mistake if not
#
# With the approximate mounting and the trajectory they must. Half of the strips may be wrong and
# the median good (headings of 0 and 180 degrees in radians), so a usual mistake that explains the
# worse half is reported as well.


MOST = 0.75
"""Quantile of the distances that must be within the limit after a mistake is undone."""


class Contradiction(NamedTuple):
    """A sentence on surveyed points that do not fit, and where the likely mistake is.

    `table` is that of a block, or "mount" for the angles of a camera in flight.toml.
    """

    table: str
    column: str
    camera: str
    found: str
    expected: str


def misses(block: Block) -> tuple[Sightings, Array]:
    """Return the measurements of all surveyed points, and how far unadjusted points are from them.

    Returns
    -------
    seen : Sightings
    ratio : ndarray, shape (n,)
        In quarters of the image diagonal; infinite behind the camera.
    """
    x_m = _surveyed(block)
    known = np.isfinite(x_m[block.image_points.point_idx, 0])
    seen = _sightings_of(block, block.image_points[known], x_m)
    return seen, _ratio(seen, block.trajectory.T_m_b[seen.exposures])


def _ratio(seen: Sightings, T_m_b: Pose) -> Array:
    with np.errstate(all="ignore"):
        v = _residuals(seen, T_m_b, seen.x_m, seen.cameras)
    quarter = [c.diagonal_px * c.pixel_mm / (4 * c.interior.f) for c in seen.cameras]
    ratio = np.linalg.norm(v, axis=1) / np.array(quarter)[seen.camera_idx]
    return np.nan_to_num(ratio, nan=np.inf)


def contradictions(
    block: Block, trajectory: Any, enh: Array, files: Mapping[str, str]
) -> Iterator[Contradiction]:
    """Yield a problem where the median distance exceeds a quarter of the image diagonal.

    Parameters
    ----------
    block : Block
    trajectory : acx4files.flight.tables.Table
        Of the block.
    enh : ndarray, shape (n_points, 3)
        East, north and height of the surveyed points as they were given; NaN for tie points.
    files : mapping of str to str
        Names of the tables ``trajectory``, ``control_points`` and ``image_points``.
    """
    seen, ratio = misses(block)
    if not len(seen):
        return
    mine = {k: seen.camera_idx == k for k in range(len(block.cameras))}
    judged = [k for k, rows in mine.items() if rows.sum() >= 3]  # enough to judge a camera
    wrong = [k for k in judged if _upper(ratio[mine[k]], 0.5) > 1]
    if wrong and len(wrong) < len(judged):
        for k in wrong:
            case = _part(block, trajectory, enh, mine[k])
            yield _explained(block, case, files, ratio[mine[k]], only=k)
    elif _upper(ratio, MOST) > 1:
        found = _explained(block, _part(block, trajectory, enh, ratio >= 0), files, ratio)
        if found.table or _upper(ratio, 0.5) > 1:
            yield found if found.table else found._replace(table="control_points")


def _part(block: Block, trajectory: Any, enh: Array, chosen: Mask) -> _Case:
    """Return the case of the chosen measurements of surveyed points, or of every so many."""
    x_m, most = _surveyed(block), 5000
    measured = np.flatnonzero(np.isfinite(x_m[block.image_points.point_idx, 0]))[chosen]
    rows = measured[:: -(-len(measured) // most)]
    seen = _sightings_of(block, block.image_points[rows], x_m)
    return _case(block, trajectory, seen, enh[seen.points])


def _upper(values: Array, quantile: float) -> float:
    return float(np.quantile(values, quantile, method="higher"))


def _explained(
    block: Block,
    case: _Case,
    files: Mapping[str, str],
    ratio: Array,
    only: int | None = None,
) -> Contradiction:
    """Return the sentence on a block, or on one of its cameras; no table if nothing explains it."""
    of = slice(None) if only is None else slice(only, only + 1)
    camera = block.cameras[of][0].name
    allowed = float(np.median([c.diagonal_px / 4 for c in block.cameras]))
    median = float(np.median(ratio)) * allowed
    place = f"{median:.0f} px from their measurements" if median < np.inf else "behind the camera"
    found = (
        f"control points{'' if only is None else f' in images of {camera}'} lie {place} (median; "
        f"{int((ratio > 1).sum())} of {len(ratio)} too far) with the trajectory of "
        f"{files['trajectory']} and the points of {files['control_points']}; "
    )
    table, column = ("", "east_m") if only is None else ("mount", "mount_kappa_deg")
    readings = _readings(case, turned=True) if only is None else _turned_cameras(case)
    after = [(reading, _ratio(seen, T_m_b)) for reading, seen, T_m_b in case.tried(readings)]
    mended = [(r, own) for r, own in after if _upper(own, MOST) < 1]
    if not mended:
        found += _whereabouts(block) if only is None else "no turn of its axes explains it"
    else:
        best, own = mended[_alike([_upper(own, MOST) for _, own in mended])[0]]
        table, column = best.table, best.columns[0 if best.quantity == "position" else -1]
        if table == "mount":
            says = _turned_axes(block.cameras[of], best.changed["cameras"][of])
        else:
            columns = ", ".join(best.columns).replace("east_m, north_m", "east_m and north_m")
            says = f"{columns} were {best.meaning} in {files[table]}"
        found += f"it looks as if {says} (then {np.median(own) * allowed:.0f} px)"
    column = column if column != "positions" else "exposure"
    expected = f"must be below {allowed:.0f} px, a quarter of the image diagonal"
    return Contradiction(table, column, camera, found, expected)


def _turned_cameras(case: _Case) -> Iterator[Reading]:
    """Yield the block with its cameras turned onto the surveyed points, if that explains much."""
    with np.errstate(all="ignore"):
        seen = replace(case.seen, cameras=started(case.seen, case.T_m_b).cameras)
    if _upper(_ratio(seen, case.T_m_b), MOST) < 0.5:  # turned cameras bring any far points near
        cameras = {"cameras": seen.cameras}
        yield Reading("mount", ("mount_kappa_deg",), "", "attitude", cameras)


def _turned_axes(declared: Sequence[Camera], cameras: Sequence[Camera]) -> str:
    """Return the end of a sentence on the mounting angles that fit."""
    turned = np.degrees(log(declared[0].T_b_c.R.T @ cameras[0].T_b_c.R))
    axis = int(np.argmax(np.abs(turned)))
    by = f" by {(turned[axis] + 179.5) % 360 - 179.5:.0f} degrees about {'xyz'[axis]}"
    by = by if abs(turned[axis]) > 0.98 * np.linalg.norm(turned) else ""
    opk = {camera.name: np.round(np.degrees(camera.T_b_c.opk)) + 0.0 for camera in cameras}
    listed = [f"{name} {o:.0f}, {p:.0f}, {k:.0f}" for name, (o, p, k) in opk.items()]
    body = len(cameras) == 1 and np.allclose(cameras[0].T_b_c.R, np.eye(3), atol=np.radians(3.0))
    of_camera = ", or the angles are of the camera, not of the body" if body else ""
    return (
        f"the camera axes were turned{by}: mount_omega_deg, mount_phi_deg, mount_kappa_deg of "
        f"{'; '.join(listed)} would fit{of_camera}"
    )


def _whereabouts(block: Block) -> str:
    """Return a sentence on the distance between control and exposures, to find the mistake."""
    surveyed = np.concatenate([block.control.x_m, block.check.x_m])
    shift = surveyed.mean(axis=0) - block.trajectory.T_m_b.r.mean(axis=0)
    grid = block.frame.grid
    doubt = np.hypot(*shift[:2]) > 50_000.0 and not grid.is_local  # only another CRS explains it
    return (
        "no usual mistake explains it; the control points' middle lies "
        f"{shift[0]:.0f} m east, {shift[1]:.0f} m north and {shift[2]:.0f} m up of the exposures'"
        + (f" (is {grid.crs} the right CRS?)" if doubt else "")
    )


# --- Readings of a flight that is not refused, compared by an adjustment


class Found(NamedTuple):
    """A reading with a much smaller misfit than the given reading.

    Attributes
    ----------
    name : str
        The change, such as "pitch of opposite sign".
    quantity : str
        Quantity of the residuals.
    given, found : float
        Robust residuals of the given and of this reading. `found` is NaN where the name alone
        explains them.
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
        """A sentence on the reading, with its residuals and those of the given reading."""
        of, given, found = f"the residuals of {self.quantity}", self.given, self.found
        if not np.isfinite(given):
            says = f"with {self.name} {of} are {_shown(found, self.unit)}"
            return f"{says}; as the numbers are, rays do not meet"
        if not np.isfinite(found):
            return f"{of} are {_shown(given, self.unit)}: {self.name}"
        change = "fall" if found < given else "rise"
        numbers = f"from {_shown(given, self.unit)} to {_shown(found, self.unit)}"
        return f"with {self.name} {of} {change} {numbers}"


def _shown(value: float, unit: str) -> str:
    number = f"{value:.2g}" if value < 100 else f"{value:.0f}"
    return f"{number}{unit}" if unit == "°" else f"{number} {unit}"


_Fit = tuple["Mounted", "Reading", "Sightings", Pose]


def best_reading(flight: Any, block_name: str) -> Found | None:
    """Return the reading of a block with a much smaller misfit than the given one; or None.

    Every usual reading of trajectory, control and image measurements is tried on at most sixty
    images. Mounting and interior orientation are estimated in each. They absorb some errors, such
    as a delay at one speed: these are not found. The principal point absorbs half a pixel.

    Parameters
    ----------
    flight : acx4files.flight.Flight
    block_name : str

    Raises
    ------
    FlightError
        Where the flight has no such block.
    """
    block = flight.block(block_name)
    seen = sightings(block)
    if seen is None:
        return None
    with np.errstate(all="ignore"):  # readings may be absurd
        case = _case(block, flight.trajectories[block_name], seen)
        given = mounted(seen, case.T_m_b)
        sigma = np.linalg.norm(list(stated(block, seen, given).values()))
        as_stated = 1 / OFF < given.misfit / sigma < 1.4  # then only half of it is looked for
        tried = [*case.tried(_readings(case))]
        misfits = [started(others, T_m_b).misfit for _, others, T_m_b in tried]
        promising = (0.5 if as_stated else 1.1) * started(seen, case.T_m_b).misfit
        limit = min(promising, max(sorted(misfits)[:12], default=0.0))
        fits = [
            (mounted(others, T_m_b), reading, others, T_m_b)
            for (reading, others, T_m_b), misfit in zip(tried, misfits, strict=True)
            if misfit <= limit
        ]
        if np.isfinite(given.misfit) and not as_stated:
            numbered = _numbered(block, seen, case.T_m_b)
            fitted = [(mounted(seen, case.T_m_b, r.moves), r, seen, case.T_m_b) for r in numbered]
            fits += sorted(fitted, key=lambda fit: fit[0].misfit)
        return _best(fits, given, seen) or other_unit(block, seen, given)


def notes(flight: Any) -> Iterator[str]:
    """Yield a sentence for every block of a `Flight` that another reading fits much better."""
    for name in flight.blocks:
        reading = best_reading(flight, name)
        if reading is not None:
            yield f"{name}: {reading.sentence}"


def _alike(misfits: Sequence[float]) -> Index:
    """Return the places of those about as good as the best, the simplest first."""
    return np.flatnonzero(np.array(misfits) <= 1.25 * min(misfits, default=0.0))


def _best(fits: list[_Fit], given: Mounted, seen: Sightings) -> Found | None:
    """Return the simplest of the best readings, if much better than the given reading."""
    camera, n = seen.cameras[0], len(seen.exposures)
    floor = 0.25 * camera.pixel_mm / camera.interior.f  # misfit that no reading can explain
    # Every exposure has two independent components of attitude or more, and the quantile of the
    # misfit needs about twice the data that a standard deviation needs: n exposures are worth n
    # degrees of freedom, and the logarithm of a ratio of two misfits has the standard deviation
    # 1 / sqrt(n). There are a hundred readings, but only seven with an estimated number.
    good = []
    for fit in fits:
        least, certain = (2.0, 5.0) if fit[1].moves is STILL else (1.5, 2.5)
        better = max(least, np.exp(certain / np.sqrt(n)))
        if better * (fit[0].misfit + floor) < given.misfit + floor:
            good.append(fit)
    alike = [good[i] for i in _alike([fit.misfit + floor for fit, *_ in good])]
    near = [fit for fit in alike if _turn(fit[0], seen) < np.radians(15.0)]
    return next((_found(given, *fit) for fit in near or alike), None)


def _turn(fit: Mounted, seen: Sightings) -> float:
    """Return the largest turn of a camera from its declared boresight, radians."""
    pairs = zip(fit.cameras, seen.cameras, strict=True)
    return max(float(np.linalg.norm(log(old.T_b_c.R.T @ new.T_b_c.R))) for new, old in pairs)


def _found(given: Mounted, fit: Mounted, reading: Reading, seen: Sightings, T_m_b: Pose) -> Found:
    """Return a reading with its misfits, as errors of attitude, position or measurement."""
    camera, moves = fit.cameras[0], reading.moves
    if moves is not STILL:
        reading = reading._replace(meaning=moves.says(*np.multiply(moves.units, fit.sizes)))
    scale, unit, quantity = {
        "attitude": (np.degrees(1.0), "°", "attitude"),
        "position": (_range_m(seen, T_m_b, fit), "m", "position"),
        "image": (camera.interior.f / camera.pixel_mm, "px", "image measurements"),
    }[reading.quantity]
    return Found(reading.name, quantity, given.misfit * scale, fit.misfit * scale, unit)


def _range_m(seen: Sightings, T_m_b: Pose, fit: Mounted) -> float:
    """Return the median distance of points from the body, m."""
    rays_m = fit.x_m[seen.point_idx] - T_m_b.r[seen.exposure_idx]
    return float(np.nanmedian(np.linalg.norm(rays_m, axis=1)))


# --- Standard deviations in another unit: ratios of residuals to sigma


OFF = 2.0
"""Ratio of residuals to sigma, or its inverse, from which another unit is looked for."""

RIGHT = 1.6
"""The same within which a unit is right: neighbouring units differ by ten and more."""

ANGLE_UNITS = {"seconds of arc": 1 / 3600, "minutes of arc": 1 / 60, "radians": 180 / np.pi}

SHARED = (
    "this sigma is rather that of an error which neighbouring exposures share, as of a receiver "
    "without corrections; gnss in flight.toml makes a common shift an unknown"
)
"""Text in place of another unit: such an error leaves small residuals."""


def stated(block: Block, seen: Sightings, given: Mounted) -> dict[str, float]:
    """Return the standard deviations that a block states, as angles at the camera, radians.

    Medians, of ``image measurements``, ``attitude`` and ``position``; NaN where none is stated.
    """
    camera, trajectory, rows = given.cameras[0], block.trajectory, seen.exposures
    range_m = _range_m(seen, trajectory.T_m_b[rows], given)
    sigma_px = _usual(block.image_points.sigma_px)
    return {
        "image measurements": sigma_px * camera.pixel_mm / camera.interior.f,
        "attitude": _usual(trajectory.sigma_attitude[rows, :2]),
        "position": _usual(trajectory.sigma_position[rows]) / range_m,
    }


def other_unit(block: Block, seen: Sightings, given: Mounted) -> Found | None:
    """Return the unit in which standard deviations agree with residuals; None if they already do.

    None, too, where no plausible mounting fits: residuals are no errors of observation then.

    Parameters
    ----------
    block : Block
    seen : Sightings
        Of this block.
    given : Mounted
        The fit of the block as given.

    Returns
    -------
    Found or None
        Its name is as "sigma of attitude in seconds of arc", or `SHARED`.
    """
    if given.held:
        return None
    T_m_b, camera = block.trajectory.T_m_b[seen.exposures], given.cameras[0]
    noise, sigmas = measuring_noise(seen, T_m_b, given), stated(block, seen, given)
    # A receiver without corrections states half a metre to fifteen.
    alone = 0.5 <= sigmas["position"] * _range_m(seen, T_m_b, given) <= 15.0
    lengths = {} if alone else {"mm": 1e-3, "cm": 1e-2}
    for quantity, units, misfit, others in (
        ("image measurements", {"mm": 1 / camera.pixel_mm}, noise, 0.0),
        ("attitude", ANGLE_UNITS, given.misfit, np.hypot(sigmas["position"], noise)),
        ("position", lengths, given.misfit, np.hypot(sigmas["attitude"], noise)),
    ):
        sigma = sigmas[quantity]
        before = misfit / np.hypot(sigma, others)
        if alone and quantity == "position" and before < 1 / OFF:
            return Found(SHARED, quantity, before, np.nan, "σ")
        for unit, factor in units.items() if before > OFF or before < 1 / OFF else ():
            after = misfit / np.hypot(factor * sigma, others)
            if 1 / RIGHT < after < RIGHT:
                return Found(f"sigma of {quantity} in {unit}", quantity, before, after, "σ")
    return None


def _usual(sigma: Array) -> float:
    """Return the median of the standard deviations that are known, NaN for none."""
    known = sigma[np.isfinite(sigma)]
    return float(np.median(known)) if len(known) else np.nan


# --- Robust adjustment of the cameras' mountings on a trajectory assumed exact: eq. (14)
#
# The purpose is only to compare misfits, so errors of GNSS and INS remain in them. Mounting and
# interior orientation are free within plausible limits: they absorb the same errors as in a real
# adjustment.


N_MOUNT, N_LENS = 6, 8
N_CAMERA = N_MOUNT + N_LENS
"""Columns of a camera: turn, lever arm, then f, xp, yp, k1, k2, k3, p1, p2."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Mounted:
    """Cameras that fit a trajectory best.

    Attributes
    ----------
    cameras : tuple of Camera
        With their interior orientation and mounting.
    x_m : ndarray, shape (n_points, 3)
        Points, m.
    sizes : ndarray, shape (k,)
        Numbers that were estimated with them.
    misfit : float
        Angle by which rays miss their points, per component, robustly; radians. Infinite where
        most points lie behind the cameras.
    held : bool
        Whether lever arms and focal lengths are held as declared, since no plausible ones fit.
    """

    cameras: tuple[Camera, ...]
    x_m: Array
    sizes: Array = field(default_factory=lambda: np.zeros(0))
    misfit: float = np.inf
    held: bool = False


def mounted(seen: Sightings, T_m_b: Pose, moves: Moves = STILL) -> Mounted:
    """Return the mountings and interior orientations that fit a trajectory best.

    Parameters
    ----------
    seen : Sightings
    T_m_b : Pose
        One per exposure.
    moves : Moves, optional
        With numbers to be estimated.
    """
    starts = []
    for value in moves.starts:
        sizes = np.full(len(moves.units), value)
        other, moved, x_m = moves.applied(sizes, seen, T_m_b, seen.x_m)
        starts.append(replace(started(replace(other, x_m=x_m), moved), sizes=sizes))
    start = min(starts, key=lambda state: state.misfit)
    fit = _adjusted(seen, T_m_b, start, moves)
    plausible = all(
        np.linalg.norm(camera.T_b_c.r - declared.T_b_c.r) < 10.0
        and abs(camera.interior.f / declared.interior.f - 1) < 0.02
        for camera, declared in zip(fit.cameras, seen.cameras, strict=True)
    )
    return fit if plausible else _adjusted(seen, T_m_b, replace(start, held=True), moves)


def started(seen: Sightings, T_m_b: Pose) -> Mounted:
    """Return the cameras turned onto surveyed points, and tie points where their rays meet.

    Quick, in closed form; lever arms and interior orientations are as declared.

    Parameters
    ----------
    seen : Sightings
    T_m_b : Pose
        One per exposure.
    """
    body, ahead = T_m_b[seen.exposure_idx], Pose(R=np.eye(3), r=np.zeros(3))
    ray_c, cameras = np.empty((len(seen), 3)), list(seen.cameras)
    for k, camera in enumerate(cameras):
        mine = seen.camera_idx == k
        ray_c[mine] = rays(camera, ahead, seen.colrow[mine])
        rows = np.flatnonzero(mine & np.isfinite(seen.x_m[seen.point_idx, 0]))
        if len(rows) < 3:
            continue
        targets = to_camera(body[rows], seen.x_m[seen.point_idx[rows]]) - camera.T_b_c.r
        targets /= np.linalg.norm(targets, axis=1, keepdims=True)
        R_b_c = _turned(camera.T_b_c.R, ray_c[rows], targets)
        cameras[k] = replace(camera, T_b_c=Pose(R=R_b_c, r=camera.T_b_c.r))
    x_m = seen.x_m.copy()
    ties = np.isnan(x_m[:, 0])
    if ties.any():
        R_b_c = np.stack([camera.T_b_c.R for camera in cameras])[seen.camera_idx]
        met = intersect(body.r, transform(body.R @ R_b_c, ray_c), seen.point_idx, len(x_m))
        x_m[ties] = met[ties]
    start = Mounted(cameras=tuple(cameras), x_m=x_m)
    return replace(start, misfit=size(_residuals(seen, T_m_b, x_m, start.cameras)))


def _turned(R_b_c: Array, ray_c: Array, to_b: Array) -> Array:
    """Return the rotation with the least sum of chords between rays and directions.

    Kabsch's rotation, reweighted by the chords, as in `bundle.start.start_values`.
    """
    weight = np.ones(len(ray_c))
    for _ in range(8):
        before = R_b_c
        U, _, Vt = np.linalg.svd((to_b * weight[:, None]).T @ ray_c)
        R_b_c = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
        if np.abs(R_b_c - before).max() < 1e-6:
            break
        chord = to_b - ray_c @ R_b_c.T
        weight = 1 / np.maximum(np.sqrt(np.einsum("ni,ni->n", chord, chord)), 1e-4)
    return R_b_c


def _adjusted(seen: Sightings, T_m_b: Pose, start: Mounted, moves: Moves) -> Mounted:
    """Return the robust adjustment from a start."""
    prior = _prior_sigma(seen.cameras, held=start.held)
    prior = np.concatenate([prior, np.full(len(moves.units), np.inf)])
    best = state = replace(start, misfit=np.inf)
    for _ in range(12):
        v, A, B = _linear(seen, T_m_b, state, moves)
        misfit = size(v)
        state = replace(state, misfit=misfit)
        settled = misfit > 0.997 * best.misfit
        best = state if misfit < best.misfit else best
        if settled or not np.isfinite(misfit):
            break
        try:
            dx, x_m = _step(seen, state, (v, A, B), prior)
        except np.linalg.LinAlgError:  # a point that nearly parallel rays leave open
            break
        if not np.all(np.isfinite(dx)):
            break
        state = _moved(state, dx, x_m)
    return best


def size(v: Array) -> float:
    """Return the robust size of residuals in two components, per component.

    Parameters
    ----------
    v : ndarray, shape (n, 2)
        Radians; NaN counts as infinite.
    """
    u = np.nan_to_num(np.abs(v), nan=np.inf)
    # The third quartile of the absolute values of a normal distribution is 1.1503.
    each = np.quantile(u, 0.75, axis=0, method="higher") / 1.1503
    return float(np.sqrt(np.mean(each**2)))


def measuring_noise(seen: Sightings, T_m_b: Pose, found: Mounted) -> float:
    """Return the misfit of rays with a free pose for every exposure: the measuring noise.

    Returns
    -------
    float
        Standard deviation of a component, median of the exposures, radians; NaN where none has
        measurements enough.
    """
    v, A, B = _linear(seen, T_m_b, found)
    ok = np.all(np.isfinite(v), axis=1)
    variances, free_pose = [], 6
    for exposure in range(len(T_m_b)):
        rows = np.flatnonzero(ok & (seen.exposure_idx == exposure))
        cameras = np.unique(seen.camera_idx[rows])
        if 2 * len(rows) < free_pose + 4 or len(cameras) != 1:
            continue
        c = N_CAMERA * int(cameras[0])
        J = np.concatenate([A[rows, :, c : c + 3], B[rows]], axis=2).reshape(-1, free_pose)
        residuals = v[rows].ravel() - J @ np.linalg.lstsq(J, v[rows].ravel(), rcond=None)[0]
        variances.append(residuals @ residuals / (len(residuals) - free_pose))
    return float(np.sqrt(np.median(variances))) if variances else np.nan


def _prior_sigma(cameras: tuple[Camera, ...], *, held: bool) -> Array:
    """Return prior standard deviations of the cameras' unknowns, tiny for held unknowns."""
    out: list[float] = []
    for camera in cameras:
        f, r = camera.interior.f, 0.5 * camera.diagonal_px * camera.pixel_mm
        lens = [0.01 / r**2, 0.01 / r**4, 0.01 / r**6, 0.002 / r, 0.002 / r]
        lever, focal = (1e-6, 1e-6) if held else (1.0, 0.01 * f)
        out += [*[np.inf] * 3, *[lever] * 3, focal, 0.005 * f, 0.005 * f, *lens]
    return np.array(out)


def _linear(
    seen: Sightings, T_m_b: Pose, state: Mounted, moves: Moves = STILL
) -> tuple[Array, Array, Array]:
    """Return residuals (n, 2) and derivatives by the unknowns (n, 2, p) and the points (n, 2, 3).

    All divided by the declared focal length, so in radians.
    """
    sizes, n = state.sizes, N_CAMERA * len(state.cameras)
    at = moves.applied(sizes, seen, T_m_b, state.x_m)
    v = _residuals(*at, state.cameras)
    A, B = np.zeros((len(seen), 2, n + len(sizes))), np.empty((len(seen), 2, 3))
    for k, rows, T_m_c, x_c, xy in _seen_by(*at, state.cameras):
        camera, unit = state.cameras[k], seen.cameras[k].interior.f
        by_x = pinhole_jacobian(camera.interior.f, x_c) / unit
        by_lens = -correct_jacobian(camera.interior, xy)[:, :, :N_LENS] / unit
        by_lens[:, :, 0] = pinhole(camera.interior.f, x_c) / (camera.interior.f * unit)
        by_mount = [by_x @ skew(x_c), -by_x @ camera.T_b_c.R.T]
        A[rows, :, N_CAMERA * k : N_CAMERA * (k + 1)] = np.concatenate([*by_mount, by_lens], axis=2)
        B[rows] = by_x @ np.swapaxes(T_m_c.R, -1, -2)
    step = 1e-5
    for i, unit_size in enumerate(np.eye(len(sizes))):
        there = moves.applied(sizes + step * unit_size, seen, T_m_b, state.x_m)
        A[:, :, n + i] = (_residuals(*there, state.cameras) - v) / step
    return v, A, B


def _residuals(seen: Sightings, T_m_b: Pose, x_m: Array, cameras: tuple[Camera, ...]) -> Array:
    """Return projected minus corrected image points, divided by the declared focal length."""
    v = np.empty((len(seen), 2))
    for k, rows, _, x_c, xy in _seen_by(seen, T_m_b, x_m, cameras):
        interior = cameras[k].interior
        v[rows] = (pinhole(interior.f, x_c) - correct(interior, xy)) / seen.cameras[k].interior.f
    return v


def _seen_by(
    seen: Sightings, T_m_b: Pose, x_m: Array, cameras: tuple[Camera, ...]
) -> Iterator[tuple[int, Index, Pose, Array, Array]]:
    """Yield a camera's measurements, its poses, points in its frame, and image coordinates."""
    for k, camera in enumerate(cameras):
        rows = np.flatnonzero(seen.camera_idx == k)
        T_m_c = T_m_b[seen.exposure_idx[rows]] @ camera.T_b_c
        x_c = to_camera(T_m_c, x_m[seen.point_idx[rows]])
        yield k, rows, T_m_c, x_c, xy_from_colrow(camera, seen.colrow[rows])


def _step(
    seen: Sightings, state: Mounted, linear: tuple[Array, Array, Array], prior: Array
) -> tuple[Array, Array]:
    """Return a reweighted step of the unknowns, with points eliminated, and the moved points."""
    u = np.nan_to_num(np.linalg.norm(linear[0], axis=1), nan=np.inf) / (4.0 * state.misfit)
    v, A, B = (np.nan_to_num(part) for part in linear)
    weight = (np.square(1 / (1 + u**2)) / state.misfit**2)[:, None, None]
    WA, WB = weight * A, weight * B
    N = np.einsum("nki,nkj->ij", WA, A, optimize=True) + np.diag(prior**-2)
    h = np.einsum("nki,nk->i", WA, v) + _from_declared(seen, state) / prior**2
    C, D, g = (np.zeros((len(seen.x_m), 3, *more)) for more in ((3,), (len(h),), ()))
    np.add.at(C, seen.point_idx, np.swapaxes(WB, 1, 2) @ B)
    np.add.at(D, seen.point_idx, np.swapaxes(WB, 1, 2) @ A)
    np.add.at(g, seen.point_idx, np.einsum("nki,nk->ni", WB, v))
    surveyed = np.isfinite(seen.x_m[:, 0])  # held; tie points are loosely, if rays leave them open
    C += np.where(surveyed, 1e30, 1e-12)[:, None, None] * np.eye(3)
    DC = np.linalg.solve(C, D)
    N -= np.einsum("pki,pkj->ij", D, DC, optimize=True)
    h -= np.einsum("pki,pk->i", DC, g)
    dx = -np.linalg.solve(N, h)
    step = np.linalg.solve(C, (g + D @ dx)[..., None])[..., 0]
    return dx, np.where(surveyed[:, None], state.x_m, state.x_m - step)


def _from_declared(seen: Sightings, state: Mounted) -> Array:
    """Return the unknowns less their declared values; zero for turns, which are free."""
    out = []
    for camera, declared in zip(state.cameras, seen.cameras, strict=True):
        lens = camera.interior.to_array() - declared.interior.to_array()
        out += [np.zeros(3), camera.T_b_c.r - declared.T_b_c.r, lens[:N_LENS]]
    return np.concatenate([*out, state.sizes])


def _moved(state: Mounted, dx: Array, x_m: Array) -> Mounted:
    cameras = []
    for k, camera in enumerate(state.cameras):
        d = dx[N_CAMERA * k : N_CAMERA * (k + 1)]
        turn = d[:3] * min(1.0, 0.5 / max(float(np.linalg.norm(d[:3])), 1e-300))
        lens = camera.interior.to_array()
        lens[:N_LENS] += d[N_MOUNT:]
        lens[0] = max(lens[0], 0.5 * camera.interior.f)
        mount = Pose(R=camera.T_b_c.R @ exp(turn), r=camera.T_b_c.r + d[3:N_MOUNT])
        cameras.append(replace(camera, interior=Interior.from_array(lens), T_b_c=mount))
    sizes = state.sizes + dx[N_CAMERA * len(cameras) :]
    return replace(state, cameras=tuple(cameras), x_m=x_m, sizes=sizes)


# --- A part of a block's measurements, enough to compare readings of the flight by


MOST_IMAGES, MOST_MEASUREMENTS = 60, 900
"""Largest numbers of images in use and of their measurements, spread over the block."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Sightings:
    """Measurements of points, most of them surveyed.

    Attributes
    ----------
    cameras : tuple of Camera
        As declared.
    points : ndarray, shape (n_points,)
        Places of the points in the block.
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
    points: Index
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
    """Return measurements of at most sixty images; None if too few to compare readings.

    Surveyed points are enough where there are some in every image; else tie points are added.
    """
    x_m = _surveyed(block)
    if np.isfinite(x_m).any():  # no point of a block is 300 km from the others
        x_m[(np.abs(x_m - np.nanmedian(x_m, axis=0)) > 300_000.0).any(axis=1)] = np.nan
    points = block.image_points[np.isfinite(block.image_points.sigma_px)]
    is_surveyed = np.isfinite(x_m[:, 0])
    for chosen in (_of_surveyed, _with_ties):
        seen = _sightings_of(block, chosen(block, points, is_surveyed), x_m)
        if len(seen.exposures) >= 6 and len(seen) >= 30:  # fewer may fit by chance
            return seen
    return None


def _sightings_of(block: Block, few: ImagePoints, x_m: Array) -> Sightings:
    """Return some measurements of a block, with coordinates of all its points or NaN."""
    shown, point_idx = np.unique(few.point_idx, return_inverse=True)
    exposures, exposure_idx = np.unique(
        block.images.exposure_idx[few.image_idx], return_inverse=True
    )
    return Sightings(
        cameras=block.cameras,
        points=shown,
        exposures=exposures,
        camera_idx=block.images.camera_idx[few.image_idx],
        exposure_idx=exposure_idx,
        point_idx=point_idx,
        colrow=few.colrow,
        x_m=x_m[shown],
    )


def _surveyed(block: Block) -> Array:
    """Return the coordinates of surveyed points, NaN for all other points."""
    x_m = np.full((len(block.points), 3), np.nan)
    for surveyed in (block.control, block.check):
        x_m[surveyed.point_idx] = surveyed.x_m
    return x_m


def _of_surveyed(block: Block, points: ImagePoints, is_surveyed: Mask) -> ImagePoints:
    """Return measurements of surveyed points, evenly spaced, and not too many of them."""
    points = points[is_surveyed[points.point_idx]]
    exposure = block.images.exposure_idx[points.image_idx]
    points = points[np.isin(exposure, _spaced(np.unique(exposure), _most_exposures(block)))]
    return points[_spaced(np.arange(len(points)), MOST_MEASUREMENTS)]


def _with_ties(block: Block, points: ImagePoints, is_surveyed: Mask) -> ImagePoints:
    """Return the measurements of neighbouring exposures, of surveyed and of some tie points."""
    exposure = block.images.exposure_idx[points.image_idx]
    measured = np.unique(exposure)
    first, run = _spaced(np.arange(len(measured)), _most_exposures(block) // 10), np.arange(10)
    runs = np.unique(np.minimum(first[:, None] + run, len(measured) - 1))
    points = points[np.isin(exposure, measured[runs])]
    rays = np.bincount(points.point_idx, minlength=len(is_surveyed))
    # Two rays of one strip do not control angles across it.
    ties = np.flatnonzero((rays >= 3) & ~is_surveyed)
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
