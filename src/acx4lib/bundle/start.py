"""Approximate values of an adjustment, and new ones where it fails.

Orientations from few points, poses by resection without a trajectory, a robust start that most
observations agree on, and the distances of rays from their points.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from acx4lib.block import Block, ImagePoints, Trajectory
from acx4lib.bundle.network import Network, camera_poses
from acx4lib.bundle.unknowns import State
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.collinearity import rays
from acx4lib.geometry.frames import Pose, transform
from acx4lib.geometry.intersection import intersect, largest_angles, resect
from acx4lib.least_squares.covariance import medians

# --- Approximate values of a network: coordinates of points, and rotations of cameras
#
# Where the given values are far off, rotations of cameras in closed form alternate with
# intersections of points. Nothing here is an adjustment.


ROUNDS = 15
"""Number of rotations of the cameras, in each of the two phases."""

NEAR = np.radians(0.2)
"""Misfit of a ray below which its weight no longer grows."""

VAGUE = np.radians(1.0)
"""Sigma of an observed attitude, above which start values do not keep it."""

INERTIA = 1e-3
"""Weight of a camera's present rotation, as a share of its rays': one ray leaves a turn open."""

CHUNK = 1 << 18
"""Rays computed at a time."""


# --- points ----------------------------------------------------------------------------------


def _sight(block: Block, T_m_c: Pose, points: ImagePoints) -> tuple[Array, Array]:
    """Return the start points of rays, m, and their unit vectors, mapping frame."""
    out = _camera_rays(block.cameras, block.images.camera_idx[points.image_idx], points.colrow)
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
    origins, directions = _sight(block, T_m_c, points)
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
    alternates with intersections. Images whose attitude is not observed, or with a sigma above
    `VAGUE`, are also turned one by one. Interior orientations and positions do not change.

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
    measured = _seen_by(network, network.start, network.image_points)
    surveyed = _with_surveyed(network, np.full_like(network.start.x_m, np.nan))
    each = np.arange(len(network.pose_names))
    state = _turned_alike(measured, surveyed)
    for _ in range(ROUNDS):
        state = _turned(measured, state, surveyed, each)
    weights = np.ones(len(measured.points))
    for _ in range(ROUNDS):
        x_m = _intersected(measured, state, weights)
        state = _turned(measured, state, x_m, each)
        weights = NEAR / np.maximum(_chords(measured, state, x_m), NEAR)
    return replace(state, x_m=_intersected(measured, state, weights))


def turned_alike(network: Network) -> State:
    """Return approximate values with all poses of a camera turned alike onto the control points.

    The majority of the control points decides; single ones that are far off have little effect.
    """
    rows = np.isin(network.image_points.point_idx, network.control.point_idx)
    measured = _seen_by(network, network.start, network.image_points[rows])
    return _turned_alike(measured, _with_surveyed(network, np.full_like(network.start.x_m, np.nan)))


def _turned_alike(measured: _Seen, surveyed: Array) -> State:
    network = measured.network
    pose_camera = np.zeros(len(network.pose_names), dtype=np.intp)
    pose_camera[measured.pose] = measured.camera
    state = replace(network.start, T_m_b=network.observed.T_m_b)
    for _ in range(ROUNDS):
        state = _turned(measured, state, surveyed, pose_camera)
    return state


def _intersected(measured: _Seen, state: State, weights: Array) -> Array:
    T_m_c = camera_poses(measured.network, state)[measured.points.image_idx]
    directions = transform(T_m_c.R, measured.ray_c)
    x_m = _met(T_m_c.r, directions, measured.points.point_idx, len(state.x_m), weights)
    return _with_surveyed(measured.network, x_m)


def _turned(measured: _Seen, state: State, x_m: Array, pose_group: Index) -> State:
    """Turn free mountings, and groups of poses whose attitude is vague and not held."""
    network = measured.network
    if np.all(network.layout.mount[:, 3:] >= 0):
        ahead = _towards(measured, state, x_m)
        Q = _rotations(ahead, measured.ray_c, measured.camera, len(network.layout.mount))
        state = replace(state, T_b_c=Pose(R=state.T_b_c.R @ Q, r=state.T_b_c.r))
    vague = np.any(network.observed.sigma_attitude > VAGUE, axis=1)
    vague &= np.any(network.layout.pose[:, 3:] >= 0, axis=1)  # the others are held
    if vague.any():
        R_b_c = state.T_b_c.R[measured.camera]
        ahead = transform(R_b_c, _towards(measured, state, x_m))
        ray = transform(R_b_c, measured.ray_c)
        n_groups = int(pose_group.max()) + 1
        Q = _rotations(ahead, ray, pose_group[measured.pose], n_groups)[pose_group]
        Q[~vague] = np.eye(3)
        state = replace(state, T_m_b=Pose(R=state.T_m_b.R @ Q, r=state.T_m_b.r))
    return state


def _rotations(ahead: Array, ray: Array, group: Index, n_groups: int) -> Array:
    """Return the rotations of each group's rays onto directions, shape (n_groups, 3, 3)."""
    known = np.isfinite(ahead[:, 0])
    ahead, ray, group = ahead[known], ray[known], group[known]
    weight = 1 / np.maximum(np.linalg.norm(ahead - ray, axis=1), NEAR)
    total = np.bincount(group, weight, minlength=n_groups)
    H = np.where(total > 0, INERTIA * total, 1.0)[:, None, None] * np.eye(3)
    for i in range(3):
        for j in range(3):
            H[:, i, j] += np.bincount(group, weight * ahead[:, i] * ray[:, j], minlength=n_groups)
    U, _, Vt = np.linalg.svd(H)
    U[:, :, 2] *= np.linalg.det(U @ Vt)[:, None]
    return U @ Vt


