"""Rows of the synthetic image weighed, sampled and blended, compiled: what `rendering` asks for.

The image is cut into square cells, at whose corners the positions in the heads are known; between
them positions are bilinear. This module knows neither cameras nor files.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from acx4lib.compiling import compiled, inlined
from acx4lib.expected import Array, Raster

SHOULDER = 4.0  # slope of equalised grey values over those just below saturation


@compiled
def blend(
    out: Raster,
    images: tuple[Raster, ...],
    nodes: Array,
    factors: Array,
    step: int,
    skip: int,
    feather: float,
) -> None:
    """Fill rows of an image with those of several heads, equalised and blended.

    Parameters
    ----------
    out : ndarray of uint8 or uint16, shape (height, width, bands)
        0 where no head sees.
    images : tuple of ndarray of the same type, shape (rows, cols, bands)
        Of the heads, 2 x 2 px at least.
    nodes : ndarray, shape (n_heads, m + 1, n + 1, 2)
        col, row in each head's image at the corners of the cells, px; NaN where it does not see.
    factors : ndarray of float32, shape (n_heads, m + 1, n + 1, bands)
        By which grey values are multiplied, at the same corners.
    step : int
        Side of a cell, px.
    skip : int
        Rows of the first cells that lie above `out`.
    feather : float
        Width of the transition between heads, px; 0 for a seam.
    """
    height, width, bands = out.shape
    top = np.float32(np.iinfo(out.dtype).max)
    weights = np.empty((len(images), step, step), np.float32)
    sees = np.empty(len(images), np.bool_)
    total = np.empty((step, step, bands), np.float32)
    # heads are mounted crosswise: downwards here is along rows there
    for j in range(nodes.shape[2] - 1):
        for i in range(nodes.shape[1] - 1):
            n_seeing, n_whole = 0, 0
            for k in range(len(images)):
                rows, cols = images[k].shape[:2]
                low, high = _set_depths(weights, nodes, k, i, j, step, cols, rows)
                sees[k] = high > 0
                n_seeing += high > 0
                n_whole += low > 0
            alone = n_seeing == n_whole == 1  # most cells: one head sees all of it, no other any
            if not alone:
                _weigh(weights, np.float32(feather))
            total[:] = 0
            for k in range(len(images)):
                if sees[k]:
                    if alone:
                        weights[k] = 1
                    _add_samples(total, weights, images[k], nodes, factors, k, i, j, step, top)
            row, col = i * step - skip, j * step
            for r in range(max(-row, 0), min(step, height - row)):
                for c in range(min(step, width - col)):
                    for band in range(bands):
                        value = min(max(total[r, c, band], np.float32(0)), top)
                        out[row + r, col + c, band] = int(value + np.float32(0.5))


@inlined
def _row_of_cell(
    nodes: Array, k: int, i: int, j: int, r: int, step: int
) -> tuple[float, float, float, float]:
    """Return the position of a row of a cell in head k, and the way to the next pixel: x, y."""
    v = r / step
    x_0 = nodes[k, i, j, 0] + v * (nodes[k, i + 1, j, 0] - nodes[k, i, j, 0])
    y_0 = nodes[k, i, j, 1] + v * (nodes[k, i + 1, j, 1] - nodes[k, i, j, 1])
    x_1 = nodes[k, i, j + 1, 0] + v * (nodes[k, i + 1, j + 1, 0] - nodes[k, i, j + 1, 0])
    y_1 = nodes[k, i, j + 1, 1] + v * (nodes[k, i + 1, j + 1, 1] - nodes[k, i, j + 1, 1])
    return x_0, (x_1 - x_0) / step, y_0, (y_1 - y_0) / step


@inlined
def _set_depths(
    depths: Array, nodes: Array, k: int, i: int, j: int, step: int, width: int, height: int
) -> tuple[Any, Any]:
    """Set the distances of a cell's pixels from the border of head k; -1 where it does not see.

    Return the smallest and the largest.
    """
    low, high = np.float32(width), np.float32(-1)
    half, right, bottom = np.float32(0.5), np.float32(width - 0.5), np.float32(height - 0.5)
    for r in range(step):
        x_0, dx, y_0, dy = _row_of_cell(nodes, k, i, j, r, step)
        if np.isnan(x_0 + dx + y_0 + dy):  # one of the corners
            for c in range(step):
                depths[k, r, c] = -1
            low = np.float32(-1)
        else:
            for c in range(step):
                x, y = np.float32(x_0 + c * dx), np.float32(y_0 + c * dy)
                depth = min(x + half, right - x, y + half, bottom - y)
                depths[k, r, c] = depth
                low, high = min(low, depth), max(high, depth)
    return low, high


@inlined
def _weigh(weights: Array, width: Any) -> None:
    """Replace depths by weights, whose sum is 1 where any head sees and 0 elsewhere."""
    zero = np.float32(0)
    n, rows, cols = weights.shape
    for i in range(rows):
        for j in range(cols):
            deepest, total = zero, zero
            for k in range(n):
                deepest = max(deepest, weights[k, i, j])
            for k in range(n):
                d = weights[k, i, j]
                if width > 0:
                    w = max(zero, min(d, d - deepest + width))
                else:  # of several heads with the same distance, the first
                    w = np.float32(d == deepest and d > 0 and total == 0)
                weights[k, i, j] = w
                total += w
            if total > 0:
                for k in range(n):
                    w = weights[k, i, j]
                    weights[k, i, j] = w / total if w < total else np.float32(1)


@inlined
def _add_samples(
    total: Array,
    weights: Array,
    image: Raster,
    nodes: Array,
    factors: Array,
    k: int,
    i: int,
    j: int,
    step: int,
    top: Any,
) -> None:
    """Add the bilinear samples of head k to a cell, each equalised and times its weight.

    The outermost pixels of an image are extended without end. What is saturated stays saturated:
    equalised values rise steeply to the largest one just below it.
    """
    height, width, bands = image.shape
    share = np.float32(1 / step)
    for r in range(step):
        x_0, dx, y_0, dy = _row_of_cell(nodes, k, i, j, r, step)
        t = np.float32(r) * share
        for c in range(step):
            weight = weights[k, r, c]
            if weight == 0:
                continue
            x = min(max(x_0 + c * dx, 0.0), width - 1.0)
            y = min(max(y_0 + c * dy, 0.0), height - 1.0)
            col, row = min(int(x), width - 2), min(int(y), height - 2)
            u, v, s = np.float32(x - col), np.float32(y - row), np.float32(c) * share
            for band in range(bands):
                upper_left = np.float32(image[row, col, band])
                upper = upper_left + u * (np.float32(image[row, col + 1, band]) - upper_left)
                lower_left = np.float32(image[row + 1, col, band])
                lower = lower_left + u * (np.float32(image[row + 1, col + 1, band]) - lower_left)
                value = upper + v * (lower - upper)
                left = factors[k, i, j, band]
                left += t * (factors[k, i + 1, j, band] - left)
                right = factors[k, i, j + 1, band]
                right += t * (factors[k, i + 1, j + 1, band] - right)
                steep = np.float32(SHOULDER) * value - np.float32(SHOULDER - 1) * top
                value = max(value * (left + s * (right - left)), min(steep, top))
                total[r, c, band] += weight * value


@compiled
def halve_into(small: Raster, image: Raster) -> None:
    """Fill an image of half the size with means of 2 x 2 pixels, without those that are zero.

    Parameters
    ----------
    small : ndarray of image's type, shape (ceil(rows / 2), ceil(cols / 2), bands)
        Means are rounded half up; 0 where all pixels are.
    image : ndarray of uint8 or uint16, shape (rows, cols, bands)
        A last odd row or column counts twice.
    """
    rows, cols, bands = image.shape
    for i in range(small.shape[0]):
        lower = min(2 * i + 1, rows - 1)
        for j in range(small.shape[1]):
            right = min(2 * j + 1, cols - 1)
            for band in range(bands):
                a, b = int(image[2 * i, 2 * j, band]), int(image[2 * i, right, band])
                c, d = int(image[lower, 2 * j, band]), int(image[lower, right, band])
                n = max((a > 0) + (b > 0) + (c > 0) + (d > 0), 1)
                total = a + b + c + d
                small[i, j, band] = (total + 2) // 4 if n == 4 else (total + n // 2) // n
