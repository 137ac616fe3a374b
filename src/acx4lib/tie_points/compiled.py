"""Windows of two images compared, fitted and interpolated, compiled.

Windows are square with an odd side. Results are NaN where a window or a search leaves an image or
contains a NaN. The plain versions, one of them an adjustment with ten unknowns, are written out
in the tests.
"""

from __future__ import annotations

import numpy as np

from acx4lib.compiling import compiled, inlined
from acx4lib.expected import Array, Index

# --- correlation ------------------------------------------------------------------------------


@inlined
def _window_inside(image: Array, col: int, row: int, half: int) -> bool:
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
def _scores(window: Array, energy: np.float32, patch: Array, sums: Array, score: Array) -> bool:
    """Fill in the coefficient of every place in a patch; return whether all of it are numbers."""
    side, places = len(window), len(score)
    count = np.float32(side * side)
    good = True
    for y in range(places):
        sums[:] = 0
        for j in range(side):
            for i in range(side):
                for x in range(places):
                    value = patch[y + j, i + x]
                    sums[0, x] += window[j, i] * value
                    sums[1, x] += value
                    sums[2, x] += value * value
        for x in range(places):
            spread = sums[2, x] - sums[1, x] * sums[1, x] / count
            score[y, x] = sums[0, x] / np.sqrt(energy * spread) if spread > 0 else -1.0
            good = good and not np.isnan(score[y, x] + spread)
    return good


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
    sums = np.empty((3, places), np.float32)
    score = np.empty((places, places), np.float32)
    for p in range(n):
        col, row, ncol, nrow = at[p, 0], at[p, 1], near[p, 0], near[p, 1]
        if not (_window_inside(a, col, row, half) and _window_inside(b, ncol, nrow, reach)):
            continue
        energy = _centred(a, col, row, half, window)
        if not energy > 0:
            continue
        level = b[nrow, ncol]  # so that sums of squares keep their digits
        for j in range(2 * reach + 1):
            for i in range(2 * reach + 1):
                patch[j, i] = b[nrow - reach + j, ncol - reach + i] - level
        if not _scores(window, energy, patch, sums, score):
            continue
        best = score.argmax()
        x, y = best % places, best // places
        coefficient[p] = score[y, x]
        if 0 < x < places - 1 and 0 < y < places - 1:
            along_x = _peak(score[y, x - 1], score[y, x], score[y, x + 1])
            along_y = _peak(score[y - 1, x], score[y, x], score[y + 1, x])
            found[p, 0] = ncol + x - search + along_x
            found[p, 1] = nrow + y - search + along_y
    return found, coefficient


# --- cubic splines through grey values ---------------------------------------------------------


@inlined
def _spline_weights(t: np.float32) -> tuple[np.float32, np.float32, np.float32, np.float32]:
    """Return the weights of four cubic B-spline coefficients, a fraction t after the second."""
    sixth = np.float32(1.0 / 6.0)
    s = np.float32(1) - t
    first, last = sixth * s * s * s, sixth * t * t * t
    third = sixth * (np.float32(1) + np.float32(3) * t * (np.float32(1) + t * s))
    return first, np.float32(1) - first - third - last, third, last


@inlined
def _spline(b: Array, col: int, row: int, x: np.float32, y: np.float32) -> np.float32:
    """Return the value of a spline with coefficients b, a fraction x, y after a whole pixel."""
    x0, x1, x2, x3 = _spline_weights(x)
    y0, y1, y2, y3 = _spline_weights(y)
    value = np.float32(0)
    for k, weight in ((row - 1, y0), (row, y1), (row + 1, y2), (row + 2, y3)):
        value += weight * (
            x0 * b[k, col - 1] + x1 * b[k, col] + x2 * b[k, col + 1] + x3 * b[k, col + 2]
        )
    return value


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
                out[row, col] = _spline(coefficients, c, r, np.float32(x - c), np.float32(y - r))


# --- least-squares matching -------------------------------------------------------------------


N_UNKNOWNS = 10
"""Affine transformation (6); gain, offset and the two slopes of the offset (4)."""

RIM = 2
"""Pixels around a window that derivatives need."""

OF_PLACE = 6
"""Unknowns of the affine transformation, the first ones."""

