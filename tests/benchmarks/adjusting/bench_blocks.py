"""Blocks of the paper's camera with known truth, made in memory, up to two million points.

The library's own projection makes them: they serve to time an adjustment and to compare solvers,
not to test signs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

import numpy as np

from acx4lib.block import Block, ImagePoints, Images, SurveyedPoints, Trajectory
from acx4lib.bundle import adjust
from acx4lib.bundle.network import Network
from acx4lib.bundle.observations import PoseObservations
from acx4lib.bundle.unknowns import Layout, State, layout
from acx4lib.geometry.camera import (
    INTERIOR,
    Camera,
    Interior,
    inside,
)
from acx4lib.geometry.collinearity import project
from acx4lib.geometry.frames import Pose, exp, rotation_from_opk, transform
from acx4lib.geometry.geodesy import GridSystem, MappingFrame
from acx4lib.geometry.parameters import MOUNT
from acx4lib.model import Model

FREE = INTERIOR[:8]
"""All interior parameters of the paper: f, xp, yp, k1, k2, k3, p1, p2; those without a lens."""

FRAME = MappingFrame(grid=GridSystem(crs="EPSG:31982"), origin=np.array([-49.3, -25.4]))
GROUND_M = 900.0
START_F_MM = 74.0
START_TIES_M = 3.0
"""Start values of tie points lie this far from the truth at most, along each axis."""

TRUTH = Camera(  # Table 3, single-step method
    name="SYN",
    width_px=12000,
    height_px=16200,
    pixel_mm=0.0056,
    interior=Interior(
        f=74.4404,
        xp=0.0569,
        yp=0.0063,
        k1=2.42e-7,
        k2=-9.30e-11,
        k3=2.06e-14,
        p1=1.70e-6,
        p2=2.03e-7,
    ),
    T_b_c=Pose(
        R=rotation_from_opk(np.radians([0.49665, -1.59457, 0.07984])),
        r=np.array([0.223, -0.399, -0.201]),
    ),
)
SIGMA_PX = 0.003 / 5.6e-3  # 3 micrometres
SIGMA_CONTROL_M = np.array([0.01, 0.01, 0.02])
SIGMA_POSITION_M = np.array([0.05, 0.05, 0.10])
SIGMA_ATTITUDE = np.radians([0.005, 0.005, 0.008])


@dataclass(frozen=True, kw_only=True)
class Strip:
    """A strip: number of images, height over ground, base and place aside, m.

    It is flown along the x axis, or across.
    """

    n: int
    height_m: float
    base_m: float
    aside_m: float = 0.0
    turned: bool = False
    across: bool = False


@dataclass(frozen=True, kw_only=True)
class Design:
    """A block to make.

    Attributes
    ----------
    layout : str
        Key of `LAYOUTS`.
    ties : int
        Number of tie points, each in two images at least.
    """

    layout: str
    ties: int


_LOW = Strip(n=10, height_m=1000.0, base_m=181.0)
_HIGH = Strip(n=11, height_m=1500.0, base_m=271.0)


def parallel(counts: list[int], *, base_m: float = 469.0) -> tuple[Strip, ...]:
    """Return strips with overlaps of 60 and 30 %, flown to and fro."""
    middle = (len(counts) - 1) / 2
    return tuple(
        Strip(n=n, height_m=1300.0, base_m=base_m, aside_m=1109.0 * (i - middle), turned=i % 2 == 1)
        for i, n in enumerate(counts)
    )


LAYOUTS = {
    # the paper's calibration block: two heights, both directions, overlaps of 80 and 50 %
    "52": (
        replace(_LOW, aside_m=609.0),
        replace(_LOW, turned=True),
        replace(_LOW, aside_m=-609.0),
        replace(_HIGH, turned=True),
        _HIGH,
    ),
    # the paper's validation block
    "268": parallel([14 if i % 5 in (0, 2) else 13 for i in range(20)]),
    "1000": parallel([40] * 25),
    "4000": parallel([40] * 100),
}
CONTROL = {"52": (8, 7), "268": (6, 6), "1000": (6, 6), "4000": (6, 24)}
"""Rows and columns of the control points."""

DESIGNS = {
    "a500": Design(layout="52", ties=500),
    "a5k": Design(layout="52", ties=5_000),
    "a50k": Design(layout="52", ties=50_000),
    "c100k": Design(layout="268", ties=100_000),
    "d500k": Design(layout="1000", ties=500_000),
    "e2m": Design(layout="4000", ties=2_000_000),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Made:
    """A block as a calibration meets it, and the truth.

    Attributes
    ----------
    block : Block
        Noisy, with the approximate camera.
    x_m : ndarray, shape (n_points, 3)
        True points, m; control points first.
    """

    block: Block
    x_m: np.ndarray


def make(design: Design) -> Made:
    """Return a block, the same for a design."""
    return fly(LAYOUTS[design.layout], design.ties, control=CONTROL[design.layout], seed=1)


def fly(
    strips: Sequence[Strip],
    ties: int,
    *,
    control: tuple[int, int],
    seed: int,
    turned_deg: float = 0.0,
) -> Made:
    """Return a block of strips with a number of tie points, and rows and columns of control.

    The strips are turned against the x axis, counter-clockwise.
    """
    rng = np.random.default_rng(seed)
    T_m_b = _fly(strips, rng)
    surveyed = _control(strips, control, rng)
    x_m = np.concatenate([surveyed, _strew(strips, 2 * ties + 100, rng)])
    if turned_deg:
        R = rotation_from_opk(np.array([0.0, 0.0, np.radians(turned_deg)]))
        T_m_b, x_m = Pose(R=R @ T_m_b.R, r=T_m_b.r @ R.T), x_m @ R.T
    image_idx, point_idx, colrow = _look(T_m_b, x_m)
    rays = np.bincount(point_idx, minlength=len(x_m))
    kept = rays >= 2
    kept[: len(surveyed)] = True
    kept &= np.cumsum(kept) <= len(surveyed) + ties
    number = np.cumsum(kept) - 1
    rows = kept[point_idx]
    x_m = x_m[kept]
    points = ImagePoints(
        image_idx=image_idx[rows],
        point_idx=number[point_idx[rows]],
        colrow=colrow[rows] + SIGMA_PX * rng.standard_normal((int(rows.sum()), 2)),
        sigma_px=np.full(int(rows.sum()), SIGMA_PX),
    )
    return Made(block=_block(T_m_b, x_m, points, n_control=len(surveyed), rng=rng), x_m=x_m)


def network(made: Made) -> Network:
    """Return the single step of a block, with start values that lie off the truth."""
    ready = adjust.mounted_orientation(made.block, Model(free=FREE))
    rng = np.random.default_rng(2)
    x_m = made.x_m + rng.uniform(-START_TIES_M, START_TIES_M, made.x_m.shape)
    x_m[made.block.control.point_idx] = made.block.control.x_m
    # the cost functions for Ceres correct the points as they were measured
    return replace(ready, start=replace(ready.start, x_m=x_m), distortion_at="measured")


def _fly(strips: Sequence[Strip], rng: np.random.Generator) -> Pose:
    """Return true body poses: planned, with some wind."""
    R, r = [], []
    for strip in strips:
        forward = -1.0 if strip.turned else 1.0
        along = forward * strip.base_m * (np.arange(strip.n) - (strip.n - 1) / 2)
        places = np.column_stack([along, np.full_like(along, strip.aside_m), np.zeros(strip.n)])
        places[:, 2] = GROUND_M + strip.height_m
        if strip.across:
            places = places @ rotation_from_opk(np.array([0.0, 0.0, np.pi / 2])).T
        r.append(places + np.clip(rng.standard_normal(places.shape), -2, 2) * [6.0, 8.0, 5.0])
        turn = np.pi * strip.turned + np.pi / 2 * strip.across
        heading = rotation_from_opk(np.array([0.0, 0.0, turn]))
        R.append(heading @ exp(np.radians(np.clip(rng.standard_normal((strip.n, 3)), -2, 2))))
    return Pose(R=np.concatenate(R), r=np.concatenate(r))


def _half_extent(strips: Sequence[Strip]) -> np.ndarray:
    """Return half the length and width of what the images' centres span, m."""
    strips = [strip for strip in strips if not strip.across]
    along = max(strip.base_m * (strip.n - 1) / 2 for strip in strips)
    return np.array([along, max(abs(strip.aside_m) for strip in strips)])


