"""A planned block.

Its exposures, the visibility of points in its images, and its tables free of error.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import NormalDist

import numpy as np

from acx4book.planning import plan as plans
from acx4book.planning.plan import TURN_S, Plan, PlannedBlock, Strip, image_length_m
from acx4files.flight.block_from_tables import BlockTables, assemble, lonlat_of, poses
from acx4files.flight.tables import Table
from acx4lib import expected
from acx4lib.block import Block
from acx4lib.errors import FlightError
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import Camera, border_distance
from acx4lib.geometry.collinearity import as_seen, project
from acx4lib.geometry.frames import Pose, opk_from_rotation, rotation_from_rph
from acx4lib.geometry.geodesy import R_ENU_NED, R_FRD_FLU, MappingFrame, mean_origin

# --- A block as it is planned: its tables as a flight has them, with image points free of errors


def block(plan: Plan, name: str, *, wind: int = 0, tie_places: Array | None = None) -> Block:
    """Return a planned block.

    Parameters
    ----------
    plan : Plan
    name : str
        One of its blocks.
    wind : int
        As `exposures` takes it.
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
    sight = _joined([surveyed, ties])
    if not sight.shown.any():
        reason = "lie apart from the strips"
        raise FlightError([f"{name}: no image shows a point; there are none, or they {reason}"])
    taken = exposures(plan.blocks[name], wind=wind)
    tables = BlockTables(
        name=name,
        pictures=Path(),
        images=_images(plan, name, taken),
        image_points=_image_points(plan, name, taken, sight, len(surveyed.local)),
        trajectory=_trajectory(plan, name, taken),
        control=_control(plan, name, surveyed),
    )
    return assemble(tables, plan.setup)


def over(plan: Plan, name: str, *, wind: int = 0) -> Over:
    """Return a planned block in the air."""
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
    east, north = plans.on_map(plan.blocks[name].area, taken.local).T
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
        (
            f"{exposure}_{camera.name}" if len(cameras) > 1 else exposure,
            camera.name,
            exposure,
            strip,
        )
        for exposure, strip in zip(taken.names, taken.strips, strict=True)
        for camera in cameras
    ]


def _images(plan: Plan, name: str, taken: Exposures) -> Table:
    rows = _image_names(plan, name, taken)
    columns = zip(*rows, strict=True)
    text = dict(zip(("image", "camera", "exposure", "strip"), columns, strict=True))
    return _table("images", len(rows), text)


def _control(plan: Plan, name: str, surveyed: Visibility) -> Table:
    n = len(surveyed.local)
    axes = ("east", "north", "height")
    numbers = {f"{axis}_m": surveyed.x_g[:, k] for k, axis in enumerate(axes)}
    numbers |= {
        f"sigma_{axis}_m": np.full(n, sigma)
        for axis, sigma in zip(axes, plan.blocks[name].points.sigma_m, strict=True)
    }
    return _table("control_points", n, {"point": _point_names(n, n)}, numbers)


def _image_points(
    plan: Plan, name: str, taken: Exposures, sight: Visibility, n_surveyed: int
) -> Table:
    images = [row[0] for row in _image_names(plan, name, taken)]
    points = _point_names(n_surveyed, len(sight.local))
    exposure, camera, point = np.nonzero(sight.shown.transpose(1, 0, 2))
    sigma = np.full(len(sight.local), plan.setup.apriori.image_point_px)
    sigma_px = plan.blocks[name].points.sigma_px
    if sigma_px is not None:
        sigma[:n_surveyed] = sigma_px
    colrow = sight.colrow[camera, exposure, point]
    text = {
        "image": [images[i] for i in (exposure * len(sight.shown) + camera).tolist()],
        "point": [points[i] for i in point.tolist()],
    }
    numbers = {"col_px": colrow[:, 0], "row_px": colrow[:, 1], "sigma_px": sigma[point]}
    return _table("image_points", len(point), text, numbers)


def _point_names(n_surveyed: int, n: int) -> list[str]:
    """Return the names of surveyed points, then of tie points."""
    surveyed = [f"P{i:02d}" for i in range(1, n_surveyed + 1)]
    ties = [f"T{i:05d}" for i in range(1, n - n_surveyed + 1)]
    return [*surveyed, *ties]


