"""Approximate values of an adjustment: points from rays, and orientations where those given fail.

`with_measurements` chooses the image points that determine their points, and intersects these.
Where the given values are far off, `recovered` turns cameras onto their control points, and
`robust_phase` finds the state that most observations agree on; `prepared` does all of it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
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
from acx4lib.least_squares import processors
from acx4lib.least_squares.covariance import medians

FAR_OFF = np.radians(4.0)
"""Median angle of an image's rays and points above which approximate values are bad."""

ASTRAY = np.radians(1.0)
"""The same limit after an adjustment; no lens and no terrain makes such residuals."""

SAMPLE = 20
"""Measurements per image, on average, that are examined for it."""

ROUNDS = 15
"""Number of rotations of the cameras, in each of two phases."""

NEAR = np.radians(0.2)
"""Misfit of a ray below which its weight no longer grows."""

VAGUE = np.radians(1.0)
"""Sigma of an observed attitude, above which start values do not keep it."""

INERTIA = 1e-3
"""Weight of a camera's present rotation, as a share of its rays': one ray leaves a turn open."""

CHUNK = 1 << 18
"""Rays that are turned at a time."""


def prepared(network: Network) -> Network:
    """Return a network with approximate values from which it can be adjusted.

    Where rays miss their points by more than `FAR_OFF`, it begins at the state that most
    observations agree on, and the measurements are chosen anew.
    """
    if not far_off(network, network.start).any():
        return network
    network = with_measurements(network, recovered(network))
    return with_measurements(network, _robust(network, network.start))


def robust_start(network: Network) -> State:
    """Return the state that most observations agree on, even from wrong approximate values."""
    return _robust(network, recovered(network))


def _robust(network: Network, state: State) -> State:
    """Return the state that most observations agree on; unchanged if points lie behind cameras."""
    if not in_front(network, state):
        return state
    with processors.on_one_thread():
        return robust_phase(network, state)


# --- measurements that determine their points ---------------------------------------------------


def with_measurements(network: Network, state: State) -> Network:
    """Return the network with the block's usable image points, and start coordinates of points.

    Tie points that are measured once, or whose rays meet at less than the block's smallest angle,
    are left out. Control points begin at their surveyed coordinates.

    Parameters
    ----------
    network : Network
    state : State
        Cameras and poses, at which it begins.
    """
    block, point_idx = network.block, network.block.image_points.point_idx
    used = np.flatnonzero(np.isfinite(block.image_points.sigma_px))
    n_rays = np.bincount(point_idx[used], minlength=len(block.points))
    control = block.control[np.flatnonzero(np.isfinite(block.control.sigma_m).any(axis=1))]
    is_tie = np.ones(len(block.points), dtype=bool)
    is_tie[control.point_idx] = False
    cameras = with_estimates(block.cameras, state)
    x_m, angle = start_points(replace(block, cameras=cameras), camera_poses(network, state), used)
    once = is_tie & (n_rays == 1)
    flat = is_tie & (n_rays >= 2) & (angle < block.smallest_angle)
    rows = used[~(flat | once)[point_idx[used]]]
    rows = rows[np.argsort(point_idx[rows], kind="stable")]
    x_m[control.point_idx] = control.x_m
    too_flat = f"whose rays meet at less than {np.degrees(block.smallest_angle):g} degrees"
    reasons = (("measured once", once), (too_flat, flat))
    return replace(
        network,
        image_points=block.image_points[rows],
        rows=rows,
        control=control[np.isin(control.point_idx, point_idx[rows])],
        start=replace(state, x_m=x_m),
        left_out={why: int(unused.sum()) for why, unused in reasons if unused.any()},
    )


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
    camera_idx = block.images.camera_idx[points.image_idx]
    ray_m = _turned(T_m_c.R, points.image_idx, _rays(block.cameras, camera_idx, points.colrow))
    origins, n_points = T_m_c.r[points.image_idx], len(block.points)
    x_m = _met(origins, ray_m, points.point_idx, n_points)
    return x_m, largest_angles(ray_m, points.point_idx, n_points)


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


