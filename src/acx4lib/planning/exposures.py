"""Where, when and in which attitude a planned block is exposed.

An aircraft is never quite on its line, nor level, and that helps to tell lever arm and boresight
apart. So the exposures leave the line and the level as much as usual. The simulator moves its
aircraft as much, by chance. Here the wind 0 leaves it evenly, and every other wind by chance with
its own number: both are the same in every run.

The ground speed of a strip is constant: an exposure ahead of its place is late by as much.
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

IN_TURN = 0.4
"""Share of the base by which an exposure leaves its place along the strip at most."""

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


def exposures(planned: PlannedBlock, *, wind: int = 0) -> Exposures:
    """Return where a block is exposed, strip by strip.

    Parameters
    ----------
    planned : PlannedBlock
    wind : int
        Number of the wind that moves it.
    """
    strips = tuple(planned.strips.values())
    counts = [strip.n_exposures for strip in strips]
    names = tuple(name for name, n in zip(planned.strips, counts, strict=True) for _ in range(n))
    number = np.concatenate([np.arange(n) for n in counts])
    course = np.repeat([strip.course_deg for strip in strips], counts)
    base = np.repeat([strip.base_m for strip in strips], counts)
    speed = np.repeat([strip.speed_m_s for strip in strips], counts)
    moved, crab = _winds(len(names), len(strips), wind)
    ahead = np.clip(SCATTER_M[0] * moved[:, 0], -IN_TURN * base, IN_TURN * base)
    aside = SCATTER_M[1] * moved[:, 1]
    heading = course + CRAB_DEG * np.repeat(crab, counts)
    return Exposures(
        names=tuple(f"{name}-{i + 1:02d}" for name, i in zip(names, number, strict=True)),
        strips=names,
        local=np.concatenate([_along(strip, planned.area.course_deg) for strip in strips])
        + _turned(np.column_stack([ahead, aside]), course - planned.area.course_deg),
        flying_height_m=np.repeat([strip.flying_height_m for strip in strips], counts)
        + moved[:, 2] * SCATTER_M[2],
        course_deg=course,
        time_s=np.repeat(_begins(strips), counts) + (number * base + ahead) / speed,
        rph_deg=moved[:, 3:] * MOTION_DEG + heading[:, None] * np.array([0.0, 0.0, 1.0]),
    )


def _winds(n: int, n_strips: int, wind: int) -> tuple[Array, Array]:
    """Return numbers of a normal distribution, at most 2, (n, 6), and from -1 to 1, (n_strips,)."""
    if wind == 0:
        return _unsteady(n), _evenly(n_strips)[:, 0] * 2 - 1
    rng = np.random.default_rng(wind)
    return np.clip(rng.standard_normal((n, 6)), -2.0, 2.0), rng.uniform(-1.0, 1.0, n_strips)


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
