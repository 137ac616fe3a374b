"""Tests of the stability of the boresight, and σ in calm air."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from acx4lib.block import ImagePoints
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.network import Network, camera_poses
from acx4lib.bundle.observations import attitude_equations, has_times
from acx4lib.bundle.start import with_estimates
from acx4lib.bundle.unknowns import State
from acx4lib.calibration import trajectory_errors
from acx4lib.design import strip_of_exposure
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.collinearity import as_seen, project
from acx4lib.geometry.frames import Pose, exp, log, mean_rotation, turn
from acx4lib.least_squares import adjustment, statistics
from acx4lib.least_squares.covariance import propagate, sigmas
from acx4lib.least_squares.normal_equations import Equations

# --- Does the boresight stay? Steps between strips and a drift, as added unknowns of an
# adjustment
#
# Boresights of single images share the errors of the bundle: of one strip, they are off together.
# So their differences are tested with the covariance of the attitudes' residuals, which has these
# errors, and not with the scatter within the strips.


OPEN = 1e-3
"""Least share of a turn in the residuals; below, it is a boresight or not determined."""

COMMON = 1e-5
"""The same of a turn of all exposures; below, the boresight absorbs it completely."""

LEAST_REDUNDANCY = 1.0
"""Least redundancy of the attitudes, beside the turns, for an estimate of their scatter."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Turns:
    """Turns of the cameras against the body, tested together.

    Attributes
    ----------
    names : tuple of str
        Strips; a drift has one name, and its turn is the change from the first exposure to the
        last.
    turns, sigma : ndarray, shape (n, 3)
        About the body's axes, less the mean of all exposures; radians, sigma from the remaining
        residuals of the attitudes. Infinite where a turn has no effect on the residuals.
    f : float
        (T / dof) / s^2; T is the sum of squares that the turns explain, s^2 the variance factor of
        the attitudes beside them.
    dof : int
    redundancy : float
        Of the attitudes, beside the turns.
    """

    names: tuple[str, ...]
    turns: Array
    sigma: Array
    f: float
    dof: int
    redundancy: float

    @property
    def p(self) -> float:
        """Probability of such turns, or larger ones, where the boresight stays."""
        return statistics.f_sf(self.f, self.dof, self.redundancy)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Residuals:
    """The residuals of the attitudes, and the effects of turns on them.

    Attributes
    ----------
    equations : Equations
    redundancy : float
    shown : ndarray, shape (m, 3, k)
        By how much a turn of each kind shows in the residuals: Q_vv P C.
    normal, right : ndarray, shape (k, k) and (k,)
        C^T P Q_vv P C and C^T P v.
    scale : ndarray, shape (k,)
        Roots of the diagonal of C^T P C.
    """

    equations: Equations
    redundancy: float
    shown: Array
    normal: Array
    right: Array
    scale: Array


def between_strips(bundle: Bundle) -> Turns | None:
    """Test whether the boresight differs between strips.

    Parameters
    ----------
    bundle : Bundle
        With attitudes as observations, such as that of the single step.

    Returns
    -------
    Turns or None
        None where there are no two strips with attitudes that the images control.

    Notes
    -----
    With the residuals v = estimated - observed, their weights P and covariance Q_vv, and C the
    derivatives of the observed attitudes by the turns, the turns are M^+ C^T P v with
    M = C^T P Q_vv P C, and the sum of squares falls by T = v^T P C M^+ C^T P v [1]_. An adjustment
    with the turns as unknowns gives the same, where it is linear in them. Turns that all exposures
    share are excluded.

    References
    ----------
    .. [1] K.-R. Koch, "Parameter Estimation and Hypothesis Testing in Linear Models", 2nd
       edition, 1999, chapters 3.4 and 4.2.
    """
    block = bundle.network.block
    strip = np.full(len(block.trajectory), "", dtype=object)
    strip[block.images.exposure_idx] = block.images.strips
    names = tuple(filter(None, dict.fromkeys(strip)))
    if len(names) < 2:
        return None
    membership = np.stack([strip == name for name in names], axis=1).astype(float)
    mean = membership.mean(axis=0)
    return _tested(bundle, names, membership - mean, np.eye(len(names)) - mean)


def over_time(bundle: Bundle) -> Turns | None:
    """Test whether the boresight drifts, linearly over time or over the order of the exposures.

    Parameters
    ----------
    bundle : Bundle
        As in `between_strips`; so is the test.
    """
    trajectory = bundle.network.block.trajectory
    time = trajectory.time_s if has_times(trajectory) else np.arange(len(trajectory), dtype=float)
    if not np.ptp(time) > 0:
        return None
    share = (time - time.mean()) / np.ptp(time)
    return _tested(bundle, ("drift",), share[:, None], np.eye(1))


