"""The usual mistakes in positions and angles, and the flight with each of them undone."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
import pyproj

from acx4lib.expected import Array
from acx4lib.flight.block_from_tables import BlockTables, lonlat_of
from acx4lib.flight.checks import readings
from acx4lib.flight.problems import SHOWN
from acx4lib.flight.setup import Setup
from acx4lib.flight.text.table import Table
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.frames import Pose, opk_from_rotation, rotation_from_opk, turn
from acx4lib.geometry.geodesy import GridSystem

NO_TURN = np.radians(3.0)
"""Mounting angles below which a camera has the axes of the body."""

SIGNS = ((-1, 1, 1), (1, -1, 1), (-1, -1, 1), (1, 1, -1), (-1, -1, -1))
QUARTERS = (90, 180, -90)


@dataclass(frozen=True, kw_only=True, eq=False)
class Mistake:
    """A flight with one supposed mistake undone.

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


def mistakes(tables: BlockTables, setup: Setup) -> Iterator[Mistake]:
    """Yield a block with each of the usual mistakes undone.

    Parameters
    ----------
    tables : BlockTables
    setup : Setup
    """
    for where in ("control", "trajectory"):
        yield from _position_mistakes(tables, setup, where)
    yield from mounting_mistakes(tables, setup)
    yield from _trajectory_mistakes(tables, setup)
    yield from _measurement_mistakes(tables, setup)


def _swapped(table: Table, a: str, b: str) -> Table:
    return readings.changed(table, **{a: table.numbers[b], b: table.numbers[a]})


def _position_mistakes(tables: BlockTables, setup: Setup, where: str) -> Iterator[Mistake]:
    table: Table = getattr(tables, where)

    def undone(column: str, says: str, changed: Table) -> Mistake:
        return Mistake(
            where=where,
            column=column,
            says=f"{says} in {table.file}",
            tables=replace(tables, control=changed)
            if where == "control"
            else replace(tables, trajectory=changed),
            setup=setup,
        )

    if where == "control":
        height, lonlat = table.numbers["height_m"], lonlat_of(table, setup.grid)
        for meaning, other in readings.height_readings(height, lonlat, setup.grid):
            changed = readings.changed(table, height_m=other)
            yield undone("height_m", f"height_m were {meaning}", changed)
    if "lat_deg" in table.numbers:
        both = "latitude and longitude were"
        yield undone("lat_deg", f"{both} swapped", _swapped(table, "lat_deg", "lon_deg"))
        degrees = {name: np.degrees(table.numbers[name]) for name in ("lat_deg", "lon_deg")}
        yield undone("lat_deg", f"{both} in radians", readings.changed(table, **degrees))
        return
    says = "east_m and north_m were swapped"
    yield undone("east_m", says, _swapped(table, "east_m", "north_m"))
    for zone, east_north in _other_zones(setup.grid, table.stack("east_m", "north_m")):
        moved = readings.changed(table, east_m=east_north[:, 0], north_m=east_north[:, 1])
        yield undone("east_m", f"east_m and north_m were of UTM zone {zone}", moved)


def _other_zones(grid: GridSystem, east_north: Array) -> Iterator[tuple[str, Array]]:
    """Yield east and north as they would be if given in a neighbouring UTM zone."""
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


def _trajectory_mistakes(tables: BlockTables, setup: Setup) -> Iterator[Mistake]:
    table = tables.trajectory
    names = {*tables.images.text["camera"]}
    others = readings.readings(table, setup.grid)
    if len(names) == 1:
        of_camera = readings.of_cameras(table, setup.cameras[names.pop()].T_b_c.R)
        others = chain(others, of_camera)
    for reading in others:
        yield Mistake(
            where="trajectory",
            column=reading.columns[-1] if table.has(reading.columns[-1]) else "exposure",
            says=f"{reading.says} in {table.file}",
            tables=replace(tables, trajectory=reading.table),
            setup=setup,
        )


def _measurement_mistakes(tables: BlockTables, setup: Setup) -> Iterator[Mistake]:
    table = tables.image_points
    name_of = dict(zip(tables.images.text["image"], tables.images.text["camera"], strict=True))
    cameras = [setup.cameras[name_of[image]] for image in table.text["image"]]
    size = np.array([[camera.width_px, camera.height_px] for camera in cameras])
    pixel_mm = np.array([[camera.pixel_mm] for camera in cameras])
    others = readings.pixel_readings(table.stack("col_px", "row_px"), size, pixel_mm)
    for columns, meaning, colrow in others:
        col, row = colrow.T
        yield Mistake(
            where="image_points",
            column="row_px",
            says=f"{columns} were {meaning} in {table.file}",
            tables=replace(tables, image_points=readings.changed(table, col_px=col, row_px=row)),
            setup=setup,
        )


def mounting_mistakes(tables: BlockTables, setup: Setup, *, only: str = "") -> Iterator[Mistake]:
    """Yield a block with other mountings: quarter turns, upside down, the inverse rotation.

    Parameters
    ----------
    tables : BlockTables
    setup : Setup
    only : str
        Name of the only camera to change; empty for all cameras.
    """
    present = set(tables.images.text["camera"])
    names = [name for name in setup.cameras if name == only or (not only and name in present)]
    upside = turn(0, np.pi)
    turns: list[tuple[str, Callable[[Array], Array]]] = [
        *((f"turned by {k} degrees about z", _turned(_quarter(k))) for k in QUARTERS),
        *(("with z forward", _turned(upside @ _quarter(k))) for k in (0, *QUARTERS)),
        ("of the inverse rotation, body to camera", _inverse),
        *(("of other signs", _signs(*signs)) for signs in SIGNS),
    ]
    for says, turned in turns:
        cameras = {
            name: _remounted(camera, turned) if name in names else camera
            for name, camera in setup.cameras.items()
        }
        own = [cameras[name] for name in names]
        yield Mistake(
            where="mount",
            says=f"the camera axes were {says}: {_angles(own)}{_or_of_the_camera(own)}",
            tables=tables,
            setup=replace(setup, cameras=cameras),
        )


def _angles(cameras: list[Camera]) -> str:
    """Return the sentence on the mounting angles that would fit."""
    opk = {camera.name: np.round(np.degrees(camera.T_b_c.opk)) + 0.0 for camera in cameras[:SHOWN]}
    of = "; ".join(f"{name} {o:.0f}, {p:.0f}, {k:.0f}" for name, (o, p, k) in opk.items())
    more = "; …" if len(cameras) > SHOWN else ""
    return f"mount_omega_deg, mount_phi_deg, mount_kappa_deg of {of}{more} would fit"


def _or_of_the_camera(cameras: list[Camera]) -> str:
    """Return what a mounting without any turn may mean as well."""
    alone = len(cameras) == 1 and np.allclose(cameras[0].T_b_c.R, np.eye(3), atol=NO_TURN)
    return ", or the angles are of the camera, not of the body" if alone else ""


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
