"""Radiometric response of the heads, from grey values of the same ground in their overlaps.

Gain and falloff.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from acx4lib import expected, shown
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import Camera, xy_from_colrow
from acx4lib.least_squares import processors
from acx4lib.least_squares.covariance import sigmas
from acx4lib.synthetic_image.compiled import patch_means
from acx4lib.synthetic_image.frame import footprint, head_from_synthetic
from acx4lib.synthetic_image.head_map import forget

# --- Radiometric response of the heads, from their overlaps: gain, and falloff towards the border
#
# Two heads see the ground of their overlap through different parts of their lenses. Therefore the
# log ratios of their grey values determine the gains and the radial falloff, band by band. They
# do not determine the brightness that all heads share.


Q = TypeVar("Q", np.float32, np.float64)

PER_CELL = 20
"""Samples in a cell of an overlap; responses are taken as constant in a cell."""

BEYOND = 0.1
"""Part of q by which responses are continued beyond the outermost `PER_CELL` samples."""

ENOUGH = 200
"""Samples of an overlap and a band below which the overlap is called poor."""

SIGMA_GAIN, SIGMA_RADIAL = 0.2, 0.3
"""A priori sigma of a log gain and of a radial term: lenses lose 20 to 30 % at their corners."""

HUBER, TUKEY, STEPS, SETTLED = 2.0, 5.0, 12, 1e-6
"""Widths of the two losses in spreads, most steps with each, size of a step that ends them."""


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
    valid_range : ndarray, shape (n_heads, 2), optional
        Smallest and largest valid q; beyond, the response at the limit is used. The range is the
        same for all bands, so that colours do not change beyond it. By default, the response is
        valid everywhere.
    """

    coefficients: Array
    valid_range: Array | None = None

    def __post_init__(self) -> None:
        expected.shape("coefficients", self.coefficients, ("n_heads", "n_bands", 3))
        if self.valid_range is not None:
            expected.shape("valid_range", self.valid_range, (len(self.coefficients), 2))

    def within(self, k: int, q: NDArray[Q]) -> NDArray[Q]:
        """Clip q of a head to the valid range of its response."""
        if self.valid_range is None:
            return q
        return np.clip(q, *self.valid_range[k].astype(q.dtype))


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
    floor : ndarray, shape (n_bands,)
        Robust RMS of the part that changes from sample to sample: noise, and ground that looks
        different to the two heads. No smooth response can make `after` smaller.
    n_used, n_saturated, n_dark : ndarray, shape (n_bands,)
        Numbers of samples.
    """

    head_a: int
    head_b: int
    before: Array
    after: Array
    floor: Array
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


# --- the model -------------------------------------------------------------------------------


def log_response(response: Response, k: int, colrow: Array, camera: Camera) -> Array:
    """Return the logarithm of a head's response at pixels, shape (n, n_bands)."""
    q = response.within(k, corner_share(camera, colrow))
    return _powers(q) @ response.coefficients[k].T


def _powers(q: Array) -> Array:
    return np.stack([np.ones_like(q), q, q * q], axis=-1)


POINTS = 20_000
"""Number of samples of an overlap."""


# --- the estimate ---------------------------------------------------------------------------------


def estimate_response(
    images: Sequence[Image],
    orientation: RelativeOrientation,
    synthetic: Camera,
    *,
    rng: np.random.Generator,
    n_points: int = POINTS,
) -> ResponseFit:
    """Estimate the responses of the heads from one exposure's overlaps.

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

    Notes
    -----
    For several exposures, join their `overlap_samples` and use `fit_response`.
    """
    samples = overlap_samples(images, orientation, synthetic, rng=rng, n_points=n_points)
    n_bands = _with_bands(images[0]).shape[2]
    return fit_response(samples, n_heads=len(images), n_bands=n_bands)


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
    expected.whole("n_heads", n_heads)
    expected.whole("n_bands", n_bands)
    coefficients, sigma = np.zeros((2, n_heads, n_bands, 3))
    for band in range(n_bands):
        A, y = _equations(samples, n_heads, band)
        x, cov = _robust(A, y)
        to_zero_mean = _zero_mean_gain(n_heads)
        coefficients[:, band] = (to_zero_mean @ x).reshape(n_heads, 3)
        sigma[:, band] = sigmas(to_zero_mean @ cov @ to_zero_mean.T).reshape(n_heads, 3)
    response = Response(coefficients=coefficients, valid_range=_valid_range(samples, n_heads))
    pairs = sorted({(s.head_a, s.head_b) for s in samples})
    return ResponseFit(
        response=response,
        sigma=sigma,
        overlaps=tuple(_disagreement(samples, pair, response) for pair in pairs),
    )