# --- Where, when and in which attitude a planned block is exposed
#
# An aircraft is never quite on its line, nor level, and that helps to tell lever arm and boresight
# apart. So the exposures leave the line and the level as much as usual. The simulator moves its
# aircraft as much, by chance. Here the wind 0 leaves it evenly, and every other wind by chance
# with its own number: both are the same in every run.
#
# The ground speed of a strip is constant: an exposure ahead of its place is late by as much.


SCATTER_M = np.array([6.0, 8.0, 5.0])
"""Standard deviations of an exposure's place, forward, left and up."""

MOTION_DEG = np.array([1.1, 0.9, 0.8])
"""Standard deviations of roll, pitch and yaw."""

IN_TURN = 0.4
"""Share of the base by which an exposure leaves its place along the strip at most."""

CRAB_DEG = 4.0
"""Largest angle, by side wind, between heading and course of a strip."""

_STEPS = np.sqrt(np.array([2.0, 3.0, 5.0, 7.0, 11.0, 13.0]))
"""Their multiples, without whole parts, are spread evenly."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Exposures:
    """The exposures of a planned block.

    Attributes
    ----------
    names, strips : tuple of str
    local : ndarray, shape (n, 2)
        Forward and left of the block's middle, m.
    flying_height_m, course_deg, time_s : ndarray, shape (n,)
    rph_deg : ndarray, shape (n, 3)
        Roll, pitch, heading from grid north.
    """

    names: tuple[str, ...]
    strips: tuple[str, ...]
    local: Array
    flying_height_m: Array
    course_deg: Array
    time_s: Array
    rph_deg: Array


def exposures(planned: PlannedBlock, *, wind: int = 0) -> Exposures:
    """Return where a block is exposed, strip by strip.

    Parameters
    ----------
    planned : PlannedBlock
    wind : int
        Number of the wind that moves it.
    """
    strips = tuple(planned.strips.values())
    counts = [strip.n_exposures for strip in strips]
    names = tuple(name for name, n in zip(planned.strips, counts, strict=True) for _ in range(n))
    number = np.concatenate([np.arange(n) for n in counts])
    course = np.repeat([strip.course_deg for strip in strips], counts)
    base = np.repeat([strip.base_m for strip in strips], counts)
    speed = np.repeat([strip.speed_m_s for strip in strips], counts)
    moved, crab = _winds(len(names), len(strips), wind)
    ahead = np.clip(SCATTER_M[0] * moved[:, 0], -IN_TURN * base, IN_TURN * base)
    aside = SCATTER_M[1] * moved[:, 1]
    heading = course + CRAB_DEG * np.repeat(crab, counts)
    return Exposures(
        names=tuple(f"{name}-{i + 1:02d}" for name, i in zip(names, number, strict=True)),
        strips=names,
        local=np.concatenate([_along(strip, planned.area.course_deg) for strip in strips])
        + _turned(np.column_stack([ahead, aside]), course - planned.area.course_deg),
        flying_height_m=np.repeat([strip.flying_height_m for strip in strips], counts)
        + moved[:, 2] * SCATTER_M[2],
        course_deg=course,
        time_s=np.repeat(_begins(strips), counts) + (number * base + ahead) / speed,
        rph_deg=moved[:, 3:] * MOTION_DEG + heading[:, None] * np.array([0.0, 0.0, 1.0]),
    )


def _winds(n: int, n_strips: int, wind: int) -> tuple[Array, Array]:
    """Return numbers of a normal distribution, at most 2, (n, 6), and from -1 to 1, (n_strips,)."""
    if wind == 0:
        return _unsteady(n), _evenly(n_strips)[:, 0] * 2 - 1
    rng = np.random.default_rng(wind)
    return np.clip(rng.standard_normal((n, 6)), -2.0, 2.0), rng.uniform(-1.0, 1.0, n_strips)


def _evenly(n: int) -> Array:
    """Return numbers from 0 to 1 that are spread evenly in every column, shape (n, 6)."""
    return (np.arange(1, n + 1)[:, None] * _STEPS) % 1


def _unsteady(n: int) -> Array:
    """Return numbers of a normal distribution, at most 2, without chance, shape (n, 6)."""
    normal = NormalDist()
    values = [normal.inv_cdf(max(share, 1e-9)) for share in _evenly(n).ravel().tolist()]
    return np.clip(values, -2.0, 2.0).reshape(n, 6)


def _turned(along: Array, turn_deg: Array) -> Array:
    """Return ahead and aside of strips as forward and left of the block, shape (n, 2)."""
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    return np.column_stack([c * along[:, 0] + s * along[:, 1], c * along[:, 1] - s * along[:, 0]])


def flying_time_s(strips: tuple[Strip, ...]) -> float:
    """Return the time from the first exposure to the last, turns included."""
    if not strips:
        return 0.0
    return float(_begins(strips)[-1]) + _on_strip(strips[-1])


def _on_strip(strip: Strip) -> float:
    return (strip.n_exposures - 1) * strip.base_m / strip.speed_m_s


def _begins(strips: tuple[Strip, ...]) -> Array:
    """Return the time of the first exposure of every strip."""
    steps = [0.0, *(_on_strip(strip) + TURN_S for strip in strips[:-1])]
    return np.cumsum(np.array(steps))


def _along(strip: Strip, block_course_deg: float) -> Array:
    """Return the places of a strip's exposures, forward and left of the block's middle."""
    n = strip.n_exposures
    way = (np.arange(n) - (n - 1) / 2) * strip.base_m
    turn = np.full(n, strip.course_deg - block_course_deg)
    return np.array([strip.forward_m, strip.left_m]) + _turned(
        np.column_stack([way, np.zeros(n)]), turn
    )


# --- Which images show which points of the ground, and the tie points that follow from it
#
# - Tie points fill their area evenly, one after the other, until every camera has as many as are
#   asked for in three images or more; those that no camera has in three images do not count.
# - Every image that shows a point measures it, if it is not nearer to the edge than `MARGIN_PX`.
# - Where the points of a synthetic image are measured in heads, its frame decides what is shown.
#
# A simulated flight of the plan gets the same tie points; its images are moved by wind.


MARGIN_PX = 25.0
"""Nothing is measured nearer to the edge of an image."""

LEAST_RAYS = 3
"""Number of images of one camera in which a tie point must be."""

REACH = 1.3
"""Radius around an image's middle, in half diagonals, outside which no point is projected."""

