"""Usual mistakes in the numbers of a flight, found by the fit to control points.

Control points are projected into the images; where they miss their measurements, the usual errors
of signs, orders and units are tried one by one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, islice, product

import numpy as np
import pyproj

from acx4files.flight.block_from_tables import BlockTables, assemble, lonlat_of, measured_control
from acx4files.flight.problems import SHOWN, Problem
from acx4files.flight.settings import Setup
from acx4files.flight.tables import Table
from acx4files.flight.toml_file import Toml
from acx4lib.block import Block
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import Camera, correct, xy_from_colrow
from acx4lib.geometry.collinearity import pinhole, to_camera
from acx4lib.geometry.frames import (
    Pose,
    opk_from_rotation,
    rotation_from_opk,
    rph_from_rotation,
    turn,
)
from acx4lib.geometry.geodesy import GridSystem

# --- Whether control points project near their measurements, and the likely mistake if not
#
# With the approximate mounting and the trajectory, a control point must project near its
# measurements. If it does not, the usual mistakes are undone one by one. If everything fits
# after one of them, this mistake is named.


ENOUGH = 3
"""Number of control measurements that is enough to judge a single camera."""

ENOUGH_TO_EXPLAIN = 5000
"""Number of rows of a table above which mistakes are tried on a part of the measurements."""

MOST = 0.75
"""Quantile of the distances that must be within the limit after a mistake is undone."""

ALIKE = 0.9
"""Ratio to the best misfit so far below which a later mistake is clearly the better explanation."""

FAR = 50_000.0
"""Distance of a block from its control points, m, that only another CRS explains."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Misfit:
    """Distances of control points from their measurements.

    Attributes
    ----------
    distance_px : ndarray, shape (n,)
        Infinite for a point behind the camera.
    allowed_px : ndarray, shape (n,)
        A quarter of the image diagonal.
    camera_idx, point_idx : ndarray, shape (n,)
    """

    distance_px: Array
    allowed_px: Array
    camera_idx: Index
    point_idx: Index

    def __len__(self) -> int:
        """Count the measurements."""
        return len(self.distance_px)

    def __getitem__(self, keep: Mask) -> Misfit:
        """Select measurements."""
        return Misfit(
            distance_px=self.distance_px[keep],
            allowed_px=self.allowed_px[keep],
            camera_idx=self.camera_idx[keep],
            point_idx=self.point_idx[keep],
        )

    def ratio(self, quantile: float) -> float:
        """Return a quantile of the ratios of distance to allowed distance."""
        return float(np.quantile(self.distance_px / self.allowed_px, quantile, method="higher"))


def misfit(block: Block) -> Misfit:
    """Return the distances of surveyed points, projected unadjusted, from their measurements."""
    x_m = np.full((len(block.points), 3), np.nan)
    is_surveyed = np.zeros(len(block.points), dtype=bool)
    for surveyed in (block.control, block.check):
        x_m[surveyed.point_idx] = surveyed.x_m
        is_surveyed[surveyed.point_idx] = True
    points = block.image_points[is_surveyed[block.image_points.point_idx]]
    camera_idx = block.images.camera_idx[points.image_idx]
    distance = np.full(len(points), np.inf)
    allowed = np.full(len(points), np.inf)
    for i, camera in enumerate(block.cameras):
        mine = camera_idx == i
        T_m_c = block.T_m_b_images[points.image_idx[mine]] @ camera.T_b_c
        x_c = to_camera(T_m_c, x_m[points.point_idx[mine]])
        ideal = correct(camera.interior, xy_from_colrow(camera, points.colrow[mine]))
        away = pinhole(camera.interior.f, x_c) - ideal
        distance[mine] = np.hypot(*away.T) / camera.pixel_mm
        allowed[mine] = camera.diagonal_px / 4
    distance[np.isnan(distance)] = np.inf
    return Misfit(
        distance_px=distance,
        allowed_px=allowed,
        camera_idx=camera_idx,
        point_idx=points.point_idx,
    )