_STEPS = 20
_DONE_PX = 5e-4  # a hundredth of the best points' standard deviation


@inlined
def _derivatives(a: Array, col: int, row: int, half: int, B: Array) -> bool:
    """Fill B with the derivatives of a window's grey values; return False without a whole window.

    Central differences of fourth order. The unit of coordinates in the window is half its side.
    """
    k = 0
    level = a[row, col]
    good = True
    for j in range(-half, half + 1):
        for i in range(-half, half + 1):
            r, c = row + j, col + i
            gx = (8 * (a[r, c + 1] - a[r, c - 1]) - (a[r, c + 2] - a[r, c - 2])) / 12
            gy = (8 * (a[r + 1, c] - a[r - 1, c]) - (a[r + 2, c] - a[r - 2, c])) / 12
            x, y = i / half, j / half
            B[0, k], B[1, k] = gx, gy
            B[2, k], B[3, k] = gx * x, gx * y
            B[4, k], B[5, k] = gy * x, gy * y
            B[6, k], B[7, k] = a[r, c] - level, 1.0
            B[8, k], B[9, k] = x, y
            good = good and not np.isnan(gx + gy + a[r, c])
            k += 1
    return good


@inlined
def _inverse(B: Array, N: Array, Q: Array) -> bool:
    """Invert the normal matrix of B's rows after Gauss and Jordan; return whether it is regular."""
    for i in range(N_UNKNOWNS):
        for j in range(N_UNKNOWNS):
            total = 0.0
            for k in range(B.shape[1]):
                total += B[i, k] * B[j, k]
            N[i, j] = total
            Q[i, j] = 1.0 if i == j else 0.0
        N[i, N_UNKNOWNS] = N[i, i]
    for i in range(N_UNKNOWNS):
        if not N[i, i] > 1e-9 * N[i, N_UNKNOWNS]:
            return False
        for row in range(N_UNKNOWNS):
            factor = N[row, i] / N[i, i] if row != i else 0.0
            for j in range(N_UNKNOWNS):
                N[row, j] -= factor * N[i, j]
                Q[row, j] -= factor * Q[i, j]
    for i in range(N_UNKNOWNS):
        for j in range(N_UNKNOWNS):
            Q[i, j] /= N[i, i]
    return True


@inlined
def _sample(b: Array, W: Array, half: int, level: np.float32, out: Array) -> bool:
    """Fill `out` with b's window under an affine transformation; return whether it is whole.

    Positions count from a whole pixel, so that single precision keeps their fractions.
    """
    rows, cols = b.shape
    col0, row0 = int(np.floor(W[4])), int(np.floor(W[5]))
    dcol, drow = np.float32(W[4] - col0), np.float32(W[5] - row0)
    reach = 3 + int(half * max(abs(W[0]) + abs(W[1]), abs(W[2]) + abs(W[3])) + 1e-6)
    if not (reach <= col0 < cols - reach and reach <= row0 < rows - reach):
        return False
    xx, xy, yx, yy = np.float32(W[0]), np.float32(W[1]), np.float32(W[2]), np.float32(W[3])
    k = 0
    check = np.float32(0)
    for j in range(-half, half + 1):
        for i in range(-half, half + 1):
            x = dcol + xx * np.float32(i) + xy * np.float32(j)
            y = drow + yx * np.float32(i) + yy * np.float32(j)
            fx, fy = np.floor(x), np.floor(y)
            out[k] = _spline(b, col0 + int(fx), row0 + int(fy), x - fx, y - fy) - level
            check += out[k]
            k += 1
    return not np.isnan(check)


@inlined
def _compose(W: Array, p: Array, half: int) -> float:
    """Combine an affine transformation with the inverse of an increment, W := W D^-1.

    Return the largest movement of a corner of the window, px.
    """
    tx, ty = p[0] / p[6], p[1] / p[6]
    xx, xy = 1 + p[2] / (p[6] * half), p[3] / (p[6] * half)
    yx, yy = p[4] / (p[6] * half), 1 + p[5] / (p[6] * half)
    det = xx * yy - xy * yx
    ixx, ixy, iyx, iyy = yy / det, -xy / det, -yx / det, xx / det
    itx, ity = -(ixx * tx + ixy * ty), -(iyx * tx + iyy * ty)
    w0, w1, w2, w3 = W[0], W[1], W[2], W[3]
    W[4] += w0 * itx + w1 * ity
    W[5] += w2 * itx + w3 * ity
    W[0], W[1] = w0 * ixx + w1 * iyx, w0 * ixy + w1 * iyy
    W[2], W[3] = w2 * ixx + w3 * iyx, w2 * ixy + w3 * iyy
    bend = max(abs(xx - 1) + abs(xy), abs(yx) + abs(yy - 1))
    return max(abs(tx), abs(ty)) + half * bend


