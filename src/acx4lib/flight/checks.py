"""Contradictions between the tables of a block and flight.toml; oddities become notes only."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from functools import partial
from textwrap import shorten

import numpy as np
import pyproj

from acx4lib import shown
from acx4lib.expected import Array
from acx4lib.flight.block import Block
from acx4lib.flight.block_from_tables import (
    BlockTables,
    index_of,
    lonlat_of,
    measured_control,
    used_exposures,
)
from acx4lib.flight.problems import Problem, counted, did_you_mean, quoted
from acx4lib.flight.readings import FOOT, misfit
from acx4lib.flight.setup import Setup
from acx4lib.flight.table_files import named_file
from acx4lib.flight.tables import Table
from acx4lib.flight.toml_file import Toml
from acx4lib.geometry.camera import Camera, inside
from acx4lib.geometry.geodesy import LOCAL, GridSystem
from acx4lib.geometry.parameters import DELAYS
from acx4lib.least_squares.covariance import medians

# --- Contradictions between the tables of a block, and between these and flight.toml


def name_problems(tables: BlockTables, toml: Toml) -> Iterator[Problem]:
    """Yield unknown names of images, cameras and so on, and cells with none of the choices."""
    cameras = toml.table("cameras")
    if cameras:
        yield from _unknown(tables.images, "camera", cameras, f"must be a camera of {toml.file}")
    for table, column, other in (
        (tables.images, "exposure", tables.trajectory),
        (tables.image_points, "image", tables.images),
    ):
        if len(other) and column in other.text:
            expected = f"must have a row in {other.file}"
            yield from _unknown(table, column, other.text[column], expected)
    yield from _unknown(tables.control, "role", ("control", "check"), "must be control or check")
    if tables.distances is not None:
        yield from _distance_problems(tables.distances, tables.image_points)
    yield from _strip_problems(tables, toml)
    if tables.name == "heads":
        yield from _head_problems(tables.images, toml)
    elif toml.get("synthetic", "measured_in") == "heads":
        yield from _other_cameras(tables.images, toml, ", since measured_in is 'heads'")


def _distance_problems(distances: Table, measured: Table) -> Iterator[Problem]:
    """Yield ends of distances that no image shows, and distances from a point to itself."""
    if "point" not in measured.text or not distances.has("point_a", "point_b"):
        return
    for end in ("point_a", "point_b"):
        expected = f"must be a point of {measured.file}"
        yield from _unknown(distances, end, measured.text["point"], expected)
    names = list(zip(distances.text["point_a"], distances.text["point_b"], strict=True))
    yield from counted(
        [row for row, (a, b) in enumerate(names) if a == b],
        lambda row: distances.problem(
            row, "point_b", f"{quoted(names[row][1])} again", "must be another point than point_a"
        ),
    )


def _strip_problems(tables: BlockTables, toml: Toml) -> Iterator[Problem]:
    """Yield a problem where drifts or delays are asked for and there are no strips or times."""
    keys = ("stages", "mounting", "gnss")
    asked = toml.get(*keys) if tables.name == "calibration" else None
    asked = asked if isinstance(asked, list) else []
    has_strips = any(tables.images.text.get("strip", ()))
    for name in asked:
        if name in ("drift", *DELAYS) and not has_strips:
            yield toml.problem(
                keys, repr(name), f"needs strips in {tables.images.file}, column strip"
            )
    yield from _timeless(tables, toml, keys, [name for name in asked if name in DELAYS])


def _timeless(
    tables: BlockTables, toml: Toml, keys: tuple[str, ...], delays: Sequence[str]
) -> Iterator[Problem]:
    """Yield a problem for each delay and correlation where the trajectory has no times."""
    if len(tables.trajectory) == 0 or tables.trajectory.has("time_s"):
        return
    expected = f"needs times in {tables.trajectory.file}, column time_s"
    for name in delays:
        yield toml.problem(keys, repr(name), expected)
    for key in ("gnss_correlation_s", "attitude_correlation_s"):
        if key in toml.table("apriori"):
            yield toml.problem(("apriori", key), quoted(toml.get("apriori", key)), expected)


def _unknown(table: Table, column: str, known: Collection[str], expected: str) -> Iterator[Problem]:
    names, known = table.text.get(column, ()), dict.fromkeys(known)
    unknown = set(names) - known.keys() - {""}
    rows = [row for row, name in enumerate(names) if name in unknown] if unknown else []

    def problem(row: int) -> Problem:
        found = f"{quoted(names[row])} is unknown{did_you_mean(names[row], known)}"
        return table.problem(row, column, found, expected)

    yield from counted(rows, problem)


def file_problems(tables: BlockTables) -> Iterator[Problem]:
    """Yield files of images that are not there, or outside of the flight."""
    images, flight, folder = tables.images, tables.pictures, tables.pictures / tables.name
    names = images.text.get("file", ())
    expected = f"must be a file under {folder}, links resolved"
    inside, block = flight.resolve(), folder.resolve()
    faults = {name: named_file(inside, block, name)[1] for name in set(names) if name}
    rows = [row for row, name in enumerate(names) if faults.get(name)]
    yield from counted(
        rows,
        lambda row: images.problem(
            row, "file", f"{quoted(names[row])} {faults[names[row]]}", expected
        ),
    )


def _head_problems(images: Table, toml: Toml) -> Iterator[Problem]:
    """Yield a problem where the heads' images and the declared heads do not agree."""
    heads = toml.get("synthetic", "heads")
    if toml.values and "synthetic" not in toml.values:
        yield toml.problem(("synthetic",), "missing", "required, since there is a block heads")
    if not isinstance(heads, list) or "camera" not in images.text:
        return
    yield from _other_cameras(images, toml, "")
    names, cameras = set(images.text["camera"]), toml.table("cameras")
    for head in heads:
        if isinstance(head, str) and head not in names and head in cameras:
            expected = f"every head needs images in {images.file}"
            yield toml.problem(("synthetic", "heads"), f"{head!r} took no image", expected)


