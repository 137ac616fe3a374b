"""Where, when and in which attitude a planned block is exposed.

An aircraft is never quite on its line, nor level, and that helps to tell lever arm and boresight
apart. So the exposures leave the line and the level as much as usual, the same in every run. The
simulator moves its aircraft as much, by chance.
"""

from __future__ import annotations

from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from acx4lib.expected import Array
from acx4lib.planning.plan import TURN_S, PlannedBlock, Strip

SCATTER_M = np.array([6.0, 8.0, 5.0])
"""Standard deviations of an exposure's place, forward, left and up."""

MOTION_DEG = np.array([1.1, 0.9, 0.8])
"""Standard deviations of roll, pitch and yaw."""

CRAB_DEG = 4.0
"""Largest angle, by side wind, between heading and course of a strip."""

_STEPS = np.sqrt(np.array([2.0, 3.0, 5.0, 7.0, 11.0, 13.0]))
"""Their multiples, without whole parts, are spread evenly."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Exposures:
    """The exposures of a planned block.

    Attributes
    ----------
    names, strips : tuple of str
    local : ndarray, shape (n, 2)
        Forward and left of the block's middle, m.
    flying_height_m, course_deg, time_s : ndarray, shape (n,)
    rph_deg : ndarray, shape (n, 3)
        Roll, pitch, heading from grid north.
    """

    names: tuple[str, ...]
    strips: tuple[str, ...]
    local: Array
    flying_height_m: Array
    course_deg: Array
    time_s: Array
    rph_deg: Array


def exposures(planned: PlannedBlock) -> Exposures:
    """Return where a block is exposed, strip by strip."""
    strips = tuple(planned.strips.values())
    counts = [strip.n_exposures for strip in strips]
    names = tuple(name for name, n in zip(planned.strips, counts, strict=True) for _ in range(n))
    number = np.concatenate([np.arange(n) for n in counts])
    course = np.repeat([strip.course_deg for strip in strips], counts)
    moved = _unsteady(len(names))
    heading = course + CRAB_DEG * np.repeat(_evenly(len(strips))[:, 0] * 2 - 1, counts)
    return Exposures(
        names=tuple(f"{name}-{i + 1:02d}" for name, i in zip(names, number, strict=True)),
        strips=names,
        local=np.concatenate([_along(strip, planned.area.course_deg) for strip in strips])
        + _turned(moved[:, :2] * SCATTER_M[:2], course - planned.area.course_deg),
        flying_height_m=np.repeat([strip.flying_height_m for strip in strips], counts)
        + moved[:, 2] * SCATTER_M[2],
        course_deg=course,
        time_s=np.repeat(_begins(strips), counts)
        + number * np.repeat([strip.base_m / strip.speed_m_s for strip in strips], counts),
        rph_deg=moved[:, 3:] * MOTION_DEG + heading[:, None] * np.array([0.0, 0.0, 1.0]),
    )


def _evenly(n: int) -> Array:
    """Return numbers from 0 to 1 that are spread evenly in every column, shape (n, 6)."""
    out: Array = (np.arange(1, n + 1)[:, None] * _STEPS) % 1
    return out


def _unsteady(n: int) -> Array:
    """Return numbers of a normal distribution, at most 2, without chance, shape (n, 6)."""
    normal = NormalDist()
    values = [normal.inv_cdf(max(share, 1e-9)) for share in _evenly(n).ravel().tolist()]
    out: Array = np.clip(values, -2.0, 2.0).reshape(n, 6)
    return out


def _turned(along: Array, turn_deg: Array) -> Array:
    """Return ahead and aside of strips as forward and left of the block, shape (n, 2)."""
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    return np.column_stack([c * along[:, 0] + s * along[:, 1], c * along[:, 1] - s * along[:, 0]])


def flying_time_s(strips: tuple[Strip, ...]) -> float:
    """Return the time from the first exposure to the last, turns included."""
    if not strips:
        return 0.0
    return float(_begins(strips)[-1]) + _on_strip(strips[-1])


def _on_strip(strip: Strip) -> float:
    return (strip.n_exposures - 1) * strip.base_m / strip.speed_m_s


def _begins(strips: tuple[Strip, ...]) -> Array:
    """Return the time of the first exposure of every strip."""
    steps = [0.0, *(_on_strip(strip) + TURN_S for strip in strips[:-1])]
    return np.cumsum(np.array(steps))


def _along(strip: Strip, block_course_deg: float) -> Array:
    """Return the places of a strip's exposures, forward and left of the block's middle."""
    n = strip.n_exposures
    way = (np.arange(n) - (n - 1) / 2) * strip.base_m
    turn = np.full(n, strip.course_deg - block_course_deg)
    return np.array([strip.forward_m, strip.left_m]) + _turned(
        np.column_stack([way, np.zeros(n)]), turn
    )
