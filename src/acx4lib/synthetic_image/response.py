"""Radiometric response of the heads, from grey values of the same ground in their overlaps.

Two heads see the ground of their overlap through different parts of their lenses. Therefore the
log ratios of their grey values determine the gains and the radial falloff, band by band. They do
not determine the brightness that all heads share.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from acx4lib import expected, shown
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Index, Mask, Raster
from acx4lib.geometry.camera import Camera, xy_from_colrow
from acx4lib.least_squares import processors
from acx4lib.least_squares.covariance import sigmas
from acx4lib.synthetic_image.frame import footprint, head_from_synthetic

SIGMA_GAIN, SIGMA_RADIAL = 0.2, 0.3
"""A priori sigma of a log gain and of a radial term: lenses lose 20 to 30 % at their corners."""

HUBER, TUKEY, STEPS, SETTLED = 2.0, 5.0, 12, 1e-6
"""Widths of the two losses in spreads, most steps with each, size of a step that ends them."""

POINTS = 20_000
"""Number of samples of an overlap."""

DARK_DN = 16.0
"""Smallest mean of a patch; below it, photon noise and offsets are too large a share."""


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Response:
    """Dependence of grey values on head, band and position in the image.

    A head's grey value is the true one times exp(g + a q + b q^2), where q is the squared
    distance from the middle of its image, divided by that of its corner.

    Attributes
    ----------
    coefficients : ndarray, shape (n_heads, n_bands, 3)
        g, a, b. The mean of g over the heads is zero in each band.
    """

    coefficients: Array

    def __post_init__(self) -> None:
        expected.shape("coefficients", self.coefficients, ("n_heads", "n_bands", 3))


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class OverlapResponse:
    """Differences between two heads in grey values of the same ground.

    Attributes
    ----------
    head_a, head_b : int
    before, after : ndarray, shape (n_bands,)
        Robust RMS of the log ratio, before and after correction for the responses; NaN without
        samples.
    n_used, n_saturated, n_dark : ndarray, shape (n_bands,)
        Numbers of samples.
    """

    head_a: int
    head_b: int
    before: Array
    after: Array
    n_used: Index
    n_saturated: Index
    n_dark: Index


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class ResponseFit:
    """Estimated responses and the differences that remain.

    Attributes
    ----------
    response : Response
    sigma : ndarray, shape (n_heads, n_bands, 3)
        Of the coefficients, from the scatter of the samples; it does not include the error that
        a falloff of another shape causes.
    overlaps : tuple of OverlapResponse
    """

    response: Response
    sigma: Array
    overlaps: tuple[OverlapResponse, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """Grey values of the same ground in two heads.

    Attributes
    ----------
    head_a, head_b : int
    q_a, q_b : ndarray, shape (n,)
        Squared distance from the middle of the head's image, divided by that of its corner.
    log_ratio : ndarray, shape (n, n_bands)
        Logarithm of the ratio of a patch's means, a over b; NaN if it is saturated or dark.
    saturated, dark : ndarray, shape (n, n_bands)
        The samples left out for these two reasons.
    """

    head_a: int
    head_b: int
    q_a: Array
    q_b: Array
    log_ratio: Array
    saturated: Mask
    dark: Mask


def estimate_response(
    images: Sequence[Raster],
    orientation: RelativeOrientation,
    synthetic: Camera,
    *,
    rng: np.random.Generator,
    n_points: int = POINTS,
) -> ResponseFit:
    """Estimate the responses of the heads from one exposure's overlaps.

    For several exposures, join their `overlap_samples` and use `fit_response`.

    Parameters
    ----------
    images : sequence of ndarray, shape (rows, cols, bands)
        Images of the orientation's heads; only patches of them are read.
    orientation : RelativeOrientation
        Its heads have the size of the images.
    synthetic : Camera
    rng : numpy.random.Generator
        Draws the points.
    n_points : int
        Largest number of points of an overlap.
    """
    samples = overlap_samples(images, orientation, synthetic, rng=rng, n_points=n_points)
    return fit_response(samples, n_heads=len(images), n_bands=images[0].shape[2])


# --- the fit ---------------------------------------------------------------------------------


def fit_response(samples: Sequence[Samples], *, n_heads: int, n_bands: int) -> ResponseFit:
    """Estimate the responses of heads from samples of their overlaps.

    Robust least squares band by band, with a priori knowledge: the mean log gain of all heads is
    zero, and gains and radial terms are small (`SIGMA_GAIN`, `SIGMA_RADIAL`). It matters only
    for what the overlaps leave open: the common brightness, and heads without samples.

    Parameters
    ----------
    samples : sequence of Samples
        Of one exposure or of several.
    n_heads, n_bands : int
    """
    coefficients, sigma = np.zeros((2, n_heads, n_bands, 3))
    to_zero_mean = np.eye(3 * n_heads)
    to_zero_mean[::3, ::3] -= 1 / n_heads
    for band in range(n_bands):
        A, y = _equations(samples, n_heads, band)
        x, cov = _robust(A, y)
        coefficients[:, band] = (to_zero_mean @ x).reshape(n_heads, 3)
        sigma[:, band] = sigmas(to_zero_mean @ cov @ to_zero_mean.T).reshape(n_heads, 3)
    response = Response(coefficients=coefficients)
    pairs = sorted({(s.head_a, s.head_b) for s in samples})
    return ResponseFit(
        response=response,
        sigma=sigma,
        overlaps=tuple(
            _disagreement([s for s in samples if (s.head_a, s.head_b) == pair], response)
            for pair in pairs
        ),
    )


def _powers(q: Array) -> Array:
    return np.stack([np.ones_like(q), q, q * q], axis=-1)


def _equations(samples: Sequence[Samples], n_heads: int, band: int) -> tuple[Array, Array]:
    """Return the design matrix and the log ratios of the good samples of a band."""
    rows, values = [np.zeros((0, 3 * n_heads))], [np.zeros(0)]
    for s in samples:
        good = np.isfinite(s.log_ratio[:, band])
        A = np.zeros((int(good.sum()), n_heads, 3))
        A[:, s.head_a] = _powers(s.q_a[good])
        A[:, s.head_b] = -_powers(s.q_b[good])
        rows.append(A.reshape(-1, 3 * n_heads))
        values.append(s.log_ratio[good, band])
    return np.concatenate(rows), np.concatenate(values)


def _robust(A: Array, y: Array) -> tuple[Array, Array]:
    """Return the solution with a priori knowledge, and its covariance."""
    n = A.shape[1]
    prior = np.diag(1 / np.tile([SIGMA_GAIN, SIGMA_RADIAL, SIGMA_RADIAL], n // 3) ** 2)
    x, N = np.zeros(n), prior
    for width in (HUBER, TUKEY):
        for _ in range(STEPS):
            u = np.abs(y - A @ x)
            scale = _robust_rms(u)
            ratio = u / (width * scale)
            if width == TUKEY:
                weight = np.square(1 - np.square(np.minimum(ratio, 1.0)))
            else:
                weight = 1 / np.maximum(ratio, 1.0)
            AtP = A.T * (weight / scale**2)
            N = AtP @ A + prior
            before, x = x, np.linalg.solve(N, AtP @ y)
            if np.max(np.abs(x - before)) < SETTLED:
                break
    return x, np.linalg.inv(N)


def _robust_rms(v: Array) -> float:
    """Return the RMS of normally distributed errors with the same median size."""
    return max(1e-9, float(np.median(np.abs(v))) / 0.6745) if len(v) else 1.0


def _disagreement(samples: Sequence[Samples], response: Response) -> OverlapResponse:
    """Return the differences of a pair of heads, from its samples at all exposures."""
    a, b = samples[0].head_a, samples[0].head_b
    y = np.concatenate([s.log_ratio for s in samples])
    q_a, q_b = (np.concatenate([getattr(s, name) for s in samples]) for name in ("q_a", "q_b"))
    modelled = [_powers(q) @ response.coefficients[k].T for q, k in ((q_a, a), (q_b, b))]

    def by_band(values: Array) -> Array:
        finite = [v[np.isfinite(v)] for v in values.T]
        return np.array([_robust_rms(v) if len(v) else np.nan for v in finite])

    return OverlapResponse(
        head_a=a,
        head_b=b,
        before=by_band(y),
        after=by_band(y - modelled[0] + modelled[1]),
        n_used=np.isfinite(y).sum(axis=0),
        n_saturated=np.sum([s.saturated.sum(axis=0) for s in samples], axis=0),
        n_dark=np.sum([s.dark.sum(axis=0) for s in samples], axis=0),
    )


# --- ratios of grey values of the same ground in two heads, from patches of their overlaps -------


def corner_share(camera: Camera, colrow: Array) -> Array:
    """Return q, the squared distance from the middle of the image divided by the corner's.

    Parameters
    ----------
    camera : Camera
    colrow : ndarray, shape (..., 2)
        Pixels; the corner is that of the outer pixel edges.

    Returns
    -------
    ndarray, shape (...)
    """
    r = np.linalg.norm(xy_from_colrow(camera, colrow), axis=-1)
    return np.square(r / (0.5 * camera.pixel_mm * camera.diagonal_px))


def overlap_samples(
    images: Sequence[Raster],
    orientation: RelativeOrientation,
    synthetic: Camera,
    *,
    rng: np.random.Generator,
    n_points: int = POINTS,
) -> list[Samples]:
    """Return grey values of the same ground for all pairs of heads that overlap.

    Parameters are those of `estimate_response`.
    """
    # patches of reduced images cover more ground, so fewer pixels are enough
    patch = 5 if max(images[0].shape) >= 4000 else 3
    saturated = [_saturation(image) for image in images]
    pairs = []
    for pair in combinations(range(len(images)), 2):
        xy = _points(orientation, pair, synthetic, rng=rng, n_points=n_points, patch=patch)
        pairs += [(pair, xy)] if len(xy) else []

    def sampled(pair_and_points: tuple[tuple[int, int], Array]) -> Samples:
        pair, xy = pair_and_points
        parts = [_patches(images[k], orientation, k, xy, synthetic, patch) for k in pair]
        (at_a, mean_a, peak_a), (at_b, mean_b, peak_b) = parts
        too_bright = (peak_a >= saturated[pair[0]]) | (peak_b >= saturated[pair[1]])
        dark = ~too_bright & (np.minimum(mean_a, mean_b) < DARK_DN)
        good = ~(too_bright | dark)
        return Samples(
            head_a=pair[0],
            head_b=pair[1],
            q_a=corner_share(orientation.heads[pair[0]], at_a),
            q_b=corner_share(orientation.heads[pair[1]], at_b),
            log_ratio=np.log(
                np.divide(mean_a, mean_b, where=good, out=np.full(good.shape, np.nan))
            ),
            saturated=too_bright,
            dark=dark,
        )

    return processors.in_order(sampled, pairs)


def _points(
    orientation: RelativeOrientation,
    pair: tuple[int, int],
    synthetic: Camera,
    *,
    rng: np.random.Generator,
    n_points: int,
    patch: int,
) -> Array:
    """Draw points whose whole patches are seen by both heads, shape (n, 2), mm."""
    half = 0.5 * synthetic.pixel_mm * np.array([synthetic.width_px, synthetic.height_px])
    outlines = [footprint(orientation, k, per_side=8) for k in pair]
    low = np.max([-half, *(outline.min(axis=0) for outline in outlines)], axis=0)
    high = np.min([half, *(outline.max(axis=0) for outline in outlines)], axis=0)
    if np.any(high <= low):
        return np.zeros((0, 2))
    xy = rng.uniform(low, high, (2 * n_points, 2))
    seen = np.ones(len(xy), dtype=bool)
    for k in pair:
        camera, colrow = orientation.heads[k], head_from_synthetic(orientation, k, xy)
        last = np.array([camera.width_px, camera.height_px]) - 1
        seen &= np.all((colrow >= patch) & (colrow <= last - patch), axis=1)
    # the patches must not overlap, or the same pixels would count twice
    room = np.prod((high - low) / synthetic.pixel_mm) * seen.mean() / patch**2
    return xy[seen][: min(n_points, int(room))]


def _patches(
    image: Raster,
    orientation: RelativeOrientation,
    k: int,
    xy: Array,
    synthetic: Camera,
    patch: int,
) -> tuple[Array, Array, Array]:
    """Return positions in a head, means over patch x patch synthetic pixels, and largest values.

    Means are of bilinear samples of the same ground in both heads, shape (n, n_bands); the
    largest values, of the pixels around these.
    """
    step = synthetic.pixel_mm * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    here, right, up = (head_from_synthetic(orientation, k, xy + s) for s in step)
    offset = np.arange(patch) - (patch - 1) / 2
    i, j = (o.ravel()[:, None] for o in np.meshgrid(offset, offset))
    positions = here[:, None] + i * (right - here)[:, None] + j * (up - here)[:, None]
    first = np.floor(positions).astype(np.intp)
    x, y = np.moveaxis(positions - first, -1, 0)
    down, across = np.array([[0, 0, 1, 1], [0, 1, 0, 1]])[:, :, None, None]
    values = image[first[..., 1] + down, first[..., 0] + across]  # around samples of points
    weights = np.abs(1 - across - x) * np.abs(1 - down - y) / patch**2
    return here, np.einsum("cps,cpsb->pb", weights, values), values.max(axis=(0, 2))


def _saturation(image: Raster) -> Array:
    """Return the grey value from which pixels are saturated, shape (n_bands,).

    It is the largest value of the data type, or the largest value found if it is unusually
    frequent, as some heads clip at a smaller value.
    """
    every = max(max(image.shape) // 500, 1)
    top = float(np.iinfo(image.dtype).max)
    levels = []
    for band in np.moveaxis(image[::every, ::every], -1, 0):
        values, count = np.unique(band, return_counts=True)
        below = count[:-1][values[:-1] >= values[-1] - 0.01 * top].max(initial=0)
        clips = 20 <= count[-1] < 0.5 * band.size and count[-1] > 3 * below
        levels.append(values[-1] if clips else top)
    return np.array(levels, float)
