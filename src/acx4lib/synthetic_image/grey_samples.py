"""Ratios of grey values of the same ground in two heads, from patches of their overlaps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from acx4lib import expected
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import Camera, xy_from_colrow
from acx4lib.least_squares import processors
from acx4lib.synthetic_image.compiled.patch_means import patch_means
from acx4lib.synthetic_image.frame import footprint, head_from_synthetic
from acx4lib.synthetic_image.mapped_pixels import forget

Image = np.ndarray
"""A head's image: uint8 or uint16, shape (rows, cols, bands)."""

POINTS = 20_000
"""Number of samples of an overlap."""

DARK_DN = 16.0
"""Mean of a patch below which photon noise and offsets are a too large part of it."""


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
    share: Array = np.square(r / corner)
    return share


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
    expected.instance("rng", rng, np.random.Generator)
    expected.whole("n_points", n_points)
    images = [with_bands(image) for image in images]
    _check_images(images, orientation)
    # patches of reduced images cover more ground, so fewer pixels are enough
    patch = 5 if max(images[0].shape) >= 4000 else 3
    pairs = []
    for pair in combinations(range(len(images)), 2):
        xy = _points(orientation, pair, synthetic, rng=rng, n_points=n_points, patch=patch)
        pairs += [(pair, xy)] if len(xy) else []

    def sampled(one: tuple[tuple[int, int], Array]) -> Samples:
        pair, xy = one
        both = [_patches(images[k], orientation, k, xy, synthetic, patch) for k in pair]
        return _samples(orientation, pair, xy, both)

    found = processors.in_order(sampled, pairs)
    for image in images:
        forget(image)
    return found


def _check_images(images: Sequence[Image], orientation: RelativeOrientation) -> None:
    expected.many("images", images, len(orientation.heads), "images, one for each head")
    for image, head in zip(images, orientation.heads, strict=True):
        expected.shape(f"image of {head.name}", image, (head.height_px, head.width_px, "bands"))


def with_bands(image: Image) -> Image:
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
    """Return points whose whole patches are seen by both heads, shape (n, 2), mm."""
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
    """Grey values of one head's patches: their mean, and which are saturated, (n, n_bands)."""

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
    """Return means over patch x patch synthetic pixels, which show both heads' same ground."""
    step = synthetic.pixel_mm * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    here, right, up = (head_from_synthetic(orientation, k, xy + s) for s in step)
    offset = np.arange(patch) - (patch - 1) / 2
    i, j = (o.ravel()[:, None] for o in np.meshgrid(offset, offset))
    at = here[:, None] + i * (right - here)[:, None] + j * (up - here)[:, None]
    n, bands = len(xy), image.shape[2]
    mean, peak = np.zeros((n, bands)), np.zeros((n, bands), image.dtype)
    often = np.zeros((bands, np.iinfo(image.dtype).max + 1), np.int64)
    patch_means(image, at, mean, peak, often)
    return _Patches(colrow=here, mean=mean, saturated=peak >= _saturation(often))


def _saturation(often: Index) -> Array:
    """Return the grey value from which pixels are saturated, shape (n_bands,).

    It is the largest value of the data type, or the largest value found if it is unusually
    frequent, as some heads clip at a smaller value.

    Parameters
    ----------
    often : ndarray, shape (n_bands, values)
        Number of pixels with each value of the data type.
    """
    levels = np.full(len(often), often.shape[1] - 1.0)
    for band, level in enumerate(levels):
        found = np.flatnonzero(often[band])
        count = often[band, found]
        below = count[:-1][found[:-1] >= found[-1] - 0.01 * level].max(initial=0)
        if 20 <= count[-1] < 0.5 * count.sum() and count[-1] > 3 * below:
            levels[band] = found[-1]
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
