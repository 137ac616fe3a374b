"""Angles between rays and their points, and the images and points with the largest ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acx4lib.bundle.network import Network, camera_poses
from acx4lib.bundle.unknowns import State
from acx4lib.expected import Array, Index, Mask
from acx4lib.flight.block import ImagePoints
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.collinearity import rays
from acx4lib.geometry.frames import Pose
from acx4lib.least_squares.covariance import medians

FAR_OFF = np.radians(4.0)
"""Median angle of an image's rays and points above which approximate values are bad."""

SAMPLE = 20
"""Measurements per image, on average, that are examined for it."""

ASTRAY = np.radians(1.0)
"""The same limit after an adjustment; no lens and no terrain makes such residuals."""

OUTLYING = 50.0
"""Ratio of a measurement's misfit to the median above which a message may name it."""

MOST_NAMED = 3
"""Largest number of images, points or measurements that a message names."""


def camera_rays(cameras: Sequence[Camera], camera_idx: Index, colrow: Array) -> Array:
    """Return the unit vectors of measured rays in the axes of their cameras, shape (n, 3)."""
    own_axes = Pose(R=np.eye(3), r=np.zeros(3))
    out = np.empty((len(colrow), 3))
    for k, camera in enumerate(cameras):
        own = camera_idx == k
        out[own] = rays(camera, own_axes, colrow[own])
    return out


def misfits(network: Network, state: State) -> Array:
    """Return the median angle of each image's rays and points, radians, shape (n_images,).

    From a sample of the measurements; infinite where points have no coordinates.
    """
    n_images = len(network.block.images)
    step = 1 + len(network.image_points) // (SAMPLE * n_images)
    some = np.arange(0, len(network.image_points), step)
    seen = seen_by(network, state, network.image_points[some])
    return medians(_angles(seen, state), seen.points.image_idx, n_images)


def far_off(network: Network, state: State, *, limit: float = FAR_OFF) -> Mask:
    """Tell which images miss their points by more than a limit, radians."""
    return misfits(network, state) > limit


def control_misfits(network: Network, state: State) -> Array:
    """Return the median angles of surveyed control points and their rays, radians, shape (k,)."""
    rows = np.isin(network.image_points.point_idx, network.control.point_idx)
    seen = seen_by(network, state, network.image_points[rows])
    angles = _angles(seen, replace(state, x_m=with_surveyed(network, state.x_m)))
    return medians(angles, seen.points.point_idx, network.n_points)[network.control.point_idx]


def in_front(network: Network, state: State) -> bool:
    """Tell whether all points are in front of the cameras that measure them."""
    seen = seen_by(network, state, network.image_points)
    return bool(np.all(towards(seen, state, state.x_m)[:, 2] < 0))


def suspects(network: Network, state: State) -> str:
    """Return the images and points that most of their rays miss, for a message.

    Control points have their surveyed coordinates.

    Parameters
    ----------
    network : Network
    state : State

    Returns
    -------
    str
        Begins with a semicolon; empty where there are none.
    """
    block, points = network.block, network.image_points
    state = replace(state, x_m=with_surveyed(network, state.x_m))
    angles = _angles(seen_by(network, state, points), state)
    parts = []
    for what, names, group in (
        ("images", block.images.names, points.image_idx),
        ("points", block.points, points.point_idx),
    ):
        off = np.degrees(medians(angles, group, len(names)))
        bad = np.flatnonzero(off > np.degrees(ASTRAY))
        worst = bad[np.argsort(-off[bad])][:MOST_NAMED]
        if len(worst):
            listed = ", ".join(f"{names[i]} by {off[i]:.0f} degrees" for i in worst)
            parts.append(f"in {len(bad)} of {len(np.unique(group))} {what} ({listed})")
    if not parts:
        return _wrong_rays(network, np.degrees(angles))
    hint = "are their names, exposures, surveyed coordinates and mounting angles right?"
    return f"; rays miss their points {' and '.join(parts)}: {hint}"


def _wrong_rays(network: Network, off_deg: Array) -> str:
    """Return single measurements that are far worse than most, for a message."""
    points, block = network.image_points, network.block
    usual = np.median(off_deg) if len(off_deg) else 0.0
    bad = np.flatnonzero(off_deg > OUTLYING * usual)
    worst = bad[np.argsort(-off_deg[bad])][:MOST_NAMED]
    listed = ", ".join(
        f"{block.points[points.point_idx[row]]} in {block.images.names[points.image_idx[row]]}"
        for row in worst
    )
    said = "1 measurement is" if len(bad) == 1 else f"{len(bad)} measurements are"
    return f"; {said} far off, most of all {listed}" if listed else ""


def _angles(seen: Seen, state: State) -> Array:
    """Return angles between rays and directions to points, radians; NaN for unknown points."""
    return 2 * np.arcsin(np.minimum(chords(seen, state, state.x_m) / 2, 1.0))


def with_surveyed(network: Network, x_m: Array) -> Array:
    """Return coordinates of points (n, 3), those of control points replaced by surveyed ones."""
    out = x_m.copy()
    out[network.control.point_idx] = network.control.x_m
    return out


@dataclass(frozen=True, kw_only=True, eq=False)
class Seen:
    """Measurements with their rays in camera axes, their cameras and their poses.

    Attributes
    ----------
    network : Network
    points : ImagePoints
    ray_c : ndarray, shape (n, 3)
        Unit vectors.
    camera, pose : ndarray, shape (n,)
    """

    network: Network
    points: ImagePoints
    ray_c: Array
    camera: Index
    pose: Index


def seen_by(network: Network, state: State, points: ImagePoints) -> Seen:
    """Return measurements with their rays through the cameras of a state."""
    cameras = with_estimates(network.block.cameras, state)
    camera = network.block.images.camera_idx[points.image_idx]
    return Seen(
        network=network,
        points=points,
        ray_c=camera_rays(cameras, camera, points.colrow),
        camera=camera,
        pose=network.pose_idx[points.image_idx],
    )


def with_estimates(cameras: Sequence[Camera], state: State) -> tuple[Camera, ...]:
    """Return the cameras with the interior orientation and the mounting of a state."""
    return tuple(
        replace(camera, interior=interior, T_b_c=state.T_b_c[k])
        for k, (camera, interior) in enumerate(zip(cameras, state.interiors, strict=True))
    )


def towards(seen: Seen, state: State, x_m: Array) -> Array:
    """Return unit vectors from the cameras to the points, in camera axes, shape (n, 3)."""
    T_m_c = camera_poses(seen.network, state)[seen.points.image_idx]
    ahead = np.einsum("nji,nj->ni", T_m_c.R, x_m[seen.points.point_idx] - T_m_c.r)
    return ahead / np.linalg.norm(ahead, axis=1, keepdims=True)


def chords(seen: Seen, state: State, x_m: Array) -> Array:
    """Return the chords between the unit vectors of rays and of directions to points, (n,)."""
    return np.linalg.norm(towards(seen, state, x_m) - seen.ray_c, axis=1)
