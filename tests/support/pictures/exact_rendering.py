"""The synthetic image computed plainly, in double precision, with the exact map at every pixel.

What the renderer and its benchmark are measured against; it shares no code with it but the map.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

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
    cubic: bool = False,
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
    sample = sampled_cubic if cubic else sampled
    for k, (image, at) in enumerate(zip(images, positions, strict=True)):
        used = weights[k] > 0
        values = sample(image, at[used])
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
    return _sampled(image, at, {0: lambda s: 1 - s, 1: lambda s: s})


def sampled_cubic(image: Array, at: Array) -> Array:
    """Return Catmull-Rom samples at positions (n, 2)."""
    weights = {
        -1: lambda s: (-s + 2 * s**2 - s**3) / 2,
        0: lambda s: (2 - 5 * s**2 + 3 * s**3) / 2,
        1: lambda s: (s + 4 * s**2 - 3 * s**3) / 2,
        2: lambda s: (-(s**2) + s**3) / 2,
    }
    return _sampled(image, at, weights)


def _sampled(image: Array, at: Array, weights: dict[int, Callable[[Array], Array]]) -> Array:
    height, width = image.shape[:2]
    at = np.clip(at, 0, [width - 1, height - 1])
    whole = np.floor(at).astype(int)
    s, t = (at - whole).T
    out = np.zeros((len(at), image.shape[2]))
    for i, down in weights.items():
        for j, right in weights.items():
            row = np.clip(whole[:, 1] + i, 0, height - 1)
            col = np.clip(whole[:, 0] + j, 0, width - 1)
            out += (down(t) * right(s))[:, None] * image[row, col]
    return out
