"""Small blocks with known truth, exact by the library's own projection.

They serve to test the adjustment, whose signs the simulated flights check elsewhere. A block's
cameras hold the truth; `approximate` is what a calibration starts from.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acx4lib.block import (
    Block,
    ImagePoints,
    Images,
    SurveyedPoints,
    Trajectory,
)
from acx4lib.bundle.unknowns import layout
from acx4lib.calibration.estimates import Calibration
from acx4lib.geometry.camera import Camera, Interior, inside
from acx4lib.geometry.collinearity import project, refraction_lift
from acx4lib.geometry.frames import Pose, exp, rotation_from_opk, transform
from acx4lib.geometry.geodesy import GridSystem, MappingFrame
from acx4lib.geometry.parameters import MOUNT

FRAME = MappingFrame(grid=GridSystem(crs="EPSG:31982"), origin=np.array([-49.3, -25.4]))
GROUND_M = 900.0

CAMERA = Camera(
    name="CAM",
    width_px=4000,
    height_px=3000,
    pixel_mm=0.01,
    interior=Interior(f=50.0, xp=0.06, yp=-0.04, k1=2e-6, p1=2e-6, p2=-3e-6),
    T_b_c=Pose(R=rotation_from_opk(np.radians([0.5, -0.8, 1.2])), r=np.array([0.25, -0.40, -0.20])),
)
BOTH_WAYS = (
    (1000.0, -150.0, 0.0),
    (1000.0, 150.0, 180.0),
    (1500.0, -80.0, 90.0),
    (1500.0, 60.0, -90.0),
)
"""Strips: height over ground in m, metres aside of the middle, direction in degrees from east."""


def fly(strips=BOTH_WAYS, *, per_strip=3, base_m=220.0, tilt_deg=1.5, seed=1):
    """Return body poses along strips, shape (n,), slightly tilted."""
    rng = np.random.default_rng(seed)
    R, r = [], []
    for height, aside, direction in strips:
        along = base_m * (np.arange(per_strip) - (per_strip - 1) / 2)
        turned = rotation_from_opk(np.radians([0.0, 0.0, direction]))
        places = np.column_stack([along, np.full(per_strip, aside), np.zeros(per_strip)])
        r.append(places @ turned.T + [0.0, 0.0, GROUND_M + height])
        tilts = np.radians(rng.uniform(-tilt_deg, tilt_deg, (per_strip, 3)))
        R.append(turned @ rotation_from_opk(tilts))
    return Pose(R=np.concatenate(R), r=np.concatenate(r))


def terrain(n, *, half_m=330.0, relief_m=60.0, seed=2):
    """Return points scattered over hilly ground, shape (n, 3)."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(-half_m, half_m, (n, 2))
    return np.column_stack([xy, GROUND_M + relief_m * rng.uniform(-1, 1, n)])


def crosses(*, spacing_m=300.0):
    """Return nine points, three by three, on hilly ground."""
    rng = np.random.default_rng(3)
    x, y = (a.ravel() for a in np.meshgrid([-spacing_m, 0, spacing_m], [-spacing_m, 0, spacing_m]))
    return np.column_stack([x, y, GROUND_M + 40 * rng.uniform(-1, 1, 9)])


def surveyed(x_m, first, *, sigma=(0.01, 0.01, 0.02)):
    """Return surveyed points that stand in the block from point `first` on."""
    return SurveyedPoints(
        point_idx=first + np.arange(len(x_m)),
        x_m=x_m,
        R_g_m=FRAME.grid_axes(x_m).reshape(-1, 3, 3),
        sigma_m=np.tile(np.asarray(sigma, dtype=float), (len(x_m), 1)),
    )


def simulate(T_m_b, *, cameras=(CAMERA,), ties=None, control=None, check=None, refraction="none"):
    """Return an exact block: every camera exposed at every pose, every point it sees measured.

    Parameters
    ----------
    T_m_b : Pose
        Body poses, shape (n,).
    cameras : sequence of Camera
        With their true mounting.
    ties, control, check : ndarray, shape (k, 3), optional
        Points, m.
    refraction : str
        ``"none"`` or ``"standard"``.
    """
    none = np.zeros((0, 3))
    ties, control, check = (none if x is None else x for x in (ties, control, check))
    x_m = np.concatenate([control, check, ties])
    image_idx, point_idx, colrow = [], [], []
    for image, (exposure, k) in enumerate(np.ndindex(len(T_m_b), len(cameras))):
        T_m_c = T_m_b[exposure] @ cameras[k].T_b_c
        poses = Pose(R=np.tile(T_m_c.R, (len(x_m), 1, 1)), r=np.tile(T_m_c.r, (len(x_m), 1)))
        up = np.zeros_like(x_m)
        if refraction == "standard":
            up[:, 2] = refraction_lift(poses.r, x_m)
        seen_at = project(cameras[k], poses, x_m + up)
        seen = np.flatnonzero(inside(cameras[k], np.nan_to_num(seen_at, nan=-1e9)))
        image_idx.append(np.full(len(seen), image))
        point_idx.append(seen)
        colrow.append(seen_at[seen])
    exposures = len(T_m_b)
    names = [f"P{i}" for i in range(len(x_m))]
    return Block(
        name="calibration",
        frame=FRAME,
        cameras=tuple(cameras),
        images=Images(
            names=tuple(f"{e}_{camera.name}" for e in range(exposures) for camera in cameras),
            camera_idx=np.tile(np.arange(len(cameras)), exposures),
            exposure_idx=np.repeat(np.arange(exposures), len(cameras)),
            strips=("",) * (exposures * len(cameras)),
        ),
        points=tuple(names),
        image_points=ImagePoints(
            image_idx=np.concatenate(image_idx),
            point_idx=np.concatenate(point_idx),
            colrow=np.concatenate(colrow),
            sigma_px=np.full(sum(map(len, point_idx)), 0.5),
        ),
        control=surveyed(control, 0),
        check=surveyed(check, len(control)),
        trajectory=Trajectory(
            exposures=tuple(str(e) for e in range(exposures)),
            T_m_b=T_m_b,
            R_g_m=FRAME.grid_axes(T_m_b.r),
            sigma_position=np.tile([0.02, 0.02, 0.03], (exposures, 1)),
            sigma_attitude=np.tile(np.radians([0.005, 0.005, 0.008]), (exposures, 1)),
        ),
    )


