"""The synthetic image computed plainly, in double precision, with the exact map at every pixel.

What the renderer and its benchmark are measured against; it shares no code with it but the map.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.geometry.camera import Camera, xy_from_colrow
from acx4lib.synthetic_image.frame import head_from_synthetic

Array = np.ndarray


def exact_positions(
    orientation: RelativeOrientation, synthetic: Camera, window: tuple[int, int, int, int]
) -> list[Array]:
    """Return where each head sees the pixels of a window, shape (rows, cols, 2), px."""
    rows, cols = np.arange(*window[:2]), np.arange(*window[2:])
    colrow = np.stack(np.meshgrid(cols, rows), axis=-1).astype(float)
    xy = xy_from_colrow(synthetic, colrow)
    flat = xy.reshape(-1, 2)
    return [
        head_from_synthetic(orientation, k, flat).reshape(xy.shape)
        for k in range(len(orientation.heads))
    ]


def blended(
    images: Sequence[Array],
    positions: Sequence[Array],
    *,
    feather_px: float,
    coefficients: Array | None = None,
) -> Array:
    """Return the unrounded image at positions of the heads, 0 where none sees."""
    depth = np.stack([_depth(im, at) for im, at in zip(images, positions, strict=True)])
    deepest = depth.max(axis=0)
    if feather_px > 0:
        weights = np.clip(np.minimum(depth, depth - deepest + feather_px), 0, None)
    else:
        weights = np.argmax(depth, axis=0) == np.arange(len(depth))[:, None, None]
        weights = weights * (depth > 0)
    total = weights.sum(axis=0)
    weights = np.divide(weights, total, out=np.zeros(weights.shape), where=total > 0)
    out = np.zeros((*deepest.shape, images[0].shape[2]))
    for k, (image, at) in enumerate(zip(images, positions, strict=True)):
        used = weights[k] > 0
        values = sampled(image, at[used])
        if coefficients is not None:
            values = _equalised(image, at[used], values, coefficients[k])
        out[used] += weights[k][used][:, None] * values
    return np.clip(out, 0, np.iinfo(images[0].dtype).max)


def _depth(image: Array, at: Array) -> Array:
    height, width = image.shape[:2]
    x, y = at[..., 0] + 0.5, at[..., 1] + 0.5
    depth = np.minimum(np.minimum(x, width - x), np.minimum(y, height - y))
    return np.where(depth > 0, depth, -np.inf)


def _equalised(image: Array, at: Array, values: Array, coefficients: Array) -> Array:
    """Divide by the response; what is saturated stays so."""
    size = np.array(image.shape[1::-1])
    q = np.sum((at - (size - 1) / 2) ** 2, axis=-1) / np.sum((size / 2) ** 2)
    g, a, b = coefficients.T
    top = np.iinfo(image.dtype).max
    factor = np.exp(g + np.outer(q, a) + np.outer(q**2, b))
    return np.maximum(values / factor, np.minimum(4 * values - 3 * top, top))


def sampled(image: Array, at: Array) -> Array:
    """Return bilinear samples at positions (n, 2); the outermost pixels go on for ever."""
    height, width = image.shape[:2]
    at = np.clip(at, 0, [width - 1, height - 1])
    whole = np.floor(at).astype(int)
    s, t = (at - whole).T[..., None]
    out = np.zeros((len(at), image.shape[2]))
    for i, down in ((0, 1 - t), (1, t)):
        for j, right in ((0, 1 - s), (1, s)):
            row = np.minimum(whole[:, 1] + i, height - 1)
            col = np.minimum(whole[:, 0] + j, width - 1)
            out += down * right * image[row, col]
    return out