# --- A robust first phase: estimates that resist gross errors and bad approximate values
#
# Reweighted adjustment steps use all observations, first with Huber's loss, which has one minimum,
# then with the loss of Geman and McClure, which gives gross errors almost no weight.


Residuals = tuple[Array, Array]  # v and sigma of a group

HUBER_WIDTH, HUBER_STEPS = 2.0, 15
"""Width of Huber's loss, in spreads of the residuals, and largest number of steps."""

REDESCENDING_WIDTHS = (16.0, 8.0, 4.0, 4.0)
"""Widths of single steps, in spreads; a residual of this width has a quarter of its weight."""

SETTLED = 0.02
"""Relative decrease of the robust cost below which the steps with the first loss end."""

FAINT = 1e-12
"""Smallest weight: even a point of which all rays are wrong keeps coordinates."""

DAMPING = (0.0, 1e-4, 1e-2, 1.0, 1e2, 1e4, 1e6)

POINT_STEPS = 5
"""Number of reweighted steps of a single point."""

PAIRS = 1 << 20
"""Pairs of rays that are processed at a time."""

SUSPECT = 5.0
"""Residual, in spreads, above which an observation is suspected of a gross error."""


def robust_phase(
    network: Network, state: State, redundancy: Sequence[Array] | None = None
) -> State:
    """Return a state that most observations agree on.

    Parameters
    ----------
    network : Network
    state : State
        A state with all points in front of their cameras.
    redundancy : sequence of ndarray, optional
        Redundancy numbers of the network's groups, from an adjustment. They also reveal wrong
        observations with small residuals, such as control, which pull the others to themselves.

    Returns
    -------
    State
        Near the least-squares solution of the good observations; an adjustment must follow.

    Notes
    -----
    Iteratively reweighted least squares. The widths are multiples of the spread of a kind's
    residuals: their median over 0.6745, at least one sigma. While bad approximate values make all
    residuals large, all observations keep their full weight.
    """
    groups: Sequence[Residuals] = network.residuals(state)
    cost = np.inf
    shown = _shown(groups, redundancy)
    for _ in range(HUBER_STEPS):
        loss = _loss(groups, "huber", HUBER_WIDTH, shown)
        before, cost = cost, loss.cost(groups)
        if cost > (1 - SETTLED) * before:
            break
        state, groups = _stepped(network, state, groups, loss)
    for width in REDESCENDING_WIDTHS:
        loss = _loss(groups, "redescending", width, shown)
        state, groups = _stepped(network, state, groups, loss)
    return _with_points_of_most_rays(network, state, groups[0])


