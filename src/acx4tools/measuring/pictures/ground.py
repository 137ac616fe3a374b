"""The ground under a block, as far as it is known: a height for every place."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from acx4lib import expected
from acx4lib.expected import Array

CELLS = 48
"""Cells along the longer side of a surface; between them heights are bilinear."""

SMOOTH = (1.0, 3.0, 9.0, 27.0)
"""Widths, in cells, of the means from which a cell takes its height: the first that has points."""

_LEAST_WEIGHT = 0.3


@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """Heights of the ground in the mapping frame.

    Attributes
    ----------
    origin : ndarray, shape (2,)
        x, y of the first cell's middle, m.
    cell_m : float
    z : ndarray, shape (rows, cols)
        m; rows count along y. Beyond the surface the nearest height holds.
    """

    origin: Array
    cell_m: float
    z: Array

    def __post_init__(self) -> None:
        expected.shape("origin", self.origin, (2,))
        expected.positive_number("cell_m", self.cell_m)
        expected.shape("z", self.z, ("rows", "cols"))
        expected.finite("z", self.z)

    def heights(self, xy: Array) -> Array:
        """Return the heights at places, shape (n,), m."""
        last = np.array(self.z.shape[::-1]) - 1
        at = np.clip((xy - self.origin) / self.cell_m, 0, last)
        i = np.minimum(at.astype(np.intp), np.maximum(last - 1, 0))
        (tx, ty), (c, r) = (at - i).T, i.T
        c1, r1 = np.minimum(c + 1, last[0]), np.minimum(r + 1, last[1])
        low = (1 - tx) * self.z[r, c] + tx * self.z[r, c1]
        high = (1 - tx) * self.z[r1, c] + tx * self.z[r1, c1]
        return np.asarray((1 - ty) * low + ty * high)


def level(z: float) -> Surface:
    """Return a plane of one height, m."""
    return Surface(origin=np.zeros(2), cell_m=1.0, z=np.full((1, 1), float(z)))


def through(x_m: Array) -> Surface:
    """Return a smooth surface through points of the ground.

    Parameters
    ----------
    x_m : ndarray, shape (n, 3)
        At least one point, m; single points that are far off its neighbours have little effect,
        as a cell takes the median of its points.
    """
    expected.shape("x_m", x_m, ("n", 3))
    origin = x_m[:, :2].min(axis=0)
    cell = max(float(np.ptp(x_m[:, :2], axis=0).max()) / (CELLS - 1), 1e-3)
    place = np.rint((x_m[:, :2] - origin) / cell).astype(np.intp)
    shape = tuple(place.max(axis=0)[::-1] + 1)
    z, seen = np.zeros(shape, np.float32), np.zeros(shape, np.float32)
    mean = float(np.median(x_m[:, 2]))
    order = np.lexsort((place[:, 0], place[:, 1]))
    flat = place[order, 1] * shape[1] + place[order, 0]
    for part in np.split(order, np.flatnonzero(np.diff(flat)) + 1):
        col, row = place[part[0]]
        z[row, col], seen[row, col] = np.median(x_m[part, 2]) - mean, 1
    return Surface(origin=origin, cell_m=cell, z=mean + _filled(z, seen).astype(float))


def _filled(z: Array, seen: Array) -> Array:
    """Return a smooth surface where only some cells are seen."""
    out, open_cells = np.zeros_like(z), np.ones(z.shape, bool)
    for width in SMOOTH:
        weight = cv2.GaussianBlur(seen, (0, 0), width, borderType=cv2.BORDER_CONSTANT)
        total = cv2.GaussianBlur(z * seen, (0, 0), width, borderType=cv2.BORDER_CONSTANT)
        enough = open_cells & (weight * 2 * np.pi * width**2 > _LEAST_WEIGHT)
        out[enough] = (total / np.maximum(weight, 1e-12))[enough]
        open_cells &= ~enough
    return out