# --- rays and the points that they miss --------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class _Sights:
    """Measured rays, and the images, cameras and poses from which they come.

    Attributes
    ----------
    network : Network
    ray_c : ndarray, shape (n, 3)
        Unit vectors in camera axes.
    image, point, camera, pose : ndarray, shape (n,)
    """

    network: Network
    ray_c: Array
    image: Index
    point: Index
    camera: Index
    pose: Index

    @classmethod
    def of(cls, network: Network, state: State, points: ImagePoints) -> _Sights:
        """Return the rays of image points through the cameras of a state."""
        camera = network.block.images.camera_idx[points.image_idx]
        cameras = with_estimates(network.block.cameras, state)
        return cls(
            network=network,
            ray_c=_rays(cameras, camera, points.colrow),
            image=points.image_idx,
            point=points.point_idx,
            camera=camera,
            pose=network.pose_idx[points.image_idx],
        )

    def towards(self, state: State, x_m: Array) -> Array:
        """Return unit vectors from the cameras to the points, in camera axes, shape (n, 3)."""
        T_m_c = camera_poses(self.network, state)[self.image]
        ahead = np.einsum("nji,nj->ni", T_m_c.R, x_m[self.point] - T_m_c.r)
        return ahead / np.linalg.norm(ahead, axis=1, keepdims=True)

    def chords(self, state: State, x_m: Array) -> Array:
        """Return the chords between the unit vectors of rays and of directions to points, (n,)."""
        return np.linalg.norm(self.towards(state, x_m) - self.ray_c, axis=1)

    def angles(self, state: State, x_m: Array) -> Array:
        """Return angles between rays and directions to points, radians; NaN for unknown points."""
        return 2 * np.arcsin(np.minimum(self.chords(state, x_m) / 2, 1.0))

    def intersected(self, state: State, weights: Array) -> Array:
        """Return points where their rays meet, control points where they were surveyed, m."""
        T_m_c = camera_poses(self.network, state)
        ray_m = _turned(T_m_c.R, self.image, self.ray_c)
        x_m = _met(T_m_c.r[self.image], ray_m, self.point, len(state.x_m), weights)
        return _with_surveyed(self.network, x_m)


def _rays(cameras: Sequence[Camera], camera_idx: Index, colrow: Array) -> Array:
    """Return the unit vectors of measured rays in the axes of their cameras, shape (n, 3)."""
    own_axes = Pose(R=np.eye(3), r=np.zeros(3))
    out = np.empty((len(colrow), 3))
    for k, camera in enumerate(cameras):
        of_camera = camera_idx == k
        out[of_camera] = rays(camera, own_axes, colrow[of_camera])
    return out


def _turned(R: Array, idx: Index, vectors: Array) -> Array:
    """Return R[idx] times vectors, without all of these matrices at a time."""
    out = np.empty_like(vectors)
    for start in range(0, len(out), CHUNK):
        part = slice(start, start + CHUNK)
        out[part] = transform(R[idx[part]], vectors[part])
    return out


def with_estimates(cameras: Sequence[Camera], state: State) -> tuple[Camera, ...]:
    """Return the cameras with the interior orientation and the mounting of a state."""
    return tuple(
        replace(camera, interior=interior, T_b_c=state.T_b_c[k])
        for k, (camera, interior) in enumerate(zip(cameras, state.interiors, strict=True))
    )


def _with_surveyed(network: Network, x_m: Array) -> Array:
    """Return coordinates of points (n, 3), those of control points replaced by surveyed ones."""
    out = x_m.copy()
    out[network.control.point_idx] = network.control.x_m
    return out


def far_off(network: Network, state: State, *, limit: float = FAR_OFF) -> Mask:
    """Tell which images miss their points by more than a limit, radians, in the median.

    From a sample of the measurements; points without coordinates are missed.
    """
    n_images = len(network.block.images)
    step = 1 + len(network.image_points) // (SAMPLE * n_images)
    sample = np.arange(0, len(network.image_points), step)
    sights = _Sights.of(network, state, network.image_points[sample])
    return medians(sights.angles(state, state.x_m), sights.image, n_images) > limit


def control_misfits(network: Network, state: State) -> Array:
    """Return the median angles of surveyed control points and their rays, radians, shape (k,)."""
    sights = _of_control(network, state)
    angles = sights.angles(state, _with_surveyed(network, state.x_m))
    return medians(angles, sights.point, network.n_points)[network.control.point_idx]


