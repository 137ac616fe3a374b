"""Large shifts between heads, found in reduced images, and matches that agree with each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from acx4lib.expected import Array, Mask
from acx4lib.tie_points.matching import OverlapMatches, OverlapTask, match_overlap
from acx4lib.tie_points.overlaps import GreyExposure, SharedWindow

LEAST_CELL_PX = 14  # windows of neighbours overlap by a third
NARROW_PX = 220  # shorter side of an overlap in reduced images
LEAST_TIES = 12  # of an overlap, so that a homography is checked by other points
WITNESSES = 3  # further matches by which a few are believed: by chance one in 10^4 overlaps
_SIMPLE = ((cv2.estimateAffine2D, 3), (cv2.findHomography, 4))  # and the matches they need
NO_SHIFT = np.zeros((2, 3))
_LEAST_CUBIC, _GROWING_STEPS = 100, 20  # ten matches for each of ten coefficients


def coarse_factor(windows: Sequence[SharedWindow]) -> int:
    """Return the factor of reduction with which overlaps are about `NARROW_PX` wide."""
    sides = [min(w.window[1] - w.window[0], w.window[3] - w.window[2]) for w in windows]
    return max(1, round(max(sides, default=NARROW_PX) / NARROW_PX))


def coarse_task(task: OverlapTask, coarse: GreyExposure) -> OverlapTask:
    """Return the matching of the same overlap in reduced images, with a wide search."""
    options = task.options
    row_0, row_1, col_0, col_1 = task.shared.window
    k = coarse.factor
    window = (row_0 // k, -(-row_1 // k), col_0 // k, -(-col_1 // k))
    return replace(
        task,
        images=coarse.images,
        orientation=coarse.orientation,
        synthetic=coarse.synthetic,
        shared=replace(task.shared, window=window),
        shift=NO_SHIFT,
        cell=LEAST_CELL_PX,
        noise=task.noise / k**2,
        options=replace(
            options,
            search_px=options.coarse_search_px,
            largest_sigma_px=2 * options.largest_sigma_px,
        ),
    )


def coarse_shift(task: OverlapTask, coarse: GreyExposure) -> Array:
    """Return the shift of an overlap, found in reduced images, shape (2, 3).

    Zero where they give no reliable shift.
    """
    matches = match_overlap(coarse_task(task, coarse))
    agree = consensus(matches, 2 * task.options.consensus_px)
    if not agree.any():
        return NO_SHIFT
    # coordinates are those of pixel centres: reduced col 0 is in the middle of k cols
    k = coarse.factor
    a = k * matches.colrow_a[agree] + (k - 1) / 2
    d = k * (matches.colrow_b - matches.colrow_a)[agree]
    A = np.column_stack([a, np.ones(len(a))])
    return np.linalg.lstsq(A, d, rcond=None)[0].T


def consensus(matches: OverlapMatches, threshold_px: float) -> Mask:
    """Tell which matches agree with each other, shape (n,).

    Parameters
    ----------
    matches : OverlapMatches
    threshold_px : float
        Largest allowed misfit.

    Returns
    -------
    ndarray of bool
        All False where fewer than `LEAST_TIES` agree, or less than a tenth: that may be chance. Of
        fewer matches, half must agree, and `WITNESSES` more than determine a transformation.

    Notes
    -----
    The first model is a homography, by MAGSAC [1]_ with a fixed seed. In the synthetic geometry
    it is exact for errors of the heads' rotations; calibrated lenses add hundredths of a pixel.
    The second is a cubic polynomial that starts from these matches; with badly known lenses, it
    keeps the matches of the whole overlap. Moving objects and false matches fit neither model.
    A few matches must fit an affine transformation or, if they are enough, a homography.

    References
    ----------
    .. [1] D. Barath et al., "MAGSAC++, a fast, reliable and accurate robust estimator",
       CVPR 2020.
    """
    n = len(matches.colrow_a)
    least = max(LEAST_TIES, 0.1 * n)
    if n < least:
        return _few(matches, threshold_px)
    for wider in (1, 4):  # with badly known lenses few matches fit a homography
        agree = _on_homography(matches, wider * threshold_px)
        if agree.sum() >= max(least, _LEAST_CUBIC):
            agree = _grown(matches, agree, threshold_px)
        elif wider > 1:
            break
        if agree.sum() >= least:
            return agree
    return _few(matches, threshold_px)


def _few(matches: OverlapMatches, threshold_px: float) -> Mask:
    """Return which of few matches agree on a transformation of few parameters."""
    n, a, b = len(matches.colrow_a), matches.colrow_a, matches.colrow_b
    best = np.zeros(n, dtype=bool)
    for estimate, determined_by in _SIMPLE:
        if n < determined_by + WITNESSES:
            continue
        found, agree = estimate(a, b, method=cv2.RANSAC, ransacReprojThreshold=threshold_px)
        enough = max(determined_by + WITNESSES, n / 2, best.sum() + 1)
        if found is not None and agree.sum() >= enough:
            best = agree.ravel() > 0
    return best


def _on_homography(matches: OverlapMatches, threshold_px: float) -> Mask:
    """Return which matches agree on a homography."""
    found, agree = cv2.findHomography(
        matches.colrow_a, matches.colrow_b, cv2.USAC_MAGSAC, threshold_px, maxIters=5000
    )
    if found is None or agree.sum() < LEAST_TIES:
        return np.zeros(len(matches.colrow_a), dtype=bool)
    # MAGSAC itself has no sharp limit
    misfits = homography_misfits(matches, agree.ravel() > 0)
    near: Mask = np.hypot(*misfits.T) <= threshold_px
    return near


def _grown(matches: OverlapMatches, agree: Mask, threshold_px: float) -> Mask:
    """Return which matches agree with a cubic polynomial that starts from some of them."""
    x, y = ((matches.colrow_a - matches.colrow_a.mean(axis=0)) / np.ptp(matches.colrow_a)).T
    powers = [x**i * y**j for i in range(4) for j in range(4 - i)]
    A, d = np.column_stack(powers), matches.colrow_b - matches.colrow_a
    for _ in range(_GROWING_STEPS):
        before = agree
        misfit = d - A @ np.linalg.lstsq(A[before], d[before], rcond=None)[0]
        agree = np.hypot(*misfit.T) <= threshold_px
        if np.array_equal(agree, before):
            break
    return agree


def homography_misfits(matches: OverlapMatches, agree: Mask) -> Array:
    """Return the misfits of all matches to the homography of those that agree, (n, 2), px."""
    found, _ = cv2.findHomography(matches.colrow_a[agree], matches.colrow_b[agree], 0)
    fitted = cv2.perspectiveTransform(matches.colrow_a[:, None], found)[:, 0]
    return matches.colrow_b - np.asarray(fitted, float)