def _strew(strips: Sequence[Strip], n: int, rng: np.random.Generator) -> np.ndarray:
    half = _half_extent(strips) + 400.0
    return _on_ground(half * rng.uniform(-1, 1, (n, 2)), rng)


def _control(
    strips: Sequence[Strip], shape: tuple[int, int], rng: np.random.Generator
) -> np.ndarray:
    x, y = (
        share * np.linspace(-1, 1, n) for share, n in zip(_half_extent(strips), shape, strict=True)
    )
    return _on_ground(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2), rng)


def _on_ground(xy: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return points on waves of 30 m with 2 m of roughness."""
    height = 30 * np.sin(xy[:, 0] / 300) * np.cos(xy[:, 1] / 400)
    return np.column_stack([xy, GROUND_M + height + 2 * rng.standard_normal(len(xy))])


def _look(T_m_b: Pose, x_m: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which image sees which point where, without noise, image by image."""
    T_m_c = T_m_b @ TRUTH.T_b_c
    parts = [
        (np.full(len(points), image), points, colrow)
        for image, (points, colrow) in enumerate(_seen(T_m_c, x_m))
    ]
    image_idx, point_idx, colrow = (np.concatenate(part) for part in zip(*parts, strict=True))
    return image_idx, point_idx, colrow


def _seen(T_m_c: Pose, x_m: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    by_y = np.argsort(x_m[:, 1])
    y = x_m[by_y, 1]
    for T in (T_m_c[i] for i in range(len(T_m_c))):
        reach = 0.9 * (T.r[2] - GROUND_M)  # half an image's diagonal on the ground, with tilt
        near = by_y[np.searchsorted(y, T.r[1] - reach) : np.searchsorted(y, T.r[1] + reach)]
        near = np.sort(near[np.abs(x_m[near, 0] - T.r[0]) < reach])
        poses = Pose(R=np.broadcast_to(T.R, (len(near), 3, 3)), r=T.r[None])
        colrow = project(TRUTH, poses, x_m[near])
        on = inside(TRUTH, np.nan_to_num(colrow, nan=-1e9))
        yield near[on], colrow[on]


def _block(
    T_m_b: Pose, x_m: np.ndarray, points: ImagePoints, *, n_control: int, rng: np.random.Generator
) -> Block:
    exposures = tuple(f"E{i}" for i in range(len(T_m_b)))
    return Block(
        frame=FRAME,
        cameras=(
            replace(TRUTH, interior=Interior(f=START_F_MM), T_b_c=Pose(R=np.eye(3), r=np.zeros(3))),
        ),
        images=Images(names=exposures),
        points=tuple(f"P{i}" for i in range(len(x_m))),
        image_points=points,
        control=_surveyed(x_m[:n_control], rng),
        trajectory=_recorded(T_m_b, exposures, rng),
    )


def _surveyed(x_m: np.ndarray, rng: np.random.Generator) -> SurveyedPoints:
    R_g_m = FRAME.grid_axes(x_m).reshape(-1, 3, 3)
    noise = SIGMA_CONTROL_M * rng.standard_normal(x_m.shape)
    return SurveyedPoints(
        point_idx=np.arange(len(x_m)),
        x_m=x_m + transform(np.swapaxes(R_g_m, 1, 2), noise),
        R_g_m=R_g_m,
        sigma_m=np.tile(SIGMA_CONTROL_M, (len(x_m), 1)),
    )


def _recorded(T_m_b: Pose, exposures: tuple[str, ...], rng: np.random.Generator) -> Trajectory:
    R_g_m = FRAME.grid_axes(T_m_b.r)
    shift = SIGMA_POSITION_M * rng.standard_normal((len(T_m_b), 3))
    turn = SIGMA_ATTITUDE * rng.standard_normal((len(T_m_b), 3))
    return Trajectory(
        exposures=exposures,
        T_m_b=Pose(R=T_m_b.R @ exp(turn), r=T_m_b.r + transform(np.swapaxes(R_g_m, 1, 2), shift)),
        R_g_m=R_g_m,
        sigma_position=np.tile(SIGMA_POSITION_M, (len(T_m_b), 1)),
        sigma_attitude=np.tile(SIGMA_ATTITUDE, (len(T_m_b), 1)),
    )


# --- an adjustment's input as one plain file, which every solver of the benchmark reads --------


def write_problem(network: Network, path: Path) -> None:
    """Write a network of one camera with one image per exposure.

    Raises
    ------
    ValueError
        For another network.
    """
    n_poses = len(network.pose_names)
    if len(network.block.cameras) != 1 or not np.array_equal(network.pose_idx, np.arange(n_poses)):
        msg = "the problem file holds one camera with one image per exposure"
        raise ValueError(msg)
    counts = (n_poses, network.n_points, len(network.control), len(network.image_points))
    with path.open("wb") as out:
        np.array(counts, dtype=np.int64).tofile(out)
        for array in _arrays(network):
            array.tofile(out)


def _arrays(network: Network) -> list[np.ndarray]:
    camera, control = network.block.cameras[0], network.control
    start, observed, points = network.start, network.observed, network.image_points
    numbers = [
        np.array([camera.width_px, camera.height_px, camera.pixel_mm]),
        *(start.interiors[0].to_array(), start.T_b_c.R[0], start.T_b_c.r[0]),
        *(start.T_m_b.R, start.T_m_b.r, observed.R_g_m),  # observed and start values alike
        *(observed.sigma_position, observed.sigma_attitude, start.x_m),
        *(control.point_idx, control.x_m, control.R_g_m, control.sigma_m),
        *(points.image_idx, points.point_idx, points.colrow, points.sigma_px),
    ]
    return [
        np.ascontiguousarray(a, dtype=np.int32 if a.dtype.kind == "i" else np.float64)
        for a in numbers
    ]


def read_problem(
    path: Path, *, free: Sequence[str] = FREE, free_mount: Sequence[str] = MOUNT
) -> Network:
    """Return the network of a file, ready for adjustment.

    Parameters
    ----------
    path : Path
    free, free_mount : sequence of str
        As in `adjust.mounted_orientation`; nothing of the mounting where poses are the camera's.
    """
    with path.open("rb") as file:
        n_poses, n_points, n_control, n_rays = np.fromfile(file, np.int64, 4)
        camera = _camera(file)
        T_m_b = Pose(R=_floats(file, n_poses, 3, 3), r=_floats(file, n_poses, 3))
        observed = PoseObservations(
            T_m_b=T_m_b,
            R_g_m=_floats(file, n_poses, 3, 3),
            sigma_position=_floats(file, n_poses, 3),
            sigma_attitude=_floats(file, n_poses, 3),
        )
        x_m = _floats(file, n_points, 3)
        control = SurveyedPoints(
            point_idx=np.fromfile(file, np.int32, n_control),
            x_m=_floats(file, n_control, 3),
            R_g_m=_floats(file, n_control, 3, 3),
            sigma_m=_floats(file, n_control, 3),
        )
        points = ImagePoints(
            image_idx=np.fromfile(file, np.int32, n_rays),
            point_idx=np.fromfile(file, np.int32, n_rays),
            colrow=_floats(file, n_rays, 2),
            sigma_px=_floats(file, n_rays),
        )
    block = _block_read(camera, observed, control, points, n_points=n_points)
    return _network_read(block, observed, x_m, layout(1, n_poses, free=free, free_mount=free_mount))


def _floats(file: BinaryIO, *shape: int) -> np.ndarray:
    return np.fromfile(file, np.float64, int(np.prod(shape))).reshape(shape)


def _camera(file: BinaryIO) -> Camera:
    width_px, height_px, pixel_mm = _floats(file, 3)
    return Camera(
        name="SYN",
        width_px=int(width_px),
        height_px=int(height_px),
        pixel_mm=pixel_mm,
        interior=Interior.from_array(_floats(file, len(INTERIOR))),
        T_b_c=Pose(R=_floats(file, 3, 3), r=_floats(file, 3)),
    )


def _block_read(
    camera: Camera,
    observed: PoseObservations,
    control: SurveyedPoints,
    points: ImagePoints,
    *,
    n_points: int,
) -> Block:
    exposures = tuple(f"E{i}" for i in range(len(observed.T_m_b)))
    return Block(
        frame=FRAME,
        cameras=(camera,),
        images=Images(names=exposures),
        points=tuple(f"P{i}" for i in range(n_points)),
        image_points=points,
        control=control,
        trajectory=Trajectory(
            exposures=exposures,
            T_m_b=observed.T_m_b,
            R_g_m=observed.R_g_m,
            sigma_position=observed.sigma_position,
            sigma_attitude=observed.sigma_attitude,
        ),
    )


def _network_read(
    block: Block, observed: PoseObservations, x_m: np.ndarray, columns: Layout
) -> Network:
    """Return what `adjust.mounted_orientation` does, without a search for start values."""
    n, camera = len(block.images), block.cameras[0]
    return Network(
        block=block,
        pose_names=block.trajectory.exposures,
        pose_idx=np.arange(n),
        layout=columns,
        image_points=block.image_points,
        rows=np.arange(len(block.image_points), dtype=np.int32),
        control=block.control,
        observed=observed,
        start=State(
            interiors=(camera.interior,),
            T_b_c=Pose(R=camera.T_b_c.R[None], r=camera.T_b_c.r[None]),
            T_m_b=observed.T_m_b,
            x_m=x_m,
        ),
        distortion_at="measured",  # as `bench_blocks.network` has it
    )
