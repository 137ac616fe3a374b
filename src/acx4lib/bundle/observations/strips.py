"""The strips of a block, and how the body moves along them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from acx4lib.errors import AdjustmentError
from acx4lib.expected import Array, Index
from acx4lib.flight.block import Block, Trajectory
from acx4lib.geometry.frames import log, transform
from acx4lib.geometry.parameters import DELAYS


@dataclass(frozen=True, kw_only=True, eq=False)
class Strips:
    """The strips along which observed positions may drift.

    Attributes
    ----------
    names : tuple of str
        n_strips names.
    idx : ndarray, shape (n_poses,), or (1,) where there are no strips
        The strip of each pose, -1 for none.
    elapsed : ndarray, shape as `idx`
        Time since the mean time of the strip's exposures.
    unit : str
        Unit of the time: ``"s"``, or ``"exposure"`` where only the order is known.
    """

    names: tuple[str, ...] = ()
    idx: Index = field(default_factory=lambda: np.full(1, -1))
    elapsed: Array = field(default_factory=lambda: np.zeros(1))
    unit: str = "s"


def strips_of(block: Block) -> Strips:
    """Return the strips of a block that have exposures at two times or more.

    The time is that of the trajectory; where it has none, the order of the exposures.

    Parameters
    ----------
    block : Block
    """
    trajectory = block.trajectory
    strip = np.full(len(trajectory), "", dtype=object)
    strip[block.images.exposure_idx] = block.images.strips
    timed = has_times(trajectory)
    names: list[str] = []
    idx, elapsed = np.full(len(trajectory), -1), np.zeros(len(trajectory))
    for name in filter(None, dict.fromkeys(strip)):
        here = np.flatnonzero(strip == name)
        time = trajectory.time_s[here] if timed else np.arange(len(here), dtype=float)
        if np.ptp(time) > 0:
            idx[here], elapsed[here] = len(names), time - time.mean()
            names.append(name)
    return Strips(names=tuple(names), idx=idx, elapsed=elapsed, unit="s" if timed else "exposure")


# --- motion ----------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """How fast a body moves and turns at its exposures.

    Attributes
    ----------
    velocity : ndarray, shape (n, 3)
        Along the grid's axes, m/s; the same at all exposures of a strip.
    rate : ndarray, shape (n, 3)
        Of rotation, about the body's axes, rad/s.
    """

    velocity: Array
    rate: Array


STRAIGHT = 0.2
"""Root mean square distance of exposures from uniform motion on a line, over the length of their
strip, above which they have no common velocity."""


def motion_of(block: Block, *, delays: Sequence[str] = DELAYS) -> Motion:
    """Return the velocity of every strip, and the rate of rotation from neighbours in it.

    Parameters
    ----------
    block : Block
    delays : sequence of str
        Those that are asked for, names of `parameters.DELAYS`: the velocity is zero without
        ``"delay"``, the rate without ``"attitude_delay"``.

    Raises
    ------
    AdjustmentError
        Where an exposure has no time, no neighbour in its strip, or the time of its neighbour, or
        where a strip is not straight.

    Notes
    -----
    The velocity is the slope of the line that fits the recorded positions of a strip over time.
    That of neighbours alone would be no observation without error: what wind, and the moment of
    exposure, move one position against the next by is divided by a second or two. A delay would be
    estimated from this, and come out too small where the aircraft flies more steadily.

    The rate is at t_i the slope of the parabola through an exposure and its two neighbours; at
    either end of a strip, that of the line to the one neighbour. A steady turn comes out exactly.
    Of an oscillation of period T, sampled at intervals h, the share sin(2 pi h / T) / (2 pi h / T)
    is seen: 94 % at T = 10 h, 64 % at T = 4 h, nothing at T = 2 h. White errors sigma of the
    recorded attitudes are errors sigma / (sqrt(2) h) of their slopes.
    """
    trajectory, strips = block.trajectory, strips_of(block)
    _require_neighbours(block, strips)
    velocity, rate = np.zeros((2, len(trajectory), 3))
    for strip, name in enumerate(strips.names):
        rows = np.flatnonzero(strips.idx == strip)
        rows = rows[np.argsort(strips.elapsed[rows], kind="stable")]
        step = np.diff(strips.elapsed[rows])
        if np.any(step <= 0):
            again = trajectory.exposures[rows[int(np.argmin(step)) + 1]]
            msg = f"a delay cannot be estimated: {again!r} has the time of another of its strip"
            raise AdjustmentError(msg)
        if "delay" in delays:
            velocity[rows] = _uniform(trajectory.T_m_b.r[rows], strips.elapsed[rows], name)
        if "attitude_delay" in delays:
            rate[rows] = _rates(trajectory.T_m_b.R[rows], step)
    return Motion(velocity=transform(trajectory.R_g_m, velocity), rate=rate)


def _uniform(r: Array, elapsed: Array, strip: str) -> Array:
    """Return the velocity with which positions of a strip are passed at times from its middle."""
    velocity: Array = elapsed @ r / (elapsed @ elapsed)
    off = r - r.mean(axis=0) - elapsed[:, None] * velocity
    length = np.linalg.norm(velocity) * np.ptp(elapsed)
    if np.sqrt(np.mean(np.sum(off**2, axis=1))) > STRAIGHT * length:
        msg = (
            f"a delay cannot be estimated: strip {str(strip)!r} is not flown straight at one speed"
        )
        raise AdjustmentError(msg)
    return velocity


def has_times(trajectory: Trajectory) -> bool:
    """Tell whether all exposures have a time."""
    return bool(np.isfinite(trajectory.time_s).all())


def _require_neighbours(block: Block, strips: Strips) -> None:
    """Raise where an exposure has no time, or none before or after it in its strip."""
    cannot = "a delay cannot be estimated"
    if not has_times(block.trajectory):
        raise AdjustmentError(f"{cannot}: trajectory.csv needs its column time_s")
    alone = np.flatnonzero(np.broadcast_to(strips.idx, len(block.trajectory)) < 0)
    if len(alone):
        name = block.trajectory.exposures[alone[0]]
        which = "exposure" if len(alone) == 1 else f"{len(alone)} exposures, the first"
        msg = f"{cannot}: no neighbour in a strip tells the velocity of {which} {name!r}"
        raise AdjustmentError(msg)


def _rates(R: Array, step: Array) -> Array:
    """Return the slopes of attitudes along one strip, about the body's axes."""
    turned = log(np.swapaxes(R[:-1], -1, -2) @ R[1:])  # about an axis that both share
    mean = turned / step[:, None]
    before, after = step[:-1, None], step[1:, None]
    inside = (mean[:-1] * after + mean[1:] * before) / (before + after)
    return np.concatenate([mean[:1], inside, mean[-1:]])
