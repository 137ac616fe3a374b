"""Pixels weighed, sampled and blended, compiled: what `rendering` asks for.

A block of the image is a number of whole cells of the maps' grid. Positions in a head are bilinear
in a cell. This module knows neither cameras nor files.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from acx4lib.compiling import compiled, inlined
from acx4lib.expected import Array, Index, Raster

MOST_BANDS = 4
SHOULDER = 4.0  # slope of equalised grey values over those just below saturation


@compiled
def set_depths(depths: Array, nodes: Array, step: int, width: int, height: int) -> None:
    """Set the distances of a block's pixels from the border of a head's image, px.

    Parameters
    ----------
    depths : ndarray of float32, shape (rows * step, cols * step)
        Not positive where the head does not see.
    nodes : ndarray, shape (rows + 1, cols + 1, 2)
        col, row in the head's image at the corners of the block's cells, px; NaN if unknown.
    step : int
        Pixels from node to node.
    width, height : int
        Size of the head's image.
    """
    half, right, bottom = np.float32(0.5), np.float32(width - 0.5), np.float32(height - 0.5)
    for i in range(nodes.shape[0] - 1):
        for j in range(nodes.shape[1] - 1):
            for r in range(step):
                x_0, dx, y_0, dy = _row_of_cell(nodes, i, j, r, step)
                row = depths[i * step + r, j * step : (j + 1) * step]
                if np.isnan(x_0 + dx + y_0 + dy):  # one of the corners
                    row[:] = -1
                    continue
                for c in range(step):
                    x, y = np.float32(x_0 + c * dx), np.float32(y_0 + c * dy)
                    row[c] = min(x + half, right - x, y + half, bottom - y)


@inlined
def _row_of_cell(
    nodes: Array, i: int, j: int, r: int, step: int
) -> tuple[float, float, float, float]:
    """Return the position of a row of a cell in the head, and the way to the next pixel: x, y."""
    v = r / step
    x_0 = nodes[i, j, 0] + v * (nodes[i + 1, j, 0] - nodes[i, j, 0])
    y_0 = nodes[i, j, 1] + v * (nodes[i + 1, j, 1] - nodes[i, j, 1])
    x_1 = nodes[i, j + 1, 0] + v * (nodes[i + 1, j + 1, 0] - nodes[i, j + 1, 0])
    y_1 = nodes[i, j + 1, 1] + v * (nodes[i + 1, j + 1, 1] - nodes[i, j + 1, 1])
    return x_0, (x_1 - x_0) / step, y_0, (y_1 - y_0) / step


@compiled
def weigh(weights: Array, feather: float) -> None:
    """Replace depths by weights, whose sum is 1 where any head sees and 0 elsewhere.

    Parameters
    ----------
    weights : ndarray of float32, shape (n_heads, rows, cols)
        Depths before.
    feather : float
        Width of the transition between heads, px; 0 for a seam.
    """
    zero, width = np.float32(0), np.float32(feather)
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


@compiled
def add_samples(
    total: Array, weights: Array, image: Raster, nodes: Array, factors: Array, cubic: bool
) -> None:
    """Add the samples of a head to a block, each equalised and times its weight.

    The outermost pixels of an image are extended without end. What is saturated stays saturated:
    equalised values rise steeply to the largest one just below it.

    Parameters
    ----------
    total : ndarray of float32, shape (rows * step, cols * step, bands)
    weights : ndarray of float32, shape (rows * step, cols * step)
        Where a weight is zero, the image is not read.
    image : ndarray of uint8 or uint16, shape (height, width, bands)
        2 x 2 px at least.
    nodes : ndarray, shape (rows + 1, cols + 1, 2)
        As in `set_depths`.
    factors : ndarray of float32, shape (rows + 1, cols + 1, bands)
        By which samples are multiplied, at the corners of the cells; without bands for 1.
    cubic : bool
        Whether samples are bicubic after Catmull and Rom, not bilinear.
    """
    rows, cols = nodes.shape[0] - 1, nodes.shape[1] - 1
    step, bands = total.shape[0] // rows, total.shape[2]
    sample, factor, growth = np.empty((3, MOST_BANDS), np.float32)
    top = np.float32(np.iinfo(image.dtype).max)
    for j in range(cols):  # heads are mounted crosswise: downwards here is along rows there
        for i in range(rows):
            for r in range(step):
                x_0, dx, y_0, dy = _row_of_cell(nodes, i, j, r, step)
                _set_factors(factor, growth, factors, i, j, r, step)
                for c in range(step):
                    weight = weights[i * step + r, j * step + c]
                    if weight == 0:
                        continue
                    if cubic:
                        _cubic(sample, image, x_0 + c * dx, y_0 + c * dy)
                    else:
                        _bilinear(sample, image, x_0 + c * dx, y_0 + c * dy)
                    for band in range(bands):
                        value = _equalised(
                            sample[band], factor[band] + np.float32(c) * growth[band], top
                        )
                        total[i * step + r, j * step + c, band] += weight * value


@inlined
def _set_factors(
    factor: Array, growth: Array, factors: Array, i: int, j: int, r: int, step: int
) -> None:
    """Set the factors of the first pixel in a row of a cell, and their growth to the next one."""
    share = np.float32(1 / step)
    v = np.float32(r) * share
    factor[:], growth[:] = 1, 0
    for band in range(factors.shape[2]):
        left = factors[i, j, band] + v * (factors[i + 1, j, band] - factors[i, j, band])
        right = factors[i, j + 1, band] + v * (
            factors[i + 1, j + 1, band] - factors[i, j + 1, band]
        )
        factor[band], growth[band] = left, (right - left) * share


@inlined
def _equalised(value: Any, factor: Any, top: Any) -> Any:
    """Return a value times a factor, which is made to reach `top` where it is saturated."""
    steep = np.float32(SHOULDER) * value - np.float32(SHOULDER - 1) * top
    return max(value * factor, min(steep, top))


@inlined
def _bilinear(sample: Array, image: Raster, x: float, y: float) -> None:
    height, width, bands = image.shape
    x, y = min(max(x, 0.0), width - 1.0), min(max(y, 0.0), height - 1.0)
    col, row = min(int(x), width - 2), min(int(y), height - 2)
    u, v = np.float32(x - col), np.float32(y - row)
    for band in range(bands):
        a, b = np.float32(image[row, col, band]), np.float32(image[row, col + 1, band])
        c, d = np.float32(image[row + 1, col, band]), np.float32(image[row + 1, col + 1, band])
        left, right = a + v * (c - a), b + v * (d - b)
        sample[band] = left + u * (right - left)


@inlined
def _cubic(sample: Array, image: Raster, x: float, y: float) -> None:
    height, width, bands = image.shape
    x, y = min(max(x, 0.0), width - 1.0), min(max(y, 0.0), height - 1.0)
    col, row = int(x), int(y)
    across, down = _catmull_rom(np.float32(x - col)), _catmull_rom(np.float32(y - row))
    for band in range(bands):
        sample[band] = 0
    for r in range(4):
        i = min(max(row + r - 1, 0), height - 1)
        for c in range(4):
            j = min(max(col + c - 1, 0), width - 1)
            for band in range(bands):
                sample[band] += down[r] * across[c] * np.float32(image[i, j, band])


@inlined
def _catmull_rom(t: Any) -> tuple[Any, Any, Any, Any]:
    """Return the weights of four pixels for a place at t between the two in the middle."""
    half = np.float32(0.5)
    return (
        half * t * (t * (np.float32(2) - t) - np.float32(1)),
        half * (t * t * (np.float32(3) * t - np.float32(5)) + np.float32(2)),
        half * t * (t * (np.float32(4) - np.float32(3) * t) + np.float32(1)),
        half * t * t * (t - np.float32(1)),
    )


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
                small[i, j, band] = (a + b + c + d + n // 2) // n


# --- Means of small patches of an image, and what of them is saturated, compiled


@compiled
def patch_means(image: Array, at: Array, mean: Array, peak: Array, often: Index) -> None:
    """Fill in the means of bilinear samples, and the largest of the pixels that they are made of.

    Count how often the pixel right of and below each sample has each value: enough pixels to tell
    how frequent a value is.

    Parameters
    ----------
    image : ndarray, shape (rows, cols, bands)
    at : ndarray, shape (n, samples, 2)
        col, row of the samples of each patch; they have pixels on all sides.
    mean : ndarray, shape (n, bands)
    peak : ndarray of the image's type, shape (n, bands)
    often : ndarray of int64, shape (bands, values)
        To be added to.
    """
    n, samples = at.shape[:2]
    bands = image.shape[2]
    total = np.empty(bands)
    for p in range(n):
        total[:] = 0.0
        peak[p] = 0
        for s in range(samples):
            col, row = int(at[p, s, 0]), int(at[p, s, 1])
            x, y = np.float32(at[p, s, 0] - col), np.float32(at[p, s, 1] - row)
            for k in range(4):
                down, across = k // 2, k % 2
                weight = abs(np.float32(1 - across) - x) * abs(np.float32(1 - down) - y)
                for band in range(bands):
                    value = image[row + down, col + across, band]
                    total[band] += np.float64(value) * np.float64(weight)
                    peak[p, band] = max(peak[p, band], value)
                    if k == 3:
                        often[band, value] += 1
        for band in range(bands):
            mean[p, band] = total[band] / samples
