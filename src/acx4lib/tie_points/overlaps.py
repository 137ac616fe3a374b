"""The parts of the synthetic image that two heads share, and grey values in its geometry."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np

from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera, border_distance, colrow_from_xy
from acx4lib.least_squares import processors
from acx4lib.synthetic_image.frame import (
    coverage,
    footprint,
    head_from_synthetic,
    reduced_camera,
    reduced_heads,
)
from acx4lib.synthetic_image.head_map import HeadMap, forget, window_map
from acx4lib.tie_points.compiled import mean_of_bands, sample_between_nodes
from acx4lib.tie_points.least_squares_matching import REACH, spline_coefficients

# first row, row after the last, first column, column after the last
SyntheticWindow = tuple[int, int, int, int]

STEP_MM = 0.09  # from node to node of a map: 16 px of 5.6 um, with errors of 0.002 px between
LONG = 3  # widths of a narrow overlap; heads that only touch at a corner need no ties
_NODES = 100  # along the longer side of the synthetic image, to find overlaps
_BORDER = 200  # points on each side of a head
_ROUNDING = 1e-3  # px


@dataclass(frozen=True, kw_only=True)
class SharedWindow:
    """The common part of two heads in the synthetic image.

    Attributes
    ----------
    head_a, head_b : int
        head_a < head_b.
    window : tuple of int
        Rectangle around it: first row, row after the last, first column, column after the last.
    area_px : float
        Number of synthetic pixels that both heads see.
    width_px : float
        Its width, synthetic pixels.
    """

    head_a: int
    head_b: int
    window: SyntheticWindow
    area_px: float
    width_px: float


@dataclass(frozen=True, kw_only=True, eq=False)
class GreyExposure:
    """Grey images of all heads at one exposure, reduced by a whole number.

    Attributes
    ----------
    images : tuple of ndarray of float32, shape (rows, cols)
    orientation : RelativeOrientation
        With heads of this size.
    synthetic : Camera
        Reduced by the same factor.
    factor : int
    """

    images: tuple[Array, ...]
    orientation: RelativeOrientation
    synthetic: Camera
    factor: int


def shared_windows(orientation: RelativeOrientation, synthetic: Camera) -> list[SharedWindow]:
    """Return the parts that pairs of heads share.

    They are found on a grid over the synthetic image; strips that are narrower than its meshes, by
    the heads' borders.
    """
    size = np.array([synthetic.height_px, synthetic.width_px])
    grid = coverage(orientation, synthetic, spacing_px=max(int(size.max()) // _NODES, 1))
    seen = grid.seen
    spacing = (size - 1) / (np.array(seen.shape[1:]) - 1)
    out = []
    for a in range(len(seen)):
        for b in range(a + 1, len(seen)):
            shared = np.argwhere(seen[a] & seen[b])
            strip = _strip(orientation, (a, b), synthetic)
            if not len(shared):
                out += [strip] if strip.area_px > LONG * strip.width_px**2 else []
                continue
            # the shared part may extend up to the next node
            first = np.maximum(np.floor((shared.min(axis=0) - 1) * spacing), 0)
            last = np.minimum(np.ceil((shared.max(axis=0) + 1) * spacing) + 1, size)
            window = (int(first[0]), int(last[0]), int(first[1]), int(last[1]))
            area = float(len(shared) * np.prod(spacing))
            inner = _depths(orientation, (a, b), synthetic, grid.xy[seen[a] & seen[b]])
            width = max(strip.width_px, 2 * float(inner.min(axis=0).max()))
            out.append(replace(strip, window=window, area_px=area, width_px=width))
    return out


def _strip(
    orientation: RelativeOrientation, pair: tuple[int, int], synthetic: Camera
) -> SharedWindow:
    """Return the common part of two heads that overlap only in a strip along their borders."""
    half = 0.5 * synthetic.pixel_mm * np.array([synthetic.width_px, synthetic.height_px])
    xy = np.concatenate([footprint(orientation, k, per_side=_BORDER) for k in pair])
    depths = _depths(orientation, pair, synthetic, xy)
    # a point of a border is 0 px inside its own head
    within = (depths.min(axis=0) > -_ROUNDING) & np.all(np.abs(xy) <= half, axis=1)
    colrow = colrow_from_xy(synthetic, xy[within])
    empty = not len(colrow)
    first = np.zeros(2) if empty else np.floor(colrow.min(axis=0))
    last = np.zeros(2) if empty else np.ceil(colrow.max(axis=0)) + 1
    width = float(depths[:, within].max(initial=0.0))
    return SharedWindow(
        head_a=pair[0],
        head_b=pair[1],
        window=(int(first[1]), int(last[1]), int(first[0]), int(last[0])),
        area_px=width * float(np.max(last - first)),
        width_px=width,
    )


def _depths(
    orientation: RelativeOrientation, pair: tuple[int, int], synthetic: Camera, xy: Array
) -> Array:
    """Return the depths of points inside the borders of two heads, synthetic px, shape (2, n)."""
    depths = []
    for k in pair:
        head = orientation.heads[k]
        depth = border_distance(head, head_from_synthetic(orientation, k, xy))
        depths.append(depth * head.pixel_mm / synthetic.pixel_mm)
    return np.nan_to_num(np.stack(depths), nan=-1.0)


def grey(image: np.ndarray) -> Array:
    """Return the mean of an image's bands, shape (rows, cols), float32."""
    out = np.empty(image.shape[:2], np.float32)
    mean_of_bands(image, out)
    return out


