"""What an estimate rests on: the strips that were planned, or the wind and the hills.

A flight is never level and straight, nor its ground flat, and this tells parameters apart that the
strips alone leave together. Nobody plans it: the next flight may have less of it. So sigma is
computed again, of the same strips in calm air over level ground.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.network import Network, camera_poses
from acx4lib.bundle.observations import Motion
from acx4lib.bundle.start import with_estimates
from acx4lib.bundle.unknowns import State
from acx4lib.calibration import trajectory_errors
from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index, Mask
from acx4lib.flight.block import ImagePoints
from acx4lib.flight.design import strip_of_exposure
from acx4lib.geometry.collinearity import as_seen, project
from acx4lib.geometry.frames import Pose, exp, log, mean_rotation, turn
from acx4lib.least_squares import adjustment
from acx4lib.least_squares.covariance import propagate, sigmas

LEFT = 0.05
"""Share of wind and hills that is left, so that what rests on nothing else is still computed."""

SAME_HEIGHT = 0.03
"""Strips whose flying heights differ by less than this share are taken for planned at one."""

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
    """Return by how many times larger sigma would be in calm air over level ground.

    Parameters
    ----------
    bundle : Bundle
        Of `uses.mounted_orientation`.

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
    except AdjustmentError:  # singular, and too large to say which unknowns are
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
        Its exposures.
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
    """Return the strips; None where exposures have none, or where one is not straight."""
    names = np.array(strip_of_exposure(bundle.network.block), dtype=object)
    if np.any(names == ""):
        return None
    found = []
    for name in dict.fromkeys(names):
        rows = np.flatnonzero(names == name)
        strip = _strip(bundle.state.T_m_b[rows], rows)
        if strip is None:
            return None
        found.append(strip)
    return found


def _strip(T_m_b: Pose, rows: Index) -> _Strip | None:
    away = T_m_b.r[:, :2] - T_m_b.r[:, :2].mean(axis=0)
    along = T_m_b.R[0, :2, 0]
    if len(rows) > 1:
        _, size, axes = np.linalg.svd(away, full_matrices=False)
        length = np.ptp(away @ axes[0])
        if not size[1] < STRAIGHT * length * np.sqrt(len(rows)):
            return None
        along = axes[0] * np.sign((away[-1] - away[0]) @ axes[0])
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
    seen = np.flatnonzero(np.isfinite(x_m).all(axis=1) & _used(network))
    ground = float(x_m[seen, 2].mean())
    x_m[seen, 2] = ground + LEFT * (x_m[seen, 2] - ground)
    calm = replace(state, T_m_b=_calm_poses(state.T_m_b, strips, ground), x_m=x_m)
    observed = replace(network.observed, T_m_b=calm.T_m_b)
    if observed.motion is not None:
        observed = replace(observed, motion=_calm_motion(observed.motion, strips))
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
    for strip, height, own in zip(strips, heights, attitudes, strict=True):
        rows, steady = strip.rows, strip.course @ own
        middle = T_m_b.r[rows].mean(axis=0)
        away = T_m_b.r[rows] - middle
        line = np.append(strip.along, 0.0)
        on_line = middle + (away @ line)[:, None] * line
        on_line[:, 2] = height
        r[rows] = on_line + LEFT * (T_m_b.r[rows] - on_line)
        R[rows] = steady @ exp(LEFT * log(steady.T @ T_m_b.R[rows]))
    return Pose(R=R, r=r)


def _calm_motion(motion: Motion, strips: list[_Strip]) -> Motion:
    """Return the velocities of strips of which those with about one speed have one."""
    velocity = motion.velocity.copy()
    flown = np.array([velocity[s.rows].mean(axis=0) for s in strips])
    speed = np.linalg.norm(flown[:, :2], axis=1)
    for strip, own, usual, now in zip(strips, flown, _alike(speed, SAME_SPEED), speed, strict=True):
        steady = own * [1.0, 1.0, 0.0] * (usual / now if now > 0 else 1.0)
        velocity[strip.rows] = steady + LEFT * (velocity[strip.rows] - steady)
    return Motion(velocity=velocity, rate=LEFT * motion.rate)


def _alike(values: Array, share: float) -> Array:
    """Return values of which those that differ by less than a share have their mean."""
    out = values.astype(float)
    for rows in _groups(values, share):
        out[rows] = values[rows].mean()
    return out


def _groups(values: Array, share: float) -> Iterator[Index]:
    """Yield the places of values within a share of the largest of their group."""
    left = np.argsort(-values, kind="stable")
    while len(left):
        near = values[left] > (1 - share) * values[left[0]]
        near[0] = True
        yield left[near]
        left = left[~near]


def _alike_turns(R: list[Array]) -> list[Array]:
    """Return rotations of which those that differ by less than 20 degrees have their mean."""
    out, left = list(R), list(range(len(R)))
    while left:
        near = [k for k in left if np.linalg.norm(log(R[left[0]].T @ R[k])) < SAME_TURN]
        mean = mean_rotation(np.array([R[k] for k in near]))
        for k in near:
            out[k] = mean
        left = [k for k in left if k not in near]
    return out


# --- measurements ----------------------------------------------------------------------------


def _measured(network: Network, state: State) -> ImagePoints:
    """Return the measurements where the images would then show their points."""
    points, block = network.image_points, network.block
    cameras = with_estimates(block.cameras, state)
    T_m_c = camera_poses(network, state)[points.image_idx]
    x_m = as_seen(T_m_c.r, state.x_m[points.point_idx], refraction=network.refraction)
    camera_idx = block.images.camera_idx[points.image_idx]
    colrow = points.colrow.copy()
    for k, camera in enumerate(cameras):
        own = np.flatnonzero(camera_idx == k)
        at = project(camera, T_m_c[own], x_m[own])
        there = np.isfinite(at).all(axis=1)
        colrow[own[there]] = at[there]
    return replace(points, colrow=colrow)


def _thinned(network: Network) -> Network:
    """Return the network with a part of its tie points, spread over all, with the weight of all."""
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
    own = points[rows]
    lighter = np.ones(network.n_points)
    lighter[chosen] = np.sqrt(TIE_POINTS / len(tie))
    own = replace(own, sigma_px=own.sigma_px * lighter[own.point_idx])
    return replace(network, image_points=own, rows=network.rows[rows])
