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
        if not (_window_inside(a, col, row, half) and _window_inside(b, ncol, nrow, reach)):
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
        if not _window_inside(image, col, row, half + 1):
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


# --- grey values, and cubic splines through them ----------------------------------------------


@inlined
def _spline_weights(t: np.float32) -> tuple[np.float32, np.float32, np.float32, np.float32]:
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
                x0, x1, x2, x3 = _spline_weights(np.float32(x - c))
                y0, y1, y2, y3 = _spline_weights(np.float32(y - r))
                value = np.float32(0)
                for k, weight in ((r - 1, y0), (r, y1), (r + 1, y2), (r + 2, y3)):
                    value += weight * (
                        x0 * coefficients[k, c - 1]
                        + x1 * coefficients[k, c]
                        + x2 * coefficients[k, c + 1]
                        + x3 * coefficients[k, c + 2]
                    )
                out[row, col] = value


# --- least-squares matching -------------------------------------------------------------------


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
            x0, x1, x2, x3 = _spline_weights(x - fx)
            y0, y1, y2, y3 = _spline_weights(y - fy)
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
        if np.isnan(start[point, 0] + start[point, 1]) or not _window_inside(a, col, row, half + 2):
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
