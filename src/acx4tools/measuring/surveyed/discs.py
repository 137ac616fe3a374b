"""Discs on a ground of another brightness: found by templates, centred by least squares."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy.optimize import least_squares
from scipy.special import ndtr

from acx4lib.expected import Array

RADII_PX = (0.7, 1.0, 1.4, 2.0, 2.8, 4.0, 5.6, 8.0)
"""Radii of the templates: every disc is near one of them."""

LEAST_CORRELATION = 0.75
MOST = 8
"""Discs that are looked at more closely around one place."""

LEAST_SIGMA_PX = 0.02
"""What a disc's model leaves unexplained: its edge, and the response of the pixels."""

LARGEST_MISFIT = 0.12
"""Of the residuals' root mean square, as a share of the disc's contrast."""

_BLUR, _SAMPLES = 0.5, 4
_WEIGHT = 0.05  # of the usual blur and the template's radius: small discs determine neither
_SMALL_PX, _PHASES = 1.8, ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5))
_PLAY = (np.arange(_SAMPLES) + 0.5) / _SAMPLES - 0.5


@dataclass(frozen=True, kw_only=True)
class Disc:
    """A disc in a picture.

    Attributes
    ----------
    col, row : float
    sigma_px : float
        Of either coordinate.
    radius_px : float
    contrast : float
        Grey value of the disc less that of its ground.
    correlation : float
        With its template.
    """

    col: float
    row: float
    sigma_px: float
    radius_px: float
    contrast: float
    correlation: float


def discs(grey: Array) -> list[Disc]:
    """Return the discs in a part of a picture, the clearest first.

    Parameters
    ----------
    grey : ndarray of float32, shape (rows, cols)
        Without NaN.
    """
    starts: list[tuple[float, float, float, float]] = []
    for one in sorted(_starts(grey), reverse=True):
        if len(starts) < MOST and not any(_same(one, other) for other in starts):
            starts.append(one)
    found = (centred(grey, c, r, size, correlation=rho) for rho, size, c, r in starts)
    return [disc for disc in found if disc is not None]


def _same(a: tuple[float, ...], b: tuple[float, ...]) -> bool:
    """Tell whether two starts are of the same disc; the clearer one has the better radius."""
    return np.hypot(a[2] - b[2], a[3] - b[3]) < max(1.5, b[1])


def _starts(grey: Array) -> list[tuple[float, float, float, float]]:
    """Return correlation, radius, col and row of the local maxima of all templates.

    A small disc looks different where its middle lies between pixels, and has templates for it.
    """
    out: list[tuple[float, float, float, float]] = []
    for radius in RADII_PX:
        for dx, dy in _PHASES if radius < _SMALL_PX else _PHASES[:1]:
            template = _template(radius, dx, dy)
            half = len(template) // 2
            if min(grey.shape) <= 2 * half + 2:
                return out
            score = np.abs(cv2.matchTemplate(grey, template, cv2.TM_CCOEFF_NORMED))
            score[~np.isfinite(score)] = 0
            peak = (score == cv2.dilate(score, np.ones((5, 5)))) & (score >= LEAST_CORRELATION)
            rows, cols = np.nonzero(peak)
            out += [
                (float(score[r, c]), radius, int(c) + half + dx, int(r) + half + dy)
                for r, c in zip(rows, cols, strict=True)
            ]
    return out


def _template(radius: float, dx: float, dy: float) -> Array:
    """Return a blurred disc, its middle at dx, dy, with a ring of its ground around it."""
    half = int(np.ceil(_reach(radius)))
    x = np.arange(-half, half + 1, dtype=float)
    return _image(x[None, :] - dx, x[:, None] - dy, radius, _BLUR).astype(np.float32)


def _reach(radius: float) -> float:
    """Return how far from its middle a disc is compared with its ground, px."""
    return 1.6 * radius + 0.7


def _image(x: Array, y: Array, radius: float, blur: float) -> Array:
    """Return the share of a blurred disc in pixels, from their distances to its middle."""
    xx = (x[..., None] + _PLAY) ** 2
    yy = (y[..., None] + _PLAY) ** 2
    away = np.sqrt(xx[..., None, :] + yy[..., :, None])
    return np.asarray(ndtr((radius - away) / blur).mean(axis=(-1, -2)))


def centred(
    grey: Array, col: float, row: float, radius: float, *, correlation: float
) -> Disc | None:
    """Return the disc near a place, centred by least squares; None where there is none.

    The unknowns are its middle, its radius, the blur of its edge, and two grey values. The pixels
    are those within its own ring of ground, so that what lies beyond has no effect.

    Parameters
    ----------
    grey : ndarray of float32, shape (rows, cols)
    col, row : float
    radius : float
        Approximate, px.
    correlation : float
        Is passed on.
    """
    half = int(np.ceil(_reach(radius))) + 1
    rows, cols = grey.shape
    c, r = round(col), round(row)
    if not (half <= c < cols - half and half <= r < rows - half):
        return None
    y, x = np.mgrid[-half : half + 1, -half : half + 1].reshape(2, -1).astype(float)
    x, y = x - (col - c), y - (row - r)
    near = np.hypot(x, y) <= _reach(radius) + 0.5
    x, y = x[near], y[near]
    values = grey[r - half : r + half + 1, c - half : c + half + 1].ravel()[near].astype(float)
    inner = np.hypot(x, y) <= max(radius, 0.8)
    ground = float(np.median(values[~inner]))
    contrast = float(np.mean(values[inner])) - ground
    if contrast == 0:
        return None

    start = np.array([0.0, 0.0, np.log(radius), np.log(_BLUR), ground / contrast, 1.2])

    def misfit(p: Array) -> Array:
        share = _image(x - p[0], y - p[1], np.exp(p[2]), np.exp(p[3]))
        usual = _WEIGHT * (p[2:4] - start[2:4])
        return np.append(p[4] + p[5] * share - values / contrast, usual)

    fit = least_squares(misfit, start, method="lm", max_nfev=120)
    return _judged(fit.x, fit.fun, np.asarray(fit.jac), (col, row, radius, contrast, correlation))


def _judged(
    p: Array, v: Array, J: Array, start: tuple[float, float, float, float, float]
) -> Disc | None:
    """Return the disc of a fit, if it is one."""
    col, row, radius, contrast, correlation = start
    rms = float(np.sqrt(v @ v / max(len(v) - len(p), 1)))
    size = float(np.exp(p[2]))
    away = np.hypot(p[0], p[1])
    N = J.T @ J
    if away > max(1.0, 0.7 * radius) or not p[5] > 0 or rms > LARGEST_MISFIT * p[5]:
        return None
    if size > 2 * radius or np.linalg.cond(N) > 1e14:
        return None
    sigma = rms * float(np.sqrt(np.linalg.inv(N)[:2, :2].trace() / 2))
    return Disc(
        col=col + float(p[0]),
        row=row + float(p[1]),
        sigma_px=float(np.hypot(sigma, LEAST_SIGMA_PX)),
        radius_px=size,
        contrast=float(p[5]) * contrast,
        correlation=correlation,
    )