def _shown(groups: Sequence[Residuals], redundancy: Sequence[Array] | None) -> tuple[Array, ...]:
    """Return the square roots of the redundancy numbers, one where they are not known."""
    if redundancy is None:
        return tuple(np.ones_like(v) for v, _ in groups)
    return tuple(np.sqrt(np.clip(np.nan_to_num(r, nan=1.0), 0.01, 1.0)) for r in redundancy)


# --- losses ----------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class _Loss:
    """A loss for every kind of observation.

    Attributes
    ----------
    name : str
        ``"huber"`` or ``"redescending"``.
    widths : tuple of float
        Widths of the kinds, in sigmas.
    shown : tuple of ndarray
        Factors on sigma that give the residuals' own sigma: roots of redundancy numbers.
    """

    name: str
    widths: tuple[float, ...]
    shown: tuple[Array, ...]

    def factors(self, groups: Sequence[Residuals]) -> list[Array]:
        """Return the factors on sigma that give the residuals their robust weights."""
        weights = []
        for width, u in zip(self.widths, self._sizes(groups), strict=True):
            if self.name == "huber":
                weights.append(width / np.maximum(u, width))
            else:
                weights.append(np.square(1 / (1 + np.square(u / width))))
        return [1 / np.sqrt(np.maximum(weight, FAINT)) for weight in weights]

    def cost(self, groups: Sequence[Residuals]) -> float:
        """Return the sum of the loss over all residuals; infinite for an impossible state."""
        total = 0.0
        with np.errstate(over="ignore", invalid="ignore"):  # after a very large step
            for width, u in zip(self.widths, self._sizes(groups), strict=True):
                if self.name == "huber":
                    near = np.minimum(u, width)
                    total += float(np.sum(near**2 + 2 * width * (u - near)))
                else:
                    total += float(np.sum(u**2 / (1 + np.square(u / width))))
        return total if np.isfinite(total) else np.inf

    def _sizes(self, groups: Sequence[Residuals]) -> list[Array]:
        return [
            sizes(v, sigma * shown) for (v, sigma), shown in zip(groups, self.shown, strict=True)
        ]


def _loss(groups: Sequence[Residuals], name: str, width: float, shown: tuple[Array, ...]) -> _Loss:
    widths = tuple(width * spread(v, sigma) for v, sigma in groups)
    return _Loss(name=name, widths=widths, shown=shown)


def sizes(v: Array, sigma: Array) -> Array:
    """Return abs(v) / sigma: of image points the length of the vector, of others each component."""
    u = np.abs(v / sigma)
    return np.linalg.norm(u, axis=1, keepdims=True) if v.shape[1] == 2 else u


def spread(v: Array, sigma: Array) -> float:
    """Return the robust standard deviation of residuals in sigmas, at least one."""
    u = np.abs(v / sigma)[np.isfinite(sigma)]
    return max(1.0, float(np.median(u)) / 0.6745) if len(u) else 1.0


# --- steps -----------------------------------------------------------------------------------


def reweighted(network: Network, factors: Sequence[Array]) -> Network:
    """Return the network with the sigma of its observations multiplied.

    Parameters
    ----------
    network : Network
    factors : sequence of ndarray
        In the order of `Network.residuals`; one factor for both coordinates of an image point.
        Declared mountings keep their sigma.
    """
    points, control, observed = network.image_points, network.control, network.observed
    on_image, on_control, on_position, on_attitude = factors[:4]
    sigma_m = control.sigma_m.copy()
    sigma_m[~network.held_control] *= on_control
    return network.with_sigma(
        image_points=replace(points, sigma_px=points.sigma_px * on_image[:, 0]),
        control=replace(control, sigma_m=sigma_m),
        observed=replace(
            observed,
            sigma_position=observed.sigma_position * on_position,
            sigma_attitude=observed.sigma_attitude * on_attitude,
        ),
    )