def _tested(bundle: Bundle, names: tuple[str, ...], shares: Array, reported: Array) -> Turns | None:
    """Test turns of single exposures beside a turn that all exposures share.

    `shares`, shape (m, n), is the share of each turn in each exposure, with mean zero; `reported`,
    shape (n, n), is the share of each turn in each value of the returned `Turns`.
    """
    if not _observes_attitudes(bundle.network):
        return None
    common_and_each = np.column_stack([np.ones(len(shares)), shares])
    k = 3 * common_and_each.shape[1]
    C = np.einsum("mn,ab->manb", common_and_each, np.eye(3)).reshape(-1, 3, k)
    common, each = np.arange(3), np.arange(3, k)
    r = _beside(_residuals(bundle, C), common, each)
    _, of_common, _ = _solved(r, common, COMMON)
    explained, of_each, dof = _solved(r, each, OPEN)
    inverse = np.zeros_like(r.normal)
    inverse[:3, :3], inverse[3:, 3:] = of_common, of_each
    v = r.equations.v - r.shown @ (inverse @ r.right)
    weighed = r.equations.weighed(r.shown)
    redundancy = r.redundancy - float(np.sum(inverse * np.einsum("mdk,mdl->kl", r.shown, weighed)))
    if dof < 1 or redundancy < LEAST_REDUNDANCY:
        return None
    variance = float(np.sum(v * r.equations.weighed(v[:, :, None])[:, :, 0])) / redundancy
    if not variance > 0:
        return None
    by_turns = np.kron(reported, np.eye(3))
    sigma = sigmas(variance * propagate(by_turns, of_each))
    return Turns(
        names=names,
        turns=(by_turns @ of_each @ r.right[each]).reshape(-1, 3),
        sigma=np.where(sigma > 0, sigma, np.inf).reshape(-1, 3),
        f=explained / dof / variance,
        dof=dof,
        redundancy=redundancy,
    )


def _beside(r: _Residuals, common: Index, each: Index) -> _Residuals:
    """Return the turns made independent of the turn that all exposures share.

    A boresight without sigma absorbs a turn of all exposures completely, a declared boresight
    nearly so: neither is a step.
    """
    _, inverse, _ = _solved(r, common, COMMON)
    K = np.eye(len(r.right))
    K[np.ix_(common, each)] = -inverse @ r.normal[np.ix_(common, each)]
    return replace(r, shown=r.shown @ K, normal=K.T @ r.normal @ K, right=K.T @ r.right)


def _observes_attitudes(network: Network) -> bool:
    rows = len(network.pose_names) == len(network.block.trajectory)
    return rows and bool(np.isfinite(network.observed.sigma_attitude).any())


def _residuals(bundle: Bundle, C: Array) -> _Residuals:
    """Return the effects of turns C, shape (m, 3, k), on the residuals of the attitudes."""
    network, solution = bundle.network, bundle.solution
    e = attitude_equations(network.observed, bundle.state, network.layout)
    weighed = e.weighed(C)
    columns, held = e.columns[e.unit], e.columns[e.unit] < 0
    A = np.where(held[:, None, :], 0.0, e.A)
    by_columns = np.zeros((network.n_columns, C.shape[2]))
    np.add.at(by_columns, columns, np.einsum("mda,mdk->mak", A, weighed))
    gain = solution.inverse.times(by_columns.T).T
    shown = C - np.einsum("mda,mak->mdk", A, gain[columns])
    group = solution.group("attitude")
    return _Residuals(
        equations=e,
        redundancy=float(np.nansum(group.redundancy)),
        shown=np.where(np.isfinite(e.sigma)[:, :, None], shown, 0.0),
        normal=np.einsum("mdk,mdl->kl", C, weighed) - by_columns.T @ gain,
        right=np.einsum("mdk,md->k", weighed, e.v),
        scale=np.sqrt(np.einsum("mdk,mdk->k", C, weighed)),
    )


def _solved(r: _Residuals, chosen: Index, least: float) -> tuple[float, Array, int]:
    """Return the sum of squares that chosen turns explain, their inverse normals and rank."""
    scale = np.where(r.scale[chosen] > 0, r.scale[chosen], 1.0)
    values, vectors = np.linalg.eigh(r.normal[np.ix_(chosen, chosen)] / scale[:, None] / scale)
    kept = values > least
    part = vectors[:, kept] / scale[:, None]
    along = part.T @ r.right[chosen]
    return float(np.sum(along**2 / values[kept])), (part / values[kept]) @ part.T, int(kept.sum())


# --- Dependence of an estimate on wind and hills, beside the planned strips
#
# A flight is never level and straight, nor its ground flat. This separates parameters that the
# strips alone cannot separate. It is not planned: the next flight may have less of it. So sigma is
# computed again for the same strips in calm air over level ground.


