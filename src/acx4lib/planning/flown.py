"""A block as it is planned: its tables as a flight has them, with image points free of errors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from acx4lib import expected
from acx4lib.errors import FlightError
from acx4lib.expected import Array
from acx4lib.flight.block import Block
from acx4lib.flight.block_from_tables import BlockTables, assemble, lonlat_of, poses
from acx4lib.flight.text.table import Table
from acx4lib.geometry.frames import opk_from_rotation, rotation_from_rph
from acx4lib.geometry.geodesy import R_ENU_NED, R_FRD_FLU, mean_origin
from acx4lib.planning import ground
from acx4lib.planning.exposures import Exposures, exposures
from acx4lib.planning.plan import Plan
from acx4lib.planning.sight import Over, Sight, joined


def block(plan: Plan, name: str, *, wind: int = 0, tie_places: Array | None = None) -> Block:
    """Return a planned block.

    Parameters
    ----------
    plan : Plan
    name : str
        One of its blocks.
    wind : int
        As `exposures.exposures` takes it.
    tie_places : ndarray, shape (n, 2), optional
        Where tie points are, if three images of a camera show them, as `Over.tie_places` returns
        it; so a simulated flight has them. By default they are looked for in this wind.

    Returns
    -------
    Block
        As the reader of flights makes one, so that every key of flight.toml has its effect.

    Raises
    ------
    FlightError
        Where the images show no point, or less tie points than asked for.
    """
    in_the_air = over(plan, name, wind=wind)
    surveyed = in_the_air.surveyed()
    ties = in_the_air.tie_points() if tie_places is None else in_the_air.ties_at(tie_places)
    seen = joined([surveyed, ties])
    if not seen.shown.any():
        where = "lie apart from the strips"
        raise FlightError([f"{name}: no image shows a point; there are none, or they {where}"])
    taken = exposures(plan.blocks[name], wind=wind)
    tables = BlockTables(
        name=name,
        pictures=Path(),
        images=_images(plan, name, taken),
        image_points=_image_points(plan, name, taken, seen, len(surveyed.local)),
        trajectory=_trajectory(plan, name, taken),
        control=_control(plan, name, surveyed),
    )
    return assemble(tables, plan.setup)


def over(plan: Plan, name: str, *, wind: int = 0) -> Over:
    """Return a planned block in the air."""
    expected.instance("plan", plan, Plan)
    expected.one_of("name", name, plan.blocks)
    grid = plan.setup.grid
    trajectory = _trajectory(plan, name, exposures(plan.blocks[name], wind=wind))
    frame = mean_origin(grid, lonlat_of(trajectory, grid))
    return Over(plan=plan, name=name, frame=frame, T_m_b=poses(trajectory, frame))


# --- tables ----------------------------------------------------------------------------------


def _table(
    file: str, n: int, text: Mapping[str, Sequence[str]], numbers: dict[str, Array] | None = None
) -> Table:
    return Table(file=file, lines=np.arange(n), text=text, numbers=numbers or {}, in_memory=True)


def _trajectory(plan: Plan, name: str, taken: Exposures) -> Table:
    east, north = ground.on_map(plan.blocks[name].area, taken.local).T
    R_grid_b = R_ENU_NED @ rotation_from_rph(np.radians(taken.rph_deg)) @ R_FRD_FLU
    opk = np.degrees(opk_from_rotation(R_grid_b))
    numbers = {
        "east_m": east,
        "north_m": north,
        "height_m": plan.terrain.height_m + taken.flying_height_m,
        **dict(zip(("omega_deg", "phi_deg", "kappa_deg"), opk.T, strict=True)),
        "time_s": taken.time_s,
    }
    return _table("trajectory", len(east), {"exposure": taken.names}, numbers)


def _image_names(plan: Plan, name: str, taken: Exposures) -> list[tuple[str, str, str, str]]:
    """Return image, camera, exposure and strip of every image, exposure by exposure."""
    cameras = plan.cameras(name)
    return [
        (f"{at}_{camera.name}" if len(cameras) > 1 else at, camera.name, at, strip)
        for at, strip in zip(taken.names, taken.strips, strict=True)
        for camera in cameras
    ]


def _images(plan: Plan, name: str, taken: Exposures) -> Table:
    rows = _image_names(plan, name, taken)
    columns = zip(*rows, strict=True)
    text = dict(zip(("image", "camera", "exposure", "strip"), columns, strict=True))
    return _table("images", len(rows), text)


def _control(plan: Plan, name: str, surveyed: Sight) -> Table:
    n = len(surveyed.local)
    axes = ("east", "north", "height")
    numbers = {f"{axis}_m": surveyed.x_g[:, k] for k, axis in enumerate(axes)}
    numbers |= {
        f"sigma_{axis}_m": np.full(n, sigma)
        for axis, sigma in zip(axes, plan.blocks[name].points.sigma_m, strict=True)
    }
    return _table("control_points", n, {"point": _point_names(n, n)}, numbers)


def _image_points(plan: Plan, name: str, taken: Exposures, seen: Sight, n_surveyed: int) -> Table:
    images = [row[0] for row in _image_names(plan, name, taken)]
    points = _point_names(n_surveyed, len(seen.local))
    exposure, camera, point = np.nonzero(seen.shown.transpose(1, 0, 2))
    sigma = np.full(len(seen.local), plan.setup.apriori.image_point_px)
    own = plan.blocks[name].points.sigma_px
    if own is not None:
        sigma[:n_surveyed] = own
    at = seen.colrow[camera, exposure, point]
    text = {
        "image": [images[i] for i in (exposure * len(seen.shown) + camera).tolist()],
        "point": [points[i] for i in point.tolist()],
    }
    numbers = {"col_px": at[:, 0], "row_px": at[:, 1], "sigma_px": sigma[point]}
    return _table("image_points", len(point), text, numbers)


def _point_names(n_surveyed: int, n: int) -> list[str]:
    """Return the names of surveyed points, then of tie points."""
    surveyed = [f"P{i:02d}" for i in range(1, n_surveyed + 1)]
    ties = [f"T{i:05d}" for i in range(1, n - n_surveyed + 1)]
    return [*surveyed, *ties]