def _valid_range(samples: Sequence[Samples], n_heads: int) -> Array:
    """Return the range of q covered by samples of any band, shape (n_heads, 2)."""
    out = np.tile([-np.inf, np.inf], (n_heads, 1))
    for k in range(n_heads):
        sides = [(s.head_a, s.q_a, s) for s in samples] + [(s.head_b, s.q_b, s) for s in samples]
        parts = [q[np.isfinite(s.log_ratio).any(axis=1)] for head, q, s in sides if head == k]
        q_sorted = np.sort(np.concatenate([*parts, []]))
        if len(q_sorted) >= 2 * PER_CELL:
            out[k] = q_sorted[PER_CELL - 1] - BEYOND, q_sorted[-PER_CELL] + BEYOND
    # no limit where only the image ends, so that nothing is cut at its outermost pixels
    return np.where([out[:, 0] > 0, out[:, 1] < 1], out.T, [[-np.inf], [np.inf]]).T


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
    for width, tukey in ((HUBER, False), (TUKEY, True)):
        for _ in range(STEPS):
            u = np.abs(y - A @ x)
            scale = _robust_rms(u)
            ratio = u / (width * scale)
            if tukey:
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


def _zero_mean_gain(n_heads: int) -> Array:
    """Return the matrix that subtracts the mean from the gains."""
    out = np.eye(3 * n_heads)
    out[::3, ::3] -= 1 / n_heads
    return out


def _disagreement(
    samples: Sequence[Samples], pair: tuple[int, int], response: Response
) -> OverlapResponse:
    pair_samples = [s for s in samples if (s.head_a, s.head_b) == pair]
    y = np.concatenate([s.log_ratio for s in pair_samples])
    residuals = [s.log_ratio - _modelled(s, response) for s in pair_samples]
    rough = np.concatenate([_rough(s, v) for s, v in zip(pair_samples, residuals, strict=True)])
    good = np.isfinite(y)

    def by_band(values: Array) -> Array:
        finite = [v[np.isfinite(v)] for v in values.T]
        return np.array([_robust_rms(v) if len(v) else np.nan for v in finite])

    return OverlapResponse(
        head_a=pair[0],
        head_b=pair[1],
        before=by_band(y),
        after=by_band(np.concatenate(residuals)),
        floor=by_band(rough),
        n_used=good.sum(axis=0),
        n_saturated=np.sum([s.saturated.sum(axis=0) for s in pair_samples], axis=0),
        n_dark=np.sum([s.dark.sum(axis=0) for s in pair_samples], axis=0),
    )


def _modelled(s: Samples, response: Response) -> Array:
    a, b = (response.coefficients[k] for k in (s.head_a, s.head_b))
    q_a, q_b = response.within(s.head_a, s.q_a), response.within(s.head_b, s.q_b)
    return _powers(q_a) @ a.T - _powers(q_b) @ b.T


def _rough(samples: Samples, residuals: Array) -> Array:
    """Return log ratios minus the medians of their cells, of some twenty samples each."""
    per_side = max(1, int(np.sqrt(len(residuals) / PER_CELL)))
    low, high = samples.xy.min(axis=0), samples.xy.max(axis=0)
    place = (per_side * (samples.xy - low) / np.maximum(high - low, 1e-12)).astype(int)
    cell = np.minimum(place, per_side - 1) @ [1, per_side]
    out = np.full(residuals.shape, np.nan)
    for band, values in enumerate(residuals.T):
        good = np.isfinite(values)
        if not good.any():
            continue
        good_cell = cell[good]
        count = np.bincount(good_cell, minlength=per_side**2)
        medians = ndimage.median(values[good], good_cell, np.arange(per_side**2))
        enough = count[good_cell] > PER_CELL // 4
        out[np.flatnonzero(good)[enough], band] = (values[good] - medians[good_cell])[enough]
    return out


def poor_overlaps(fit: ResponseFit, names: Sequence[str]) -> list[str]:
    """Return sentences on overlaps and heads with too few samples, left to the a priori values.

    Parameters
    ----------
    fit : ResponseFit
    names : sequence of str
        Names of the heads.
    """
    out, met = [], set()
    for o in fit.overlaps:
        if o.n_used.min() < ENOUGH:
            out.append(
                f"the overlap of {names[o.head_a]} and {names[o.head_b]} has only "
                f"{o.n_used.min()} usable samples ({o.n_saturated.max()} saturated, "
                f"{o.n_dark.max()} dark)"
            )
        else:
            met |= {o.head_a, o.head_b}
    unconnected = [name for k, name in enumerate(names) if k not in met]
    if unconnected:
        out.append(f"{', '.join(unconnected)}: no overlap tells the response; it is held near one")
    return out


# --- Ratios of grey values of the same ground in two heads, from patches of their overlaps


Image = np.ndarray
"""A head's image: uint8 or uint16, shape (rows, cols, bands)."""

