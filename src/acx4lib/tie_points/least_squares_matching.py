"""Points of one image found in another: correlation, then least-squares matching (Figure 1)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from acx4lib.expected import Array, Index
from acx4lib.tie_points.compiled import (
    N_UNKNOWNS,
    OF_PLACE,
    RIM,
    correlate_points,
    match_points,
)

POLE = np.sqrt(3.0) - 2.0  # of the filter that gives the coefficients of a cubic spline
REACH = 12  # px; beyond it that filter has less than 1e-6 of its weight
WITNESSES = 64  # windows for the correlation of noise from residuals: sigma to a tenth
AT_A_TIME = 128  # windows, so that their design matrices need little memory
LEAST_NOISE = 0.01  # of grey values that were rounded and averaged, however alike they are


@dataclass(frozen=True, kw_only=True, eq=False)
class Matches:
    """Positions of the windows of an image in another one.

    Attributes
    ----------
    colrow : ndarray, shape (n, 2)
        Pixels of the other image; NaN where the matching failed.
    sigma_px : ndarray, shape (n, 2)
        Standard deviation along columns and rows, from the residuals of all windows.
    gain : ndarray, shape (n,)
        Ratio of grey values, the other image over the first.
    """

    colrow: Array
    sigma_px: Array
    gain: Array


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
    taps = POLE ** np.abs(np.arange(-REACH, REACH + 1))
    taps = (taps / taps.sum()).astype(np.float32)
    # subtracted, so that the numbers are small and keep their digits
    level = np.float32(image[image.shape[0] // 2, image.shape[1] // 2])
    level = level if np.isfinite(level) else np.float32(0)
    out = cv2.sepFilter2D(
        np.asarray(image, np.float32) - level, -1, taps, taps, borderType=cv2.BORDER_REFLECT_101
    )
    return out + level


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
    return correlate_points(a, b, at.astype(np.int64), np.rint(near).astype(np.int64), half, search)


def match(a: Array, b: Array, at: Index, near: Array, *, half: int) -> Matches:
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
    colrow, gain, residuals = match_points(
        a, _spline_of_seen(b), at.astype(np.int64), np.asarray(near, float), half
    )
    sigma = np.full((len(at), 2), np.nan)
    matched = np.flatnonzero(np.isfinite(gain))
    if len(matched):
        sigma[matched] = _sigmas(a, at[matched], half, residuals[matched], gain[matched])
    return Matches(colrow=colrow, sigma_px=sigma, gain=gain)


# --- precision of a match ------------------------------------------------------------------


def _sigmas(a: Array, at: Index, half: int, residuals: Array, gain: Array) -> Array:
    """Return the standard deviations of matched positions, from the residuals, (n, 2), px.

    Compression and interpolation give neighbouring pixels the same noise, and most of it at edges,
    which decide the position. So the variance is the sum over the window of squared residuals
    times squared derivatives of the position [1]_, times a factor for the correlation of noise
    between neighbours. This factor comes from residuals of many windows, mirrored, because these
    have the same noise and no relation to the texture.

    References
    ----------
    .. [1] H. White, "A heteroskedasticity-consistent covariance matrix estimator and a direct
       test for heteroskedasticity", Econometrica 48(4), 1980.
    """
    sample = np.linspace(0, len(at) - 1, min(len(at), WITNESSES)).astype(np.intp)
    noise = residuals[sample]
    noise = noise / np.sqrt(np.mean(np.square(noise), axis=1, keepdims=True) + LEAST_NOISE**2)
    noise = _mirrored(noise)
    moves = position_derivatives(a, at[sample], half, residuals[sample], gain[sample])
    remaining = 1 - _absorbed(moves, _columns(_windows(a, at[sample], half)))
    out = np.empty((len(at), 2))
    for start in range(0, len(at), AT_A_TIME):
        part = slice(start, start + AT_A_TIME)
        squares = np.square(residuals[part]) + np.float32(LEAST_NOISE**2)
        moves = position_derivatives(a, at[part], half, residuals[part], gain[part])
        moved = np.square(moves)
        by_residuals = np.sum(moved * squares[:, None], axis=2)
        by_noise = moves.reshape(-1, moves.shape[2]) @ noise.T
        shared = np.mean(np.square(by_noise), axis=1).reshape(-1, 2)
        alone = moved @ np.mean(np.square(noise), axis=0)
        out[part] = np.sqrt(by_residuals * shared / (alone * remaining))
    return out


def position_derivatives(a: Array, at: Index, half: int, residuals: Array, gain: Array) -> Array:
    """Return derivatives of matched positions by b's grey values, shape (n, 2, pixels).

    A match satisfies B^T v = 0 with the design matrix B, derivatives of a. The derivatives of
    B^T v by the position are B^T times the derivatives of b; with those of a, the noise that is in
    both factors would seem to be texture. Derivatives of b are a's times the gain, plus those of
    the residuals.

    Parameters
    ----------
    a, at, half
        As of `match`.
    residuals : ndarray, shape (n, pixels)
        Of the matched windows.
    gain : ndarray, shape (n,)
    """
    B, side = _columns(_windows(a, at, half)), 2 * half + 1
    N = (B @ B.swapaxes(1, 2)).astype(float)  # by unknown of the equation, by unknown of the window
    N[:, :, :OF_PLACE] *= gain[:, None, None]
    # the rim of the residuals has no derivatives; the other pixels stand for it
    share = (side / (side - 2 * RIM)) ** 2
    inner = B.reshape(-1, N_UNKNOWNS, side, side)[:, :, RIM:-RIM, RIM:-RIM]
    slopes = _columns(residuals.reshape(-1, side, side))[:, :OF_PLACE]
    slopes[:, 2:] *= (half - RIM) / half  # of coordinates whose unit is half of the whole window
    products = inner.reshape(*slopes.shape[:1], N_UNKNOWNS, -1) @ slopes.swapaxes(1, 2)
    N[:, :, :OF_PLACE] += share * products
    first = np.linalg.solve(N.swapaxes(1, 2), np.eye(N_UNKNOWNS)[:, :2])
    return -(first.swapaxes(1, 2).astype(np.float32) @ B)


def _windows(a: Array, at: Index, half: int) -> Array:
    """Return windows with a rim for their derivatives, less their means, (n, side, side)."""
    reach = np.arange(-half - RIM, half + RIM + 1)
    grey = a[at[:, 1, None, None] + reach[:, None], at[:, 0, None, None] + reach]
    return grey - grey.mean(axis=(1, 2), keepdims=True)


def _mirrored(windows: Array) -> Array:
    """Return windows mirrored in three ways, shape (3 n, pixels)."""
    side = round(np.sqrt(windows.shape[1]))
    square = windows.reshape(-1, side, side)
    ways = square[:, ::-1], square[:, :, ::-1], square[:, ::-1, ::-1]
    return np.concatenate([way.reshape(windows.shape) for way in ways])


def _absorbed(moves: Array, columns: Array) -> float:
    """Return the part of the noise's effect that the adjustment absorbed.

    It is the part of `moves`, mirrored, that the unknowns of other windows absorb.
    """
    n, _, pixels = columns.shape
    basis = np.linalg.qr(columns.transpose(0, 2, 1).astype(float))[0]
    unit = _mirrored(moves.reshape(-1, pixels))
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    taken = unit @ basis.transpose(1, 0, 2).reshape(pixels, -1).astype(np.float32)
    return float(np.sum(np.square(taken), dtype=float)) / (n * len(unit))


def _columns(grey: Array) -> Array:
    """Return derivatives by the unknowns of windows, without their rim, (n, unknowns, pixels)."""
    side = grey.shape[2] - 2 * RIM
    x = np.linspace(-1, 1, side, dtype=np.float32)
    y = x[:, None]
    gx = _slopes(grey)[:, RIM:-RIM]
    gy = _slopes(grey.swapaxes(1, 2)).swapaxes(1, 2)[:, :, RIM:-RIM]
    inner, ones = grey[:, RIM:-RIM, RIM:-RIM], np.ones_like(gx)
    all_of_them = [gx, gy, gx * x, gx * y, gy * x, gy * y, inner, ones, ones * x, ones * y]
    return np.stack(all_of_them, axis=1).reshape(len(grey), N_UNKNOWNS, side * side)


def _slopes(grey: Array) -> Array:
    """Return derivatives along rows: central differences of fourth order, without the rim."""
    near, far = grey[..., 3:-1] - grey[..., 1:-3], grey[..., 4:] - grey[..., :-4]
    return (8 * near - far) / np.float32(12)


# --- the surface that is matched -------------------------------------------------------------


def _spline_of_seen(image: Array) -> Array:
    """Return spline coefficients, NaN where they depend on pixels that are NaN."""
    unseen = np.isnan(image)
    if not unseen.any():
        return spline_coefficients(image)
    out = spline_coefficients(np.where(unseen, np.nanmean(image) if not unseen.all() else 0, image))
    affected = cv2.dilate(unseen.astype(np.uint8), np.ones((9, 9), np.uint8))
    out[affected > 0] = np.nan
    return out