def fit_problems(tables: BlockTables, setup: Setup, toml: Toml) -> Iterator[Problem]:
    """Yield a problem where the median distance exceeds a quarter of the image diagonal.

    Half of the strips may be wrong and the median good (headings of 0 and 180 degrees in
    radians). So a problem is also reported where a usual mistake explains the worse half.

    Parameters
    ----------
    tables : BlockTables
        Tables without any other problem.
    setup : Setup
    toml : Toml
        It has the lines of the mounting angles.
    """
    tables = _control_only(tables)
    if not len(tables.image_points):
        return
    with np.errstate(all="ignore"):  # wrong positions may have no convergence
        block = assemble(tables, setup)
        misfits = misfit(block)
    by_camera = {c.name: misfits[misfits.camera_idx == i] for i, c in enumerate(block.cameras)}
    judged = {name: mine for name, mine in by_camera.items() if len(mine) >= ENOUGH}
    wrong = {name: mine for name, mine in judged.items() if mine.ratio(0.5) > 1}
    if wrong and len(wrong) < len(judged):
        for name, mine in islice(wrong.items(), SHOWN):
            yield _one_camera(tables, setup, toml, (name, mine))
        if len(wrong) > SHOWN:
            fault = f"control points do not fit images of {len(wrong) - SHOWN} more cameras"
            yield toml.problem(("cameras",), fault, "must lie near their measurements")
    elif misfits.ratio(MOST) > 1:
        problem, explained = _whole_block(tables, setup, toml, misfits)
        if explained or misfits.ratio(0.5) > 1:
            yield problem


def _control_only(tables: BlockTables) -> BlockTables:
    """Return the tables with measured control points only, without tie points."""
    surveyed = set(tables.control.text["point"])
    names = tables.image_points.text["point"]
    measured = np.array([name in surveyed for name in names], dtype=bool)
    return replace(
        tables,
        image_points=tables.image_points.select(measured),
        control=tables.control.select(measured_control(tables)),
        distances=None,
    )


