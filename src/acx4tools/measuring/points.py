"""Points of many rays: a corner of one picture with its places in all others."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib import expected
from acx4lib.expected import NOT_GIVEN, Array, Index, Mask
from acx4tools.measuring.pairs import Found

WANTED = 3
"""Rays of a point, wherever the block has as many pictures of its place."""

Pairs = Mapping[tuple[int, int], tuple[Found, Found]]
"""For views i < j, the corners of i found in j, and those of j found in i."""


@dataclass(frozen=True, kw_only=True, eq=False)
class TieRays:
    """Measurements of points; those of a point share one number.

    Attributes
    ----------
    point, view : ndarray, shape (n,)
    colrow : ndarray, shape (n, 2)
        Pixels of the pictures as matched.
    sigma_px : ndarray, shape (n,)
    of_head : ndarray of bool, shape (n,)
        Whether the camera is that of the point's corner, as all are by default.
    """

    point: Index
    view: Index
    colrow: Array
    sigma_px: Array
    of_head: Mask = NOT_GIVEN

    def __post_init__(self) -> None:
        expected.default(self, "of_head", lambda: np.ones(len(self.point), dtype=bool))

    def __getitem__(self, keep: Index | Mask) -> TieRays:
        """Select measurements."""
        return expected.part_of(self, keep)

    def __len__(self) -> int:
        """Count the measurements."""
        return len(self.point)


def joined(corners: Sequence[Index], pairs: Pairs, camera: Index) -> TieRays:
    """Return one point for every corner that was found anywhere, with all its rays.

    The corner itself is a ray of the point. Of the variance of a difference, one half belongs to
    either picture.

    Parameters
    ----------
    corners : sequence of ndarray, shape (n, 2)
        Of every view.
    pairs : mapping
    camera : ndarray, shape (n_views,)
    """
    first = np.cumsum([0, *(len(at) for at in corners)])
    parts = [
        (first[master] + found.which, np.full(len(found), view), found)
        for (i, j), both in pairs.items()
        for master, view, found in ((i, j, both[0]), (j, i, both[1]))
    ]
    point = np.concatenate([np.zeros(0, np.intp), *(p for p, _, _ in parts)])
    view = np.concatenate([np.zeros(0, np.intp), *(v for _, v, _ in parts)])
    sigma = np.concatenate([np.zeros((0, 2)), *(found.sigma_px for _, _, found in parts)])
    colrow = np.concatenate([np.zeros((0, 2)), *(found.colrow for _, _, found in parts)])
    own, inverse, count = np.unique(point, return_inverse=True, return_counts=True)
    mean_square = np.bincount(inverse, sigma[:, 0] ** 2) / count
    master = np.searchsorted(first, own, side="right") - 1
    at = np.concatenate([np.zeros((0, 2), np.intp), *corners])[own].astype(float)
    every = TieRays(
        point=np.concatenate([own, point]),
        view=np.concatenate([master, view]),
        colrow=np.concatenate([at, colrow]),
        sigma_px=np.sqrt(np.concatenate([mean_square, sigma[:, 1] ** 2]) / 2),
        of_head=np.concatenate([own >= 0, camera[view] == camera[master[inverse]]]),
    )
    return every[np.lexsort((every.view, every.point))]


def chosen(rays: TieRays, shown: Index, *, apart_px: float) -> TieRays:
    """Return points of enough rays that do not measure the same texture twice.

    Of points closer to each other in a picture than `apart_px`, the one with the most rays stays:
    two on the same texture share its noise, and would count as two. Only pictures of the camera in
    which a point is a corner count, so that every head has its points.

    Parameters
    ----------
    rays : TieRays
        Ordered by point.
    shown : ndarray, shape (n,)
        For every ray, the number of pictures that show its point's place.
    apart_px : float
        Least distance of two points in a picture, px.
    """
    point, start, count = np.unique(rays.point, return_index=True, return_counts=True)
    enough = count >= np.minimum(np.maximum(shown[start], 2), WANTED)
    worst = np.maximum.reduceat(rays.sigma_px, start) if len(point) else np.zeros(0)
    taken: set[tuple[int, int, int]] = set()
    keep = np.zeros(len(rays), dtype=bool)
    for i in np.lexsort((worst, -count)).tolist():
        own = slice(start[i], start[i] + count[i])
        cell = np.floor(rays.colrow[own] / apart_px).astype(int)
        seen = zip(rays.view[own], cell, rays.of_head[own], strict=True)
        places = [(int(v), int(c), int(r)) for v, (c, r), here in seen if here]
        if enough[i] and not any(_near(place, taken) for place in places):
            taken.update(places)
            keep[own] = True
    return rays[keep]


def _near(place: tuple[int, int, int], taken: set[tuple[int, int, int]]) -> bool:
    """Tell whether a cell or one of its neighbours in a picture is taken."""
    view, col, row = place
    return any((view, col + i, row + j) in taken for i in (-1, 0, 1) for j in (-1, 0, 1))
