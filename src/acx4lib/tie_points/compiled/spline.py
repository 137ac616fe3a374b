"""Grey values of an image, and cubic splines through them at many positions, compiled."""

from __future__ import annotations

import numpy as np

from acx4lib.compiling import compiled, inlined
from acx4lib.expected import Array


@inlined
def spline_weights(t: np.float32) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    """Return the weights of four cubic B-spline coefficients, a fraction t after the second."""
    sixth = np.float32(1.0 / 6.0)
    s = np.float32(1) - t
    first, last = sixth * s * s * s, sixth * t * t * t
    third = sixth * (np.float32(1) + np.float32(3) * t * (np.float32(1) + t * s))
    return first, np.float32(1) - first - third - last, third, last


@compiled
def mean_of_bands(image: Array, out: Array) -> None:
    """Fill `out` with the means of an image's bands, (rows, cols, bands)."""
    bands = image.shape[2]
    share = np.float32(1) / np.float32(bands)
    for row in range(image.shape[0]):
        for col in range(image.shape[1]):
            total = np.float32(0)
            for band in range(bands):
                total += np.float32(image[row, col, band])
            out[row, col] = total * share


@compiled
def sample_between_nodes(
    coefficients: Array, nodes: Array, step: int, origin: Array, out: Array
) -> None:
    """Fill an image with values of a cubic spline at positions that are bilinear between nodes.

    Parameters
    ----------
    coefficients : ndarray of float32, shape (rows, cols)
        Coefficients of the spline for a part of an image.
    nodes : ndarray, shape (m, n, 2)
        col, row in the image, at every `step`-th pixel of `out`.
    step : int
    origin : ndarray, shape (2,)
        col, row in the image of the part's first pixel.
    out : ndarray of float32
        NaN where the neighbourhood of a position is not wholly in the part.
    """
    rows, cols = coefficients.shape
    for row in range(out.shape[0]):
        i = min(row // step, nodes.shape[0] - 2)
        t = row / step - i
        for j in range(nodes.shape[1] - 1):
            left_x = (1 - t) * nodes[i, j, 0] + t * nodes[i + 1, j, 0] - origin[0]
            left_y = (1 - t) * nodes[i, j, 1] + t * nodes[i + 1, j, 1] - origin[1]
            dx = (1 - t) * nodes[i, j + 1, 0] + t * nodes[i + 1, j + 1, 0] - origin[0] - left_x
            dy = (1 - t) * nodes[i, j + 1, 1] + t * nodes[i + 1, j + 1, 1] - origin[1] - left_y
            first = j * step
            last = min(first + step, out.shape[1])
            if j == nodes.shape[1] - 2:
                last = out.shape[1]
            for col in range(first, last):
                x, y = left_x + dx * (col - first) / step, left_y + dy * (col - first) / step
                if not (1 <= x < cols - 2 and 1 <= y < rows - 2):
                    out[row, col] = np.nan
                    continue
                c, r = int(x), int(y)
                x0, x1, x2, x3 = spline_weights(np.float32(x - c))
                y0, y1, y2, y3 = spline_weights(np.float32(y - r))
                value = np.float32(0)
                for k, weight in ((r - 1, y0), (r, y1), (r + 1, y2), (r + 2, y3)):
                    value += weight * (
                        x0 * coefficients[k, c - 1]
                        + x1 * coefficients[k, c]
                        + x2 * coefficients[k, c + 1]
                        + x3 * coefficients[k, c + 2]
                    )
                out[row, col] = value