LEFT = 0.05
"""Share of wind and hills that remains, so that parameters resting on them stay computable."""

SAME_HEIGHT = 0.03
"""Strips whose flying heights differ by less than this share count as planned at one height."""

SAME_SPEED = 0.1
"""The same of ground speeds, which differ by head wind and tail wind."""

SAME_TURN = np.radians(20.0)
"""The same of attitudes against the direction of flight, which differ by side wind."""

STRAIGHT = 0.2
"""Root mean square distance of exposures from the line of their strip, over its length, above which
the strip is none."""

TIE_POINTS = 300
"""Tie points that take part, of a block that has more, with the weight of all."""

GOLDEN = 0.6180339887498949


def calm_sigmas(bundle: Bundle) -> Array | None:
    """Return the factors by which sigma would grow in calm air over level ground.

    Parameters
    ----------
    bundle : Bundle
        Of `adjust.mounted_orientation`.

    Returns
    -------
    ndarray, shape (n,), or None
        One ratio for every parameter of cameras, then of the trajectory, in the order of
        `trajectory_errors.reported_covariance`. None where the exposures do not lie in strips, or
        where a large block becomes singular.
    """
    strips = _strips(bundle)
    if strips is None:
        return None
    thin = _thinned(bundle.network)
    J = trajectory_errors.jacobian(bundle)
    calm = _calmed(replace(bundle, network=thin), strips)
    try:
        ratio: Array = _sigmas(J, *calm) / _sigmas(J, thin, bundle.state)
    except AdjustmentError:  # singular, and too large to find the singular unknowns
        return None
    return ratio


def _sigmas(J: Array, network: Network, state: State) -> Array:
    """Return sigma a priori of all parameters."""
    cov = adjustment.covariance(network, state, np.arange(len(J)))
    return sigmas(propagate(J, cov))


# --- strips ----------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class _Strip:
    """One strip.

    Attributes
    ----------
    rows : ndarray
        Its poses.
    along : ndarray, shape (2,)
        Unit vector of its direction.
    height : float
        Mean, m.
    R : ndarray, shape (3, 3)
        Mean attitude, against the direction of flight.
    """

    rows: Index
    along: Array
    height: float
    R: Array

    @property
    def course(self) -> Array:
        """Rotation from axes along the strip to the mapping frame, shape (3, 3)."""
        return turn(2, float(np.arctan2(self.along[1], self.along[0])))


def _strips(bundle: Bundle) -> list[_Strip] | None:
    """Return the strips; None if exposures have no strip, or a strip is not straight."""
    of_exposure = np.array(strip_of_exposure(bundle.network.block), dtype=object)
    names = of_exposure[bundle.network.exposure_idx]
    if np.any(names == ""):
        return None
    straight_strips = []
    for name in dict.fromkeys(names):
        rows = np.flatnonzero(names == name)
        strip = _strip(bundle.state.T_m_b[rows], rows)
        if strip is None:
            return None
        straight_strips.append(strip)
    return straight_strips


def _strip(T_m_b: Pose, rows: Index) -> _Strip | None:
    offsets = T_m_b.r[:, :2] - T_m_b.r[:, :2].mean(axis=0)
    along = T_m_b.R[0, :2, 0]
    if len(rows) > 1:
        _, size, axes = np.linalg.svd(offsets, full_matrices=False)
        length = np.ptp(offsets @ axes[0])
        if not size[1] < STRAIGHT * length * np.sqrt(len(rows)):
            return None
        along = axes[0] * np.sign((offsets[-1] - offsets[0]) @ axes[0])
    along = along / np.linalg.norm(along)
    course = turn(2, float(np.arctan2(along[1], along[0])))
    return _Strip(
        rows=rows,
        along=along,
        height=float(T_m_b.r[:, 2].mean()),
        R=mean_rotation(course.T @ T_m_b.R),
    )


# --- calm air --------------------------------------------------------------------------------


def _calmed(bundle: Bundle, strips: list[_Strip]) -> tuple[Network, State]:
    """Return the network in calm air over level ground, and its state."""
    network, state = bundle.network, bundle.state
    x_m = state.x_m.copy()
    used = np.flatnonzero(np.isfinite(x_m).all(axis=1) & _used(network))
    ground = float(x_m[used, 2].mean())
    x_m[used, 2] = ground + LEFT * (x_m[used, 2] - ground)
    calm = replace(state, T_m_b=_calm_poses(state.T_m_b, strips, ground), x_m=x_m)
    observed = replace(network.observed, T_m_b=calm.T_m_b)
    if observed.velocity is not None:
        observed = replace(observed, velocity=_calm_velocity(observed.velocity, strips))
    control = network.control
    control = replace(control, x_m=x_m[control.point_idx])
    points = _measured(network, calm)
    return replace(network, observed=observed, control=control, image_points=points), calm