@inlined
def _matched(
    b: Array, B: Array, Q: Array, half: int, start: Array, W: Array, p: Array, values: Array
) -> bool:
    """Move a window of b until its grey values are those of a; return whether this converges.

    Fills in its affine transformation, the last increments, and its grey values less their mean
    at the start.
    """
    W[0], W[1], W[2], W[3] = 1.0, 0.0, 0.0, 1.0
    W[4], W[5] = start[0], start[1]
    level = np.float32(0)
    for step in range(_STEPS):
        if not _sample(b, W, half, level, values):
            return False
        if step == 0:
            for k in range(len(values)):
                level += values[k]
            level /= np.float32(len(values))
            for k in range(len(values)):
                values[k] -= level
        p[:] = 0.0
        for i in range(N_UNKNOWNS):
            total = np.float32(0)
            for k in range(len(values)):
                total += B[i, k] * values[k]
            for j in range(N_UNKNOWNS):
                p[j] += Q[j, i] * total
        if not 0.2 < p[6] < 5.0:
            return False
        move = _compose(W, p, half)
        away = max(abs(W[4] - start[0]), abs(W[5] - start[1]))
        bend = max(abs(W[0] - 1) + abs(W[1]), abs(W[2]) + abs(W[3] - 1))
        if not (away < 0.4 * half and bend < 0.3):
            return False
        if move < _DONE_PX:
            return True
    return False


@compiled
def match_points(
    a: Array, b: Array, at: Index, start: Array, half: int
) -> tuple[Array, Array, Array]:
    """Match windows of an image with another one by least squares.

    The grey values of b, interpolated under an affine transformation W, are those of a with a
    gain and a sloping offset, because the vignetting of two overlapping heads falls off in
    different directions. The derivatives are those of a's window. So they and the normal matrix
    are computed only once.

    Parameters
    ----------
    a, b : ndarray of float32, shape (rows, cols)
    at : ndarray of int64, shape (n, 2)
        col, row of the windows' middles in `a`.
    start : ndarray, shape (n, 2)
        Approximate positions in `b`.
    half : int
        Windows have 2 half + 1 pixels a side.

    Returns
    -------
    found : ndarray, shape (n, 2)
        Positions in `b`; NaN where the matching fails, does not converge or moves by more than a
        fifth of the window.
    gain : ndarray, shape (n,)
        Ratio of grey values, b over a.
    residuals : ndarray of float32, shape (n, pixels)
        Of b's window, row by row.
    """
    n, side = len(at), 2 * half + 1
    size = side * side
    found, gain = np.full((n, 2), np.nan), np.full(n, np.nan)
    residuals = np.full((n, size), np.nan, np.float32)
    B, values = np.empty((N_UNKNOWNS, size), np.float32), np.empty(size, np.float32)
    N, Q = np.empty((N_UNKNOWNS, N_UNKNOWNS + 1)), np.empty((N_UNKNOWNS, N_UNKNOWNS))
    W, p = np.empty(6), np.empty(N_UNKNOWNS)
    for point in range(n):
        col, row = at[point, 0], at[point, 1]
        if np.isnan(start[point, 0] + start[point, 1]) or not _window_inside(a, col, row, half + 2):
            continue
        if not _derivatives(a, col, row, half, B):
            continue
        if not _inverse(B, N, Q):
            continue
        if not _matched(b, B, Q, half, start[point], W, p, values):
            continue
        for k in range(size):
            v = np.float64(values[k])
            for i in range(N_UNKNOWNS):
                v -= B[i, k] * p[i]
            residuals[point, k] = v
        found[point, 0], found[point, 1] = W[4], W[5]
        gain[point] = p[6]
    return found, gain, residuals
