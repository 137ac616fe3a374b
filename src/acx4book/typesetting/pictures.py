"""Pictures in figures: 16-bit images stretched for the screen and reduced in size.

No file of pixels is made with it: stretch and gamma are only for viewing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke

from acx4book.typesetting.style import BLACK, PAPER, SOFT
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Raster
from acx4lib.geometry.camera import Camera, xy_from_colrow
from acx4lib.synthetic_image.frame import synthetic_from_head

DPI = 150
"""Pixels of a figure per inch."""

NO_PICTURES = "heads/images.csv names no files with pixels."

HALO = (withStroke(linewidth=2.4, foreground=PAPER),)
"""Outline of text on a picture."""

OUTLINED = (withStroke(linewidth=3.6, foreground=BLACK),)
"""Outline of white marks on a picture."""

GAMMA = 1.6
"""The ground is darker than the middle grey of a screen."""

LEVELS = 40
"""Grey values of a band in a figure; more can hardly be distinguished and need larger files."""

ALL_LEVELS = 256
"""Grey values of a band where pixels are enlarged; such files are small."""

Window = tuple[int, int, int, int]
"""First row, row after the last, first column, column after the last."""


# --- pixels ----------------------------------------------------------------------------------


def smaller(image: Raster | Array, k: int) -> Array:
    """Return means of k x k pixels from the middle of an image, shape (rows, cols, bands)."""
    rows, cols = image.shape[0] // k, image.shape[1] // k
    top, left = (image.shape[0] - k * rows) // 2, (image.shape[1] - k * cols) // 2
    out = np.empty((rows, cols, *image.shape[2:]), dtype=np.float32)
    for i in range(rows):  # a line at a time: the image may be on a disk
        line = image[top + i * k : top + (i + 1) * k, left : left + k * cols]
        out[i] = line.sum(axis=0, dtype=float).reshape(cols, k, -1).sum(axis=1) / k**2
    return out


@dataclass(frozen=True, kw_only=True)
class Stretch:
    """The grey values shown as black and white."""

    low: float
    high: float


def common_stretch(images: Sequence[Array | Raster]) -> Stretch:
    """Return a common stretch of all bands and images, so that differences stay visible.

    Parameters
    ----------
    images : sequence of ndarray, shape (rows, cols, bands)
        Zero in all bands means no data.
    """
    values = np.concatenate([image[image.any(axis=-1)].ravel() for image in images])
    if not len(values):
        return Stretch(low=0.0, high=1.0)
    low, high = np.percentile(values, [0.4, 100 - 0.4])
    return Stretch(low=float(low), high=float(max(high, low + 1)))


def displayed(image: Array | Raster, stretch: Stretch, *, levels: int = LEVELS) -> Array:
    """Return an image for a screen, shape (rows, cols, 3), 0 to 1.

    Of three or four bands it shows the first three, of others the first; no data is white.
    """
    bands = image[..., :3] if image.shape[-1] >= 3 else image[..., [0, 0, 0]]
    part = np.clip((bands - stretch.low) / (stretch.high - stretch.low), 0, 1) ** (1 / GAMMA)
    out: Array = np.rint(part * (levels - 1)) / (levels - 1)
    out[~image.any(axis=-1)] = 1.0
    return out


# --- axes ------------------------------------------------------------------------------------


def frameless(ax: Axes) -> None:
    """Remove everything around a picture except a thin border."""
    ax.set(xticks=[], yticks=[])
    ax.grid(visible=False)
    ax.spines[:].set(visible=True, color=SOFT, linewidth=0.4)


def extent_mm(synthetic: Camera, window: Window | None = None) -> tuple[float, ...]:
    """Return the outer edges of a part of the synthetic image: left, right, bottom, top, mm."""
    top, bottom, left, right = window or (0, synthetic.height_px, 0, synthetic.width_px)
    corners = np.array([[left, top], [right, bottom]]) - 0.5
    (x0, y1), (x1, y0) = xy_from_colrow(synthetic, corners)
    return float(x0), float(x1), float(y0), float(y1)


# --- heads -----------------------------------------------------------------------------------


def middle_xy(orientation: RelativeOrientation, k: int) -> Array:
    """Return the position of a head's middle in the synthetic image, mm."""
    camera = orientation.heads[k]
    middle = 0.5 * np.array([[camera.width_px - 1, camera.height_px - 1]])
    return synthetic_from_head(orientation, k, middle)[0]


def middles_apart(orientation: RelativeOrientation) -> bool:
    """Tell whether names of heads fit at their middles without overlap."""
    heads = orientation.heads
    middles = np.array([middle_xy(orientation, k) for k in range(len(heads))])
    sizes = [camera.width_px * camera.pixel_mm for camera in heads]
    apart = [float(np.hypot(*(a - b))) for a, b in combinations(middles, 2)]
    return min(apart, default=np.inf) > 0.2 * min(sizes)
