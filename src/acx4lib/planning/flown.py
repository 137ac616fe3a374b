"""A block as it is planned: level images, and points measured where they would be, without errors.

- The aircraft flies level along its course; nothing drifts, nothing shakes.
- Tie points fill their area evenly. Every image that shows a point measures it.
- An image shows what is not nearer to its edges than `MARGIN_PX`.
- Tie points that no camera has in three images are not measured.

A simulated flight of the plan obeys the same rules, but for the wind.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acx4lib import expected
from acx4lib.errors import FlightError
from acx4lib.expected import Array, Index, Mask
from acx4lib.flight.block import Block
from acx4lib.flight.block_from_tables import BlockTables, assemble, lonlat_of, poses
from acx4lib.flight.text.table import Table
from acx4lib.geometry.camera import Camera, border_distance
from acx4lib.geometry.collinearity import project
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import mean_origin
from acx4lib.geometry.refraction import as_seen
from acx4lib.planning import ground
from acx4lib.planning.plan import TURN_S, Plan, PlannedBlock, Strip, image_length_m

MARGIN_PX = 25.0
"""Nothing is measured nearer to the edge of an image."""

LEAST_RAYS = 3
"""Number of images of one camera in which a tie point must be seen."""

REACH = 1.3
"""Radius around an image's middle, in half diagonals, outside which no point is projected."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Exposures:
    """The exposures of a planned block.

    Attributes
    ----------
    names, strips : tuple of str
    local : ndarray, shape (n, 2)
        Forward and left of the block's middle, m.
    flying_height_m, course_deg, time_s : ndarray, shape (n,)
    """

    names: tuple[str, ...]
    strips: tuple[str, ...]
    local: Array
    flying_height_m: Array
    course_deg: Array
    time_s: Array


def exposures(planned: PlannedBlock) -> Exposures:
    """Return where a block is exposed, strip by strip."""
    parts, begin = [], 0.0
    for name, strip in planned.strips.items():
        n = strip.n_exposures
        parts.append((name, strip, _along(strip, planned.area.course_deg), begin + _times(strip)))
        begin += (n - 1) * strip.base_m / strip.speed_m_s + TURN_S
    counts = [strip.n_exposures for _, strip, _, _ in parts]
    return Exposures(
        names=tuple(
            f"{name}-{i + 1:02d}" for name, strip, _, _ in parts for i in range(strip.n_exposures)
        ),
        strips=tuple(name for name, strip, _, _ in parts for _ in range(strip.n_exposures)),
        local=np.concatenate([local for _, _, local, _ in parts]),
        flying_height_m=np.repeat([strip.flying_height_m for _, strip, _, _ in parts], counts),
        course_deg=np.repeat([strip.course_deg for _, strip, _, _ in parts], counts),
        time_s=np.concatenate([times for _, _, _, times in parts]),
    )


def _times(strip: Strip) -> Array:
    times: Array = np.arange(strip.n_exposures) * strip.base_m / strip.speed_m_s
    return times


def _along(strip: Strip, block_course_deg: float) -> Array:
    turn = np.radians(strip.course_deg - block_course_deg)
    n = strip.n_exposures
    way = (np.arange(n) - (n - 1) / 2) * strip.base_m
    ahead = np.array([np.cos(turn), -np.sin(turn)])
    return np.array([strip.forward_m, strip.left_m]) + way[:, None] * ahead


def block(plan: Plan, name: str) -> Block:
    """Return a planned block, with image points free of errors.

    Parameters
    ----------
    plan : Plan
    name : str
        One of its blocks.

    Raises
    ------
    FlightError
        Where no image shows a point.
    """
    expected.instance("plan", plan, Plan)
    expected.one_of("name", name, plan.blocks)
    planned = plan.blocks[name]
    taken = exposures(planned)
    trajectory = _trajectory(plan, planned, taken)
    frame = mean_origin(plan.setup.grid, lonlat_of(trajectory, plan.setup.grid))
    surveyed = ground.on_ground(plan, planned.area, ground.places(planned.points))
    x_g = np.concatenate([surveyed, ground.on_ground(plan, planned.area, tie_places(plan, name))])
    seen = _Seen(plan=plan, name=name, T_m_b=poses(trajectory, frame), x_m=frame.from_grid(x_g))
    shown, colrow = seen.everywhere()
    shown[:, :, len(surveyed) :] &= _tied(shown[:, :, len(surveyed) :])
    if not shown.any():
        problem = f"blocks: no image of block {name} shows a point; control and strips lie apart"
        raise FlightError([problem])
    tables = BlockTables(
        name=name,
        pictures=Path(),
        images=_images(plan, name, taken),
        image_points=_image_points(plan, planned, shown, colrow, len(surveyed)),
        trajectory=trajectory,
        control=_control(planned, surveyed),
    )
    return assemble(tables, plan.setup)


def tie_places(plan: Plan, name: str) -> Array:
    """Return where the tie points of a block lie, forward and left of its middle, m, (n, 2)."""
    planned = plan.blocks[name]
    if planned.tie_area_m is not None:
        low, high = -0.5 * np.array(planned.tie_area_m), 0.5 * np.array(planned.tie_area_m)
    else:
        low, high = _shown_area(plan, planned)
    out: Array = low + (high - low) * ground.evenly(planned.tie_points)
    return out


