"""Where and when a planned block is exposed: level, on course, at equal distances."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib.expected import Array
from acx4lib.planning.plan import TURN_S, PlannedBlock, Strip


@dataclass(frozen=True, kw_only=True, eq=False)
class Exposures:
    """The exposures of a planned block.

    Attributes
    ----------
    names, strips : tuple of str
    local : ndarray, shape (n, 2)
        Forward and left of the block's middle, m.
    flying_height_m, course_deg, time_s : ndarray, shape (n,)
    """

    names: tuple[str, ...]
    strips: tuple[str, ...]
    local: Array
    flying_height_m: Array
    course_deg: Array
    time_s: Array


def exposures(planned: PlannedBlock) -> Exposures:
    """Return where a block is exposed, strip by strip."""
    strips = tuple(planned.strips.values())
    counts = [strip.n_exposures for strip in strips]
    names = tuple(name for name, n in zip(planned.strips, counts, strict=True) for _ in range(n))
    number = np.concatenate([np.arange(n) for n in counts])
    return Exposures(
        names=tuple(f"{name}-{i + 1:02d}" for name, i in zip(names, number, strict=True)),
        strips=names,
        local=np.concatenate([_along(strip, planned.area.course_deg) for strip in strips]),
        flying_height_m=np.repeat([strip.flying_height_m for strip in strips], counts),
        course_deg=np.repeat([strip.course_deg for strip in strips], counts),
        time_s=np.repeat(_begins(strips), counts)
        + number * np.repeat([strip.base_m / strip.speed_m_s for strip in strips], counts),
    )


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
    return np.cumsum(steps)


def _along(strip: Strip, block_course_deg: float) -> Array:
    """Return the places of a strip's exposures, forward and left of the block's middle."""
    turn = np.radians(strip.course_deg - block_course_deg)
    way = (np.arange(strip.n_exposures) - (strip.n_exposures - 1) / 2) * strip.base_m
    ahead = np.array([np.cos(turn), -np.sin(turn)])
    return np.array([strip.forward_m, strip.left_m]) + way[:, None] * ahead