def _other_cameras(images: Table, toml: Toml, since: str) -> Iterator[Problem]:
    """Yield the images of declared cameras that are no heads."""
    heads = toml.get("synthetic", "heads")
    names = images.text.get("camera", ())
    known = [head for head in heads if isinstance(head, str)] if isinstance(heads, list) else names
    others = set(names) & toml.table("cameras").keys() - set(known)
    expected = f"must be one of synthetic.heads in {toml.file}{since}"
    yield from counted(
        [row for row, name in enumerate(names) if name in others],
        lambda row: images.problem(row, "camera", f"{names[row]!r} is no head", expected),
    )


def uncalibrated_problems(blocks: Sequence[BlockTables], setup: Setup) -> Iterator[Problem]:
    """Yield the cameras of the validation block that are not in the calibration block.

    Where both are carried into the synthetic image, its camera is calibrated.
    """
    images = {tables.name: tables.images for tables in blocks}
    if setup.measured_in_heads or not {"calibration", "validation"} <= images.keys():
        return
    calibrated = images["calibration"].text.get("camera", ())
    validated, known = images["validation"].text.get("camera", ()), set(calibrated)
    first: dict[str, int] = {}
    for row, name in enumerate(validated if calibrated else ()):
        first.setdefault(name, row)
    for name, row in first.items():
        if name not in known:
            found = f"{name!r} is not calibrated"
            expected = f"must be a camera with images in {images['calibration'].file}"
            yield images["validation"].problem(row, "camera", found, expected)


def sensor_problems(tables: BlockTables, setup: Setup) -> Iterator[Problem]:
    """Yield measurements outside the sensor; rows with unknown names are not checked."""
    images, measured = tables.images, tables.image_points
    if not (images.has("image", "camera") and measured.has("image", "col_px", "row_px")):
        return
    image_idx = index_of(measured.text["image"], images.text["image"])
    names = tuple(setup.cameras)
    camera_idx = np.append(index_of(images.text["camera"], names), -1)[image_idx]
    colrow = measured.stack("col_px", "row_px")
    finite = np.isfinite(colrow).all(axis=1)
    for i, name in enumerate(names):
        camera, mine = setup.cameras[name], np.flatnonzero((camera_idx == i) & finite)
        rows = mine[~inside(camera, colrow[mine])]
        swapped = partial(_inside_if_swapped, camera, colrow)
        sides = np.array([camera.width_px, camera.height_px])
        mm = bool(np.all(np.abs(colrow[mine]) <= (sides + 1) / 2 * camera.pixel_mm))
        beyond_col = np.abs(colrow[rows, 0] - (camera.width_px - 1) / 2) > camera.width_px / 2
        for column, size, outside in (
            ("col_px", camera.width_px, rows[beyond_col]),
            ("row_px", camera.height_px, rows[~beyond_col]),
        ):
            expected = f"must lie on the sensor of {camera.name}, from -0.5 to {size - 0.5}"
            hint = " (in mm from the middle?)" if mm else ""
            yield from counted(outside, _outside(measured, column, hint, swapped, expected))