def grey_window(
    image: np.ndarray,
    orientation: RelativeOrientation,
    k: int,
    synthetic: Camera,
    window: SyntheticWindow,
) -> Array:
    """Return the grey values of one head in a part of the synthetic image.

    Interpolated by cubic splines. Bilinear interpolation would shift fine structures by
    hundredths of a pixel, depending on their position between the pixels.

    Parameters
    ----------
    image : ndarray, shape (rows, cols, bands)
        Image of the head; or its grey values, shape (rows, cols).
    orientation : RelativeOrientation
    k : int
        Number of the head.
    synthetic : Camera
    window : tuple of int
        First row, row after the last, first column, column after the last; it may extend beyond
        the synthetic image's border.

    Returns
    -------
    ndarray of float32
        NaN where the head does not see.
    """
    step_px = min(max(round(STEP_MM / synthetic.pixel_mm), 4), 16)
    head = window_map(orientation, k, synthetic, window, step_px=step_px)
    out = np.full((window[1] - window[0], window[3] - window[2]), np.nan, np.float32)
    first, last = _part(head)
    if np.all(last - first > 3):
        part = image[first[1] : last[1], first[0] : last[0]]
        part = np.asarray(part, np.float32) if part.ndim == 2 else grey(part)
        resample(part, head.nodes, head.step_px, first, out)
    return out


def resample(part: Array, nodes: Array, step: int, origin: Array, out: Array) -> None:
    """Fill an image with grey values of another one, by cubic splines.

    Parameters
    ----------
    part : ndarray of float32, shape (rows, cols)
        Grey values of a part of the other image.
    nodes : ndarray, shape (m, n, 2)
        col, row in the other image, at every `step`-th pixel of `out`; bilinear between them.
    step : int
    origin : ndarray, shape (2,)
        col, row in the other image of the part's first pixel.
    out : ndarray of float32
        NaN where the part has no values.
    """
    whole = np.ascontiguousarray(nodes, dtype=float)
    sample_between_nodes(spline_coefficients(part), whole, step, origin.astype(float), out)


def _part(head: HeadMap) -> tuple[np.ndarray, np.ndarray]:
    """Return first col, row of the pixels of a map, and col, row after the last."""
    size = np.array([head.width_px, head.height_px])
    flat = head.nodes.reshape(-1, 2)
    flat = flat[np.isfinite(flat[:, 0])]
    if not len(flat):
        return size, size
    first = np.clip(np.floor(flat.min(axis=0)) - REACH, 0, size).astype(np.intp)
    last = np.clip(np.ceil(flat.max(axis=0)) + REACH + 1, 0, size).astype(np.intp)
    return first, last


def reduced_exposure(
    images: Sequence[np.ndarray],
    orientation: RelativeOrientation,
    synthetic: Camera,
    factor: int,
) -> GreyExposure:
    """Return grey images reduced by a factor; pixels are means of factor x factor pixels."""
    heads = reduced_heads(orientation, factor)
    pairs = zip(images, heads.heads, strict=True)
    return GreyExposure(
        images=tuple(processors.in_order(lambda pair: _reduced_grey(*pair, factor), pairs)),
        orientation=heads,
        synthetic=reduced_camera(synthetic, factor),
        factor=factor,
    )


def _reduced_grey(image: np.ndarray, camera: Camera, factor: int) -> Array:
    """Return the means of factor x factor pixels, from the middle of an image."""
    size = factor * np.array([camera.height_px, camera.width_px])
    row, col = (np.array(image.shape[:2]) - size) // 2
    out = np.empty((camera.height_px, camera.width_px), np.float32)
    rows = max(512 // factor, 1)
    for start in range(0, len(out), rows):  # a few rows at a time: the image may be on a disk
        stop = min(start + rows, len(out))
        part = image[row + factor * start : row + factor * stop, col : col + size[1]]
        small = cv2.resize(part, (out.shape[1], stop - start), interpolation=cv2.INTER_AREA)
        out[start:stop] = grey(small.reshape(*small.shape[:2], -1))
    forget(image)
    return out
