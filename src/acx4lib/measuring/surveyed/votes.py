"""Which spots are targets: those that all pictures and all points agree on.

The points of a block are found where the trajectory puts them but for an error that changes
smoothly over the ground. A target is off by this error in every picture; other bright spots are
anywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib.expected import Array, Index

SAME_POINT_PX, OTHER_POINT_PX = 3.0, 6.0
"""Largest differences between offsets of one point in two pictures, and of two points."""

OTHER_POINTS = 0.25
"""Weight of the vote of another point."""

ALIKE = 1.5
"""Largest ratio of the diameters on the ground of two targets."""


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A spot that may be a surveyed point.

    Attributes
    ----------
    point, view : int
    offset_m : tuple of float
        On the ground, from where the point should be.
    pixel_m : float
        Size of a pixel on the ground.
    radius_m : float
    bright : bool
    correlation : float
    colrow : tuple of float
    sigma_px : float
    """

    point: int
    view: int
    offset_m: tuple[float, float]
    pixel_m: float
    radius_m: float
    bright: bool
    correlation: float
    colrow: tuple[float, float]
    sigma_px: float


def elected(candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return the candidates that are targets, one at most for a point in a picture.

    Parameters
    ----------
    candidates : sequence of Candidate
    """
    if not candidates:
        return []
    votes = _votes(candidates)
    best: dict[tuple[int, int], int] = {}
    for k, one in enumerate(candidates):
        other = best.get((one.point, one.view))
        if other is None or votes[k] > votes[other]:
            best[one.point, one.view] = k
    return [candidates[k] for k in sorted(best.values()) if votes[k] >= 1.0]


def _votes(candidates: Sequence[Candidate]) -> Array:
    """Return how much each candidate is supported by those of other pictures and points."""
    offset = np.array([c.offset_m for c in candidates])
    pixel = np.array([c.pixel_m for c in candidates])
    radius = np.log([c.radius_m for c in candidates])
    bright = np.array([c.bright for c in candidates])
    point, view = (np.array([getattr(c, n) for c in candidates]) for n in ("point", "view"))
    score = np.array([c.correlation for c in candidates])
    out = np.zeros(len(candidates))
    for k in range(len(candidates)):
        away = np.hypot(*(offset - offset[k]).T) / np.maximum(pixel, pixel[k])
        alike = (bright == bright[k]) & (np.abs(radius - radius[k]) < np.log(ALIKE))
        same = alike & (point == point[k]) & (view != view[k]) & (away < SAME_POINT_PX)
        other = alike & (point != point[k]) & (away < OTHER_POINT_PX)
        out[k] = _once(view[same]) + OTHER_POINTS * _once(point[other])
    return out + 0.1 * score * (out > 0)


def _once(who: Index) -> int:
    """Return how many different ones there are."""
    return len(np.unique(who))
