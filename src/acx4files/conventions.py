"""Usual readings of a flight's numbers: which sign, order, unit, frame or datum would fit better.

Most errors in direct georeferencing are a sign or an axis. This is the one place that finds them,
in two steps. `contradictions` asks whether surveyed points, projected with the declared mounting,
lie near their measurements at all; if not, the reading that mends it is named, and the flight is
refused. `best_reading` compares finer ones: for each, the mounting of the cameras of some images is
adjusted on a trajectory assumed exact; the remaining distance of rays from their points is the
misfit of the reading, which is named if it is much smaller than that of the given one. `acx4 check`
calls it, and a command that failed; no stage does.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, NamedTuple, Protocol

import numpy as np
import pyproj

from acx4lib.block import Block, ImagePoints
from acx4lib.design import strip_of_exposure
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import Camera, Interior, correct, correct_jacobian, xy_from_colrow
from acx4lib.geometry.collinearity import pinhole, pinhole_jacobian, to_camera
from acx4lib.geometry.frames import (
    Pose,
    exp,
    log,
    opk_from_rotation,
    rotation_from_opk,
    rph_from_rotation,
    skew,
    transform,
    turn,
)
from acx4lib.geometry.geodesy import GridSystem, MappingFrame
from acx4lib.geometry.intersection import intersect

Numbers = Mapping[str, Array]
"""The numeric columns of a trajectory, in either form."""


class Recorded(Protocol):
    """A trajectory as its file has it."""

    @property
    def text(self) -> Mapping[str, Sequence[str]]:
        """Names, with the column exposure."""

    @property
    def numbers(self) -> Numbers:
        """All other columns that are known."""


# --- What the numbers of a trajectory, of heights and of pixels may mean, the simplest first


ANGLES = {
    "lat_deg": ("roll_deg", "pitch_deg", "heading_deg"),
    "east_m": ("omega_deg", "phi_deg", "kappa_deg"),
}
FOOT = 0.3048
"""International foot, m; that of the US survey is longer by a hundredth of a millimetre in 5 m."""

_SIGNS = sorted(product((1, -1), repeat=3), key=lambda signs: signs.count(-1))[1:]
"""Signs of three angles, those with the fewest changes first."""


class Meaning(NamedTuple):
    """A reading of a trajectory: what columns were, what changes, the numbers it stands for."""

    columns: tuple[str, ...]
    says: str
    quantity: str
    numbers: Numbers


def poses(numbers: Numbers, frame: MappingFrame) -> Pose:
    """Return the poses T_m_b of a trajectory in either form, one for every row."""
    xyz = ("lon_deg", "lat_deg") if "lat_deg" in numbers else ("east_m", "north_m")
    at = np.stack([numbers[name] for name in (*xyz, "height_m")], axis=-1)
    angles = np.radians(np.stack([numbers[name] for name in _angles_of(numbers)], axis=-1))
    return (frame.pose_from_geographic if "lat_deg" in numbers else frame.pose_from_grid)(
        at, angles
    )


def _angles_of(numbers: Numbers) -> tuple[str, str, str]:
    return ANGLES["lat_deg" if "lat_deg" in numbers else "east_m"]


def lonlat_of(numbers: Numbers, grid: GridSystem) -> Array:
    """Return longitude and latitude of a trajectory in either form, degrees, shape (n, 2)."""
    if "lat_deg" in numbers:
        return np.stack([numbers["lon_deg"], numbers["lat_deg"]], axis=-1)
    return grid.lonlat_from_grid(np.stack([numbers["east_m"], numbers["north_m"]], axis=-1))


def meanings(numbers: Numbers, grid: GridSystem) -> Iterator[Meaning]:
    """Yield a trajectory under each usual reading of its angles, heights and rows.

    Parameters
    ----------
    numbers : mapping
    grid : GridSystem
        Of the flight, for the convergence of its meridians and the heights of its geoid.
    """
    names = _angles_of(numbers)
    for columns, says, values in _angle_readings(numbers, grid):
        changed = dict(zip(columns, values, strict=True))
        yield Meaning(columns, says, "attitude", {**numbers, **changed})
    angles = np.stack([numbers[name] for name in names], axis=-1)
    for says, opk_or_rph in _orders(np.radians(angles), with_north=names[2] == "heading_deg"):
        changed = dict(zip(names, np.degrees(opk_or_rph).T, strict=True))
        yield Meaning(names, says, "attitude", {**numbers, **changed})
    for says, height in height_readings(numbers["height_m"], lonlat_of(numbers, grid), grid):
        yield Meaning(("height_m",), says, "position", {**numbers, "height_m": height})
    n = np.arange(len(angles))
    for step, neighbour in ((1, "next"), (-1, "previous")):
        rows = np.clip(n + step, 0, len(n) - 1)
        other = {name: values[rows] for name, values in numbers.items() if name[:4] != "time"}
        says = f"of the {neighbour} row"
        yield Meaning(("positions", "angles"), says, "position", {**numbers, **other})


def _angle_readings(
    numbers: Numbers, grid: GridSystem
) -> Iterator[tuple[tuple[str, ...], str, Sequence[Array]]]:
    """Yield columns of angles, what they were, and their values: signs, zeros, columns, units."""
    names = roll, pitch, heading = _angles_of(numbers)
    a, b, c = (numbers[name] for name in names)
    for signs in _SIGNS:
        flipped = [name for name, sign in zip(names, signs, strict=True) if sign < 0]
        yield (*flipped,), "of opposite sign", [-numbers[name] for name in flipped]
    with_north = heading == "heading_deg"
    with np.errstate(all="ignore"):  # wrong positions may have no convergence
        convergence = np.nan_to_num(np.degrees(grid.convergence(lonlat_of(numbers, grid))))
    for says, values in (
        ("an angle from east" if with_north else "a heading from north", 90 - c),
        ("90 degrees too small", c + 90),
        ("180 degrees too small", c + 180),
        ("90 degrees too large", c - 90),
        ("from grid north" if with_north else "from true north", c + convergence),
    ):
        yield (heading,), says, [values]
    yield (roll, pitch), "exchanged", [b, a]
    for turned, i, j in (("the first", -1, 1), ("the second", 1, -1), ("both", -1, -1)):
        yield (roll, pitch), f"exchanged, then {turned} of opposite sign", [i * b, j * a]
    yield (roll, heading), "exchanged", [c, a]
    yield (pitch, heading), "exchanged", [c, b]
    if not with_north:
        yield names, "of a body with z down", [a + 180.0, -b, -c]
    for chosen in (names, names[:2], names[2:]):
        for unit, degrees in (("radians", 180 / np.pi), ("gon", 0.9)):
            yield chosen, f"in {unit}", [numbers[name] * degrees for name in chosen]


def _orders(angles: Array, *, with_north: bool) -> Iterator[tuple[str, Array]]:
    """Yield the angles of turns multiplied in another order, or transposed; radians."""
    R1, R2, R3 = (turn(axis, angles[:, axis]) for axis in range(3))
    if with_north:
        yield "in the order pitch before roll", rph_from_rotation(R3 @ R1 @ R2)
        yield "in the order roll, pitch, heading", rph_from_rotation(R1 @ R2 @ R3)
        transposed = rph_from_rotation(np.swapaxes(R3 @ R2 @ R1, -1, -2))
        yield "of the transposed rotation (heading, pitch, roll)", transposed
    else:
        yield "in the order phi, omega, kappa", opk_from_rotation(R2 @ R1 @ R3)
        yield "in the order kappa, phi, omega", opk_from_rotation(R3 @ R2 @ R1)
        transposed = opk_from_rotation(np.swapaxes(R1 @ R2 @ R3, -1, -2))
        yield "of the transposed rotation (omega, phi, kappa)", transposed


def of_camera(numbers: Numbers, R_b_c: Array) -> Iterator[Meaning]:
    """Yield a trajectory in the map whose angles are the camera's, converted to the body."""
    if "kappa_deg" in numbers:
        names = ANGLES["east_m"]
        angles = np.radians(np.stack([numbers[name] for name in names], axis=-1))
        body = np.degrees(opk_from_rotation(rotation_from_opk(angles) @ R_b_c.T))
        changed = {**numbers, **dict(zip(names, body.T, strict=True))}
        yield Meaning(names, "of the camera, not of the body", "attitude", changed)


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


