"""Others that sample an image at given places; each is made ready first, and called then.

A function of `PEERS` takes an image, shape (rows, cols, bands), and places in it, shape
(m, n, 2), col and row; it returns a call without arguments that gives the samples, (m, n, bands).
"""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Callable

import cv2
import numpy as np
from scipy import ndimage

from support.pictures import exact_rendering

Sampler = Callable[[], np.ndarray]


def remap(image: np.ndarray, at: np.ndarray, method: int = cv2.INTER_LINEAR) -> Sampler:
    """OpenCV, with maps in single precision."""
    x, y = (np.ascontiguousarray(at[..., axis], np.float32) for axis in (0, 1))
    return lambda: cv2.remap(image, x, y, method, borderMode=cv2.BORDER_CONSTANT)


def remap_cubic(image: np.ndarray, at: np.ndarray) -> Sampler:
    """OpenCV's cubic; its polynomial is another one than Catmull and Rom's."""
    return remap(image, at, cv2.INTER_CUBIC)


def scipy(image: np.ndarray, at: np.ndarray) -> Sampler:
    """scipy.ndimage, band by band."""
    places = np.ascontiguousarray(np.moveaxis(at[..., ::-1], -1, 0))
    bands = [np.ascontiguousarray(band) for band in np.moveaxis(image, -1, 0)]

    def sample() -> np.ndarray:
        samples = [
            ndimage.map_coordinates(b, places, order=1, mode="nearest", output=image.dtype)
            for b in bands
        ]
        return np.stack(samples, axis=-1)

    return sample


def skimage(image: np.ndarray, at: np.ndarray) -> Sampler:
    """scikit-image, band by band; its results are floating-point numbers."""
    from skimage.transform import warp  # noqa: PLC0415 not everywhere

    places = np.ascontiguousarray(np.moveaxis(at[..., ::-1], -1, 0))
    bands = [np.ascontiguousarray(band) for band in np.moveaxis(image, -1, 0)]

    def sample() -> np.ndarray:
        samples = [warp(b, places, order=1, mode="edge", preserve_range=True) for b in bands]
        return np.stack(samples, axis=-1)

    return sample


def pyvips(image: np.ndarray, at: np.ndarray) -> Sampler:
    """libvips, on one thread."""
    os.environ["VIPS_CONCURRENCY"] = "1"  # read when it is first loaded
    import pyvips as vips  # noqa: PLC0415 not everywhere

    source = vips.Image.new_from_array(image)
    places = vips.Image.new_from_array(np.ascontiguousarray(at, np.float32))
    bilinear = vips.Interpolate.new("bilinear")
    return lambda: source.mapim(places, interpolate=bilinear).numpy()


def oracle(image: np.ndarray, at: np.ndarray) -> Sampler:
    """The plain double-precision computation, its map not counted."""
    flat = at.reshape(-1, 2)
    return lambda: exact_rendering.sampled(image, flat).reshape(*at.shape[:2], -1)


PEERS: dict[str, Callable[[np.ndarray, np.ndarray], Sampler]] = {
    "remap_linear": remap,
    "remap_cubic": remap_cubic,
    "pyvips": pyvips,
    "scipy": scipy,
    "skimage": skimage,
    "oracle": oracle,
}

MODULES = {"pyvips": "pyvips", "skimage": "skimage"}


def missing(name: str) -> bool:
    """Tell whether the package that a name needs is not installed."""
    return name in MODULES and importlib.util.find_spec(MODULES[name]) is None


def cut(image: np.ndarray, at: np.ndarray, margin: int = 4) -> tuple[np.ndarray, np.ndarray]:
    """Return the part of an image that places need, and the places in that part."""
    size = np.array(image.shape[1::-1])
    low = np.clip(np.floor(at.min(axis=(0, 1))).astype(int) - margin, 0, size)
    high = np.clip(np.ceil(at.max(axis=(0, 1))).astype(int) + margin + 1, 0, size)
    return np.ascontiguousarray(image[low[1] : high[1], low[0] : high[0]]), at - low