DARK_DN = 16.0
"""Smallest mean of a patch; below it, photon noise and offsets are too large a share."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Samples:
    """Grey values of the same ground in two heads.

    Attributes
    ----------
    head_a, head_b : int
    xy : ndarray, shape (n, 2)
        Positions in the synthetic image, mm.
    q_a, q_b : ndarray, shape (n,)
        Squared distance from the middle of the head's image, divided by that of its corner.
    log_ratio : ndarray, shape (n, n_bands)
        Logarithm of the ratio of a patch's means, a over b; NaN if it is saturated or dark.
    saturated, dark : ndarray, shape (n, n_bands)
        The samples left out for these two reasons.
    """

    head_a: int
    head_b: int
    xy: Array
    q_a: Array
    q_b: Array
    log_ratio: Array
    saturated: Mask
    dark: Mask


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
    corner = 0.5 * camera.pixel_mm * camera.diagonal_px
    return np.square(r / corner)


def overlap_samples(
    images: Sequence[Image],
    orientation: RelativeOrientation,
    synthetic: Camera,
    *,
    rng: np.random.Generator,
    n_points: int = POINTS,
) -> list[Samples]:
    """Return grey values of the same ground for all pairs of heads that overlap.

    Parameters are those of `estimate_response`.

    Raises
    ------
    ValueError
        Where the images are not those of the heads.
    """
    expected.whole("n_points", n_points)
    images = [_with_bands(image) for image in images]
    _check_images(images, orientation)
    # patches of reduced images cover more ground, so fewer pixels are enough
    patch = 5 if max(images[0].shape) >= 4000 else 3
    pairs = []
    for pair in combinations(range(len(images)), 2):
        xy = _points(orientation, pair, synthetic, rng=rng, n_points=n_points, patch=patch)
        pairs += [(pair, xy)] if len(xy) else []

    def sampled(pair_and_points: tuple[tuple[int, int], Array]) -> Samples:
        pair, xy = pair_and_points
        both = [_patches(images[k], orientation, k, xy, synthetic, patch) for k in pair]
        return _samples(orientation, pair, xy, both)

    samples = processors.in_order(sampled, pairs)
    for image in images:
        forget(image)
    return samples


def _check_images(images: Sequence[Image], orientation: RelativeOrientation) -> None:
    for image, head in zip(images, orientation.heads, strict=True):
        expected.shape(f"image of {head.name}", image, (head.height_px, head.width_px, "bands"))


def _with_bands(image: Image) -> Image:
    """Return an image with an axis for its bands."""
    return image[:, :, None] if image.ndim == 2 else image


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


@dataclass(frozen=True, kw_only=True, eq=False)
class _Patches:
    """Mean grey values and saturation of one head's patches, shape (n, n_bands)."""

    colrow: Array
    mean: Array
    saturated: Mask


def _patches(
    image: Image,
    orientation: RelativeOrientation,
    k: int,
    xy: Array,
    synthetic: Camera,
    patch: int,
) -> _Patches:
    """Return means over patch x patch synthetic pixels, the same ground in both heads."""
    step = synthetic.pixel_mm * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    here, right, up = (head_from_synthetic(orientation, k, xy + s) for s in step)
    offset = np.arange(patch) - (patch - 1) / 2
    i, j = (o.ravel()[:, None] for o in np.meshgrid(offset, offset))
    positions = here[:, None] + i * (right - here)[:, None] + j * (up - here)[:, None]
    n, bands = len(xy), image.shape[2]
    mean, peak = np.zeros((n, bands)), np.zeros((n, bands), image.dtype)
    histogram = np.zeros((bands, np.iinfo(image.dtype).max + 1), np.int64)
    patch_means(image, positions, mean, peak, histogram)
    return _Patches(colrow=here, mean=mean, saturated=peak >= _saturation(histogram))


def _saturation(histogram: Index) -> Array:
    """Return the grey value from which pixels are saturated, shape (n_bands,).

    It is the largest value of the data type, or the largest value found if it is unusually
    frequent, as some heads clip at a smaller value.
    """
    levels = np.full(len(histogram), histogram.shape[1] - 1.0)
    for band, level in enumerate(levels):
        values = np.flatnonzero(histogram[band])
        count = histogram[band, values]
        below = count[:-1][values[:-1] >= values[-1] - 0.01 * level].max(initial=0)
        if 20 <= count[-1] < 0.5 * count.sum() and count[-1] > 3 * below:
            levels[band] = values[-1]
    return levels


def _samples(
    orientation: RelativeOrientation, pair: tuple[int, int], xy: Array, both: Sequence[_Patches]
) -> Samples:
    a, b = both
    saturated = a.saturated | b.saturated
    dark = ~saturated & ((a.mean < DARK_DN) | (b.mean < DARK_DN))
    good = ~(saturated | dark)
    q = [corner_share(orientation.heads[k], p.colrow) for k, p in zip(pair, both, strict=True)]
    ratio = np.divide(a.mean, b.mean, where=good, out=np.full(a.mean.shape, np.nan))
    return Samples(
        head_a=pair[0],
        head_b=pair[1],
        xy=xy,
        q_a=q[0],
        q_b=q[1],
        log_ratio=np.log(ratio),
        saturated=saturated,
        dark=dark,
    )