def _of_control(network: Network, state: State) -> _Sights:
    rows = np.isin(network.image_points.point_idx, network.control.point_idx)
    return _Sights.of(network, state, network.image_points[rows])


def in_front(network: Network, state: State) -> bool:
    """Tell whether all points are in front of the cameras that measure them."""
    sights = _Sights.of(network, state, network.image_points)
    return bool(np.all(sights.towards(state, state.x_m)[:, 2] < 0))


def suspects(network: Network, state: State) -> str:
    """Return the images and points that most of their rays miss, for a message.

    Control points have their surveyed coordinates.

    Returns
    -------
    str
        Begins with a semicolon; empty where there are none.
    """
    block, points = network.block, network.image_points
    sights = _Sights.of(network, state, points)
    angles = np.degrees(sights.angles(state, _with_surveyed(network, state.x_m)))
    parts = []
    for noun, names, group in (
        ("images", block.images.names, points.image_idx),
        ("points", block.points, points.point_idx),
    ):
        off_deg = medians(angles, group, len(names))
        bad = np.flatnonzero(off_deg > np.degrees(ASTRAY))
        worst = bad[np.argsort(-off_deg[bad])][:3]
        if len(worst):
            listed = ", ".join(f"{names[i]} by {off_deg[i]:.0f} degrees" for i in worst)
            parts.append(f"in {len(bad)} of {len(np.unique(group))} {noun} ({listed})")
    return f"; rays miss their points {' and '.join(parts)}" if parts else ""


# --- recovered orientations -------------------------------------------------------------------


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
    sights = _Sights.of(network, network.start, network.image_points)
    surveyed = _with_surveyed(network, np.full_like(network.start.x_m, np.nan))
    each = np.arange(len(network.pose_names))
    state = _alike(sights)
    for _ in range(ROUNDS):
        state = _onto(sights, state, surveyed, each)
    weights = np.ones(len(sights.point))
    for _ in range(ROUNDS):
        x_m = sights.intersected(state, weights)
        state = _onto(sights, state, x_m, each)
        weights = NEAR / np.maximum(sights.chords(state, x_m), NEAR)
    return replace(state, x_m=sights.intersected(state, weights))


def turned_alike(network: Network) -> State:
    """Return approximate values with all poses of a camera turned alike onto the control points.

    The majority of the control points decides; single ones that are far off have little effect.
    """
    return _alike(_of_control(network, network.start))


def _alike(sights: _Sights) -> State:
    network = sights.network
    surveyed = _with_surveyed(network, np.full_like(network.start.x_m, np.nan))
    pose_camera = np.zeros(len(network.pose_names), dtype=np.intp)
    pose_camera[sights.pose] = sights.camera
    state = replace(network.start, T_m_b=network.observed.T_m_b)
    for _ in range(ROUNDS):
        state = _onto(sights, state, surveyed, pose_camera)
    return state


def _onto(sights: _Sights, state: State, x_m: Array, pose_group: Index) -> State:
    """Turn free mountings, and groups of poses whose attitude is vague, not held, onto points."""
    network = sights.network
    if np.all(network.layout.mount[:, 3:] >= 0):
        ahead = sights.towards(state, x_m)
        Q = _rotations(ahead, sights.ray_c, sights.camera, len(network.layout.mount))
        state = replace(state, T_b_c=Pose(R=state.T_b_c.R @ Q, r=state.T_b_c.r))
    vague = np.any(network.observed.sigma_attitude > VAGUE, axis=1)
    vague &= np.any(network.layout.pose[:, 3:] >= 0, axis=1)  # the others are held
    if vague.any():
        R_b_c = state.T_b_c.R[sights.camera]
        ahead = transform(R_b_c, sights.towards(state, x_m))
        ray = transform(R_b_c, sights.ray_c)
        n_groups = int(pose_group.max()) + 1
        Q = _rotations(ahead, ray, pose_group[sights.pose], n_groups)[pose_group]
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

SUSPECT = 5.0
"""Residual, in spreads, above which an observation is suspected of a gross error."""

