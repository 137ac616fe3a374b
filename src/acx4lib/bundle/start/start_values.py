"""Approximate values of a network: coordinates of points, and rotations of cameras.

Where the given values are far off, rotations of cameras in closed form alternate with
intersections of points. Nothing here is an adjustment.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acx4lib.bundle.network import Network, camera_poses
from acx4lib.bundle.start.ray_misfits import (
    Seen,
    camera_rays,
    chords,
    seen_by,
    towards,
    with_surveyed,
)
from acx4lib.bundle.unknowns import State
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Block, ImagePoints
from acx4lib.geometry.frames import Pose, transform
from acx4lib.geometry.intersection import intersect, largest_angles

ROUNDS = 15
"""Number of rotations of the cameras, in each of the two phases."""

NEAR = np.radians(0.2)
"""Misfit of a ray below which its weight no longer grows."""

INERTIA = 1e-3
"""Weight of a camera's present rotation, as a share of its rays': one ray leaves a turn open."""

CHUNK = 1 << 18
"""Rays computed at a time."""


# --- points ----------------------------------------------------------------------------------


def sight(block: Block, T_m_c: Pose, points: ImagePoints) -> tuple[Array, Array]:
    """Return the start points of rays, m, and their unit vectors, mapping frame.

    Parameters
    ----------
    block : Block
    T_m_c : Pose
        One per image.
    points : ImagePoints

    Returns
    -------
    origins, directions : ndarray, shape (n, 3)
    """
    out = camera_rays(block.cameras, block.images.camera_idx[points.image_idx], points.colrow)
    for start in range(0, len(out), CHUNK):
        part = slice(start, start + CHUNK)
        out[part] = transform(T_m_c.R[points.image_idx[part]], out[part])
    return T_m_c.r[points.image_idx], out


def start_points(block: Block, T_m_c: Pose, rows: Index) -> tuple[Array, Array]:
    """Return points intersected from their rays, and the largest angle between the rays.

    Parameters
    ----------
    block : Block
    T_m_c : Pose
        One per image.
    rows : ndarray
        The image points to use.

    Returns
    -------
    x_m : ndarray, shape (n_points, 3)
        m. Where rays do not meet in front of the cameras: the mean of their ends, if they are as
        long as the median of the other rays.
    angle : ndarray, shape (n_points,)
        Radians.
    """
    points = block.image_points[rows]
    origins, directions = sight(block, T_m_c, points)
    x_m = _met(origins, directions, points.point_idx, len(block.points))
    return x_m, largest_angles(directions, points.point_idx, len(block.points))


def _met(
    origins: Array, directions: Array, point_idx: Index, n_points: int, weights: Array | float = 1.0
) -> Array:
    """Return where rays meet; where they do not, the mean of their ends at the median range."""
    x_m = intersect(origins, directions, point_idx, n_points, weights=weights)
    along = np.sum((x_m[point_idx] - origins) * directions, axis=1)
    ahead = along[along > 0]
    range_m = float(np.median(ahead)) if len(ahead) else 1000.0
    near = (along > 0.2 * range_m) & (along < 5 * range_m)
    wild = np.zeros(n_points, dtype=bool)
    wild[point_idx[(~near & (weights >= 0.5)) | ~(along > 0)]] = True
    rows = np.flatnonzero(wild[point_idx])
    w = np.broadcast_to(weights, len(point_idx))[rows]
    ends = origins[rows] + range_m * directions[rows]
    total = [np.bincount(point_idx[rows], w * e, minlength=n_points) for e in ends.T]
    weight = np.bincount(point_idx[rows], w, minlength=n_points)
    x_m[wild] = np.stack(total, axis=1)[wild] / weight[wild, None]
    return x_m


# --- recovered start values --------------------------------------------------------------------


def recovered(network: Network) -> State:
    """Return approximate values from positions and, where they are observed, attitudes.

    First the cameras are turned onto their control points. Then turning them onto all points
    alternates with intersections. Images without observed attitude are also turned one by one.
    Interior orientations and positions do not change.

    Parameters
    ----------
    network : Network

    Returns
    -------
    State

    Notes
    -----
    Every turn minimises the weighted sum of squared chords between rays and directions to points
    [1]_. The weights are the inverse chords. So it is the sum of the chords that becomes smallest,
    and a wrong measurement has little effect.

    References
    ----------
    .. [1] W. Kabsch, "A solution for the best rotation to relate two sets of vectors", Acta
       Crystallographica A32, 1976.
    """
    seen = seen_by(network, network.start, network.image_points)
    surveyed = with_surveyed(network, np.full_like(network.start.x_m, np.nan))
    each = np.arange(len(network.pose_names))
    state = _turned_alike(seen, surveyed)
    for _ in range(ROUNDS):
        state = _turned(seen, state, surveyed, each)
    weights = np.ones(len(seen.points))
    for _ in range(ROUNDS):
        x_m = _intersected(seen, state, weights)
        state = _turned(seen, state, x_m, each)
        weights = NEAR / np.maximum(chords(seen, state, x_m), NEAR)
    return replace(state, x_m=_intersected(seen, state, weights))


def turned_alike(network: Network) -> State:
    """Return approximate values with all poses of a camera turned alike onto the control points.

    The majority of the control points decides; single ones that are far off have little effect.

    Parameters
    ----------
    network : Network
    """
    rows = np.isin(network.image_points.point_idx, network.control.point_idx)
    seen = seen_by(network, network.start, network.image_points[rows])
    return _turned_alike(seen, with_surveyed(network, np.full_like(network.start.x_m, np.nan)))


def _turned_alike(seen: Seen, surveyed: Array) -> State:
    network = seen.network
    pose_camera = np.zeros(len(network.pose_names), dtype=np.intp)
    pose_camera[seen.pose] = seen.camera
    state = replace(network.start, T_m_b=network.observed.T_m_b)
    for _ in range(ROUNDS):
        state = _turned(seen, state, surveyed, pose_camera)
    return state


def _intersected(seen: Seen, state: State, weights: Array) -> Array:
    T_m_c = camera_poses(seen.network, state)[seen.points.image_idx]
    directions = transform(T_m_c.R, seen.ray_c)
    x_m = _met(T_m_c.r, directions, seen.points.point_idx, len(state.x_m), weights)
    return with_surveyed(seen.network, x_m)


def _turned(seen: Seen, state: State, x_m: Array, pose_group: Index) -> State:
    """Turn free mountings, and groups of poses whose attitude is neither observed nor held."""
    network = seen.network
    if np.all(network.layout.mount[:, 3:] >= 0):
        to = towards(seen, state, x_m)
        Q = _rotations(to, seen.ray_c, seen.camera, len(network.layout.mount))
        state = replace(state, T_b_c=Pose(R=state.T_b_c.R @ Q, r=state.T_b_c.r))
    unobserved = np.all(np.isinf(network.observed.sigma_attitude), axis=1)
    unobserved &= np.any(network.layout.pose[:, 3:] >= 0, axis=1)  # the others are held
    if unobserved.any():
        R_b_c = state.T_b_c.R[seen.camera]
        to, ray = transform(R_b_c, towards(seen, state, x_m)), transform(R_b_c, seen.ray_c)
        Q = _rotations(to, ray, pose_group[seen.pose], int(pose_group.max()) + 1)[pose_group]
        Q[~unobserved] = np.eye(3)
        state = replace(state, T_m_b=Pose(R=state.T_m_b.R @ Q, r=state.T_m_b.r))
    return state


def _rotations(to: Array, ray: Array, group: Index, n_groups: int) -> Array:
    """Return the rotations of each group's rays onto directions, shape (n_groups, 3, 3)."""
    known = np.isfinite(to[:, 0])
    to, ray, group = to[known], ray[known], group[known]
    weight = 1 / np.maximum(np.linalg.norm(to - ray, axis=1), NEAR)
    total = np.bincount(group, weight, minlength=n_groups)
    H = np.where(total > 0, INERTIA * total, 1.0)[:, None, None] * np.eye(3)
    for i in range(3):
        for j in range(3):
            H[:, i, j] += np.bincount(group, weight * to[:, i] * ray[:, j], minlength=n_groups)
    U, _, Vt = np.linalg.svd(H)
    U[:, :, 2] *= np.linalg.det(U @ Vt)[:, None]
    return U @ Vt
