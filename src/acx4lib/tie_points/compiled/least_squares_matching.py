"""Least-squares matching of many points, compiled.

Windows are square with an odd side. Results are NaN where a window leaves an image or contains a
NaN. The plain version, an adjustment with ten unknowns, is written out in the tests.
"""

from __future__ import annotations

import numpy as np

from acx4lib.compiling import compiled, inlined
from acx4lib.expected import Array, Index
from acx4lib.tie_points.compiled.cross_correlation import window_inside
from acx4lib.tie_points.compiled.spline import spline_weights

N_UNKNOWNS = 10
"""Affine transformation (6); gain, offset and the two slopes of the offset (4)."""

RIM = 2
"""Pixels around a window that derivatives need."""

_OF_PLACE = 6  # unknowns of the affine transformation, the first ones
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
    """Invert the normal matrix of B's rows by Cholesky; return whether it is regular."""
    for i in range(N_UNKNOWNS):
        for j in range(i + 1):
            total = 0.0
            for k in range(B.shape[1]):
                total += B[i, k] * B[j, k]
            N[i, j] = total
    for i in range(N_UNKNOWNS):  # N becomes its lower Cholesky factor
        diagonal = N[i, i]
        for j in range(i):
            for k in range(j):
                N[i, j] -= N[i, k] * N[j, k]
            N[i, j] /= N[j, j]
            N[i, i] -= N[i, j] * N[i, j]
        if not N[i, i] > 1e-9 * diagonal:
            return False
        N[i, i] = np.sqrt(N[i, i])
    for column in range(N_UNKNOWNS):
        for i in range(N_UNKNOWNS):
            total = 1.0 if i == column else 0.0
            for k in range(i):
                total -= N[i, k] * Q[k, column]
            Q[i, column] = total / N[i, i]
        for i in range(N_UNKNOWNS - 1, -1, -1):
            total = Q[i, column]
            for k in range(i + 1, N_UNKNOWNS):
                total -= N[k, i] * Q[k, column]
            Q[i, column] = total / N[i, i]
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
            c, r = col0 + int(fx), row0 + int(fy)
            x0, x1, x2, x3 = spline_weights(x - fx)
            y0, y1, y2, y3 = spline_weights(y - fy)
            value = y0 * (
                x0 * b[r - 1, c - 1]
                + x1 * b[r - 1, c]
                + x2 * b[r - 1, c + 1]
                + x3 * b[r - 1, c + 2]
            )
            value += y1 * (x0 * b[r, c - 1] + x1 * b[r, c] + x2 * b[r, c + 1] + x3 * b[r, c + 2])
            value += y2 * (
                x0 * b[r + 1, c - 1]
                + x1 * b[r + 1, c]
                + x2 * b[r + 1, c + 1]
                + x3 * b[r + 1, c + 2]
            )
            value += y3 * (
                x0 * b[r + 2, c - 1]
                + x1 * b[r + 2, c]
                + x2 * b[r + 2, c + 1]
                + x3 * b[r + 2, c + 2]
            )
            out[k] = value - level
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
def _fit(B: Array, values: Array, p: Array, half: int, residuals: Array, inner: Array) -> None:
    """Fill in the residuals of a window, and their derivatives, which its rim does not have.

    The unit of coordinates is that of `_derivatives`.
    """
    side = 2 * half + 1
    for k in range(side * side):
        v = np.float64(values[k])
        for i in range(N_UNKNOWNS):
            v -= B[i, k] * p[i]
        residuals[k] = v
    for j in range(RIM, side - RIM):
        for i in range(RIM, side - RIM):
            k = j * side + i
            near = residuals[k + 1] - residuals[k - 1]
            gx = (8 * near - (residuals[k + 2] - residuals[k - 2])) / 12
            near = residuals[k + side] - residuals[k - side]
            gy = (8 * near - (residuals[k + 2 * side] - residuals[k - 2 * side])) / 12
            x, y = (i - half) / half, (j - half) / half
            inner[0, k], inner[1, k] = gx, gy
            inner[2, k], inner[3, k] = gx * x, gx * y
            inner[4, k], inner[5, k] = gy * x, gy * y