def _stepped(
    network: Network, state: State, groups: Sequence[Residuals], loss: _Loss
) -> tuple[State, Sequence[Residuals]]:
    """Return state and residuals after one reweighted step, damped until its cost decreases."""
    cost, weighted = loss.cost(groups), reweighted(network, loss.factors(groups))
    for damping in DAMPING:
        trial = network.moved(state, *weighted.normals(state, damping).step())
        trial_groups = network.residuals(trial)
        if loss.cost(trial_groups) <= cost:
            return trial, trial_groups
    return state, groups


# --- points ----------------------------------------------------------------------------------


def _with_points_of_most_rays(network: Network, state: State, residuals: Residuals) -> State:
    """Where a point has a wrong ray, try each of its rays as the wrong one; keep orientations.

    Where few rays meet, reweighting finds a wrong ray only from suitable approximate values.
    """
    scale = spread(*residuals)
    wrong = sizes(*residuals)[:, 0] > SUSPECT * scale
    point = network.image_points.point_idx
    rays = np.bincount(point, minlength=network.n_points)
    doubtful = (np.bincount(point, wrong, minlength=network.n_points) > 0) & (rays > 2)
    doubtful[network.control.point_idx] = False
    rows = np.flatnonzero(doubtful[point])
    if len(rows) == 0:
        return state
    doubtful_rays = replace(
        network, image_points=network.image_points[rows], rows=network.rows[rows]
    )
    e = doubtful_rays.equations(state)[0]
    unit, dx, cost = scale * e.sigma, np.zeros((len(rows), 3)), np.zeros(len(rows))
    B, v = np.asarray(e.B) / unit[:, :, None], e.v / unit
    for part in _parts(point[rows]):
        dx[part], cost[part] = _without_each(B[part], v[part], point[rows[part]])
    order = np.lexsort((cost, point[rows]))
    points, first = np.unique(point[rows][order], return_index=True)
    x_m = state.x_m.copy()
    x_m[points] += dx[order[first]]
    moved = replace(state, x_m=x_m)
    # rays from one position do not determine their point; a step along them may be very large
    better = _point_costs(doubtful_rays, moved, scale) < _point_costs(doubtful_rays, state, scale)
    return replace(state, x_m=np.where(better[:, None], x_m, state.x_m))


def _point_costs(network: Network, state: State, scale: float) -> Array:
    """Return the cost of every point's rays, bounded for each ray, shape (n_points,)."""
    v, sigma = network.residuals(state)[0]
    u_sq = np.square(np.nan_to_num(sizes(v, sigma)[:, 0] / scale, nan=np.inf))
    bounded = np.minimum(u_sq, SUSPECT**2)
    bounded[np.isinf(u_sq)] = np.inf  # the point is behind a camera
    total: Array = np.zeros(network.n_points)
    np.add.at(total, network.image_points.point_idx, bounded)
    return total


def _parts(point: Index) -> Iterator[slice]:
    """Yield the rays of whole points, in portions whose pairs fit into memory."""
    starts = np.flatnonzero(np.diff(point, prepend=-1))
    rays = np.diff(starts, append=len(point))
    number = np.cumsum(rays**2) // PAIRS
    first = starts[np.flatnonzero(np.diff(number, prepend=-1))]
    for start, stop in zip(first, [*first[1:], len(point)], strict=True):
        yield slice(int(start), int(stop))


