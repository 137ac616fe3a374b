"""Which spots are targets: those that all pictures and all points agree on.

The points of a block are found where the trajectory puts them but for an error that changes
smoothly over the ground. A target is off by this error in every picture; other bright spots are
anywhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib.expected import Array

SAME_POINT_PX, OTHER_POINT_PX = 2.5, 3.0
"""Largest differences between offsets of one point in two pictures, and of two points."""

OTHERS = 2
"""Other points that must agree, where as many have candidates: a bright stone, too, is at the same
place in all pictures, but not beside every point."""

AROUND = 9
"""Measurements of the nearest other points, the median of whose offsets is compared."""

ALIKE, ALIKE_PX = 1.5, 0.5
"""Largest ratio, or else difference, of the radii on the ground of two targets."""


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A spot that may be a surveyed point.

    Attributes
    ----------
    point, view : int
    at_m : tuple of float
        x, y of the point in the mapping frame.
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
    at_m: tuple[float, float]
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
    by_views, by_points = _votes(candidates)
    enough = min(OTHERS, len({one.point for one in candidates}) - 1)
    votes = by_views + by_points + 0.1 * np.array([one.correlation for one in candidates])
    votes[(by_points < enough) | (by_views + by_points == 0)] = 0
    best: dict[tuple[int, int], int] = {}
    for k, one in enumerate(candidates):
        other = best.get((one.point, one.view))
        if votes[k] > 0 and (other is None or votes[k] > votes[other]):
            best[one.point, one.view] = k
    return _as_beside([candidates[k] for k in sorted(best.values())])


def _as_beside(chosen: Sequence[Candidate]) -> list[Candidate]:
    """Return the candidates with the offset of the points around them; two stones may agree."""
    out = []
    for one in chosen:
        others = [other for other in chosen if other.point != one.point]
        others.sort(key=lambda other: np.hypot(*np.subtract(other.at_m, one.at_m)))
        near = np.array([other.offset_m for other in others[:AROUND]] or [one.offset_m])
        away = np.hypot(*(np.median(near, axis=0) - one.offset_m))
        if away < OTHER_POINT_PX * one.pixel_m:
            out.append(one)
    return out


def _votes(candidates: Sequence[Candidate]) -> tuple[Array, Array]:
    """Return how many other pictures of its point, and other points, support each candidate."""
    offset = np.array([c.offset_m for c in candidates])
    pixel = np.array([c.pixel_m for c in candidates])
    radius = np.array([c.radius_m for c in candidates])
    bright = np.array([c.bright for c in candidates])
    point, view = (np.array([getattr(c, n) for c in candidates]) for n in ("point", "view"))
    out = np.zeros((2, len(candidates)))
    for k in range(len(candidates)):
        coarser = np.maximum(pixel, pixel[k])
        away = np.hypot(*(offset - offset[k]).T) / coarser
        sizes = np.maximum(radius, radius[k]) / np.minimum(radius, radius[k])
        alike = (sizes < ALIKE) | (np.abs(radius - radius[k]) < ALIKE_PX * coarser)
        alike &= bright == bright[k]
        same = alike & (point == point[k]) & (view != view[k]) & (away < SAME_POINT_PX)
        other = alike & (point != point[k]) & (away < OTHER_POINT_PX)
        out[:, k] = len(np.unique(view[same])), len(np.unique(point[other]))
    return out[0], out[1]
