"""Points of one image found in another by SIFT's key points and descriptors."""

from __future__ import annotations

import cv2
import numpy as np

from acx4lib._typing import Array

RATIO = 0.8  # of the best descriptor's distance to the second best's, at most


def sift_matches(a: Array, b: Array, *, most: int) -> tuple[Array, Array]:
    """Return points that two images share by their descriptors [1]_, compared each with each.

    Parameters
    ----------
    a, b : ndarray, shape (rows, cols)
        Grey values; NaN where there is nothing.
    most : int
        Key points of an image.

    Returns
    -------
    colrow_a, colrow_b : ndarray, shape (n, 2)
        Pixels, with false matches among them.

    References
    ----------
    .. [1] D. G. Lowe, "Distinctive image features from scale-invariant keypoints", International
       Journal of Computer Vision 60(2), 2004.
    """
    sift = cv2.SIFT.create(nfeatures=most)
    points_a, words_a = sift.detectAndCompute(_eight_bit(a), _seen(a))
    points_b, words_b = sift.detectAndCompute(_eight_bit(b), _seen(b))
    if min(len(points_a), len(points_b)) < 2:
        return np.zeros((0, 2)), np.zeros((0, 2))
    pairs = cv2.BFMatcher(cv2.NORM_L2).knnMatch(words_a, words_b, k=2)
    good = [best for best, second in pairs if best.distance < RATIO * second.distance]
    colrow_a = np.array([points_a[m.queryIdx].pt for m in good]).reshape(-1, 2)
    colrow_b = np.array([points_b[m.trainIdx].pt for m in good]).reshape(-1, 2)
    return colrow_a, colrow_b


def _eight_bit(grey: Array) -> np.ndarray:
    """Return grey values between their percentiles 0.5 and 99.5 as 8 bit, which SIFT wants."""
    seen = grey[np.isfinite(grey)]
    low, high = np.quantile(seen, [0.005, 0.995]) if len(seen) else (0.0, 1.0)
    values = (grey - low) * (255 / max(high - low, 1e-9))
    return np.clip(np.nan_to_num(values), 0, 255).astype(np.uint8)


def _seen(grey: Array) -> np.ndarray:
    """Return where there is something, a few pixels off the border to what is not."""
    return cv2.erode(np.isfinite(grey).astype(np.uint8), np.ones((9, 9), np.uint8))