def standard(**options):
    """Return two heights, flown both ways, over nine control, two check and 40 tie points."""
    options = {"ties": terrain(40), "control": crosses(), "check": terrain(2, seed=4)} | options
    return simulate(fly(), **options)


def standard_points():
    """Return the true points of `standard`: control, check and tie points."""
    return np.concatenate([crosses(), terrain(2, seed=4), terrain(40)])


def balanced():
    """Return a block with noise in which no group of observations outweighs the others."""
    exact = simulate(
        fly(per_strip=6, base_m=150.0), ties=terrain(100, half_m=450.0), control=crosses()
    )
    sigma_m = np.tile([0.10, 0.10, 0.15], (len(exact.trajectory), 1))
    sigma_attitude = np.tile(np.radians([0.005, 0.005, 0.008]), (len(exact.trajectory), 1))
    block = replace(
        exact,
        control=surveyed(crosses(), 0, sigma=(0.06, 0.06, 0.10)),
        trajectory=replace(exact.trajectory, sigma_position=sigma_m, sigma_attitude=sigma_attitude),
    )
    return noisy(block, np.random.default_rng(7))


def in_strips(block, per_strip):
    """Return the block with its exposures in strips A, B, ... and uneven times."""
    n = len(block.trajectory)
    names = np.array(["ABCDEFGH"[i // per_strip] for i in range(n)])
    times = 1e5 + 4.0 * np.arange(n) + np.sin(np.arange(n))
    return replace(
        block,
        images=replace(block.images, strips=tuple(names[block.images.exposure_idx])),
        trajectory=replace(block.trajectory, time_s=times),
    )


def approximate(block, *, df=0.3, boresight_deg=0.5, lever_m=None):
    """Return the block with cameras as one knows them before: no distortion, nothing mounted.

    Parameters
    ----------
    block : Block
    df : float
        Error of the focal length, mm.
    boresight_deg : float
        Error of the boresight about each axis.
    lever_m : ndarray, optional
        Approximate lever arm, by default zero.
    """
    wrong = exp(np.radians(np.full(3, boresight_deg)))
    lever = np.zeros(3) if lever_m is None else np.asarray(lever_m, dtype=float)
    return replace(
        block,
        cameras=tuple(
            replace(
                camera,
                interior=Interior(f=camera.interior.f + df),
                T_b_c=Pose(R=camera.T_b_c.R @ wrong, r=lever),
            )
            for camera in block.cameras
        ),
    )


def noisy(block, rng):
    """Return the block with normal noise of the size that its sigmas and correlations state."""
    trajectory = block.trajectory
    noise = {
        "image_point": rng.normal(size=(len(block.image_points), 2))
        * block.image_points.sigma_px[:, None],
        "control_point": rng.normal(size=(len(block.control), 3)) * block.control.sigma_m,
        "gnss": drawn(trajectory, trajectory.slow_positions, rng) * trajectory.sigma_position,
        "attitude": drawn(trajectory, trajectory.slow_attitudes, rng) * trajectory.sigma_attitude,
    }
    for kind, by in noise.items():
        block = changed(block, kind, by)
    return block


def drawn(trajectory, process, rng):
    """Draw three components of white noise and, from exposure to exposure, of a slow process."""
    white = rng.normal(size=(len(trajectory), 3))
    if process.share == 0:
        return white
    walk = rng.normal(size=(len(trajectory), 3))
    for i, apart in enumerate(np.diff(trajectory.time_s), start=1):
        left = np.exp(-apart / process.time_constant_s)
        walk[i] = left * walk[i - 1] + np.sqrt(1 - left**2) * walk[i]
    return process.share * walk + np.sqrt(1 - process.share**2) * white


def changed(block, kind, by):
    """Return the block with observations of one kind changed.

    Parameters
    ----------
    block : Block
    kind : str
        ``image_point`` (px), ``control_point`` and ``gnss`` (m, along the grid axes) or
        ``attitude`` (radians about the body's axes).
    by : ndarray, shape (n, 2) or (n, 3)
    """
    if kind == "image_point":
        points = block.image_points
        return replace(block, image_points=replace(points, colrow=points.colrow + by))
    if kind == "control_point":
        moved = block.control.x_m + transform(np.swapaxes(block.control.R_g_m, 1, 2), by)
        return replace(block, control=replace(block.control, x_m=moved))
    trajectory = block.trajectory
    T = trajectory.T_m_b
    if kind == "gnss":
        T = Pose(R=T.R, r=T.r + transform(np.swapaxes(trajectory.R_g_m, 1, 2), by))
    else:
        T = Pose(R=T.R @ exp(by), r=T.r)
    return replace(block, trajectory=replace(trajectory, T_m_b=T))


def surveyed_off(block, by):
    """Return the block with the survey of its check points moved by east, north, height, m."""
    R_m_g = np.swapaxes(block.check.R_g_m, 1, 2)
    x_m = block.check.x_m + transform(R_m_g, np.broadcast_to(by, block.check.x_m.shape))
    return replace(block, check=replace(block.check, x_m=x_m))


def observed_sigmas(block):
    """Return the sigma of every observation by kind, shape (n, components)."""
    return {
        "image_point": np.repeat(block.image_points.sigma_px[:, None], 2, axis=1),
        "control_point": block.control.sigma_m,
        "gnss": block.trajectory.sigma_position,
        "attitude": block.trajectory.sigma_attitude,
    }


def numeric_covariance(block, estimate, *, kinds=None):
    """Propagate every observation's sigma by forward differences of an estimate of the block.

    Parameters
    ----------
    block : Block
        Exact, so that weights and linearisation play no part.
    estimate : callable
        From a block to a vector.
    kinds : sequence of str, optional
        Kinds of observations, by default all.
    """
    cov, exact, share = 0.0, estimate(block), 1e-3  # of sigma
    for kind, sigma in observed_sigmas(block).items():
        if kinds is not None and kind not in kinds:
            continue
        for i, d in np.argwhere(np.isfinite(sigma) & (sigma > 0)):
            by = np.zeros_like(sigma)
            by[i, d] = share * sigma[i, d]
            effect = (estimate(changed(block, kind, by)) - exact) / share
            cov = cov + np.outer(effect, effect)
    return cov


# --- two cameras on one body, and a calibration of them ----------------------------------------


SECOND = replace(
    CAMERA,
    name="SIDE",
    interior=replace(CAMERA.interior, f=48.0, k1=-3e-6, b1=2e-4, b2=1.5e-4),
    T_b_c=Pose(R=rotation_from_opk(np.radians([12.0, -5.0, 90.0])), r=np.array([0.1, 0.3, 0.2])),
)
ESTIMATED = ("f", "xp", "k1", "p2")
SEEN = np.array([[50.0, -80.0, 930.0], [-120.0, 40.0, 870.0], [0.0, 150.0, 900.0]])
_STEP = {"f": 1e-3, "xp": 1e-3, "k1": 1e-8, "p2": 1e-7}


COLUMN_STEPS = np.tile([_STEP[name] for name in ESTIMATED] + [1e-2] * 3 + [1e-6] * 3, 2)


def pair():
    """Return a block of two cameras: rays of one exposure share its trajectory error."""
    return simulate(fly(BOTH_WAYS[1:3]), cameras=(CAMERA, SECOND), ties=SEEN)


def calibrated(block):
    """Return both cameras, some interior parameters and the mountings estimated, all correlated."""
    sigma = np.tile([3e-3, 3e-3, 1e-7, 1e-6] + [0.02] * 3 + [2e-5] * 3, 2)
    rng = np.random.default_rng(5)
    mix = np.linalg.qr(rng.normal(size=(20, 20)))[0] * rng.uniform(0.5, 1.5, 20)
    return Calibration(
        cameras=block.cameras,
        layout=layout(2, 0, free=ESTIMATED, free_mount=MOUNT),
        cov=sigma[:, None] * (mix @ mix.T) * sigma,
        sigma0_sq=2.0,  # plays no part a priori
        open_columns=np.zeros(20, dtype=bool),
    )


def moved_calibration(calibration, steps):
    """The calibration with its columns moved, rotations about the cameras' axes."""
    padded = np.append(steps, 0.0)
    cameras = []
    for k, camera in enumerate(calibration.cameras):
        by = padded[calibration.layout.mount[k]]
        interior = camera.interior.to_array() + padded[calibration.layout.interior[k]]
        T = Pose(R=camera.T_b_c.R @ exp(by[3:]), r=camera.T_b_c.r + by[:3])
        cameras.append(replace(camera, interior=Interior.from_array(interior), T_b_c=T))
    return replace(calibration, cameras=tuple(cameras))


def moved_trajectory(block, steps):
    steps = steps.reshape(-1, 6)
    T = block.trajectory.T_m_b
    T = Pose(R=T.R @ exp(steps[:, 3:]), r=T.r + steps[:, :3])
    return replace(block, trajectory=replace(block.trajectory, T_m_b=T))