def _without_each(B: Array, v: Array, point: Index) -> tuple[Array, Array]:
    """Return the steps of points and their costs if each ray, one at a time, is left out.

    Parameters
    ----------
    B, v : ndarray, shape (n, 2, 3) and (n, 2)
        Derivatives by the point and residuals, divided by sigma.
    point : ndarray, shape (n,)
        Sorted.

    Returns
    -------
    dx : ndarray, shape (n, 3)
    cost : ndarray, shape (n,)
        Squared residuals, each at most `SUSPECT` squared.
    """
    _, first, point_idx, rays = np.unique(
        point, return_index=True, return_inverse=True, return_counts=True
    )
    tried = np.repeat(np.arange(len(point)), rays[point_idx])
    starts = np.flatnonzero(np.diff(tried, prepend=-1))
    ray = first[point_idx[tried]] + np.arange(len(tried)) - starts[tried]
    B, v = B[ray], v[ray]
    weight = np.where(ray == tried, 0.0, 1.0)
    for _ in range(POINT_STEPS):
        BtP = np.swapaxes(B, 1, 2) * weight[:, None, None]
        V = np.add.reduceat(BtP @ B, starts)
        V += 1e-9 * np.trace(V, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        h = np.add.reduceat(np.einsum("nij,nj->ni", BtP, v), starts)
        dx = -np.linalg.solve(V, h[:, :, None])[:, :, 0]
        u_sq = np.sum((v + np.einsum("nij,nj->ni", B, dx[tried])) ** 2, axis=1)
        weight = np.square(1 / (1 + u_sq / REDESCENDING_WIDTHS[-1] ** 2))
    return dx, np.add.reduceat(np.minimum(u_sq, SUSPECT**2), starts)


# --- Angles between rays and their points, and the images and points with the largest ones


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


def _camera_rays(cameras: Sequence[Camera], camera_idx: Index, colrow: Array) -> Array:
    """Return the unit vectors of measured rays in the axes of their cameras, shape (n, 3)."""
    own_axes = Pose(R=np.eye(3), r=np.zeros(3))
    out = np.empty((len(colrow), 3))
    for k, camera in enumerate(cameras):
        of_camera = camera_idx == k
        out[of_camera] = rays(camera, own_axes, colrow[of_camera])
    return out


def _misfits(network: Network, state: State) -> Array:
    """Return the median angle of each image's rays and points, radians, shape (n_images,).

    From a sample of the measurements; infinite where points have no coordinates.
    """
    n_images = len(network.block.images)
    step = 1 + len(network.image_points) // (SAMPLE * n_images)
    sample = np.arange(0, len(network.image_points), step)
    measured = _seen_by(network, state, network.image_points[sample])
    return medians(_angles(measured, state), measured.points.image_idx, n_images)


def far_off(network: Network, state: State, *, limit: float = FAR_OFF) -> Mask:
    """Tell which images miss their points by more than a limit, radians."""
    return _misfits(network, state) > limit


def control_misfits(network: Network, state: State) -> Array:
    """Return the median angles of surveyed control points and their rays, radians, shape (k,)."""
    rows = np.isin(network.image_points.point_idx, network.control.point_idx)
    measured = _seen_by(network, state, network.image_points[rows])
    angles = _angles(measured, replace(state, x_m=_with_surveyed(network, state.x_m)))
    return medians(angles, measured.points.point_idx, network.n_points)[network.control.point_idx]


def in_front(network: Network, state: State) -> bool:
    """Tell whether all points are in front of the cameras that measure them."""
    measured = _seen_by(network, state, network.image_points)
    return bool(np.all(_towards(measured, state, state.x_m)[:, 2] < 0))


def suspects(network: Network, state: State) -> str:
    """Return the images and points that most of their rays miss, for a message.

    Control points have their surveyed coordinates.

    Returns
    -------
    str
        Begins with a semicolon; empty where there are none.
    """
    block, points = network.block, network.image_points
    state = replace(state, x_m=_with_surveyed(network, state.x_m))
    angles = _angles(_seen_by(network, state, points), state)
    parts = []
    for noun, names, group in (
        ("images", block.images.names, points.image_idx),
        ("points", block.points, points.point_idx),
    ):
        off_deg = np.degrees(medians(angles, group, len(names)))
        bad = np.flatnonzero(off_deg > np.degrees(ASTRAY))
        worst = bad[np.argsort(-off_deg[bad])][:MOST_NAMED]
        if len(worst):
            listed = ", ".join(f"{names[i]} by {off_deg[i]:.0f} degrees" for i in worst)
            parts.append(f"in {len(bad)} of {len(np.unique(group))} {noun} ({listed})")
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
    count = "1 measurement is" if len(bad) == 1 else f"{len(bad)} measurements are"
    return f"; {count} far off, most of all {listed}" if listed else ""


def _angles(measured: _Seen, state: State) -> Array:
    """Return angles between rays and directions to points, radians; NaN for unknown points."""
    return 2 * np.arcsin(np.minimum(_chords(measured, state, state.x_m) / 2, 1.0))


def _with_surveyed(network: Network, x_m: Array) -> Array:
    """Return coordinates of points (n, 3), those of control points replaced by surveyed ones."""
    out = x_m.copy()
    out[network.control.point_idx] = network.control.x_m
    return out


@dataclass(frozen=True, kw_only=True, eq=False)
class _Seen:
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


def _seen_by(network: Network, state: State, points: ImagePoints) -> _Seen:
    """Return measurements with their rays through the cameras of a state."""
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
    """Return the cameras with the interior orientation and the mounting of a state."""
    return tuple(
        replace(camera, interior=interior, T_b_c=state.T_b_c[k])
        for k, (camera, interior) in enumerate(zip(cameras, state.interiors, strict=True))
    )


def _towards(measured: _Seen, state: State, x_m: Array) -> Array:
    """Return unit vectors from the cameras to the points, in camera axes, shape (n, 3)."""
    T_m_c = camera_poses(measured.network, state)[measured.points.image_idx]
    ahead = np.einsum("nji,nj->ni", T_m_c.R, x_m[measured.points.point_idx] - T_m_c.r)
    return ahead / np.linalg.norm(ahead, axis=1, keepdims=True)


def _chords(measured: _Seen, state: State, x_m: Array) -> Array:
    """Return the chords between the unit vectors of rays and of directions to points, (n,)."""
    return np.linalg.norm(_towards(measured, state, x_m) - measured.ray_c, axis=1)


# --- Poses of exposures whose trajectory is not known: resections from control points


FEWEST = 3
"""Control points that a resection needs."""


def resected(block: Block) -> Block:
    """Return a block with poses by resection, an image of every exposure at a time.

    They are approximate values for an adjustment; their standard deviations are infinite.

    Parameters
    ----------
    block : Block
        Its poses may be any.

    Raises
    ------
    AdjustmentError
        Where no image of an exposure shows three control points.
    """
    where = np.full(len(block.points), -1)
    where[block.control.point_idx] = np.arange(len(block.control))
    points = block.image_points[where[block.image_points.point_idx] >= 0]
    n_control = np.bincount(points.image_idx, minlength=len(block.images))
    poses = []
    for exposure, name in enumerate(block.trajectory.exposures):
        image = _image(block, exposure, n_control)
        if image < 0 or n_control[image] < FEWEST:
            msg = (
                f"exposure {name!r} has no image with {FEWEST} control points, which a resection "
                "needs: give its pose, or leave out its images"
            )
            raise AdjustmentError(msg)
        camera = block.cameras[block.images.camera_idx[image]]
        image_points = points[points.image_idx == image]
        x_m = block.control.x_m[where[image_points.point_idx]]
        poses.append(resect(camera, image_points.colrow, x_m) @ camera.T_b_c.inverse)
    T_m_b = Pose(R=np.stack([T.R for T in poses]), r=np.stack([T.r for T in poses]))
    trajectory = Trajectory(exposures=block.trajectory.exposures, T_m_b=T_m_b)
    return replace(block, trajectory=trajectory)


def _image(block: Block, exposure: int, n_control: Index) -> int:
    """Return the exposure's image with the most control points; -1 where it has none."""
    images = np.flatnonzero(block.images.exposure_idx == exposure)
    return int(images[np.argmax(n_control[images])]) if len(images) else -1