def _used(network: Network) -> Mask:
    used = np.zeros(network.n_points, dtype=bool)
    used[network.image_points.point_idx] = True
    used[network.control.point_idx] = True
    return used


def _calm_poses(T_m_b: Pose, strips: list[_Strip], ground: float) -> Pose:
    heights = _alike(np.array([s.height - ground for s in strips]), SAME_HEIGHT) + ground
    attitudes = _alike_turns([s.R for s in strips])
    R, r = T_m_b.R.copy(), T_m_b.r.copy()
    for strip, height, attitude in zip(strips, heights, attitudes, strict=True):
        rows, steady = strip.rows, strip.course @ attitude
        middle = T_m_b.r[rows].mean(axis=0)
        offsets = T_m_b.r[rows] - middle
        line = np.append(strip.along, 0.0)
        on_line = middle + (offsets @ line)[:, None] * line
        on_line[:, 2] = height
        r[rows] = on_line + LEFT * (T_m_b.r[rows] - on_line)
        R[rows] = steady @ exp(LEFT * log(steady.T @ T_m_b.R[rows]))
    return Pose(R=R, r=r)


def _calm_velocity(velocity: Array, strips: list[_Strip]) -> Array:
    """Return velocities with equal speeds for strips of similar speed, and reduced wind."""
    velocity = velocity.copy()
    flown = np.array([velocity[s.rows].mean(axis=0) for s in strips])
    speed = np.linalg.norm(flown[:, :2], axis=1)
    for strip, mean_velocity, usual, actual in zip(
        strips, flown, _alike(speed, SAME_SPEED), speed, strict=True
    ):
        steady = mean_velocity * [1.0, 1.0, 0.0] * (usual / actual if actual > 0 else 1.0)
        velocity[strip.rows] = steady + LEFT * (velocity[strip.rows] - steady)
    return velocity


def _alike(values: Array, share: float) -> Array:
    """Replace values that differ by less than a share by their mean."""
    out = values.astype(float)
    for rows in _groups(values, share):
        out[rows] = values[rows].mean()
    return out


def _groups(values: Array, share: float) -> Iterator[Index]:
    """Yield the places of values within a share of the largest of their group."""
    remaining = np.argsort(-values, kind="stable")
    while len(remaining):
        near = values[remaining] > (1 - share) * values[remaining[0]]
        near[0] = True
        yield remaining[near]
        remaining = remaining[~near]


def _alike_turns(R: list[Array]) -> list[Array]:
    """Replace rotations that differ by less than `SAME_TURN` by their mean."""
    out, remaining = list(R), list(range(len(R)))
    while remaining:
        near = [k for k in remaining if np.linalg.norm(log(R[remaining[0]].T @ R[k])) < SAME_TURN]
        mean = mean_rotation(np.array([R[k] for k in near]))
        for k in near:
            out[k] = mean
        remaining = [k for k in remaining if k not in near]
    return out


# --- measurements ----------------------------------------------------------------------------


def _measured(network: Network, state: State) -> ImagePoints:
    """Return the image points, projected by the cameras of a state."""
    points, block = network.image_points, network.block
    cameras = with_estimates(block.cameras, state)
    T_m_c = camera_poses(network, state)[points.image_idx]
    x_m = as_seen(T_m_c.r, state.x_m[points.point_idx], refraction=network.refraction)
    camera_idx = block.images.camera_idx[points.image_idx]
    colrow = points.colrow.copy()
    for k, camera in enumerate(cameras):
        rows = np.flatnonzero(camera_idx == k)
        projected = project(camera, T_m_c[rows], x_m[rows])
        visible = np.isfinite(projected).all(axis=1)
        colrow[rows[visible]] = projected[visible]
    return replace(points, colrow=colrow)


def _thinned(network: Network) -> Network:
    """Return the network with a sample of its tie points that has the weight of all."""
    points = network.image_points
    kept = np.zeros(network.n_points, dtype=bool)
    kept[network.observed_points] = True
    kept[network.control.point_idx] = True
    tie = np.flatnonzero(network.free_points & ~kept)
    if len(tie) <= TIE_POINTS:
        return network
    order = np.argsort(np.arange(len(tie)) * GOLDEN % 1.0, kind="stable")
    chosen = tie[order[:TIE_POINTS]]
    kept[chosen] = True
    rows = np.flatnonzero(kept[points.point_idx])
    thinned = points[rows]
    lighter = np.ones(network.n_points)
    lighter[chosen] = np.sqrt(TIE_POINTS / len(tie))
    thinned = replace(thinned, sigma_px=thinned.sigma_px * lighter[thinned.point_idx])
    return replace(network, image_points=thinned, rows=network.rows[rows])