MOST_BATCHES = 30
"""Largest number of batches of tried points, each as many as are asked for."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Visibility:
    """Points, and where they are measured.

    Attributes
    ----------
    local : ndarray, shape (n, 2)
        Forward and left of the block's middle, m.
    x_g : ndarray, shape (n, 3)
        East, north, height, m.
    shown : ndarray of bool, shape (n_cameras, n_exposures, n)
        In which images they are measured.
    colrow : ndarray, shape (n_cameras, n_exposures, n, 2)
        Pixels; NaN where far outside the image.
    deciding : ndarray of bool
        As `shown`, in the images that decide what is measured: those of the frame, or all.
    """

    local: Array
    x_g: Array
    shown: Mask
    colrow: Array
    deciding: Mask

    def __getitem__(self, keep: Index | Mask) -> Visibility:
        """Select points."""
        return Visibility(
            local=self.local[keep],
            x_g=self.x_g[keep],
            shown=self.shown[:, :, keep],
            colrow=self.colrow[:, :, keep],
            deciding=self.deciding[:, :, keep],
        )


def _joined(sights: list[Visibility]) -> Visibility:
    """Return the points of several `Visibility`, one after the other."""
    return Visibility(
        local=np.concatenate([s.local for s in sights]),
        x_g=np.concatenate([s.x_g for s in sights]),
        shown=np.concatenate([s.shown for s in sights], axis=2),
        colrow=np.concatenate([s.colrow for s in sights], axis=2),
        deciding=np.concatenate([s.deciding for s in sights], axis=2),
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Over:
    """A planned block in the air.

    Attributes
    ----------
    plan : Plan
    name : str
        Of the block.
    frame : MappingFrame
    T_m_b : Pose
        Of the exposures.
    """

    plan: Plan
    name: str
    frame: MappingFrame
    T_m_b: Pose

    def surveyed(self) -> Visibility:
        """Return the surveyed points and their visibility."""
        return self.see(plans.places(self.plan.blocks[self.name].points))

    def see(self, local: Array) -> Visibility:
        """Return the visibility of points at places forward and left of the block's middle."""
        x_g = plans.on_ground(self.plan, self.plan.blocks[self.name].area, local)
        x_m = self.frame.from_grid(x_g)
        parts = [self._in(camera, x_m) for camera in self.plan.cameras(self.name)]
        shown = np.stack([part[0] for part in parts])
        frame = self.plan.frame(self.name)
        deciding = shown if frame is None else self._in(frame, x_m)[0][None]
        return Visibility(
            local=local,
            x_g=x_g,
            shown=shown & deciding,
            colrow=np.stack([part[1] for part in parts]),
            deciding=deciding,
        )

    def _in(self, camera: Camera, x_m: Array) -> tuple[Mask, Array]:
        """Return a camera's visibility of points, shape (n_images, n_points), and their pixels."""
        T_m_c = self.T_m_b @ camera.T_b_c
        exposure, point = np.nonzero(_near(camera, T_m_c, x_m))
        apparent = as_seen(T_m_c.r[exposure], x_m[point], refraction=self.plan.setup.refraction)
        projected = project(camera, T_m_c[exposure], apparent)
        shown = np.zeros((len(T_m_c), len(x_m)), dtype=bool)
        shown[exposure, point] = border_distance(camera, projected) >= MARGIN_PX
        colrow = np.full((*shown.shape, 2), np.nan)
        colrow[exposure, point] = projected
        return shown, colrow

    def tie_points(self) -> Visibility:
        """Return the tie points and their visibility.

        Raises
        ------
        FlightError
            Where the images show less than are asked for.
        """
        return self._tried()[0]

    def tie_places(self) -> Array:
        """Return all places that were tried for tie points, forward and left, m, (n, 2)."""
        return self._evenly(self._tried()[1], first=1)

    def ties_at(self, places: Array) -> Visibility:
        """Return the visibility of the places that are in three images of a camera."""
        sight = self.see(places)
        return sight[(sight.deciding.sum(axis=1) >= LEAST_RAYS).any(axis=0)]

    def _tried(self) -> tuple[Visibility, int]:
        """Return the visibility of the tie points, and how many places were tried for them."""
        wanted = self.plan.blocks[self.name].tie_points
        kept = [self.see(np.empty((0, 2)))]
        n_good = np.zeros(len(kept[0].deciding), dtype=int)
        for batch in range(MOST_BATCHES if wanted else 0):
            sight = self.see(self._evenly(wanted, first=1 + batch * wanted))
            good = sight.deciding.sum(axis=1) >= LEAST_RAYS
            so_far = n_good[:, None] + np.cumsum(good, axis=1)
            enough = np.all(so_far >= wanted, axis=0)
            upto = int(np.argmax(enough)) + 1 if enough.any() else wanted
            kept.append(sight[np.flatnonzero(good[:, :upto].any(axis=0))])
            if enough.any():
                return _joined(kept), batch * wanted + upto
            n_good = so_far[:, -1]
        if wanted:
            reason = f"{self.name}.tie_points: of {wanted}, three images of every camera show only"
            raise FlightError([f"{reason} {n_good.min()}; ask for less, or for a larger overlap"])
        return _joined(kept), 0

    def _evenly(self, n: int, *, first: int) -> Array:
        low, high = self._tie_area()
        return low + (high - low) * plans.evenly(n, first=first)

    def _tie_area(self) -> tuple[Array, Array]:
        """Return the least and the largest forward and left of the area with tie points."""
        planned = self.plan.blocks[self.name]
        if planned.tie_area_m is not None:
            half = 0.5 * np.array(planned.tie_area_m)
            return -half, half
        camera = self.plan.frame(self.name) or self.plan.cameras(self.name)[0]
        taken = exposures(planned)
        turn = np.radians(taken.course_deg - planned.area.course_deg)
        along = image_length_m(camera, 1.0) * taken.flying_height_m
        across = image_length_m(camera, 1.0, across=True) * taken.flying_height_m
        c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
        half = 0.5 * np.column_stack([c * along + s * across, s * along + c * across])
        return (taken.local - half).min(axis=0), (taken.local + half).max(axis=0)


def _near(camera: Camera, T_m_c: Pose, x_m: Array) -> Mask:
    """Return which points lie in a cone around the images' axes, shape (n_images, n_points)."""
    ray = x_m - T_m_c.r[:, None]
    along = -np.einsum("npi,ni->np", ray, T_m_c.R[:, :, 2])
    tangent = REACH * 0.5 * camera.pixel_mm * camera.diagonal_px / camera.interior.f
    aside_sq = np.einsum("npi,npi->np", ray, ray) - along**2
    return (along > 0) & (aside_sq < (tangent * along) ** 2)
