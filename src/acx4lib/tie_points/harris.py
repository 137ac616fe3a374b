"""Corners with texture around them (Figure 1), and the noise that texture must exceed."""

from __future__ import annotations

import cv2
import numpy as np

from acx4lib import expected
from acx4lib.expected import Array, Index, Mask

BLOCK, SOBEL, K = 5, 3, 0.04  # sides of sum and derivative, factor of the trace, after Harris
NOISE_MASK = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)  # zero on planes
_PATCH, _N_PATCHES, _QUIET = 24, 400, 0.05


def response(grey: Array) -> Array:
    """Return Harris' corner response, positive at corners.

    Parameters
    ----------
    grey : ndarray, shape (rows, cols)

    Returns
    -------
    ndarray of float32, shape (rows, cols)
        det - K trace^2 of the squared derivatives, summed over `BLOCK` x `BLOCK` pixels [1]_.

    References
    ----------
    .. [1] C. Harris, M. Stephens, "A combined corner and edge detector", Alvey Vision
       Conference, 1988.
    """
    expected.shape("grey", grey, ("rows", "cols"))
    return np.asarray(cv2.cornerHarris(np.asarray(grey, np.float32), BLOCK, SOBEL, K), np.float32)


def best_of_cells(values: Array, allowed: Mask, cell: int) -> tuple[Index, int]:
    """Return the position of the largest positive value in each cell.

    Parameters
    ----------
    values : ndarray, shape (rows, cols)
    allowed : ndarray of bool, shape (rows, cols)
        Allowed positions.
    cell : int
        Side of the cells, px; the cells of the last row and column are narrower.

    Returns
    -------
    colrow : ndarray, shape (n, 2)
        Cell by cell, without cells that have no positive value.
    n_cells : int
        Number of cells with allowed positions.
    """
    expected.shape("values", values, ("rows", "cols"))
    expected.whole("cell", cell)
    if allowed.shape != values.shape:
        msg = f"allowed: expected shape {values.shape}, got {allowed.shape}"
        raise ValueError(msg)
    rows, cols = (-(-n // cell) for n in values.shape)
    padded = np.zeros((rows * cell, cols * cell), np.float32)
    padded[: values.shape[0], : values.shape[1]] = np.where(allowed, values, 0)
    free = np.zeros(padded.shape, bool)
    free[: values.shape[0], : values.shape[1]] = allowed
    cells = _by_cell(padded, cell)
    place = np.argmax(cells, axis=1)
    found = np.flatnonzero(np.take_along_axis(cells, place[:, None], axis=1)[:, 0] > 0)
    row = found // cols * cell + place[found] // cell
    col = found % cols * cell + place[found] % cell
    return np.column_stack([col, row]), int(np.sum(_by_cell(free, cell).any(axis=1)))


def _by_cell(values: np.ndarray, cell: int) -> np.ndarray:
    """Return a row of values for each cell."""
    rows, cols = (n // cell for n in values.shape)
    return values.reshape(rows, cell, cols, cell).swapaxes(1, 2).reshape(rows * cols, -1)


def noise_level(image: np.ndarray, *, rng: np.random.Generator) -> float:
    """Estimate the noise of an image: the variance of a grey value divided by the grey value.

    The number of photons has a Poisson distribution, so the variance is proportional to the grey
    value. It comes from the quietest of many small patches; texture in the others has no effect.
    If the whole image has texture of the size of a pixel, some of it counts as noise.

    Parameters
    ----------
    image : ndarray, shape (rows, cols, bands)
        The noise is that of the mean of the bands.
    rng : Generator
        Chooses the patches.

    Returns
    -------
    float
        At least the variance that rounding to whole numbers causes.

    Notes
    -----
    The noise of a patch is found with the filter of Immerkaer [1]_, which is zero on planes.

    References
    ----------
    .. [1] J. Immerkaer, "Fast noise variance estimation", Computer Vision and Image
       Understanding 64(2), 1996.
    """
    expected.shape("image", image, ("rows", "cols", "bands"))
    rows, cols = image.shape[:2]
    side = min(_PATCH, rows, cols)
    at = rng.integers(0, [rows - side + 1, cols - side + 1], size=(_N_PATCHES, 2))
    patches = np.stack([image[row : row + side, col : col + side] for row, col in at])
    patches = patches.mean(axis=3, dtype=np.float32)
    # all below each other; what neighbours share is cut off
    filtered = cv2.filter2D(patches.reshape(-1, side), -1, NOISE_MASK).reshape(patches.shape)
    squares = np.mean(filtered[:, 1:-1, 1:-1] ** 2, axis=(1, 2), dtype=float)
    rounding = 1 / (12 * image.shape[2])
    variances = np.maximum(squares / np.sum(NOISE_MASK**2), rounding)
    ratios = variances / np.maximum(patches.mean(axis=(1, 2), dtype=float), 1.0)
    return float(np.quantile(ratios, _QUIET))