def _shown_area(plan: Plan, planned: PlannedBlock) -> tuple[Array, Array]:
    """Return the least and the largest forward and left that images show on level ground."""
    camera = plan.frame(planned.name) or plan.cameras(planned.name)[0]
    taken = exposures(planned)
    turn = np.radians(taken.course_deg - planned.area.course_deg)
    along = np.array([image_length_m(camera, h) for h in taken.flying_height_m])
    across = np.array([image_length_m(camera, h, across=True) for h in taken.flying_height_m])
    c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    half = 0.5 * np.column_stack([c * along + s * across, s * along + c * across])
    return (taken.local - half).min(axis=0), (taken.local + half).max(axis=0)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Seen:
    """Points over which the cameras of a block are flown."""

    plan: Plan
    name: str
    T_m_b: Pose
    x_m: Array

    def everywhere(self) -> tuple[Mask, Array]:
        """Return which points every image shows, (cameras, exposures, points), and where."""
        cameras = self.plan.cameras(self.name)
        parts = [self._in(camera) for camera in cameras]
        shown = np.stack([part[0] for part in parts])
        frame = self.plan.frame(self.name)
        if frame is not None:
            shown &= self._in(frame)[0]
        return shown, np.stack([part[1] for part in parts])

    def _in(self, camera: Camera) -> tuple[Mask, Array]:
        T_m_c = self.T_m_b @ camera.T_b_c
        exposure, point = np.nonzero(_near(camera, T_m_c, self.x_m))
        at = as_seen(T_m_c.r[exposure], self.x_m[point], refraction=self.plan.setup.refraction)
        colrow = project(camera, T_m_c[exposure], at)
        inside = border_distance(camera, colrow) >= MARGIN_PX
        shown = np.zeros((len(T_m_c), len(self.x_m)), dtype=bool)
        shown[exposure, point] = inside
        everywhere = np.full((*shown.shape, 2), np.nan)
        everywhere[exposure, point] = colrow
        return shown, everywhere


def _near(camera: Camera, T_m_c: Pose, x_m: Array) -> Mask:
    """Return which points lie in a cone around the images' axes, shape (n_images, n_points)."""
    ray = x_m - T_m_c.r[:, None]
    along = -np.einsum("npi,ni->np", ray, T_m_c.R[:, :, 2])
    tangent = REACH * 0.5 * camera.pixel_mm * camera.diagonal_px / camera.interior.f
    aside_sq = np.einsum("npi,npi->np", ray, ray) - along**2
    near: Mask = (along > 0) & (aside_sq < (tangent * along) ** 2)
    return near


def _tied(shown: Mask) -> Mask:
    """Return which tie points some camera has in enough images, shape (n_points,)."""
    tied: Mask = (shown.sum(axis=1) >= LEAST_RAYS).any(axis=0)
    return tied


# --- tables ----------------------------------------------------------------------------------


def _table(
    file: str, n: int, text: dict[str, Sequence[str]], numbers: dict[str, Array] | None = None
) -> Table:
    return Table(file=file, lines=np.arange(n), text=text, numbers=numbers or {}, in_memory=True)


def _trajectory(plan: Plan, planned: PlannedBlock, taken: Exposures) -> Table:
    east, north = ground.on_map(planned.area, taken.local).T
    numbers = {
        "east_m": east,
        "north_m": north,
        "height_m": plan.terrain.height_m + taken.flying_height_m,
        "omega_deg": np.zeros(len(east)),
        "phi_deg": np.zeros(len(east)),
        "kappa_deg": 90.0 - taken.course_deg,
        "time_s": taken.time_s,
    }
    return _table("trajectory", len(east), {"exposure": taken.names}, numbers)


def _image_names(plan: Plan, name: str, taken: Exposures) -> tuple[tuple[str, str, str, str], ...]:
    """Return image, camera, exposure and strip of every image, exposure by exposure."""
    cameras = plan.cameras(name)
    return tuple(
        (f"{at}_{camera.name}" if len(cameras) > 1 else at, camera.name, at, strip)
        for at, strip in zip(taken.names, taken.strips, strict=True)
        for camera in cameras
    )


def _images(plan: Plan, name: str, taken: Exposures) -> Table:
    rows = _image_names(plan, name, taken)
    columns = zip(*rows, strict=True)
    text = dict(zip(("image", "camera", "exposure", "strip"), columns, strict=True))
    return _table("images", len(rows), text)


def _control(planned: PlannedBlock, surveyed: Array) -> Table:
    names = tuple(f"P{i:02d}" for i in range(1, len(surveyed) + 1))
    axes = ("east", "north", "height")
    numbers = {f"{axis}_m": surveyed[:, k] for k, axis in enumerate(axes)}
    numbers |= {
        f"sigma_{axis}_m": np.full(len(surveyed), sigma)
        for axis, sigma in zip(axes, planned.points.sigma_m, strict=True)
    }
    return _table("control_points", len(surveyed), {"point": names}, numbers)


def _image_points(
    plan: Plan, planned: PlannedBlock, shown: Mask, colrow: Array, n_surveyed: int
) -> Table:
    taken = exposures(planned)
    images = np.array([row[0] for row in _image_names(plan, planned.name, taken)], dtype=object)
    exposure, camera, point = np.nonzero(shown.transpose(1, 0, 2))
    names = _point_names(n_surveyed, shown.shape[2])
    sigma = np.full(shown.shape[2], plan.setup.apriori.image_point_px)
    if planned.points.sigma_px is not None:
        sigma[:n_surveyed] = planned.points.sigma_px
    at = colrow[camera, exposure, point]
    text = {"image": images[exposure * len(shown) + camera], "point": names[point]}
    numbers = {"col_px": at[:, 0], "row_px": at[:, 1], "sigma_px": sigma[point]}
    return _table("image_points", len(point), text, numbers)


def _point_names(n_surveyed: int, n: int) -> Index:
    surveyed = [f"P{i:02d}" for i in range(1, n_surveyed + 1)]
    ties = [f"T{i:05d}" for i in range(1, n - n_surveyed + 1)]
    return np.array([*surveyed, *ties], dtype=object)