PAIRS, POINT_STEPS = 1 << 20, 5
"""Pairs of rays that are processed at a time, and steps of a point without one of its rays."""


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
    shown = [np.ones_like(v) for v, _ in groups]
    if redundancy is not None:
        shown = [np.sqrt(np.clip(np.nan_to_num(r, nan=1.0), 0.01, 1.0)) for r in redundancy]
    cost = np.inf
    for _ in range(HUBER_STEPS):
        loss = _Loss(_huber, HUBER_WIDTH, groups, shown)
        before, cost = cost, loss.cost(groups)
        if cost > (1 - SETTLED) * before:
            break
        state, groups = _stepped(network, state, groups, loss)
    for width in REDESCENDING_WIDTHS:
        loss = _Loss(_redescending, width, groups, shown)
        state, groups = _stepped(network, state, groups, loss)
    return _with_points_of_most_rays(network, state, groups[0])


def _huber(u: Array) -> tuple[Array, Array]:
    """Return loss and weight of residuals in widths."""
    near = np.minimum(u, 1.0)
    return near**2 + 2 * (u - near), 1 / np.maximum(u, 1.0)


def _redescending(u: Array) -> tuple[Array, Array]:
    """Return the same, by Geman and McClure."""
    least = 1 / (1 + np.square(u))
    return 1 - least, np.square(least)


class _Loss:
    """A loss for every kind of observation, with widths that fit the spreads of residuals."""

    def __init__(
        self,
        function: Callable[[Array], tuple[Array, Array]],
        width: float,
        groups: Sequence[Residuals],
        shown: Sequence[Array],
    ) -> None:
        """Set the widths; `shown` are factors on sigma that give the residuals' own sigma."""
        self.function, self.shown = function, shown
        self.widths = [width * spread(v, sigma) for v, sigma in groups]

    def factors(self, groups: Sequence[Residuals]) -> list[Array]:
        """Return the factors on sigma that give the residuals their robust weights."""
        weights = (self.function(u)[1] for u in self._in_widths(groups))
        return [1 / np.sqrt(np.maximum(weight, FAINT)) for weight in weights]

    def cost(self, groups: Sequence[Residuals]) -> float:
        """Return the sum of the loss over all residuals; infinite for an impossible state."""
        with np.errstate(over="ignore", invalid="ignore"):  # after a very large step
            losses = (self.function(u)[0] for u in self._in_widths(groups))
            total = sum(
                width**2 * float(np.sum(loss))
                for width, loss in zip(self.widths, losses, strict=True)
            )
        return total if np.isfinite(total) else np.inf

    def _in_widths(self, groups: Sequence[Residuals]) -> list[Array]:
        kinds = zip(groups, self.shown, self.widths, strict=True)
        return [sizes(v, sigma * shown) / width for (v, sigma), shown, width in kinds]


def sizes(v: Array, sigma: Array) -> Array:
    """Return abs(v) / sigma: of image points the length of the vector, of others each component."""
    u = np.abs(v / sigma)
    return np.linalg.norm(u, axis=1, keepdims=True) if v.shape[1] == 2 else u


def spread(v: Array, sigma: Array) -> float:
    """Return the robust standard deviation of residuals in sigmas, at least one."""
    u = np.abs(v / sigma)[np.isfinite(sigma)]
    return max(1.0, float(np.median(u)) / 0.6745) if len(u) else 1.0


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


# --- poses of exposures whose trajectory is not known: resections from control points ----------


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
    R, r = [], []
    for exposure, name in enumerate(block.trajectory.exposures):
        images = np.flatnonzero(block.images.exposure_idx == exposure)
        image = images[np.argmax(n_control[images])] if len(images) else -1
        if image < 0 or n_control[image] < 3:
            raise AdjustmentError(
                f"exposure {name!r} has no image with 3 control points, which a resection needs: "
                "give its pose, or leave out its images"
            )
        camera = block.cameras[block.images.camera_idx[image]]
        shown = points[points.image_idx == image]
        T_m_c = resect(camera, shown.colrow, block.control.x_m[where[shown.point_idx]])
        T_m_b = T_m_c @ camera.T_b_c.inverse
        R.append(T_m_b.R)
        r.append(T_m_b.r)
    poses = Pose(R=np.stack(R), r=np.stack(r))
    return replace(block, trajectory=Trajectory(exposures=block.trajectory.exposures, T_m_b=poses))
