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


@inlined
def _centred(a: Array, col: int, row: int, half: int, out: Array) -> np.float32:
    """Fill in a window's grey values less their mean; return the sum of their squares."""
    side = 2 * half + 1
    mean = np.float32(0)
    for j in range(side):
        for i in range(side):
            out[j, i] = a[row - half + j, col - half + i]
            mean += out[j, i]
    mean /= np.float32(side * side)
    energy = np.float32(0)
    for j in range(side):
        for i in range(side):
            out[j, i] -= mean
            energy += out[j, i] * out[j, i]
    return energy


@inlined
def _around(b: Array, col: int, row: int, reach: int, out: Array) -> None:
    """Fill in grey values less the middle one, so that sums of their squares keep their digits."""
    level = b[row, col]
    for j in range(2 * reach + 1):
        for i in range(2 * reach + 1):
            out[j, i] = b[row - reach + j, col - reach + i] - level


@inlined
def _scores(
    window: Array, energy: np.float32, patch: Array, columns: Array, product: Array, score: Array
) -> bool:
    """Fill in the coefficient of every place in a patch; return whether all of it are numbers.

    Sums over a window's columns serve all places of a row: each next place adds a column at its
    right and drops the one at its left.
    """
    side, places = len(window), len(score)
    count = np.float32(side * side)
    good = True
    for y in range(places):
        product[:] = 0
        columns[:] = 0
        for j in range(side):
            for i in range(len(patch)):
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
            good = good and not (np.isnan(score[y, x]) or np.isnan(squares))
    return good


@inlined
def _highest(score: Array) -> tuple[int, int]:
    """Return the column and the row of the first maximum."""
    best, best_x, best_y = score[0, 0], 0, 0
    for y in range(len(score)):
        for x in range(len(score)):
            if score[y, x] > best:
                best, best_x, best_y = score[y, x], x, y
    return best_x, best_y


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
    reach = half + search
    found, coefficient = np.full((n, 2), np.nan), np.full(n, np.nan)
    window = np.empty((side, side), np.float32)
    patch = np.empty((2 * reach + 1, 2 * reach + 1), np.float32)
    columns = np.empty((2, 2 * reach + 1), np.float32)
    product = np.empty(places, np.float32)
    score = np.empty((places, places), np.float32)
    for p in range(n):
        col, row, ncol, nrow = at[p, 0], at[p, 1], near[p, 0], near[p, 1]
        if not (window_inside(a, col, row, half) and window_inside(b, ncol, nrow, reach)):
            continue
        energy = _centred(a, col, row, half, window)
        if not energy > 0:
            continue
        _around(b, ncol, nrow, reach, patch)
        if not _scores(window, energy, patch, columns, product, score):
            continue
        x, y = _highest(score)
        coefficient[p] = score[y, x]
        if 0 < x < places - 1 and 0 < y < places - 1:
            along_x = _peak(score[y, x - 1], score[y, x], score[y, x + 1])
            along_y = _peak(score[y - 1, x], score[y, x], score[y + 1, x])
            found[p, 0] = ncol + x - search + along_x
            found[p, 1] = nrow + y - search + along_y
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
