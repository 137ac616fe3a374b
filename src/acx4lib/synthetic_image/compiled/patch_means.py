"""Means of small patches of an image, and what of them is saturated, compiled."""

from __future__ import annotations

import numpy as np

from acx4lib.compiling import compiled
from acx4lib.expected import Array, Index


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