def _inside_if_swapped(camera: Camera, colrow: Array, row: int) -> bool:
    return bool(inside(camera, colrow[row, ::-1]))


def _outside(
    measured: Table, column: str, hint: str, may_be_swapped: Callable[[int], bool], expected: str
) -> Callable[[int], Problem]:
    """Return a function that describes a row whose measurement lies outside the sensor."""

    def problem(row: int) -> Problem:
        swapped = " (col and row swapped?)" if not hint and may_be_swapped(row) else hint
        found = measured.text[column][row].strip() + swapped
        return measured.problem(row, column, found, expected)

    return problem


def position_problems(tables: BlockTables, grid: GridSystem) -> Iterator[Problem]:
    """Yield positions that the CRS or the geoid grid does not cover."""
    if grid.is_local:
        yield from _off_frame(tables)
        return
    yield from _degree_problems(tables, grid)
    for table, used in (
        (tables.trajectory, used_exposures(tables)),
        (tables.control, measured_control(tables)),
    ):
        rows = np.flatnonzero(used)
        lonlat = lonlat_of(table, grid)
        on_earth = np.isfinite(lonlat[:, 0]) & np.isfinite(lonlat[:, 1])
        if "east_m" in table.numbers:
            on_earth[on_earth] = np.isfinite(grid.convergence(lonlat[on_earth]))
        yield from counted(rows[~on_earth[rows]], _nowhere(table, grid))
        rows = rows[on_earth[rows]]
        undulation = grid.undulation(lonlat[rows])
        yield from counted(rows[~np.isfinite(undulation)], _no_height(table, grid, lonlat))


def _off_frame(tables: BlockTables) -> Iterator[Problem]:
    """Yield a problem where a flight on no map has a trajectory of longitudes and latitudes."""
    if "lat_deg" in tables.trajectory.numbers:
        expected = f"must be east_m, north_m, … kappa_deg, since crs is {LOCAL!r}"
        found = "longitudes and latitudes of a flight on no map"
        yield tables.trajectory.problem(0, "lat_deg", found, expected)


def _degree_problems(tables: BlockTables, grid: GridSystem) -> Iterator[Problem]:
    """Yield a problem where a table has longitudes and latitudes in the place of metres."""
    for table in (tables.trajectory, tables.control):
        if table.has("east_m", "north_m") and of_degrees(
            grid, table.numbers["east_m"], table.numbers["north_m"]
        ):
            east, north = (table.text[name][0].strip() for name in ("east_m", "north_m"))
            found = f"{east}, {north} (longitude, latitude in degrees?)"
            expected = f"must be metres where {quoted(grid.crs)[1:-1]} is meant for"
            yield table.problem(0, "east_m", found, expected)


def _nowhere(table: Table, grid: GridSystem) -> Callable[[int], Problem]:
    expected = f"must be a position that {quoted(grid.crs)[1:-1]} covers, easting first"

    def problem(row: int) -> Problem:
        east, north = (table.text[name][row].strip() for name in ("east_m", "north_m"))
        return table.problem(row, "east_m", f"{east}, {north} is nowhere", expected)

    return problem


def _no_height(table: Table, grid: GridSystem, lonlat: Array) -> Callable[[int], Problem]:
    column = "lat_deg" if "lat_deg" in table.numbers else "east_m"
    expected = f"must lie inside the geoid grid {grid.height_system}"

    def problem(row: int) -> Problem:
        found = f"no height is known at {lonlat[row, 1]:.4f}, {lonlat[row, 0]:.4f}"
        return table.problem(row, column, found, expected)

    return problem


def height_problems(tables: BlockTables) -> Iterator[Problem]:
    """Yield exposures below a control point that they see, or below all those of the block."""
    measured = measured_control(tables)
    if not measured.any():
        return
    height = tables.control.numbers["height_m"]
    lowest = int(np.flatnonzero(measured)[np.argmin(height[measured])])
    highest = _highest_seen(tables)
    trajectory = tables.trajectory
    above = [highest.get(name, lowest) for name in trajectory.text["exposure"]]
    below = trajectory.numbers["height_m"] <= height[above]
    expected = f"must lie above the control points of {tables.control.file}"
    above_in_feet = trajectory.numbers["height_m"] > FOOT * height[above]
    feet = " (in feet?)" if below.mean() > 0.5 and above_in_feet.all() else ""

    def problem(row: int) -> Problem:
        found = (
            f"{trajectory.text['height_m'][row].strip()} is below control point "
            f"{quoted(tables.control.text['point'][above[row]])} at {height[above[row]]:g}{feet}"
        )
        return trajectory.problem(row, "height_m", found, expected)

    yield from counted(np.flatnonzero(used_exposures(tables) & below), problem)


