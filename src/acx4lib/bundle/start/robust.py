"""A robust first phase: estimates that resist gross errors and bad approximate values.

Reweighted adjustment steps use all observations, first with Huber's loss, which has one minimum,
then with the loss of Geman and McClure, which gives gross errors almost no weight.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from acx4lib.bundle.network import Network
from acx4lib.bundle.unknowns import State
from acx4lib.expected import Array, Index

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
    distances = network.distances
    on_image, on_control, on_position, on_attitude, on_distance = factors[:5]
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
        distances=replace(distances, sigma_m=distances.sigma_m * on_distance[:, 0]),
    )


def _stepped(
    network: Network, state: State, groups: Sequence[Residuals], loss: _Loss
) -> tuple[State, Sequence[Residuals]]:
    """Return state and residuals after one reweighted step, damped until its cost decreases."""
    cost, weighted = loss.cost(groups), reweighted(network, loss.factors(groups))
    for damping in DAMPING:
        trial = network.moved(state, *weighted.normals(state, damping).step())
        there = network.residuals(trial)
        if loss.cost(there) <= cost:
            return trial, there
    return state, groups


# --- points ----------------------------------------------------------------------------------


def _with_points_of_most_rays(network: Network, state: State, seen: Residuals) -> State:
    """Where a point has a wrong ray, try each of its rays as the wrong one; keep orientations.

    Where few rays meet, reweighting finds a wrong ray only from suitable approximate values.
    """
    scale = spread(*seen)
    wrong = sizes(*seen)[:, 0] > SUSPECT * scale
    point = network.image_points.point_idx
    rays = np.bincount(point, minlength=network.n_points)
    doubtful = (np.bincount(point, wrong, minlength=network.n_points) > 0) & (rays > 2)
    doubtful[network.control.point_idx] = False
    rows = np.flatnonzero(doubtful[point])
    if len(rows) == 0:
        return state
    own = replace(network, image_points=network.image_points[rows], rows=network.rows[rows])
    e = own.equations(state)[0]
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
    better = _point_costs(own, moved, scale) < _point_costs(own, state, scale)
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
    _, first, which, rays = np.unique(
        point, return_index=True, return_inverse=True, return_counts=True
    )
    tried = np.repeat(np.arange(len(point)), rays[which])
    starts = np.flatnonzero(np.diff(tried, prepend=-1))
    ray = first[which[tried]] + np.arange(len(tried)) - starts[tried]
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