@inlined
def _moves(B: Array, inner: Array, gain: float, half: int, N: Array, out: Array) -> None:
    """Fill in the derivatives of a matched position by b's grey values.

    A match satisfies B^T v = 0 with the design matrix B, derivatives of a. The derivatives of
    B^T v by the position are B^T times the derivatives of b; with those of a, the noise that is in
    both factors would seem to be texture. Derivatives of b are a's times the gain, plus those of
    the residuals.
    """
    side = 2 * half + 1
    # the rim of the residuals has no derivatives; the other pixels stand for it
    share = np.float32(side * side / (side - 2 * RIM) ** 2)
    for i in range(N_UNKNOWNS):
        for j in range(N_UNKNOWNS):
            total = np.float32(0)
            for k in range(side * side):
                total += B[i, k] * B[j, k]
            N[j, i] = total * gain if j < _OF_PLACE else total
        for j in range(_OF_PLACE):
            total = np.float32(0)
            for k in range(side * side):
                total += B[i, k] * inner[j, k]
            N[j, i] += share * total
    for column in range(2):  # the first rows of N's inverse, which solve its transpose
        for i in range(N_UNKNOWNS):
            N[i, N_UNKNOWNS + column] = 1.0 if i == column else 0.0
    _solve(N)
    for row in range(2):
        out[row] = 0
        for i in range(N_UNKNOWNS):
            weight = -np.float32(N[i, N_UNKNOWNS + row])
            for k in range(side * side):
                out[row, k] += weight * B[i, k]


@inlined
def _solve(N: Array) -> None:
    """Solve equations for the columns to the right of a square matrix, in place, with pivots."""
    n, columns = N.shape
    for i in range(n):
        pivot = i
        for row in range(i + 1, n):
            if abs(N[row, i]) > abs(N[pivot, i]):
                pivot = row
        for j in range(i, columns):
            N[i, j], N[pivot, j] = N[pivot, j], N[i, j]
        for j in range(i + 1, columns):
            N[i, j] /= N[i, i]
        for row in range(n):
            if row != i:
                for j in range(i + 1, columns):
                    N[row, j] -= N[row, i] * N[i, j]


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
) -> tuple[Array, Array, Array, Array]:
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
    moves : ndarray of float32, shape (n, 2, pixels)
        Derivatives of the positions by b's grey values.
    """
    n, side = len(at), 2 * half + 1
    size = side * side
    found, gain = np.full((n, 2), np.nan), np.full(n, np.nan)
    residuals = np.full((n, size), np.nan, np.float32)
    moves = np.full((n, 2, size), np.nan, np.float32)
    inner, N_moves = np.zeros((_OF_PLACE, size), np.float32), np.empty((N_UNKNOWNS, N_UNKNOWNS + 2))
    B, values = np.empty((N_UNKNOWNS, size), np.float32), np.empty(size, np.float32)
    N, Q = np.empty((N_UNKNOWNS, N_UNKNOWNS)), np.empty((N_UNKNOWNS, N_UNKNOWNS))
    W, p = np.empty(6), np.empty(N_UNKNOWNS)
    for point in range(n):
        col, row = at[point, 0], at[point, 1]
        if np.isnan(start[point, 0] + start[point, 1]) or not window_inside(a, col, row, half + 2):
            continue
        if not _derivatives(a, col, row, half, B):
            continue
        if not _inverse(B, N, Q):
            continue
        if not _matched(b, B, Q, half, start[point], W, p, values):
            continue
        _fit(B, values, p, half, residuals[point], inner)
        _moves(B, inner, p[6], half, N_moves, moves[point])
        found[point, 0], found[point, 1] = W[4], W[5]
        gain[point] = p[6]
    return found, gain, residuals, moves