def _degree_readings(lonlat: Array) -> Iterator[tuple[tuple[str, ...], str, Array]]:
    """Yield other readings of longitude and latitude: columns, meaning, degrees, shape (n, 2)."""
    both = ("lat_deg", "lon_deg")
    yield both, "swapped", lonlat[:, ::-1]
    yield both, "in radians", np.degrees(lonlat)
    for columns, signs in ((both[1:], [-1, 1]), (both[:1], [1, -1]), (both, [-1, -1])):
        yield columns, "of opposite sign", lonlat * signs


# --- The readings of a block: some of its measurements, and the poses of the body


@dataclass(frozen=True, eq=False)
class Reading:
    """A reading of a block.

    Attributes
    ----------
    table : str
        Where the numbers stand: a table of the block, "mount" or "".
    columns : tuple of str
        Columns that are read otherwise.
    meaning : str
        What they were, such as "of opposite sign".
    quantity : {"attitude", "position", "image"}
        Quantity that changes most.
    seen : Sightings
    T_m_b : Pose
        One per exposure of the sightings.
    velocity : ndarray, shape (n_exposures, 3), or None
        m/s, where a delay is to be found.
    of_some : bool
        Whether it changes some images only, perhaps too few for the misfit of all.
    """

    table: str
    columns: tuple[str, ...]
    meaning: str
    quantity: str
    seen: Sightings
    T_m_b: Pose
    velocity: Array | None = None
    of_some: bool = False

    @property
    def name(self) -> str:
        """Columns and meaning, as in "pitch of opposite sign"."""
        plain = ", ".join(re.sub("_(deg|m|px)$", "", column) for column in self.columns)
        of_control = " of control points" if self.table == "control_points" else ""
        return f"{plain}{of_control} {self.meaning}".strip()

    @property
    def says(self) -> str:
        """The end of a sentence that begins with "it looks as if"."""
        columns = ", ".join(self.columns).replace("east_m, north_m", "east_m and north_m")
        return f"{columns} were {self.meaning}"


@dataclass(frozen=True, kw_only=True, eq=False)
class _Case:
    """What readings are made of: sightings, poses, and the numbers of the tables behind them.

    `rows` are those of the exposures in `numbers`, `enh` are east, north, height of the surveyed
    points of the sightings, NaN for others.
    """

    frame: MappingFrame
    seen: Sightings
    T_m_b: Pose
    numbers: Numbers
    rows: Index
    enh: Array

    def moved(self, meaning: Meaning) -> Iterator[Reading]:
        """Yield the reading of a trajectory, if its positions are on the earth."""
        with np.errstate(all="ignore"):
            T_m_b = poses({n: v[self.rows] for n, v in meaning.numbers.items()}, self.frame)
        if np.isfinite(T_m_b.r).all() and np.isfinite(T_m_b.R).all():
            columns, says, quantity, _ = meaning
            yield Reading("trajectory", columns, says, quantity, self.seen, T_m_b)

    def surveyed(self, columns: tuple[str, ...], says: str, enh: Array) -> Iterator[Reading]:
        """Yield a reading of the surveyed points, if they are on the earth."""
        known, x_m = np.isfinite(self.enh[:, 0]), self.seen.x_m.copy()
        with np.errstate(all="ignore"):
            x_m[known] = self.frame.from_grid(enh[known])
        if np.isfinite(x_m[known]).all():
            seen = replace(self.seen, x_m=x_m)
            yield Reading("control_points", columns, says, "position", seen, self.T_m_b)


def _case(block: Block, trajectory: Recorded, seen: Sightings, enh: Array | None = None) -> _Case:
    """Return the case of some sightings; of a long trajectory only their rows and neighbours."""
    place = {name: row for row, name in enumerate(trajectory.text["exposure"])}
    rows = np.array([place[block.trajectory.exposures[i]] for i in seen.exposures], dtype=np.intp)
    near = np.unique(np.clip(rows[:, None] + [-1, 0, 1], 0, len(place) - 1))
    if enh is None:
        enh = np.full_like(seen.x_m, np.nan)
        known = np.isfinite(seen.x_m[:, 0])
        enh[known] = block.frame.to_grid(seen.x_m[known])
    return _Case(
        frame=block.frame,
        seen=seen,
        T_m_b=block.trajectory.T_m_b[seen.exposures],
        numbers={name: values[near] for name, values in trajectory.numbers.items()},
        rows=np.searchsorted(near, rows),
        enh=enh,
    )


def _of_trajectory(case: _Case) -> Iterator[Reading]:
    for meaning in meanings(case.numbers, case.frame.grid):
        yield from case.moved(meaning)
    if len(case.seen.cameras) == 1:
        for meaning in of_camera(case.numbers, case.seen.cameras[0].T_b_c.R):
            yield from case.moved(meaning)


def _of_heights(case: _Case) -> Iterator[Reading]:
    known, enh = np.isfinite(case.enh[:, 0]), case.enh.copy()
    grid = case.frame.grid
    lonlat = grid.lonlat_from_grid(enh[known, :2])
    for says, height in height_readings(case.enh[known, 2], lonlat, grid):
        enh[known, 2] = height
        yield from case.surveyed(("height_m",), says, enh)


def _of_pixels(case: _Case) -> Iterator[Reading]:
    seen, given = case.seen, case.seen.cameras
    size = np.array([[c.width_px, c.height_px] for c in given])[seen.camera_idx]
    pixel_mm = np.array([[c.pixel_mm] for c in given])[seen.camera_idx]
    for columns, meaning, colrow in pixel_readings(seen.colrow, size, pixel_mm):
        other = replace(seen, colrow=colrow)
        yield Reading("image_points", columns, meaning, "image", other, case.T_m_b)


# --- Whether surveyed points project near their measurements, and the likely mistake if not
#
# With the approximate mounting and the trajectory they must. Half of the strips may be wrong and
# the median good (headings of 0 and 180 degrees in radians), so a usual mistake that explains the
# worse half is reported as well.


