"""Start values of a network: where points are, and how cameras look at them.

Where the given values are far off, cameras are turned onto their points, in closed form and in
turn with intersections. Nothing here is an adjustment.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from acx4lib._typing import Array, Index, Mask
from acx4lib.block import Block, ImagePoints
from acx4lib.camera import Camera
from acx4lib.collinearity import rays
from acx4lib.frames import Pose, transform
from acx4lib.intersection import intersect, largest_angles
from acx4lib.network import Network, State, camera_poses

FAR_OFF = np.radians(4.0)
"""Median angle between an image's rays and their points from which a start is bad."""

SAMPLE = 20
"""So many measurements of an image, on average, say so."""

ROUNDS = 15
"""Of turning cameras, in each of the two phases."""

ASTRAY = np.radians(1.0)
"""The same after an adjustment; no lens and no terrain makes such residuals."""

MOST_NAMED = 3
"""Images, and points, that a message names."""

NEAR = np.radians(0.2)
"""Misfit of a ray below which its weight no longer grows."""

INERTIA = 1e-3
"""Share of its rays' weight with which a camera stays as it is: one ray leaves a turn open."""

CHUNK = 1 << 18
"""Rays computed at a time."""


# --- points ----------------------------------------------------------------------------------


def sight(block: Block, T_m_c: Pose, points: ImagePoints) -> tuple[Array, Array]:
    """Return where rays begin and their unit directions, mapping frame.

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
    out = _camera_rays(block.cameras, block.images.camera_idx[points.image_idx], points.colrow)
    for start in range(0, len(out), CHUNK):
        part = slice(start, start + CHUNK)
        out[part] = transform(T_m_c.R[points.image_idx[part]], out[part])
    return T_m_c.r[points.image_idx], out


def _camera_rays(cameras: Sequence[Camera], camera_idx: Index, colrow: Array) -> Array:
    """Return the unit directions of measurements in the axes of their cameras, shape (n, 3)."""
    own_axes = Pose(R=np.eye(3), r=np.zeros(3))
    out = np.empty((len(colrow), 3))
    for k, camera in enumerate(cameras):
        own = camera_idx == k
        out[own] = rays(camera, own_axes, colrow[own])
    return out


def start_points(block: Block, T_m_c: Pose, rows: Index) -> tuple[Array, Array]:
    """Return points by intersection of their rays and the largest angle between these.

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
        m; where rays do not meet in front of the cameras, amid their ends at the others' median
        range.
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
    """Return where rays meet, or else the middle of what they reach."""
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


# --- bad start values ------------------------------------------------------------------------


def misfits(network: Network, state: State) -> Array:
    """Return the median angle between rays and their points of each image, shape (n_images,).

    Radians, from a sample of the measurements; infinite where there are no such points.
    """
    n_images = len(network.block.images)
    step = 1 + len(network.image_points) // (SAMPLE * n_images)
    some = np.arange(0, len(network.image_points), step)
    seen = _seen(network, state, network.image_points[some])
    return _medians(_angles(seen, state), seen.points.image_idx, n_images)


def far_off(network: Network, state: State, *, limit: float = FAR_OFF) -> Mask:
    """Tell which images look past their points by more than a limit, radians."""
    return misfits(network, state) > limit


def in_front(network: Network, state: State) -> bool:
    """Tell whether all points are in front of the cameras that measure them."""
    seen = _seen(network, state, network.image_points)
    return bool(np.all(_towards(seen, state, state.x_m)[:, 2] < 0))


def suspects(network: Network, state: State) -> str:
    """Return which images and points most rays pass by, for a message.

    Control points are where they were surveyed.

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
    state = replace(state, x_m=_with_surveyed(network, state.x_m))
    angles = _angles(_seen(network, state, points), state)
    parts = []
    for what, names, group in (
        ("images", block.images.names, points.image_idx),
        ("points", block.points, points.point_idx),
    ):
        off = np.degrees(_medians(angles, group, len(names)))
        bad = np.flatnonzero(off > np.degrees(ASTRAY))
        worst = bad[np.argsort(-off[bad])][:MOST_NAMED]
        if len(worst):
            listed = ", ".join(f"{names[i]} by {off[i]:.0f} degrees" for i in worst)
            parts.append(f"in {len(bad)} of {len(np.unique(group))} {what} ({listed})")
    if not parts:
        return ""
    hint = "are their names, exposures, surveyed coordinates and mounting angles right?"
    return f"; rays miss their points {' and '.join(parts)}: {hint}"


def _angles(seen: _Seen, state: State) -> Array:
    """Return angles between rays and directions to points, radians; NaN for no such point."""
    return 2 * np.arcsin(np.minimum(_chords(seen, state, state.x_m) / 2, 1.0))


def _medians(values: Array, group: Index, n_groups: int) -> Array:
    """Return the (upper) medians of groups, zero for an empty one; NaN counts as infinite."""
    order = np.lexsort((values, group))
    count = np.bincount(group, minlength=n_groups)
    middle = np.cumsum(count) - count + count // 2
    out = np.zeros(n_groups)
    out[count > 0] = np.nan_to_num(values[order[middle[count > 0]]], nan=np.inf)
    return out


def _with_surveyed(network: Network, x_m: Array) -> Array:
    out = x_m.copy()
    out[network.control.point_idx] = network.control.x_m
    return out


@dataclass(frozen=True, kw_only=True, eq=False)
class _Seen:
    """Measurements with their rays in camera axes, and what they hang on.

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