def _thinned(tables: BlockTables) -> BlockTables:
    """Return at most `ENOUGH_TO_EXPLAIN` measurements of a large block, with their rows.

    About forty mistakes are tried; a part of the measurements shows them as well as all do.
    """
    if max(len(table) for table in tables.tables) <= ENOUGH_TO_EXPLAIN:
        return tables
    points = tables.image_points
    every = -(-len(points) // ENOUGH_TO_EXPLAIN)
    points = points.select(np.arange(len(points)) % every == 0)
    images = _named(tables.images, "image", points.text["image"])
    return replace(
        tables,
        image_points=points,
        images=images,
        trajectory=_named(tables.trajectory, "exposure", images.text["exposure"]),
        control=_named(tables.control, "point", points.text["point"]),
        distances=None,
    )


def _named(table: Table, column: str, names: Iterable[str]) -> Table:
    """Select the rows with the given names."""
    wanted = set(names)
    return table.select(np.array([name in wanted for name in table.text[column]], dtype=bool))


def _whole_block(
    tables: BlockTables, setup: Setup, toml: Toml, misfits: Misfit
) -> tuple[Problem, bool]:
    """Return the problem of a block, and whether a usual mistake explains it."""
    problem = _problem(tables, misfits, "control points")
    best, explanation = _best(_mistakes(_thinned(tables), setup))
    if best is None:
        return replace(problem, found=f"{problem.found}; {_where(tables, setup)}"), False
    problem = replace(problem, found=f"{problem.found}; {explanation}")
    if best.where == "mount":
        return _at_mount(problem, toml, min(tables.images.text["camera"])), True
    table: Table = getattr(tables, best.where)
    return replace(problem, file=table.file, column=best.column), True


def _one_camera(
    tables: BlockTables, setup: Setup, toml: Toml, camera_misfits: tuple[str, Misfit]
) -> Problem:
    name, misfits = camera_misfits
    camera = dict(zip(tables.images.text["image"], tables.images.text["camera"], strict=True))
    keep = np.array([camera[i] == name for i in tables.image_points.text["image"]], dtype=bool)
    of_camera = replace(
        tables,
        image_points=tables.image_points.select(keep),
        images=_named(tables.images, "camera", [name]),
    )
    _, explanation = _best(_mounting_mistakes(_thinned(of_camera), setup, only=name))
    problem = _problem(tables, misfits, f"control points in images of {name}")
    return _at_mount(replace(problem, found=f"{problem.found}; {explanation}"), toml, name)


def _best(candidates: Iterator[_Mistake]) -> tuple[_Mistake | None, str]:
    """Return the mistake that explains nearly all misfits, or None, and a sentence on it."""
    best, least, remaining = None, 1.0 / ALIKE, ""
    for mistake in candidates:
        with np.errstate(all="ignore"):  # changed positions may not be on the earth
            after = misfit(assemble(mistake.tables, mistake.setup))
            ratio = after.ratio(MOST)
        if ratio < ALIKE * least:
            best, least, remaining = mistake, ratio, f"{np.median(after.distance_px):.0f} px"
    if best is None:
        return None, "no quarter turn or sign explains it"
    return best, f"it looks as if {best.says} (then {remaining})"


def _problem(tables: BlockTables, misfits: Misfit, points: str) -> Problem:
    median = float(np.median(misfits.distance_px))
    place = (
        f"{median:.0f} px from their measurements" if np.isfinite(median) else "behind the camera"
    )
    allowed = np.median(misfits.allowed_px)
    outside = int((misfits.distance_px > misfits.allowed_px).sum())
    return Problem(
        file=tables.control.file,
        line=1,
        column="east_m",
        found=f"{points} lie {place} (median; {outside} of {len(misfits)} too far) with the "
        f"trajectory of {tables.trajectory.file} and the points of {tables.control.file}",
        expected=f"must be below {allowed:.0f} px, a quarter of the image diagonal",
    )


def _at_mount(problem: Problem, toml: Toml, camera: str) -> Problem:
    """Move the place of a problem to the mounting angles in flight.toml."""
    return toml.problem(("cameras", camera, "mount_kappa_deg"), problem.found, problem.expected)


def _where(tables: BlockTables, setup: Setup) -> str:
    """Return a sentence on the distance between control and exposures, to find the mistake."""
    with np.errstate(all="ignore"):
        block = assemble(tables, setup)
    surveyed = np.concatenate([block.control.x_m, block.check.x_m])
    shift = surveyed.mean(axis=0) - block.trajectory.T_m_b.r.mean(axis=0)
    doubt = (
        f" (is {setup.grid.crs} the right CRS?)"
        if np.hypot(*shift[:2]) > FAR and not setup.grid.is_local
        else ""
    )
    return (
        "no usual mistake explains it; the control points' middle lies "
        f"{shift[0]:.0f} m east, {shift[1]:.0f} m north and {shift[2]:.0f} m up of the exposures'"
        f"{doubt}"
    )


# --- The usual mistakes in positions and angles, and the flight with each of them undone


NO_TURN = np.radians(3.0)
"""Mounting angles below which a camera has the axes of the body."""

SIGNS = ((-1, 1, 1), (1, -1, 1), (-1, -1, 1), (1, 1, -1), (-1, -1, -1))
QUARTERS = (90, 180, -90)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Mistake:
    """A flight with one usual mistake undone.

    Attributes
    ----------
    where : {"control", "trajectory", "image_points", "mount"}
        The table or value with the mistake.
    column : str
        Column of that table; empty for the mounting.
    says : str
        End of a sentence that begins with "it looks as if".
    tables : BlockTables
    setup : Setup
    """

    where: str
    column: str = ""
    says: str
    tables: BlockTables
    setup: Setup


def _mistakes(tables: BlockTables, setup: Setup) -> Iterator[_Mistake]:
    """Yield a block with each of the usual mistakes undone."""
    for where in ("control", "trajectory"):
        yield from _position_mistakes(tables, setup, where)
    yield from _mounting_mistakes(tables, setup)
    yield from _trajectory_mistakes(tables, setup)
    yield from _measurement_mistakes(tables, setup)


def _swapped(table: Table, a: str, b: str) -> Table:
    return _changed(table, **{a: table.numbers[b], b: table.numbers[a]})


def _position_mistakes(tables: BlockTables, setup: Setup, kind: str) -> Iterator[_Mistake]:
    table: Table = getattr(tables, kind)

    def undone(column: str, mistake: str, changed: Table) -> _Mistake:
        return _Mistake(
            where=kind,
            column=column,
            says=f"{mistake} in {table.file}",
            tables=replace(tables, control=changed)
            if kind == "control"
            else replace(tables, trajectory=changed),
            setup=setup,
        )

    if kind == "control":
        height, lonlat = table.numbers["height_m"], lonlat_of(table, setup.grid)
        for meaning, other in height_readings(height, lonlat, setup.grid):
            changed = _changed(table, height_m=other)
            yield undone("height_m", f"height_m were {meaning}", changed)
    if "lat_deg" in table.numbers:
        both = "latitude and longitude were"
        yield undone("lat_deg", f"{both} swapped", _swapped(table, "lat_deg", "lon_deg"))
        degrees = {name: np.degrees(table.numbers[name]) for name in ("lat_deg", "lon_deg")}
        yield undone("lat_deg", f"{both} in radians", _changed(table, **degrees))
        for names in (("lon_deg",), ("lat_deg",), ("lat_deg", "lon_deg")):
            negative = {name: -table.numbers[name] for name in names}
            says = f"{', '.join(names)} were of opposite sign"
            yield undone(names[0], says, _changed(table, **negative))
        return
    mistake = "east_m and north_m were swapped"
    yield undone("east_m", mistake, _swapped(table, "east_m", "north_m"))
    for zone, east_north in _other_zones(setup.grid, table.stack("east_m", "north_m")):
        moved = _changed(table, east_m=east_north[:, 0], north_m=east_north[:, 1])
        yield undone("east_m", f"east_m and north_m were of UTM zone {zone}", moved)


def _other_zones(grid: GridSystem, east_north: Array) -> Iterator[tuple[str, Array]]:
    """Yield the grid coordinates if east and north were of a neighbouring UTM zone."""
    if grid.is_local:
        return
    crs = pyproj.CRS.from_user_input(grid.crs)
    here, ellipsoid = crs.utm_zone, crs.ellipsoid
    if here is None or ellipsoid is None:
        return
    for zone in range(max(1, int(here[:-1]) - 2), min(60, int(here[:-1]) + 2) + 1):
        for hemisphere, south in (("N", ""), ("S", " +south")):
            other = pyproj.Proj(
                f"+proj=utm +zone={zone}{south} +a={ellipsoid.semi_major_metre!r} "
                f"+b={ellipsoid.semi_minor_metre!r}"
            )
            lonlat = np.stack(other(east_north[:, 0], east_north[:, 1], inverse=True), axis=-1)
            if f"{zone}{hemisphere}" != here and np.isfinite(lonlat).all():
                yield f"{zone}{hemisphere}", grid.grid_from_lonlat(lonlat)


def _trajectory_mistakes(tables: BlockTables, setup: Setup) -> Iterator[_Mistake]:
    table = tables.trajectory
    names = {*tables.images.text["camera"]}
    others = readings(table, setup.grid)
    if len(names) == 1:
        of_camera = of_cameras(table, setup.cameras[names.pop()].T_b_c.R)
        others = chain(others, of_camera)
    for reading in others:
        yield _Mistake(
            where="trajectory",
            column=reading.columns[-1] if table.has(reading.columns[-1]) else "exposure",
            says=f"{reading.says} in {table.file}",
            tables=replace(tables, trajectory=reading.table),
            setup=setup,
        )


def _measurement_mistakes(tables: BlockTables, setup: Setup) -> Iterator[_Mistake]:
    table = tables.image_points
    name_of = dict(zip(tables.images.text["image"], tables.images.text["camera"], strict=True))
    cameras = [setup.cameras[name_of[image]] for image in table.text["image"]]
    size = np.array([[camera.width_px, camera.height_px] for camera in cameras])
    pixel_mm = np.array([[camera.pixel_mm] for camera in cameras])
    others = pixel_readings(table.stack("col_px", "row_px"), size, pixel_mm)
    for columns, meaning, colrow in others:
        col, row = colrow.T
        yield _Mistake(
            where="image_points",
            column="row_px",
            says=f"{columns} were {meaning} in {table.file}",
            tables=replace(tables, image_points=_changed(table, col_px=col, row_px=row)),
            setup=setup,
        )


def _mounting_mistakes(tables: BlockTables, setup: Setup, *, only: str = "") -> Iterator[_Mistake]:
    """Yield a block with other mountings: quarter turns, upside down, the inverse rotation."""
    present = set(tables.images.text["camera"])
    names = [name for name in setup.cameras if name == only or (not only and name in present)]
    upside = turn(0, np.pi)
    turns: list[tuple[str, Callable[[Array], Array]]] = [
        *((f"turned by {k} degrees about z", _turned(_quarter(k))) for k in QUARTERS),
        *(("with z forward", _turned(upside @ _quarter(k))) for k in (0, *QUARTERS)),
        ("of the inverse rotation, body to camera", _inverse),
        *(("of other signs", _signs(*signs)) for signs in SIGNS),
    ]
    for mistake, turned in turns:
        cameras = {
            name: _remounted(camera, turned) if name in names else camera
            for name, camera in setup.cameras.items()
        }
        mounted = [cameras[name] for name in names]
        yield _Mistake(
            where="mount",
            says=f"the camera axes were {mistake}: {_angles(mounted)}{_or_of_the_camera(mounted)}",
            tables=tables,
            setup=replace(setup, cameras=cameras),
        )


def _angles(cameras: list[Camera]) -> str:
    """Return the sentence on the mounting angles that would fit."""
    opk = {camera.name: np.round(np.degrees(camera.T_b_c.opk)) + 0.0 for camera in cameras[:SHOWN]}
    listed = "; ".join(f"{name} {o:.0f}, {p:.0f}, {k:.0f}" for name, (o, p, k) in opk.items())
    more = "; …" if len(cameras) > SHOWN else ""
    return f"mount_omega_deg, mount_phi_deg, mount_kappa_deg of {listed}{more} would fit"


def _or_of_the_camera(cameras: list[Camera]) -> str:
    """Return the other explanation of a mounting without rotation: angles of the camera."""
    unturned = len(cameras) == 1 and np.allclose(cameras[0].T_b_c.R, np.eye(3), atol=NO_TURN)
    return ", or the angles are of the camera, not of the body" if unturned else ""


def _inverse(R_b_c: Array) -> Array:
    return R_b_c.T


def _quarter(k: int) -> Array:
    return turn(2, np.radians(k))


def _signs(*signs: int) -> Callable[[Array], Array]:
    return lambda R_b_c: rotation_from_opk(opk_from_rotation(R_b_c) * np.array(signs))


def _turned(R: Array) -> Callable[[Array], Array]:
    return lambda R_b_c: R_b_c @ R


def _remounted(camera: Camera, turned: Callable[[Array], Array]) -> Camera:
    return replace(camera, T_b_c=Pose(R=turned(camera.T_b_c.R), r=camera.T_b_c.r))


# --- The usual interpretations of the numbers of a flight: signs, orders, units, axes and rows


ANGLES = {
    "geographic": ("roll_deg", "pitch_deg", "heading_deg"),
    "grid": ("omega_deg", "phi_deg", "kappa_deg"),
}
_SIGNS = sorted(product((1, -1), repeat=3), key=lambda signs: signs.count(-1))[1:]
"""Signs of three angles, those with the fewest changes first."""

_QUARTERS = {
    90: "90 degrees too small",
    180: "180 degrees too small",
    -90: "90 degrees too large",
}
FOOT = 0.3048
"""International foot, m; that of the US survey is longer by a hundredth of a millimetre in 5 m."""

ROUND_GON, ROUND_DEG = 400.0, 360.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Reading:
    """A trajectory under one interpretation of its numbers, converted to the contract.

    Attributes
    ----------
    quantity : {"attitude", "position"}
        The quantity that changes most.
    columns : tuple of str
        Columns that are interpreted otherwise.
    meaning : str
        Their interpretation, such as "of opposite sign".
    table : Table
        The trajectory in the contract's own signs, orders and units.
    """

    quantity: str
    columns: tuple[str, ...]
    meaning: str
    table: Table

    @property
    def says(self) -> str:
        """The end of a sentence that begins with "it looks as if"."""
        return f"{', '.join(self.columns)} were {self.meaning}"

    @property
    def name(self) -> str:
        """Columns and meaning, as in "pitch of opposite sign"."""
        plain = [column.removesuffix("_deg").removesuffix("_m") for column in self.columns]
        return f"{', '.join(plain)} {self.meaning}"


def _angle_columns(table: Table) -> tuple[str, str, str]:
    """Return the names of a trajectory's three angles."""
    return ANGLES["geographic" if "lat_deg" in table.numbers else "grid"]


def _changed(table: Table, **columns: Array) -> Table:
    """Return a table with other numbers in some of its columns."""
    return replace(table, numbers={**table.numbers, **columns})


def readings(table: Table, grid: GridSystem) -> Iterator[Reading]:
    """Yield a trajectory under each usual interpretation, the simplest first.

    Parameters
    ----------
    table : Table
        A trajectory in either form.
    grid : GridSystem
        Of the flight, for the convergence of its meridians and the heights of its geoid.
    """
    yield from _usual_signs(table)
    yield from _headings(table, grid)
    yield from _exchanged(table)
    yield from _units(table)
    yield from _orders(table)
    yield from _heights(table, grid)
    yield from _rows(table)


def _attitude(table: Table, meaning: str, **columns: Array) -> Reading:
    return Reading(
        quantity="attitude",
        columns=tuple(columns),
        meaning=meaning,
        table=_changed(table, **columns),
    )


def _usual_signs(table: Table) -> Iterator[Reading]:
    """Yield roll, pitch and heading with opposite signs: one, two or all three."""
    names = _angle_columns(table)
    for signs in _SIGNS:
        flipped = {n: -table.numbers[n] for n, s in zip(names, signs, strict=True) if s < 0}
        yield _attitude(table, "of opposite sign", **flipped)


def _headings(table: Table, grid: GridSystem) -> Iterator[Reading]:
    """Yield headings from other zero directions."""
    heading = _angle_columns(table)[2]
    value = table.numbers[heading]
    other = "an angle from east" if heading == "heading_deg" else "a heading from north"
    yield _attitude(table, other, **{heading: 90.0 - value})
    for k, wrong in _QUARTERS.items():
        yield _attitude(table, wrong, **{heading: value + k})
    with np.errstate(all="ignore"):  # wrong positions may have no convergence
        convergence = np.degrees(grid.convergence(_lonlat(table, grid)))
    north = "from grid north" if heading == "heading_deg" else "from true north"
    yield _attitude(table, north, **{heading: value + np.nan_to_num(convergence)})


def _lonlat(table: Table, grid: GridSystem) -> Array:
    if "lat_deg" in table.numbers:
        return table.stack("lon_deg", "lat_deg")
    return grid.lonlat_from_grid(table.stack("east_m", "north_m"))


def _exchanged(table: Table) -> Iterator[Reading]:
    """Yield angles in each other's column, with all signs; a body with z down."""
    roll, pitch, heading = _angle_columns(table)
    a, b, c = (table.numbers[name] for name in (roll, pitch, heading))
    signs = {(1, 1): "", (-1, 1): "the first", (1, -1): "the second", (-1, -1): "both"}
    for (i, j), flipped in signs.items():
        turned = f", then {flipped} of opposite sign" if flipped else ""
        yield _attitude(table, f"exchanged{turned}", **{roll: i * b, pitch: j * a})
    yield _attitude(table, "exchanged", **{roll: c, heading: a})
    yield _attitude(table, "exchanged", **{pitch: c, heading: b})
    if heading == "kappa_deg":
        down = {roll: a + 180.0, pitch: -b, heading: -c}
        yield _attitude(table, "of a body with z down", **down)


def _units(table: Table) -> Iterator[Reading]:
    names = _angle_columns(table)
    for chosen in (names, names[:2], names[2:]):
        for unit, degrees in (("radians", 180 / np.pi), ("gon", ROUND_DEG / ROUND_GON)):
            turned = {name: table.numbers[name] * degrees for name in chosen}
            yield _attitude(table, f"in {unit}", **turned)


def _orders(table: Table) -> Iterator[Reading]:
    """Yield rotations multiplied in another order, or transposed."""
    names = _angle_columns(table)
    opk = np.radians(table.stack(*names))
    R1, R2, R3 = (turn(axis, opk[:, axis]) for axis in range(3))
    ours = "heading, pitch, roll" if names[2] == "heading_deg" else "omega, phi, kappa"
    if names[2] == "heading_deg":
        orders = {
            "in the order pitch before roll": R3 @ R1 @ R2,
            "in the order roll, pitch, heading": R1 @ R2 @ R3,
        }
    else:
        orders = {
            "in the order phi, omega, kappa": R2 @ R1 @ R3,
            "in the order kappa, phi, omega": R3 @ R2 @ R1,
        }
    orders[f"of the transposed rotation ({ours})"] = np.swapaxes(
        R3 @ R2 @ R1 if names[2] == "heading_deg" else R1 @ R2 @ R3, -1, -2
    )
    for meaning, R in orders.items():
        angles = np.degrees(
            rph_from_rotation(R) if names[2] == "heading_deg" else opk_from_rotation(R)
        )
        yield _attitude(table, meaning, **dict(zip(names, angles.T, strict=True)))


def _heights(table: Table, grid: GridSystem) -> Iterator[Reading]:
    height = table.numbers["height_m"]
    for meaning, value in height_readings(height, _lonlat(table, grid), grid):
        yield Reading(
            quantity="position",
            columns=("height_m",),
            meaning=meaning,
            table=_changed(table, height_m=value),
        )


def height_readings(height: Array, lonlat: Array, grid: GridSystem) -> Iterator[tuple[str, Array]]:
    """Yield the other interpretations of heights: meaning, and heights in m.

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


def plane_readings(east_north: Array) -> Iterator[tuple[str, Array]]:
    """Yield other interpretations of east and north: meaning, and values, shape (n, 2)."""
    yield "exchanged", east_north[:, ::-1]


def pixel_readings(colrow: Array, size: Array, pixel_mm: Array) -> Iterator[tuple[str, str, Array]]:
    """Yield other interpretations of image measurements: columns, their meaning, pixels.

    Half a pixel is not among them: no measurement tells it from the principal point.

    Parameters
    ----------
    colrow : ndarray, shape (n, 2)
        As they are given.
    size : ndarray, shape (n, 2)
        Width and height of the image of each, px.
    pixel_mm : ndarray, shape (n, 1)
    """
    col, row = colrow.T
    right, bottom = (size - 1 - colrow).T
    yield "row_px", "counted from the bottom", np.column_stack([col, bottom])
    yield "col_px", "counted from the right", np.column_stack([right, row])
    yield "col_px, row_px", "exchanged", np.column_stack([row, col])
    yield "col_px, row_px", "in mm from the middle", (size - 1) / 2 + colrow / pixel_mm * [1, -1]
    yield "col_px, row_px", "in mm from the corner", colrow / pixel_mm - 0.5


def _rows(table: Table) -> Iterator[Reading]:
    """Yield positions and angles of the next or previous row; the end row is repeated."""
    n = np.arange(len(table))
    taken = [name for name in table.numbers if not name.startswith(("sigma", "time"))]
    for step, neighbour in ((1, "next"), (-1, "previous")):
        rows = np.clip(n + step, 0, len(table) - 1)
        yield Reading(
            quantity="position",
            columns=("positions", "angles"),
            meaning=f"of the {neighbour} row",
            table=_changed(table, **{name: table.numbers[name][rows] for name in taken}),
        )


def of_cameras(table: Table, R_b_c: Array) -> Iterator[Reading]:
    """Yield the trajectory with omega, phi, kappa of a camera converted to the body.

    Parameters
    ----------
    table : Table
    R_b_c : ndarray, shape (3, 3)
        Boresight of the camera.
    """
    names = _angle_columns(table)
    angles = np.radians(table.stack(*names))
    if names[2] == "kappa_deg":
        body = opk_from_rotation(rotation_from_opk(angles) @ R_b_c.T)
        body_deg = dict(zip(names, np.degrees(body).T, strict=True))
        yield _attitude(table, "of the camera, not of the body", **body_deg)