JUDGED = 3
"""Number of control measurements that is enough to judge a single camera."""

EXPLAINED_BY = 5000
"""Number of measurements that readings are tried on; a part of more shows them as well."""

MOST = 0.75
"""Quantile of the distances that must be within the limit after a mistake is undone."""

CLEARLY = 0.9
"""Ratio to the best misfit so far below which a later reading is clearly the better explanation."""

TURNED = 0.5
"""The same ratio from which turned cameras explain nothing: they bring any far points near."""

FAR = 50_000.0
"""Distance of a block from its control points, m, that only another CRS explains."""

NO_TURN = np.radians(3.0)
"""Mounting angles below which a camera has the axes of the body."""

NEARLY = 0.98
"""Cosine from which a turn is about an axis."""

NAMED = 10
"""Number of cameras that a sentence names."""


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
    x_m = np.full((len(block.points), 3), np.nan)
    for surveyed in (block.control, block.check):
        x_m[surveyed.point_idx] = surveyed.x_m
    known = np.isfinite(x_m[block.image_points.point_idx, 0])
    seen = _sightings_of(block, block.image_points[known], x_m)
    return seen, _ratio(seen, block.trajectory.T_m_b[seen.exposures])


def _ratio(seen: Sightings, T_m_b: Pose) -> Array:
    start = Mounted(cameras=seen.cameras, x_m=seen.x_m)
    with np.errstate(all="ignore"):
        v = np.linalg.norm(_linear(seen, T_m_b, start, np.zeros((len(T_m_b), 3)))[0], axis=1)
    quarter = [c.diagonal_px * c.pixel_mm / (4 * c.interior.f) for c in seen.cameras]
    return np.nan_to_num(v / np.array(quarter)[seen.camera_idx], nan=np.inf)


def contradictions(
    block: Block, trajectory: Recorded, enh: Array, files: Mapping[str, str]
) -> Iterator[Contradiction]:
    """Yield a problem where the median distance exceeds a quarter of the image diagonal.

    Parameters
    ----------
    block : Block
    trajectory : Recorded
        Of the block.
    enh : ndarray, shape (n_points, 3)
        East, north and height of the surveyed points as they were given; NaN for tie points.
    files : mapping of str to str
        Names of the tables ``trajectory``, ``control_points`` and ``image_points``.
    """
    seen, ratio = misses(block)
    if not len(seen):
        return
    mine = {k: ratio[seen.camera_idx == k] for k in range(len(block.cameras))}
    judged = {k: own for k, own in mine.items() if len(own) >= JUDGED}
    wrong = [k for k, own in judged.items() if _upper(own, 0.5) > 1]
    if wrong and len(wrong) < len(judged):
        for k in wrong:
            some = _some(seen, np.flatnonzero(seen.camera_idx == k))
            case = _case(block, trajectory, some, enh[seen.points])
            found = _explained(block, _turned_cameras(case), files, mine[k], only=k)
            camera = block.cameras[k].name
            yield found._replace(table="mount", column="mount_kappa_deg", camera=camera)
    elif _upper(ratio, MOST) > 1:
        case = _case(block, trajectory, _some(seen, np.arange(len(seen))), enh[seen.points])
        found = _explained(block, _mistakes(case), files, ratio)
        if found.table or _upper(ratio, 0.5) > 1:
            yield found if found.table else found._replace(table="control_points")