def _seen(network: Network, state: State, points: ImagePoints) -> _Seen:
    cameras = with_estimates(network.block.cameras, state)
    camera = network.block.images.camera_idx[points.image_idx]
    return _Seen(
        network=network,
        points=points,
        ray_c=_camera_rays(cameras, camera, points.colrow),
        camera=camera,
        pose=network.pose_idx[points.image_idx],
    )


def with_estimates(cameras: Sequence[Camera], state: State) -> tuple[Camera, ...]:
    """Return cameras with a state's interior orientation and mounting; T_b_c where mounted."""
    return tuple(
        replace(camera, interior=interior, T_b_c=state.T_b_c[k])
        for k, (camera, interior) in enumerate(zip(cameras, state.interiors, strict=True))
    )


def _towards(seen: _Seen, state: State, x_m: Array) -> Array:
    """Return unit vectors from the cameras to the points, in camera axes, shape (n, 3)."""
    T_m_c = camera_poses(seen.network, state)[seen.points.image_idx]
    ahead = np.einsum("nji,nj->ni", T_m_c.R, x_m[seen.points.point_idx] - T_m_c.r)
    return ahead / np.linalg.norm(ahead, axis=1, keepdims=True)


def _chords(seen: _Seen, state: State, x_m: Array) -> Array:
    """Return chords between the tips of rays and of directions to points, shape (n,)."""
    return np.linalg.norm(_towards(seen, state, x_m) - seen.ray_c, axis=1)


# --- recovered start values --------------------------------------------------------------------


def recovered(network: Network) -> State:
    """Return start values that need only positions and, where they are observed, attitudes.

    Cameras are turned onto the control points that they measure, then onto all points in turn
    with intersections; single images as well, where no attitude of theirs is observed. Interior
    orientation and positions stay.

    Parameters
    ----------
    network : Network

    Returns
    -------
    State

    Notes
    -----
    Every turn is the rotation that minimises the weighted squares of the chords between rays and
    directions [1]_, reweighted by the inverse of the chords: their sum is what becomes least, and
    a wrong measurement hardly counts.

    References
    ----------
    .. [1] W. Kabsch, "A solution for the best rotation to relate two sets of vectors", Acta
       Crystallographica A32, 1976.
    """
    seen = _seen(network, network.start, network.image_points)
    state = replace(network.start, T_m_b=network.observed.T_m_b)
    surveyed = _with_surveyed(network, np.full_like(state.x_m, np.nan))
    pose_camera = np.zeros(len(network.pose_names), dtype=np.intp)
    pose_camera[seen.pose] = seen.camera
    each = np.arange(len(network.pose_names))
    for group in (pose_camera, each):
        for _ in range(ROUNDS):
            state = _turned(seen, state, surveyed, group)
    weights = np.ones(len(seen.points))
    for _ in range(ROUNDS):
        x_m = _intersected(seen, state, weights)
        state = _turned(seen, state, x_m, each)
        weights = NEAR / np.maximum(_chords(seen, state, x_m), NEAR)
    return replace(state, x_m=_intersected(seen, state, weights))


def _intersected(seen: _Seen, state: State, weights: Array) -> Array:
    T_m_c = camera_poses(seen.network, state)[seen.points.image_idx]
    directions = transform(T_m_c.R, seen.ray_c)
    x_m = _met(T_m_c.r, directions, seen.points.point_idx, len(state.x_m), weights)
    return _with_surveyed(seen.network, x_m)


def _turned(seen: _Seen, state: State, x_m: Array, pose_group: Index) -> State:
    """Turn mountings that are free, and poses whose attitude is open, in groups."""
    network = seen.network
    free = np.all(network.layout.mount[:, 3:] >= 0, axis=1)
    if free.any():
        Q = _rotations(_towards(seen, state, x_m), seen.ray_c, seen.camera, len(free))
        Q[~free] = np.eye(3)
        state = replace(state, T_b_c=Pose(R=state.T_b_c.R @ Q, r=state.T_b_c.r))
    unobserved = np.all(np.isinf(network.observed.sigma_attitude), axis=1)
    if unobserved.any():
        R_b_c = state.T_b_c.R[seen.camera]
        to, ray = transform(R_b_c, _towards(seen, state, x_m)), transform(R_b_c, seen.ray_c)
        Q = _rotations(to, ray, pose_group[seen.pose], int(pose_group.max()) + 1)[pose_group]
        Q[~unobserved] = np.eye(3)
        state = replace(state, T_m_b=Pose(R=state.T_m_b.R @ Q, r=state.T_m_b.r))
    return state


def _rotations(to: Array, ray: Array, group: Index, n_groups: int) -> Array:
    """Return the rotations that bring the rays of each group onto directions, shape (n, 3, 3)."""
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
