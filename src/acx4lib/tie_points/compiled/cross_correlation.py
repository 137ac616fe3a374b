"""Windows of an image found in another one by correlation, compiled.

Windows are square with an odd side. Results are NaN where a window or a search leaves the image
or contains a NaN. The plain version is written out in the tests.
"""

from __future__ import annotations

import numpy as np

from acx4lib.compiling import compiled, inlined
from acx4lib.expected import Array, Index


@inlined
def window_inside(image: Array, col: int, row: int, half: int) -> bool:
    """Tell whether a window lies in an image."""
    rows, cols = image.shape
    return half <= col < cols - half and half <= row < rows - half


@inlined
def _peak(before: float, at: float, after: float) -> float:
    """Return the position of the maximum of the parabola through three values, from the middle."""
    bend = before - 2 * at + after
    return 0.5 * (before - after) / bend if bend < 0 else 0.0


@compiled
def correlate_points(
    a: Array, b: Array, at: Index, near: Index, half: int, search: int
) -> tuple[Array, Array]:
    """Find points of an image in another one by the normalised correlation coefficient.

    Parameters
    ----------
    a, b : ndarray of float32, shape (rows, cols)
    at : ndarray of int64, shape (n, 2)
        col, row of the windows' middles in `a`.
    near : ndarray of int64, shape (n, 2)
        col, row in `b` around which to search.
    half : int
        Windows have 2 half + 1 pixels a side.
    search : int
        Largest shift from `near`, px.

    Returns
    -------
    found : ndarray, shape (n, 2)
        col, row in `b`, by parabolas through the maximum; NaN where the maximum lies on the
        border of the search.
    coefficient : ndarray, shape (n,)
        Its maximum; NaN where a window is not whole or without contrast.
    """
    n, side, places = len(at), 2 * half + 1, 2 * search + 1
    count = np.float32(side * side)
    found, coefficient = np.full((n, 2), np.nan), np.full(n, np.nan)
    window = np.empty((side, side), np.float32)
    patch = np.empty((side + 2 * search, side + 2 * search), np.float32)
    columns = np.empty((2, side + 2 * search), np.float32)
    product = np.empty(places, np.float32)
    score = np.empty((places, places), np.float32)
    for p in range(n):
        col, row, ncol, nrow = at[p, 0], at[p, 1], near[p, 0], near[p, 1]
        if not (window_inside(a, col, row, half) and window_inside(b, ncol, nrow, half + search)):
            continue
        mean = np.float32(0)
        for j in range(side):
            for i in range(side):
                window[j, i] = a[row - half + j, col - half + i]
                mean += window[j, i]
        mean /= count
        energy = np.float32(0)
        for j in range(side):
            for i in range(side):
                window[j, i] -= mean
                energy += window[j, i] * window[j, i]
        level = b[nrow, ncol]  # subtracted, so that sums of squares keep their digits
        for j in range(side + 2 * search):
            for i in range(side + 2 * search):
                patch[j, i] = b[nrow - half - search + j, ncol - half - search + i] - level
        best, best_x, best_y = np.float32(-1), 0, 0
        broken = not energy > 0
        for y in range(places):
            product[:] = 0
            columns[:] = 0
            for j in range(side):
                for i in range(side + 2 * search):
                    value = patch[y + j, i]
                    columns[0, i] += value
                    columns[1, i] += value * value
                for i in range(side):
                    weight = window[j, i]
                    for x in range(places):
                        product[x] += weight * patch[y + j, i + x]
            total, squares = np.float32(0), np.float32(0)
            for i in range(side - 1):
                total += columns[0, i]
                squares += columns[1, i]
            for x in range(places):
                total += columns[0, x + side - 1]
                squares += columns[1, x + side - 1]
                spread = squares - total * total / count
                score[y, x] = product[x] / np.sqrt(energy * spread) if spread > 0 else -1.0
                total -= columns[0, x]
                squares -= columns[1, x]
                if np.isnan(score[y, x]) or np.isnan(squares):
                    broken = True
                elif score[y, x] > best:
                    best, best_x, best_y = score[y, x], x, y
        if broken:
            continue
        coefficient[p] = best
        if 0 < best_x < places - 1 and 0 < best_y < places - 1:
            here = score[best_y, best_x]
            found[p, 0] = (
                ncol
                + best_x
                - search
                + _peak(score[best_y, best_x - 1], here, score[best_y, best_x + 1])
            )
            found[p, 1] = (
                nrow
                + best_y
                - search
                + _peak(score[best_y - 1, best_x], here, score[best_y + 1, best_x])
            )
    return found, coefficient


@compiled
def weakest_gradients(image: Array, at: Index, half: int) -> Array:
    """Return the mean squared derivative of windows in its weakest direction, shape (n,).

    From central differences; NaN where a window is not whole.
    """
    out = np.full(len(at), np.nan)
    size = (2 * half + 1) ** 2
    for p in range(len(at)):
        col, row = at[p, 0], at[p, 1]
        if not window_inside(image, col, row, half + 1):
            continue
        xx, xy, yy = 0.0, 0.0, 0.0
        for r in range(row - half, row + half + 1):
            for c in range(col - half, col + half + 1):
                gx = np.float64(image[r, c + 1] - image[r, c - 1]) / 2
                gy = np.float64(image[r + 1, c] - image[r - 1, c]) / 2
                xx += gx * gx
                xy += gx * gy
                yy += gy * gy
        root = np.sqrt((xx - yy) * (xx - yy) + 4 * xy * xy)
        out[p] = (xx + yy - root) / (2 * size)
    return out