def _highest_seen(tables: BlockTables) -> dict[str, int]:
    """Return for each exposure with measured control the row of its highest control point."""
    exposure = dict(zip(tables.images.text["image"], tables.images.text["exposure"], strict=True))
    height = tables.control.numbers["height_m"]
    highest: dict[str, int] = {}
    text = tables.image_points.text
    rows = index_of(text["point"], tables.control.text["point"])
    for i in np.flatnonzero(rows >= 0).tolist():
        name, row = exposure[text["image"][i]], int(rows[i])
        if height[row] > height[highest.setdefault(name, row)]:
            highest[name] = row
    return highest


# --- Strange positions of a flight's points that are no reason to refuse the flight


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


def unobserved_parts(block: Block | None) -> tuple[str, ...]:
    """Return the parts of the mounting that no trajectory observes, names of `fix` in flight.toml.

    Parameters
    ----------
    block : Block or None
        Of the calibration.
    """
    if block is None or not block.frame.grid.is_local:
        return ()
    trajectory = block.trajectory
    positions, attitudes = (
        np.isfinite(sigma).all(axis=1).any()
        for sigma in (trajectory.sigma_position, trajectory.sigma_attitude)
    )
    return (
        *(() if positions and attitudes else ("lever_arm",)),
        *(() if attitudes else ("boresight",)),
    )


def datum_notes(block: Block) -> Iterator[str]:
    """Yield what fixes the place, the directions and the scale of a block on no map."""
    if not block.frame.grid.is_local:
        return
    if block.name == "calibration" and (held := unobserved_parts(block)):
        what = "positions nor attitudes" if not _observed(block) else "attitudes"
        lack = "has neither sigma of" if not _observed(block) else "has no sigma of"
        parts = " and ".join(name.replace("_", " ") for name in held)
        yield (
            f"{block.name}: the trajectory {lack} {what}, which are start values alone; "
            f"{parts} are held"
        )
    if len(block.control) < ENOUGH and not _observed(block):
        scale = shown.count(len(block.distances), "distance")
        yield (
            f"{block.name}: neither three control points nor positions with sigma fix where the "
            "block lies: it is a free network, "
            + (f"whose scale is that of {scale}" if len(block.distances) else "of unknown scale")
        )


def _observed(block: Block) -> bool:
    """Tell whether positions are observed."""
    return bool(np.isfinite(block.trajectory.sigma_position).all(axis=1).any())


def area_notes(grid: GridSystem, blocks: dict[str, Block]) -> Iterator[str]:
    """Yield a note where a block is far outside the area of use of its CRS, if it has one.

    Parameters
    ----------
    grid : GridSystem
    blocks : dict of str to Block
    """
    if grid.is_local:
        return
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


# --- Exposures and control points that stand out from the others of a block, to be named in
# errors


FAR, TILTED = 20.0, np.radians(20.0)
"""An exposure stands out that is so many median distances from the middle of all, or turned so far
against the median vertical."""

MOST_NAMED = 3


def sentence(block: Block) -> str:
    """Return which exposures and control points stand out, as a part of a sentence."""
    at, trajectory = block.trajectory.T_m_b, block.trajectory
    middle = np.median(at.r, axis=0)
    apart = np.linalg.norm(at.r - middle, axis=1)
    usual = max(float(np.median(apart)), 1.0)
    up = np.median(at.R[:, :, 2], axis=0)
    tilt = np.arccos(np.clip(at.R[:, :, 2] @ up / max(float(np.linalg.norm(up)), 1e-9), -1, 1))
    names = [block.points[i] for i in block.control.point_idx]
    survey = np.linalg.norm(block.control.x_m - middle, axis=1)
    parts = [
        *_named("exposure", trajectory.exposures, apart / usual / FAR),
        *_named("exposure", trajectory.exposures, tilt / TILTED),
        *_named("control point", names, survey / usual / FAR),
    ]
    return f", in which {', '.join(dict.fromkeys(parts))} stand out," if parts else ""


def _named(what: str, names: Sequence[str], size: Array) -> list[str]:
    """Return the largest of those with a size above one."""
    worst = [i for i in np.argsort(-size)[:MOST_NAMED] if not size[i] <= 1]
    return [f"{what} {names[i]}" for i in worst]
