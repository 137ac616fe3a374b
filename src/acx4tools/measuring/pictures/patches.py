"""Patches of a picture, resampled into the pixels of another one by way of the ground.

Strips that cross or oppose each other, and other flying heights, differ by turns and scales that
no search over shifts can find. After this only small shifts remain.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np

from acx4lib.expected import Array, Index
from acx4lib.tie_points.least_squares_matching import REACH
from acx4lib.tie_points.overlaps import grey, resample
from acx4tools.measuring.pictures.ground import Surface
from acx4tools.measuring.pictures.views import View, pixels_of_view, transferred

STEP = 8
"""Pixels between the nodes of a patch's map, which is bilinear between them."""

FINER = 1.1
"""A picture that has more pixels along the same line is smoothed before it is resampled."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Patches:
    """Patches around points, one below the other, all of the same odd size.

    Attributes
    ----------
    grey : ndarray of float32, shape (n * side, side)
        NaN where nothing is seen.
    side : int
    scale : ndarray, shape (n,)
        Pixels of the picture they come from, along one pixel of the patches; NaN if not seen.
    nodes : ndarray, shape (n, k, k, 2)
        Places in that picture of every `STEP`-th pixel; none of a picture's own patches.
    """

    grey: Array
    side: int
    scale: Array
    nodes: Array = field(default_factory=lambda: np.zeros((0, 1, 1, 2)))

    @property
    def middles(self) -> Index:
        """Return col, row of the patches' middles in the stack, shape (n, 2)."""
        n, half = len(self.scale), self.side // 2
        return np.column_stack([np.full(n, half), np.arange(n) * self.side + half])

    def places(self, which: Index, from_middle: Array) -> Array:
        """Return the places in the other picture of points of laid patches, shape (n, 2).

        By the same nodes as the grey values: on a rough ground, the way by the ground differs.

        Parameters
        ----------
        which : ndarray, shape (n,)
            Numbers of their patches.
        from_middle : ndarray, shape (n, 2)
            Distances of the points from the middles, px.
        """
        last = self.nodes.shape[1] - 2
        at = (from_middle + self.side // 2) / STEP
        i = np.clip(np.floor(at).astype(np.intp), 0, last)
        (tx, ty), (c, r) = np.moveaxis(at - i, 1, 0)[..., None], i.T
        low = (1 - tx) * self.nodes[which, r, c] + tx * self.nodes[which, r, c + 1]
        high = (1 - tx) * self.nodes[which, r + 1, c] + tx * self.nodes[which, r + 1, c + 1]
        return np.asarray((1 - ty) * low + ty * high)


def side_of(reach: int) -> int:
    """Return the side of patches that extend by at least `reach` px to every side."""
    return 2 * STEP * -(-reach // STEP) + 1


def own_patches(view: View, at: Index, side: int) -> Patches:
    """Return a picture's own patches around pixels, shape (n, 2), as they are."""
    image, half = pixels_of_view(view), side // 2
    out = np.full((len(at), side, side), np.nan, np.float32)
    rows, cols = image.shape[:2]
    for patch, (col, row) in zip(out, at.tolist(), strict=True):
        top, left = max(row - half, 0), max(col - half, 0)
        bottom, right = min(row + half + 1, rows), min(col + half + 1, cols)
        if bottom > top and right > left:
            place = np.s_[
                top - row + half : bottom - row + half, left - col + half : right - col + half
            ]
            patch[place] = grey(np.ascontiguousarray(image[top:bottom, left:right]))
    return Patches(grey=out.reshape(-1, side), side=side, scale=np.ones(len(at)))


def laid_patches(a: View, b: View, surface: Surface, at: Index, side: int) -> Patches:
    """Return the patches of picture b that lie where those of picture a around pixels lie."""
    image, k = pixels_of_view(b), (side - 1) // STEP + 1
    offset = np.stack(np.meshgrid(*[np.arange(k) * STEP - side // 2] * 2), axis=-1)
    nodes = transferred(a, b, surface, (at[:, None, None] + offset).reshape(-1, 2).astype(float))
    nodes = nodes.reshape(len(at), k, k, 2)
    scale = _scales(nodes, side)
    out = np.full((len(at), side, side), np.nan, np.float32)
    for i in np.flatnonzero(np.isfinite(scale)):
        _lay(image, nodes[i], float(scale[i]), out[i])
    return Patches(grey=out.reshape(-1, side), side=side, scale=scale, nodes=nodes)


def _scales(nodes: Array, side: int) -> Array:
    """Return the square root of a map's change of area for every patch, (n,)."""
    across, down = nodes[:, -1, -1] - nodes[:, 0, 0], nodes[:, -1, 0] - nodes[:, 0, -1]
    area = np.abs(across[:, 0] * down[:, 1] - across[:, 1] * down[:, 0]) / 2
    return np.sqrt(area) / (side - 1)


def _lay(image: np.ndarray, nodes: Array, scale: float, out: Array) -> None:
    """Fill in a patch by splines through the part of an image that it covers."""
    rim = REACH + 2
    size = np.array(image.shape[1::-1])
    flat = nodes.reshape(-1, 2)
    first = np.clip(np.floor(flat.min(axis=0)) - rim, 0, size).astype(np.intp)
    last = np.clip(np.ceil(flat.max(axis=0)) + rim, 0, size).astype(np.intp)
    if np.any(last - first < REACH):
        return
    part = grey(np.ascontiguousarray(image[first[1] : last[1], first[0] : last[0]]))
    if scale > FINER:
        part[:] = cv2.GaussianBlur(part, (0, 0), 0.5 * np.sqrt(scale**2 - 1))
    resample(part, nodes, STEP, first, out)
