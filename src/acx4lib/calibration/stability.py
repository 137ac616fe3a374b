"""Tests of the stability of the boresight, and σ in calm air."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from acx4lib.block import ImagePoints
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.network import Network, camera_poses
from acx4lib.bundle.observations import has_times
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
    network = bundle.network
    every_exposure = len(network.pose_names) == len(network.block.trajectory)
    if not (every_exposure and np.isfinite(network.observed.sigma_attitude).any()):
        return None
    common_and_each = np.column_stack([np.ones(len(shares)), shares])
    k = 3 * common_and_each.shape[1]
    C = np.einsum("mn,ab->manb", common_and_each, np.eye(3)).reshape(-1, 3, k)
    common, each = np.arange(3), np.arange(3, k)
    r = _residuals(bundle, C)
    # a boresight without sigma absorbs a turn of all exposures completely, a declared boresight
    # nearly so: neither is a step, and the turns are made independent of it
    K = np.eye(k)
    K[np.ix_(common, each)] = -_solved(r, common, COMMON)[1] @ r.normal[np.ix_(common, each)]
    r = replace(r, shown=r.shown @ K, normal=K.T @ r.normal @ K, right=K.T @ r.right)
    _, of_common, _ = _solved(r, common, COMMON)
    explained, of_each, dof = _solved(r, each, OPEN)
    inverse = np.zeros_like(r.normal)
    inverse[:3, :3], inverse[3:, 3:] = of_common, of_each
    v = r.equations.v - r.shown @ (inverse @ r.right)
    weighed = r.equations.weighed(r.shown)
    redundancy = r.redundancy - float(np.sum(inverse * np.einsum("mdk,mdl->kl", r.shown, weighed)))
    if dof < 1 or redundancy < 1:
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


def _residuals(bundle: Bundle, C: Array) -> _Residuals:
    """Return the effects of turns C, shape (m, 3, k), on the residuals of the attitudes."""
    network, solution = bundle.network, bundle.solution
    e = next(e for e in network.besides_rays(bundle.state) if e.kind == "attitude")
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

TIE_POINTS = 300
"""Tie points that take part, of a block that has more, with the weight of all."""


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
    columns, calm = np.arange(len(J)), _calmed(thin, bundle.state, strips)
    try:
        of_calm, of_thin = (
            sigmas(propagate(J, adjustment.covariance(network, state, columns)))
            for network, state in (calm, (thin, bundle.state))
        )
    except AdjustmentError:  # singular, and too large to find the singular unknowns
        return None
    return np.asarray(of_calm / of_thin)


class _Strip(NamedTuple):
    """The poses of one strip, and the unit vector of its direction, shape (2,)."""

    rows: Index
    along: Array


def _strips(bundle: Bundle) -> list[_Strip] | None:
    """Return the strips; None if exposures have no strip, or a strip is not straight."""
    of_exposure = np.array(strip_of_exposure(bundle.network.block), dtype=object)
    names = of_exposure[bundle.network.exposure_idx]
    if np.any(names == ""):
        return None
    strips = []
    for name in dict.fromkeys(names):
        rows = np.flatnonzero(names == name)
        T_m_b = bundle.state.T_m_b[rows]
        along = T_m_b.R[0, :2, 0]
        if len(rows) > 1:
            offsets = T_m_b.r[:, :2] - T_m_b.r[:, :2].mean(axis=0)
            _, size, axes = np.linalg.svd(offsets, full_matrices=False)
            length = np.ptp(offsets @ axes[0])
            if not size[1] < 0.2 * length * np.sqrt(len(rows)):  # RMS distance from a line
                return None
            along = axes[0] * np.sign((offsets[-1] - offsets[0]) @ axes[0])
        strips.append(_Strip(rows, along / np.linalg.norm(along)))
    return strips


def _calmed(network: Network, state: State, strips: list[_Strip]) -> tuple[Network, State]:
    """Return the network in calm air over level ground, and its state."""
    x_m, control = state.x_m.copy(), network.control
    seen = np.union1d(network.image_points.point_idx, control.point_idx)
    used = seen[np.isfinite(x_m[seen]).all(axis=1)]
    ground = float(x_m[used, 2].mean())
    x_m[used, 2] = ground + LEFT * (x_m[used, 2] - ground)
    calm = replace(state, T_m_b=_calm_poses(state.T_m_b, strips, ground), x_m=x_m)
    observed = replace(network.observed, T_m_b=calm.T_m_b)
    if len(observed.velocity) > 1:
        observed = replace(observed, velocity=_calm_velocity(observed.velocity, strips))
    control = replace(control, x_m=x_m[control.point_idx])
    points = _measured(network, calm)
    return replace(network, observed=observed, control=control, image_points=points), calm


def _calm_poses(T_m_b: Pose, strips: list[_Strip], ground: float) -> Pose:
    """Return poses nearly on straight lines, at the heights and attitudes that strips share."""
    height = np.array([T_m_b.r[strip.rows, 2].mean() for strip in strips])
    above = _alike(height - ground, 0.03)
    courses = [turn(2, float(np.arctan2(along[1], along[0]))) for _, along in strips]
    steady = np.array(
        [mean_rotation(C.T @ T_m_b.R[s.rows]) for C, s in zip(courses, strips, strict=True)]
    )
    angle = np.array([[np.linalg.norm(log(a.T @ b)) for b in steady] for a in steady])
    for group in _groups(range(len(strips)), angle < np.radians(20.0)):
        steady[group] = mean_rotation(steady[group])
    R, r = T_m_b.R.copy(), T_m_b.r.copy()
    for k, (rows, along) in enumerate(strips):
        middle, line = T_m_b.r[rows].mean(axis=0), np.append(along, 0.0)
        on_line = middle + ((T_m_b.r[rows] - middle) @ line)[:, None] * line
        on_line[:, 2] = above[k] + ground
        r[rows] = on_line + LEFT * (T_m_b.r[rows] - on_line)
        attitude = courses[k] @ steady[k]
        R[rows] = attitude @ exp(LEFT * log(attitude.T @ T_m_b.R[rows]))
    return Pose(R=R, r=r)


def _calm_velocity(velocity: Array, strips: list[_Strip]) -> Array:
    """Return velocities with equal speeds for strips of similar speed, and reduced wind."""
    velocity = velocity.copy()
    flown = np.array([velocity[strip.rows].mean(axis=0) for strip in strips])
    speed = np.linalg.norm(flown[:, :2], axis=1)
    usual = _alike(speed, 0.1)  # head wind and tail wind
    for k, (rows, _) in enumerate(strips):
        steady = flown[k] * [1.0, 1.0, 0.0] * (usual[k] / speed[k] if speed[k] > 0 else 1.0)
        velocity[rows] = steady + LEFT * (velocity[rows] - steady)
    return velocity


def _alike(values: Array, share: float) -> Array:
    """Replace values within a share of the largest of their group by their mean."""
    out = values.astype(float)
    order = np.argsort(-values, kind="stable").tolist()
    for group in _groups(order, values > (1 - share) * values[:, None]):
        out[group] = values[group].mean()
    return out


def _groups(order: Iterable[int], near: Mask) -> Iterator[list[int]]:
    """Yield groups of what is near the first of each group, shape (n, n)."""
    remaining = list(order)
    while remaining:
        first = remaining[0]
        group = [k for k in remaining if k == first or near[first, k]]
        yield group
        remaining = [k for k in remaining if k not in group]


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
    spread = np.argsort(np.arange(len(tie)) * 0.6180339887498949 % 1.0, kind="stable")  # golden
    chosen = tie[spread[:TIE_POINTS]]
    kept[chosen] = True
    rows = np.flatnonzero(kept[points.point_idx])
    lighter = np.ones(network.n_points)
    lighter[chosen] = np.sqrt(TIE_POINTS / len(tie))
    thinned = points[rows]
    thinned = replace(thinned, sigma_px=thinned.sigma_px * lighter[thinned.point_idx])
    return replace(network, image_points=thinned, rows=network.rows[rows])