def _some(seen: Sightings, rows: Index) -> Sightings:
    """Return some measurements, not too many."""
    rows = rows[:: -(-len(rows) // EXPLAINED_BY)]
    return replace(
        seen,
        camera_idx=seen.camera_idx[rows],
        exposure_idx=seen.exposure_idx[rows],
        point_idx=seen.point_idx[rows],
        colrow=seen.colrow[rows],
    )


def _upper(values: Array, quantile: float) -> float:
    return float(np.quantile(values, quantile, method="higher"))


def _explained(
    block: Block,
    tried: Iterator[Reading],
    files: Mapping[str, str],
    ratio: Array,
    only: int | None = None,
) -> Contradiction:
    """Return the sentence on a block, or on one of its cameras; no table if nothing explains it."""
    allowed = float(np.median([c.diagonal_px / 4 for c in block.cameras]))
    of_camera = "" if only is None else f" in images of {block.cameras[only].name}"
    median = float(np.median(ratio)) * allowed
    place = f"{median:.0f} px from their measurements" if median < np.inf else "behind the camera"
    found = (
        f"control points{of_camera} lie {place} (median; {int((ratio > 1).sum())} of {len(ratio)} "
        f"too far) with the trajectory of {files['trajectory']} and the points of "
        f"{files['control_points']}"
    )
    expected = f"must be below {allowed:.0f} px, a quarter of the image diagonal"
    best, after = _best_explanation(tried)
    if best is None:
        cure = _whereabouts(block) if only is None else "no turn of its axes explains it"
        return Contradiction("", "east_m", "", f"{found}; {cure}", expected)
    after_px = f"(then {after * allowed:.0f} px)"
    if not best.columns:
        of = slice(None) if only is None else slice(only, only + 1)
        says = _turned_axes(block.cameras[of], best.seen.cameras[of])
        found = f"{found}; it looks as if {says} {after_px}"
        return Contradiction("mount", "mount_kappa_deg", block.cameras[0].name, found, expected)
    column = best.columns[0 if best.quantity == "position" else -1]
    found = f"{found}; it looks as if {best.says} in {files[best.table]} {after_px}"
    column = column if column != "positions" else "exposure"
    return Contradiction(best.table, column, "", found, expected)


def _best_explanation(tried: Iterable[Reading]) -> tuple[Reading | None, float]:
    """Return the reading that explains nearly all misfits, or None, and the median ratio then."""
    best, least, after = None, 1.0 / CLEARLY, np.inf
    for reading in tried:
        ratio = _ratio(reading.seen, reading.T_m_b)
        if _upper(ratio, MOST) < CLEARLY * least:
            best, least, after = reading, _upper(ratio, MOST), float(np.median(ratio))
    return best, after


def _mistakes(case: _Case) -> Iterator[Reading]:
    """Yield a block with each of the usual mistakes undone."""
    yield from _of_heights(case)
    for says, xy in _plane_readings(case.enh[:, :2], case.frame.grid):
        enh = np.column_stack([xy, case.enh[:, 2]])
        yield from case.surveyed(("east_m", "north_m"), says, enh)
    yield from _of_positions(case)
    yield from _turned_cameras(case)
    yield from _of_trajectory(case)
    yield from _of_pixels(case)


def _turned_cameras(case: _Case) -> Iterator[Reading]:
    """Yield the block with its cameras turned onto the surveyed points, if that explains much."""
    with np.errstate(all="ignore"):
        cameras = started(case.seen, case.T_m_b).cameras
    seen = replace(case.seen, cameras=cameras)
    if _upper(_ratio(seen, case.T_m_b), MOST) < TURNED:
        yield Reading("mount", (), "", "attitude", seen, case.T_m_b)


def _turned_axes(declared: Sequence[Camera], cameras: Sequence[Camera]) -> str:
    """Return the end of a sentence on the mounting angles that fit."""
    turned = np.degrees(log(declared[0].T_b_c.R.T @ cameras[0].T_b_c.R))
    axis = int(np.argmax(np.abs(turned)))
    by = f" by {(turned[axis] + 179.5) % 360 - 179.5:.0f} degrees about {'xyz'[axis]}"
    by = by if abs(turned[axis]) > NEARLY * np.linalg.norm(turned) else ""
    opk = {camera.name: np.round(np.degrees(camera.T_b_c.opk)) + 0.0 for camera in cameras}
    listed = [f"{name} {o:.0f}, {p:.0f}, {k:.0f}" for name, (o, p, k) in opk.items()]
    listed = [*listed[:NAMED], "…"] if len(listed) > NAMED else listed
    body = len(cameras) == 1 and np.allclose(cameras[0].T_b_c.R, np.eye(3), atol=NO_TURN)
    return (
        f"the camera axes were turned{by}: mount_omega_deg, mount_phi_deg, mount_kappa_deg of "
        f"{'; '.join(listed)} would fit"
        + (", or the angles are of the camera, not of the body" if body else "")
    )


def _of_positions(case: _Case) -> Iterator[Reading]:
    on_map = "lat_deg" not in case.numbers
    columns = ("east_m", "north_m") if on_map else ("lon_deg", "lat_deg")
    xy = np.stack([case.numbers[name] for name in columns], axis=-1)
    of_plane = ((columns, says, other) for says, other in _plane_readings(xy, case.frame.grid))
    for shown, says, other in of_plane if on_map else _degree_readings(xy):
        numbers = {**case.numbers, **dict(zip(columns, other.T, strict=True))}
        yield from case.moved(Meaning(shown, says, "position", numbers))


def _whereabouts(block: Block) -> str:
    """Return a sentence on the distance between control and exposures, to find the mistake."""
    surveyed = np.concatenate([block.control.x_m, block.check.x_m])
    shift = surveyed.mean(axis=0) - block.trajectory.T_m_b.r.mean(axis=0)
    grid = block.frame.grid
    doubt = np.hypot(*shift[:2]) > FAR and not grid.is_local
    return (
        "no usual mistake explains it; the control points' middle lies "
        f"{shift[0]:.0f} m east, {shift[1]:.0f} m north and {shift[2]:.0f} m up of the exposures'"
        + (f" (is {grid.crs} the right CRS?)" if doubt else "")
    )


# --- Readings of a flight that is not refused, compared by an adjustment


BETTER = 2.0
"""Ratio of the given reading's misfit to another's below which no other reading is named."""

CERTAIN = 5.0
"""Logarithm of this ratio, in its standard deviations, below which no other reading is named.

Every exposure has two independent components of attitude or more, and the quantile of the misfit
needs about twice the data that a standard deviation needs: n exposures are worth n degrees of
freedom, and the logarithm of a ratio of two has the standard deviation 1 / sqrt(n).
"""

FITTED, FITTED_CERTAIN = 1.5, 2.5
"""The same for readings with a fitted number, of which there are six and not a hundred."""

GROSS = 10.0
"""Ratio of the residuals of the worst images above which a reading of some images is named."""

ALIKE = 1.25
"""Ratio of misfits below which the simpler of two readings is named."""

PROMISING, MOST_TRIED = 1.1, 12
"""Ratio of misfits before the adjustment from which a reading is adjusted, and how many are."""

FLOOR_PX = 0.25
"""Misfit that no reading can explain, px."""

NEAR = np.radians(15.0)
"""Turn from the declared boresight within which a reading is preferred to equally good ones."""


@dataclass(frozen=True, kw_only=True)
class Found:
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
        figure = _shown(self.found, self.unit)
        if not np.isfinite(self.given):
            return (
                f"with {self.name} the residuals of {self.quantity} are {figure}; as the numbers "
                "are, rays do not meet"
            )
        if not np.isfinite(self.found):
            given = _shown(self.given, self.unit)
            return f"the residuals of {self.quantity} are {given}: {self.name}"
        change = "fall" if self.found < self.given else "rise"
        return (
            f"with {self.name} the residuals of {self.quantity} {change} "
            f"from {_shown(self.given, self.unit)} to {figure}"
        )


def _shown(value: float, unit: str) -> str:
    number = f"{value:.2g}" if value < 100 else f"{value:.0f}"
    return f"{number}{unit}" if unit == "°" else f"{number} {unit}"


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
        tried = [
            (reading, mounted(reading.seen, reading.T_m_b, reading.velocity))
            for reading in _promising([*_readings(block, case)], started(seen, case.T_m_b).misfit)
        ]
        named = _best(tried, given, seen) or _best_fitted(block, seen, given)
        return named or other_unit(block, seen, given)


def notes(flight: Any) -> Iterator[str]:
    """Yield a sentence for every block of a `Flight` that another reading fits much better."""
    for name in flight.blocks:
        reading = best_reading(flight, name)
        if reading is not None:
            yield f"{name}: {reading.sentence}"


def _readings(block: Block, case: _Case) -> Iterator[Reading]:
    """Yield the usual readings of a block, the simplest first."""
    yield from _of_trajectory(case)
    if (velocity := _velocities(block, case.seen)) is not None:
        yield Reading("", (), "", "position", case.seen, case.T_m_b, velocity)
    if np.isfinite(case.enh[:, 0]).any():
        yield from _of_heights(case)
        swapped = case.enh[:, [1, 0, 2]]
        yield from case.surveyed(("east_m", "north_m"), "swapped", swapped)
    yield from _north_up(case)
    yield from _of_pixels(case)


def _north_up(case: _Case) -> Iterator[Reading]:
    """Yield readings with images of one flying direction turned by 180 degrees, shown north up.

    The direction is against that of the first exposure, or along it.
    """
    seen, ahead = case.seen, case.T_m_b.R[:, :2, 0]
    size = np.array([[c.width_px, c.height_px] for c in seen.cameras])[seen.camera_idx]
    against = (ahead @ ahead[0] < 0)[seen.exposure_idx]
    if not against.any() or against.all():
        return
    for turned in (against, ~against):
        colrow = np.where(turned[:, None], size - 1 - seen.colrow, seen.colrow)
        says = "images of the strips in one direction turned by 180 degrees (shown north up)"
        back = replace(seen, colrow=colrow)
        yield Reading("image_points", (), says, "image", back, case.T_m_b, of_some=True)


def _promising(others: list[Reading], usual: float) -> list[Reading]:
    """Return the best readings before an adjustment, in their order, and that of the clock."""
    misfits = np.array([started(reading.seen, reading.T_m_b).misfit for reading in others])
    limit = min(PROMISING * usual, np.sort(misfits)[:MOST_TRIED].max(initial=0.0))
    return [r for r, m in zip(others, misfits, strict=True) if m <= limit or r.velocity is not None]


def _best(tried: list[tuple[Reading, Mounted]], given: Mounted, seen: Sightings) -> Found | None:
    """Return the simplest of the best readings, if much better than the given reading."""
    camera = seen.cameras[0]
    floor = FLOOR_PX * camera.pixel_mm / camera.interior.f
    for reading, fit in tried:
        mends = GROSS * (fit.worst + floor) < given.worst + floor
        if reading.of_some and mends and fit.misfit < ALIKE * given.misfit:
            return _found(
                reading, replace(given, misfit=given.worst), replace(fit, misfit=fit.worst)
            )
    better = max(BETTER, np.exp(CERTAIN / np.sqrt(len(seen.exposures))))
    good = [(r, m) for r, m in tried if better * (m.misfit + floor) < given.misfit + floor]
    if not good:
        return None
    least = min(m.misfit for _, m in good) + floor
    alike = [(r, m) for r, m in good if m.misfit + floor < ALIKE * least]
    near = [(r, m) for r, m in alike if _turn(m, seen) < NEAR]
    reading, fit = (near or alike)[0]
    return _found(_named(reading, fit), given, fit)


def _best_fitted(block: Block, seen: Sightings, given: Mounted) -> Found | None:
    """Return the best reading with a fitted number, if clearly better than the given reading."""
    camera = seen.cameras[0]
    floor = FLOOR_PX * camera.pixel_mm / camera.interior.f
    tried = list(_numbered_readings(block, seen, given))
    if not tried:
        return None
    reading, fit = min(tried, key=lambda pair: pair[1].misfit)
    better = max(FITTED, np.exp(FITTED_CERTAIN / np.sqrt(len(seen.exposures))))
    clearly = better * (fit.misfit + floor) < given.misfit + floor
    return _found(reading, given, fit) if clearly else None


def _turn(fit: Mounted, seen: Sightings) -> float:
    """Return the largest turn of a camera from its declared boresight, radians."""
    return max(
        float(np.linalg.norm(log(declared.T_b_c.R.T @ camera.T_b_c.R)))
        for camera, declared in zip(fit.cameras, seen.cameras, strict=True)
    )


def _named(reading: Reading, fit: Mounted) -> Reading:
    """Return the reading with its estimated delay in its name."""
    if reading.velocity is None:
        return reading
    late = "late" if fit.delay_s < 0 else "early"
    return replace(reading, meaning=f"positions recorded {abs(fit.delay_s):.2g} s {late}")


def _found(reading: Reading, given: Mounted, fit: Mounted) -> Found:
    """Return a reading with its misfits, as errors of attitude, position or measurement."""
    seen, camera = reading.seen, fit.cameras[0]
    rays_m = fit.x_m[seen.point_idx] - reading.T_m_b.r[seen.exposure_idx]
    scale, unit, quantity = {
        "attitude": (np.degrees(1.0), "°", "attitude"),
        "position": (float(np.nanmedian(np.linalg.norm(rays_m, axis=1))), "m", "position"),
        "image": (camera.interior.f / camera.pixel_mm, "px", "image measurements"),
    }[reading.quantity]
    return Found(
        name=reading.name,
        quantity=quantity,
        given=given.misfit * scale,
        found=fit.misfit * scale,
        unit=unit,
    )


# --- Standard deviations in another unit: ratios of residuals to sigma


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
"""Text in place of another unit: such an error leaves small residuals."""


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
    T_m_b = block.trajectory.T_m_b[seen.exposures]
    noise = measuring_noise(seen, T_m_b, given)
    camera = given.cameras[0]
    px = camera.pixel_mm / camera.interior.f
    measured = px * _usual(block.image_points.sigma_px)
    units = [("image measurements", {"mm": 1 / camera.pixel_mm}, noise / measured, 0.0)]
    rays_m = given.x_m[seen.point_idx] - T_m_b.r[seen.exposure_idx]
    range_m = float(np.nanmedian(np.linalg.norm(rays_m, axis=1)))
    position = _usual(block.trajectory.sigma_position[seen.exposures]) / range_m
    attitude = _usual(block.trajectory.sigma_attitude[seen.exposures, :2])
    for quantity, known, sigma, other in (
        ("attitude", ANGLE_UNITS, attitude, position),
        ("position", LENGTH_UNITS, position, attitude),
    ):
        units.append((quantity, known, given.misfit / sigma, np.hypot(other, noise) / sigma))
    if ALONE_M[0] <= position * range_m <= ALONE_M[1]:
        _, _, misfit, others = units.pop()
        units.append(("position", {SHARED: np.nan}, misfit, others))
    return next((unit for row in units for unit in _right(*row)), None)


def _usual(sigma: Array) -> float:
    """Return the median of the standard deviations that are known, NaN for none."""
    known = sigma[np.isfinite(sigma)]
    return float(np.median(known)) if len(known) else np.nan


def _right(quantity: str, units: dict[str, float], misfit: float, others: float) -> Iterator[Found]:
    """Yield the units in which a misfit agrees with sigma."""
    before = misfit / np.hypot(1.0, others)
    if not (before > OFF or before < 1 / OFF):
        return
    for unit, factor in units.items():
        if np.isnan(factor) and before < 1 / OFF:
            yield Found(name=unit, quantity=quantity, given=before, found=np.nan, unit="σ")
        after = misfit / np.hypot(factor, others)
        if 1 / RIGHT < after < RIGHT:
            name = f"sigma of {quantity} in {unit}"
            yield Found(name=name, quantity=quantity, given=before, found=after, unit="σ")


# --- Robust adjustment of the cameras' mountings on a trajectory assumed exact: eq. (14)
#
# The purpose is only to compare misfits, so errors of GNSS and INS remain in them. Mounting and
# interior orientation are free within plausible limits: they absorb the same errors as in a real
# adjustment.


WORST = 1 - 1 / 30
"""Share of the residuals below `Mounted.worst`."""

QUANTILE, NORMAL = 0.75, 1.1503
"""Quantile of the misfits that defines their size, and its value in the normal distribution."""

TURNS, STEPS = 8, 12
"""Largest numbers of closed-form turns, and of adjustment steps after them."""

LARGEST_TURN = 0.5
"""Of one step, radians."""

SETTLED = 0.003
"""Relative decrease of the misfit below which no further step is made."""

WIDTH = 4.0
"""Residual, in misfits, that has a quarter of its weight."""

HELD, LOOSE = 1e30, 1e-12
"""Weights, 1/m², that hold surveyed points, and tie points that rays do not determine."""

FREE_POSE, ENOUGH_LEFT = 6, 4
"""Unknowns of a free pose, and observations that must be left beyond them."""

LEVER_M, DELAY_S = 1.0, 10.0
"""Prior sigma of lever arm, m, and delay, s: where both are the same, it is a delay."""

FARTHEST_LEVER_M, FARTHEST_F = 10.0, 0.02
"""Largest plausible difference from declared lever arms, m, and share of focal lengths."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Mounted:
    """Cameras that fit a trajectory best.

    Attributes
    ----------
    cameras : tuple of Camera
        With their interior orientation and mounting.
    x_m : ndarray, shape (n_points, 3)
        Points, m.
    delay_s : float
        Time by which the trajectory's positions must move, s.
    misfit : float
        Angle by which rays miss their points, per component, robustly; radians. Infinite where
        most points lie behind the cameras.
    worst : float
        Residual that one in thirty exceeds, radians: a robust misfit ignores these images.
    held : bool
        Whether lever arms and focal lengths are held as declared, since no plausible ones fit.
    """

    cameras: tuple[Camera, ...]
    x_m: Array
    delay_s: float = 0.0
    misfit: float = np.inf
    worst: float = np.inf
    held: bool = False


def mounted(seen: Sightings, T_m_b: Pose, velocity: Array | None = None) -> Mounted:
    """Return the mountings and interior orientations that fit a trajectory best.

    Parameters
    ----------
    seen : Sightings
    T_m_b : Pose
        One per exposure.
    velocity : ndarray, shape (n_exposures, 3), optional
        m/s; with it a delay is estimated.
    """
    start = started(seen, T_m_b)
    fit = _adjusted(seen, T_m_b, start, velocity)
    if _plausible(fit, seen):
        return fit
    return _adjusted(seen, T_m_b, replace(start, held=True), velocity)


def _plausible(fit: Mounted, seen: Sightings) -> bool:
    """Tell whether lever arms and focal lengths are plausible, near their declared values."""
    return all(
        np.linalg.norm(camera.T_b_c.r - declared.T_b_c.r) < FARTHEST_LEVER_M
        and abs(camera.interior.f / declared.interior.f - 1) < FARTHEST_F
        for camera, declared in zip(fit.cameras, seen.cameras, strict=True)
    )


def _derivatives(seen: Sightings, T_m_b: Pose, fit: Mounted) -> Array:
    """Return the derivatives of all residuals by their points, radians per m, shape (n, 2, 3)."""
    return _linear(seen, T_m_b, fit, np.zeros((len(T_m_b), 3)))[2]


def _pattern_sizes(seen: Sightings, T_m_b: Pose, fit: Mounted, patterns: Array) -> Array:
    """Return the sizes of patterns in the residuals, estimated with all other unknowns."""
    v, A, B = _linear(seen, T_m_b, fit, np.zeros((len(T_m_b), 3)))
    prior = _prior_sigma(seen.cameras, held=fit.held, delayed=False)
    wide = np.concatenate([prior, np.full(patterns.shape[2], np.inf)])
    dx, _ = _step(seen, fit, (v, np.concatenate([A, patterns], axis=2), B), wide)
    return dx[len(prior) :]


# --- start ------------------------------------------------------------------------------------


def started(seen: Sightings, T_m_b: Pose) -> Mounted:
    """Return the cameras turned onto surveyed points, and tie points where their rays meet.

    Quick, in closed form; lever arms and interior orientations are as declared.

    Parameters
    ----------
    seen : Sightings
    T_m_b : Pose
        One per exposure.
    """
    body = T_m_b[seen.exposure_idx]
    ray_c, cameras = _rays(seen), list(seen.cameras)
    for k, camera in enumerate(cameras):
        rows = np.flatnonzero((seen.camera_idx == k) & np.isfinite(seen.x_m[seen.point_idx, 0]))
        if len(rows) < 3:
            continue
        targets = _to_body(body[rows], seen.x_m[seen.point_idx[rows]]) - camera.T_b_c.r
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
    return replace(start, misfit=size(_linear(seen, T_m_b, start, np.zeros((len(T_m_b), 3)))[0]))


def _rays(seen: Sightings) -> Array:
    """Return unit vectors of the measured rays in camera axes, shape (n, 3)."""
    out = np.empty((len(seen), 3))
    for k, camera in enumerate(seen.cameras):
        of_camera = seen.camera_idx == k
        out[of_camera, :2] = correct(
            camera.interior, xy_from_colrow(camera, seen.colrow[of_camera])
        )
        out[of_camera, 2] = -camera.interior.f
    return out / np.linalg.norm(out, axis=1, keepdims=True)


def _to_body(T_m_b: Pose, x_m: Array) -> Array:
    return np.einsum("nji,nj->ni", T_m_b.R, x_m - T_m_b.r)


def _turned(R_b_c: Array, ray_c: Array, to_b: Array) -> Array:
    """Return the rotation with the least sum of chords between rays and directions.

    Kabsch's rotation, reweighted by the chords, as in `bundle.start.start_values`.
    """
    weight = np.ones(len(ray_c))
    for _ in range(TURNS):
        U, _, Vt = np.linalg.svd(np.einsum("n,ni,nj->ij", weight, to_b, ray_c))
        R_b_c = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
        weight = 1 / np.maximum(np.linalg.norm(to_b - ray_c @ R_b_c.T, axis=1), 1e-4)
    return R_b_c


# --- adjustment -------------------------------------------------------------------------------

N_MOUNT, N_LENS = 6, 8
N_CAMERA = N_MOUNT + N_LENS
"""Columns of a camera: turn, lever arm, then f, xp, yp, k1, k2, k3, p1, p2; the last is a delay."""


def _adjusted(
    seen: Sightings,
    T_m_b: Pose,
    start: Mounted,
    velocity: Array | None,
) -> Mounted:
    """Return the robust adjustment from a start."""
    prior = _prior_sigma(seen.cameras, held=start.held, delayed=velocity is not None)
    if velocity is None:
        velocity = np.zeros((len(T_m_b), 3))
    best = state = replace(start, misfit=np.inf)
    for _ in range(STEPS):
        v, A, B = _linear(seen, T_m_b, state, velocity)
        misfit = size(v)
        worst = np.quantile(np.nan_to_num(np.abs(v), nan=np.inf), WORST, method="higher")
        state = replace(state, misfit=misfit, worst=float(worst))
        settled = misfit > (1 - SETTLED) * best.misfit
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
    each = np.quantile(u, QUANTILE, axis=0, method="higher") / NORMAL
    return float(np.sqrt(np.mean(each**2)))


def measuring_noise(seen: Sightings, T_m_b: Pose, found: Mounted) -> float:
    """Return the misfit of rays with a free pose for every exposure: the measuring noise.

    Returns
    -------
    float
        Standard deviation of a component, median of the exposures, radians; NaN where none has
        measurements enough.
    """
    v, A, B = _linear(seen, T_m_b, found, np.zeros((len(T_m_b), 3)))
    ok = np.all(np.isfinite(v), axis=1)
    variances = []
    for exposure in range(len(T_m_b)):
        rows = np.flatnonzero(ok & (seen.exposure_idx == exposure))
        cameras = np.unique(seen.camera_idx[rows])
        if 2 * len(rows) < FREE_POSE + ENOUGH_LEFT or len(cameras) != 1:
            continue
        c = N_CAMERA * int(cameras[0])
        J = np.concatenate([A[rows, :, c : c + 3], B[rows]], axis=2).reshape(-1, FREE_POSE)
        residuals = v[rows].ravel() - J @ np.linalg.lstsq(J, v[rows].ravel(), rcond=None)[0]
        variances.append(residuals @ residuals / (len(residuals) - FREE_POSE))
    return float(np.sqrt(np.median(variances))) if variances else np.nan


def _prior_sigma(cameras: tuple[Camera, ...], *, held: bool, delayed: bool) -> Array:
    """Return prior standard deviations of the unknowns, tiny for held unknowns."""
    out = []
    for camera in cameras:
        f, r = camera.interior.f, 0.5 * camera.diagonal_px * camera.pixel_mm
        lens = [0.01 / r**2, 0.01 / r**4, 0.01 / r**6, 0.002 / r, 0.002 / r]
        lever, focal = (1e-6, 1e-6) if held else (LEVER_M, 0.01 * f)
        out += [*[10.0] * 3, *[lever] * 3, focal, 0.005 * f, 0.005 * f, *lens]
    return np.array([*out, DELAY_S if delayed else 1e-9])


def _linear(
    seen: Sightings, T_m_b: Pose, state: Mounted, velocity: Array
) -> tuple[Array, Array, Array]:
    """Return residuals (n, 2) and derivatives by the unknowns (n, 2, p) and the points (n, 2, 3).

    All divided by the declared focal length, so in radians.
    """
    moved = Pose(R=T_m_b.R, r=T_m_b.r + state.delay_s * velocity)
    v, B = np.empty((len(seen), 2)), np.empty((len(seen), 2, 3))
    A = np.zeros((len(seen), 2, N_CAMERA * len(seen.cameras) + 1))
    for k, camera in enumerate(state.cameras):
        rows = np.flatnonzero(seen.camera_idx == k)
        f, unit = camera.interior.f, seen.cameras[k].interior.f
        T_m_c = moved[seen.exposure_idx[rows]] @ camera.T_b_c
        x_c = to_camera(T_m_c, state.x_m[seen.point_idx[rows]])
        xy = xy_from_colrow(camera, seen.colrow[rows])
        ideal = pinhole(f, x_c)
        v[rows] = (ideal - correct(camera.interior, xy)) / unit
        by_x = pinhole_jacobian(f, x_c) / unit
        by_m = by_x @ np.swapaxes(T_m_c.R, -1, -2)
        by_lens = -correct_jacobian(camera.interior, xy)[:, :, :N_LENS] / unit
        by_lens[:, :, 0] = ideal / (f * unit)
        by_mount = [by_x @ skew(x_c), -by_x @ camera.T_b_c.R.T]
        A[rows, :, N_CAMERA * k : N_CAMERA * (k + 1)] = np.concatenate([*by_mount, by_lens], axis=2)
        A[rows, :, -1] = -transform(by_m, velocity[seen.exposure_idx[rows]])
        B[rows] = by_m
    return v, A, B


def _step(
    seen: Sightings, state: Mounted, linear: tuple[Array, Array, Array], prior: Array
) -> tuple[Array, Array]:
    """Return a reweighted step of the unknowns, with points eliminated, and the moved points."""
    u = np.nan_to_num(np.linalg.norm(linear[0], axis=1), nan=np.inf) / (WIDTH * state.misfit)
    v, A, B = (np.nan_to_num(part) for part in linear)
    weight = (np.square(1 / (1 + u**2)) / state.misfit**2)[:, None, None]
    WA, WB = weight * A, weight * B
    N = np.einsum("nki,nkj->ij", WA, A, optimize=True) + np.diag(prior**-2)
    h = np.einsum("nki,nk->i", WA, v)
    declared = _from_declared(seen, state)
    h[: len(declared)] += declared / prior[: len(declared)] ** 2
    C, D, g = (np.zeros((len(seen.x_m), 3, *more)) for more in ((3,), (len(h),), ()))
    np.add.at(C, seen.point_idx, np.swapaxes(WB, 1, 2) @ B)
    np.add.at(D, seen.point_idx, np.swapaxes(WB, 1, 2) @ A)
    np.add.at(g, seen.point_idx, np.einsum("nki,nk->ni", WB, v))
    surveyed = np.isfinite(seen.x_m[:, 0])
    C += np.where(surveyed, HELD, LOOSE)[:, None, None] * np.eye(3)
    DC = np.linalg.solve(C, D)
    N -= np.einsum("pki,pkj->ij", D, DC, optimize=True)
    h -= np.einsum("pki,pk->i", DC, g)
    dx = -np.linalg.solve(N, h)
    step = np.linalg.solve(C, (g + D @ dx)[..., None])[..., 0]
    return dx, np.where(surveyed[:, None], state.x_m, state.x_m - step)


def _from_declared(seen: Sightings, state: Mounted) -> Array:
    """Return the unknowns less their declared values; zero for turns, which are free."""
    out = np.zeros(N_CAMERA * len(seen.cameras) + 1)
    for k, (camera, declared) in enumerate(zip(state.cameras, seen.cameras, strict=True)):
        c = N_CAMERA * k
        out[c + 3 : c + N_MOUNT] = camera.T_b_c.r - declared.T_b_c.r
        lens = camera.interior.to_array() - declared.interior.to_array()
        out[c + N_MOUNT : c + N_CAMERA] = lens[:N_LENS]
    out[-1] = state.delay_s
    return out


def _moved(state: Mounted, dx: Array, x_m: Array) -> Mounted:
    cameras = []
    for k, camera in enumerate(state.cameras):
        d = dx[N_CAMERA * k : N_CAMERA * (k + 1)]
        turn = d[:3] * min(1.0, LARGEST_TURN / max(float(np.linalg.norm(d[:3])), 1e-300))
        lens = camera.interior.to_array()
        lens[:N_LENS] += d[N_MOUNT:]
        lens[0] = max(lens[0], 0.5 * camera.interior.f)
        mount = Pose(R=camera.T_b_c.R @ exp(turn), r=camera.T_b_c.r + d[3:N_MOUNT])
        cameras.append(replace(camera, interior=Interior.from_array(lens), T_b_c=mount))
    return replace(state, cameras=tuple(cameras), x_m=x_m, delay_s=state.delay_s + float(dx[-1]))


# --- Readings of a block with an estimated number: a shift, a scale or a delay
#
# Each is a pattern in the residuals. Its size is estimated together with mounting and lens, which
# may absorb a part, and then removed from the measurements or from control.


ROUNDS = 2, 3
"""How often the sizes of a pattern are estimated, each time after an adjustment without it, and
how often where the reading is promising."""

PART = 0.25
"""Share of the residuals, of which a pattern that may be named makes up more."""

SEARCHED_PX = 10.0
"""Misfit, px, from which the size of a pattern that has a limit is searched."""

SEARCHED = 21
"""Number of sizes that are tried then."""

LEAST_SURVEYED = 4
"""Number of surveyed points from which they may be moved or scaled."""


class _Pattern(NamedTuple):
    """The effect of a mistake on the measurements or on the surveyed points.

    Attributes
    ----------
    name : str
        With places for the sizes.
    units : tuple of float
        By which the sizes are multiplied for the name.
    by_image, by_point : ndarray, shape (n, 2, k) or (n_points, 3, k)
        Image coordinates, radians, or meters, per unit of each size; one of them is None.
    limit : float
        Where residuals are large, the size is searched between minus and plus this limit, since
        linear steps do not lead to it; zero where they do.
    """

    name: str
    units: tuple[float, ...]
    by_image: Array | None = None
    by_point: Array | None = None
    limit: float = 0.0


def _numbered_readings(
    block: Block, seen: Sightings, given: Mounted
) -> Iterator[tuple[Reading, Mounted]]:
    """Yield the readings with a fitted number, each with its fitted cameras."""
    T_m_b = block.trajectory.T_m_b[seen.exposures]
    if not np.isfinite(given.misfit):
        return
    for pattern in (*_mounted_of_control(seen), *_mounted_of_images(block, seen, T_m_b, given)):
        yield _fitted(pattern, seen, T_m_b, given)


def _fitted(
    pattern: _Pattern, seen: Sightings, T_m_b: Pose, given: Mounted
) -> tuple[Reading, Mounted]:
    """Return the reading with a pattern removed, and its fitted cameras."""
    total, undone, fit = _start(pattern, seen, T_m_b, given)
    usual, most = ROUNDS
    for done in range(most):
        if done >= usual and fit.misfit * FITTED > given.misfit:
            break
        by_size = _in_residuals(pattern, seen, T_m_b, fit)
        step = _pattern_sizes(undone, T_m_b, fit, by_size)
        if not total.any() and size(by_size @ step) < PART * given.misfit:
            break  # without so small a part, the residuals are hardly smaller
        sizes = total + step
        without, adjusted = _fitted_without(pattern, seen, T_m_b, sizes)
        if pattern.limit and adjusted.misfit > fit.misfit:
            break  # a searched size is not left for a linear step that fits worse
        total, undone, fit = sizes, without, adjusted
    says = pattern.name.format(*np.multiply(pattern.units, total))
    quantity = "image" if pattern.by_point is None else "position"
    return Reading("", (), says, quantity, undone, T_m_b), fit


def _start(
    pattern: _Pattern, seen: Sightings, T_m_b: Pose, given: Mounted
) -> tuple[Array, Sightings, Mounted]:
    """Return the sizes to begin with, the sightings without them, and their fitted cameras."""
    camera, unchanged = seen.cameras[0], (np.zeros(len(pattern.units)), seen, given)
    if not pattern.limit or given.misfit < SEARCHED_PX * camera.pixel_mm / camera.interior.f:
        return unchanged
    fits = [
        (_fitted_without(pattern, seen, T_m_b, np.array([size]))[1].misfit, size)
        for size in np.linspace(-pattern.limit, pattern.limit, SEARCHED)
    ]
    sizes = np.array([min(fits)[1]])
    undone, fit = _fitted_without(pattern, seen, T_m_b, sizes)
    return (sizes, undone, fit) if fit.misfit < given.misfit else unchanged


def _fitted_without(
    pattern: _Pattern, seen: Sightings, T_m_b: Pose, sizes: Array
) -> tuple[Sightings, Mounted]:
    """Return the sightings without a pattern of these sizes, and their fitted cameras."""
    undone = _without(pattern, seen, sizes)
    return undone, mounted(undone, T_m_b)


def _in_residuals(pattern: _Pattern, seen: Sightings, T_m_b: Pose, fit: Mounted) -> Array:
    """Return the effect of a pattern on the residuals, radians, shape (n, 2, k)."""
    if pattern.by_image is not None:
        return -pattern.by_image
    by_point = np.zeros((len(seen.x_m), 3, 1)) if pattern.by_point is None else pattern.by_point
    return _derivatives(seen, T_m_b, fit) @ by_point[seen.point_idx]


def _without(pattern: _Pattern, seen: Sightings, sizes: Array) -> Sightings:
    """Return the sightings with a pattern of these sizes added."""
    if pattern.by_point is not None:
        return replace(seen, x_m=seen.x_m + pattern.by_point @ sizes)
    if pattern.by_image is None:
        return seen
    scale = np.array([c.interior.f / c.pixel_mm for c in seen.cameras])[seen.camera_idx]
    moved = scale[:, None] * (pattern.by_image @ sizes) * np.array([1.0, -1.0])
    return replace(seen, colrow=seen.colrow + moved)


def _mounted_of_control(seen: Sightings) -> Iterator[_Pattern]:
    """Yield patterns of surveyed points of another epoch, and of another scale."""
    surveyed: Mask = np.isfinite(seen.x_m[:, 0])
    if surveyed.sum() < LEAST_SURVEYED:
        return
    shift, scale = np.zeros((len(surveyed), 3, 3)), np.zeros((len(surveyed), 3, 1))
    shift[surveyed] = np.eye(3)
    scale[surveyed, :2, 0] = seen.x_m[surveyed, :2] - seen.x_m[surveyed, :2].mean(axis=0)
    says = "control points moved by {:+.2f} m east and {:+.2f} m north, as from another epoch,"
    yield _Pattern(says, (1.0, 1.0), by_point=shift[:, :, :2])
    says = "control points moved by {:+.1f} m in height, as from another height system,"
    yield _Pattern(says, (1.0,), by_point=shift[:, :, 2:])
    says = "control points scaled by {:+.0f} ppm, as from the ground to the grid,"
    yield _Pattern(says, (1e6,), by_point=scale)


def _mounted_of_images(
    block: Block, seen: Sightings, T_m_b: Pose, given: Mounted
) -> Iterator[_Pattern]:
    """Yield patterns of pixels that are not square, and of a rolling shutter."""
    xy, height = np.empty((len(seen), 2)), np.empty(len(seen))
    for k, camera in enumerate(seen.cameras):
        of_camera = seen.camera_idx == k
        xy[of_camera] = xy_from_colrow(camera, seen.colrow[of_camera]) / camera.interior.f
        height[of_camera] = camera.height_px
    says = "image coordinates scaled by about {:+.0f} %, as by another focal_mm or pixel_um,"
    yield _Pattern(says, (100.0,), by_image=xy[:, :, None], limit=0.5)
    wider = np.stack([xy[:, 0], np.zeros(len(seen))], axis=1)[:, :, None]
    yield _Pattern("pixels that are {:+.2f} % wider than high", (100.0,), by_image=wider)
    velocity = _velocities(block, seen)
    if velocity is not None:
        share = (seen.colrow[:, 1] - (height - 1) / 2) / height
        moved = _derivatives(seen, T_m_b, given) @ velocity[seen.exposure_idx][:, :, None]
        says = "rows read out one after the other, a rolling shutter of {:+.0f} ms,"
        yield _Pattern(says, (-1000.0,), by_image=share[:, None, None] * moved)


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


# --- A part of a block's measurements, enough to compare readings of the flight by


MOST_IMAGES = 60
"""Largest number of images in use, spread over the block."""

MOST_MEASUREMENTS = 900
"""Largest number of their measurements, spread likewise."""

RUN = 10
"""Number of neighbouring exposures in use where tie points are needed."""

FEWEST_RAYS = 3
"""Of a tie point: two rays of one strip do not control angles across it."""

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
    points = block.image_points[np.isfinite(block.image_points.sigma_px)]
    few = _of_some_images(block, points[np.isfinite(x_m[points.point_idx, 0])])
    if not _enough(block, few):
        few = _with_ties(block, points, np.isfinite(x_m[:, 0]))
    if not _enough(block, few):
        return None
    return _sightings_of(block, few, x_m)


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
