"""Points of one image found in another: correlation, then least-squares matching (Figure 1)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from acx4lib import expected
from acx4lib.expected import Array, Index
from acx4lib.tie_points.compiled.cross_correlation import correlate_points
from acx4lib.tie_points.compiled.least_squares_matching import match_points

POLE = np.sqrt(3.0) - 2.0  # of the filter that gives the coefficients of a cubic spline
REACH = 12  # px; beyond it that filter has less than 1e-6 of its weight


@dataclass(frozen=True, kw_only=True, eq=False)
class Matches:
    """Positions of the windows of an image in another one.

    Attributes
    ----------
    colrow : ndarray, shape (n, 2)
        Pixels of the other image; NaN where the matching failed.
    sigma_px : ndarray, shape (n, 2)
        Standard deviation along columns and rows, from the residuals.
    gain : ndarray, shape (n,)
        Ratio of grey values, the other image over the first.
    noise : ndarray, shape (n,)
        Standard deviation of a grey value's residual.
    """

    colrow: Array
    sigma_px: Array
    gain: Array
    noise: Array


def spline_coefficients(image: Array) -> Array:
    """Return the coefficients of the cubic spline through an image's pixels.

    The image is mirrored at its borders.

    Parameters
    ----------
    image : ndarray, shape (rows, cols)

    Returns
    -------
    ndarray of float32, shape (rows, cols)

    Notes
    -----
    Computed by a symmetric filter, cut off where it is negligible, not a recursive one [1]_.

    References
    ----------
    .. [1] M. Unser, "Splines: a perfect fit for signal and image processing", IEEE Signal
       Processing Magazine 16(6), 1999.
    """
    expected.shape("image", image, ("rows", "cols"))
    taps = POLE ** np.abs(np.arange(-REACH, REACH + 1))
    taps = (taps / taps.sum()).astype(np.float32)
    # subtracted, so that the numbers are small and keep their digits
    level = np.float32(image[image.shape[0] // 2, image.shape[1] // 2])
    level = level if np.isfinite(level) else np.float32(0)
    out = cv2.sepFilter2D(
        np.asarray(image, np.float32) - level, -1, taps, taps, borderType=cv2.BORDER_REFLECT_101
    )
    return out + level


def noise_correlation(scale: float, *, reach: int = 4) -> Array:
    """Return the correlation of the noise of pixels after interpolation by cubic splines.

    Parameters
    ----------
    scale : float
        Pixels of the interpolated image per pixel of the original one, whose noise is white.
    reach : int
        Largest distance, pixels of the interpolated image.

    Returns
    -------
    ndarray, shape (reach + 1,)
        For two pixels 0, 1, ... apart along a row or a column, averaged over all positions
        between the original pixels.

    Notes
    -----
    It is the autocorrelation of the cardinal spline, which is a cubic B-spline after the filter of
    `spline_coefficients`.
    """
    expected.positive_number("scale", scale)
    expected.whole("reach", reach, least=0)
    step = 1 / 64
    at = np.arange(-16, 16, step)
    cardinal = sum(POLE ** abs(k) * _b_spline(at - k) for k in range(-REACH, REACH + 1))
    lags = np.arange(reach + 1) / scale
    values = np.array([np.sum(cardinal * np.interp(at - lag, at, cardinal)) for lag in lags])
    return values / values[0]


def _b_spline(x: Array) -> Array:
    """Return the cubic B-spline about zero."""
    x = np.abs(x)
    inner, outer = 2 / 3 - x**2 * (1 - x / 2), np.maximum(2 - x, 0) ** 3 / 6
    return np.where(x < 1, inner, outer)


def correlate(
    a: Array, b: Array, at: Index, near: Array, *, half: int, search: int
) -> tuple[Array, Array]:
    """Find windows of an image in another one by the normalised correlation coefficient.

    Parameters
    ----------
    a, b : ndarray of float32, shape (rows, cols)
        NaN where nothing is seen.
    at : ndarray, shape (n, 2)
        Whole col, row of the windows' middles in `a`.
    near : ndarray, shape (n, 2)
        Positions in `b` around which to search; they are rounded to whole pixels.
    half : int
        Windows have 2 half + 1 pixels a side.
    search : int
        Largest shift from `near`, px.

    Returns
    -------
    colrow : ndarray, shape (n, 2)
        Positions in `b`, to fractions of a pixel; NaN where a window or the search does not lie
        in the images, or the maximum lies on the border of the search.
    coefficient : ndarray, shape (n,)
        Its maximum.
    """
    _check(a, b, at, near)
    expected.whole("half", half)
    expected.whole("search", search, least=0)
    return correlate_points(a, b, at.astype(np.int64), np.rint(near).astype(np.int64), half, search)


def match(
    a: Array, b: Array, at: Index, near: Array, *, half: int, correlation: Array | None = None
) -> Matches:
    """Match windows of an image with another one by least squares [1]_.

    The unknowns are an affine transformation of the window, a gain, and an offset with slopes,
    because the vignetting of two overlapping heads falls off in different directions.

    Parameters
    ----------
    a, b : ndarray of float32, shape (rows, cols)
        NaN where nothing is seen.
    at : ndarray, shape (n, 2)
        Whole col, row of the windows' middles in `a`.
    near : ndarray, shape (n, 2)
        Approximate positions in `b`, with errors of one or two pixels.
    half : int
        Windows have 2 half + 1 pixels a side.
    correlation : ndarray, optional
        Correlation of the noise of two pixels 0, 1, ... apart; by default the noise is white.

    Returns
    -------
    Matches
        The position in `a` has no error by definition.

    References
    ----------
    .. [1] A. W. Gruen, "Adaptive least squares correlation: a powerful image matching
       technique", South African Journal of Photogrammetry, Remote Sensing and Cartography
       14(3), 1985.
    """
    _check(a, b, at, near)
    expected.whole("half", half)
    white = np.array([1.0])
    colrow, sigma, grey = match_points(
        a,
        _spline_of_seen(b),
        at.astype(np.int64),
        np.asarray(near, float),
        half,
        white if correlation is None else correlation,
    )
    return Matches(colrow=colrow, sigma_px=sigma, gain=grey[:, 0], noise=grey[:, 1])


def _check(a: Array, b: Array, at: Index, near: Array) -> None:
    """Raise a ValueError where the arguments are not two images and positions in them."""
    expected.shape("a", a, ("rows", "cols"))
    expected.shape("b", b, ("rows", "cols"))
    expected.whole_numbers("at", at, ("n", 2))
    expected.shape("near", near, (len(at), 2))


def _spline_of_seen(image: Array) -> Array:
    """Return spline coefficients, NaN where they depend on pixels that are NaN."""
    unseen = np.isnan(image)
    if not unseen.any():
        return spline_coefficients(image)
    out = spline_coefficients(np.where(unseen, np.nanmean(image) if not unseen.all() else 0, image))
    near = cv2.dilate(unseen.astype(np.uint8), np.ones((9, 9), np.uint8))
    out[near > 0] = np.nan
    return out
