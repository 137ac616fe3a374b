"""The synthetic image from the heads' images (section 2.1): sampled, equalised, blended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Raster
from acx4lib.geometry.camera import Camera
from acx4lib.least_squares import processors
from acx4lib.synthetic_image.compiled import blend, halve_into
from acx4lib.synthetic_image.head_map import HeadMap, fitting_step, head_map, levelled, window_map
from acx4lib.synthetic_image.response import Response

FEATHER_PX = 150.0
"""Usual width of the blend of two heads, px of a head at full size."""

NARROWEST_PX = 0.01  # of a blend; single precision tells 10 000 px to a thousandth
ROWS = 128  # that a thread renders at a time


@dataclass(frozen=True, kw_only=True, eq=False)
class RenderPlan:
    """Everything needed to render an image, except the images of the heads.

    Attributes
    ----------
    maps : tuple of HeadMap
        One for each head, with nodes at the same pixels.
    width_px, height_px : int
        Size of the image.
    response : Response or None
        Grey values of the heads are divided by it. None: 1.
    feather_px : float
        Heads blend on both sides of the line at the same distance from their borders, over this
        number of pixels of theirs; less than `NARROWEST_PX` makes this line a hard seam.
    """

    maps: tuple[HeadMap, ...]
    width_px: int
    height_px: int
    response: Response | None = None
    feather_px: float = FEATHER_PX

    @property
    def step_px(self) -> int:
        """Pixels from node to node."""
        return self.maps[0].step_px


def render_plan(
    orientation: RelativeOrientation,
    synthetic: Camera,
    *,
    response: Response | None = None,
    feather_px: float = FEATHER_PX,
) -> RenderPlan:
    """Return the plan of a synthetic image; it serves all exposures of the same orientation.

    Parameters
    ----------
    orientation : RelativeOrientation
        Its heads have the size of the images.
    synthetic : Camera
    response : Response, optional
        Response by which the heads are equalised.
    feather_px : float
        As in `RenderPlan`.
    """
    step = fitting_step(orientation, synthetic)
    maps = processors.in_order(
        lambda k: levelled(head_map(orientation, k, synthetic, step_px=step)),
        range(len(orientation.heads)),
    )
    return RenderPlan(
        maps=tuple(maps),
        width_px=synthetic.width_px,
        height_px=synthetic.height_px,
        response=response,
        feather_px=feather_px,
    )


def render(plan: RenderPlan, images: Sequence[Raster]) -> Raster:
    """Return the whole image; the arguments are those of `render_into`."""
    out = np.empty((plan.height_px, plan.width_px, images[0].shape[2]), images[0].dtype)
    render_into(out, plan, images, 0)
    return out


def render_into(out: Raster, plan: RenderPlan, images: Sequence[Raster], start: int) -> None:
    """Fill some rows of the image; they do not depend on the division into rows.

    Parameters
    ----------
    out : ndarray, shape (rows, width, bands)
        Of the images' type; it becomes 0 where no head sees. A head sees everything inside the
        outer edges of its pixels; the outermost pixels are extended to these edges.
    plan : RenderPlan
    images : sequence of ndarray, shape (rows, cols, bands)
        Images of the heads in the order of the plan: uint8 or uint16, contiguous; they may be
        mapped from files.
    start : int
        First row; multiples of the plan's step are best, since a part of a cell takes as long as
        a whole one.

    Raises
    ------
    ValueError
        Where the images do not match the plan.

    Notes
    -----
    The weight of head k is max(0, min(d_k, d_k - d_max + feather_px)), divided by the sum over
    the heads; d is the distance from a head's border, px. Results are rounded to the nearest
    number and never stretched. A sample between saturated pixels remains saturated; where a head
    is made darker, samples just below rise to it steadily, `compiled.SHOULDER` times as fast, so
    that a bright sky does not become speckled.
    """
    _require_images(plan, images)
    step = plan.step_px
    readable = tuple(image.view() for image in images)
    for image in readable:
        image.flags.writeable = False  # so that code is compiled once, also for mapped files
    feather = float(plan.feather_px) if plan.feather_px >= NARROWEST_PX else 0.0

    def fill(first: int) -> None:
        part = out[first : first + ROWS]
        above, skip = divmod(start + first, step)
        below = -(-(start + first + len(part)) // step) + 1
        nodes = np.stack([head.nodes[above:below] for head in plan.maps])
        factors = _factors(plan, nodes, part.shape[2])
        blend(part, readable, nodes, factors, step, skip, feather)

    processors.in_order(fill, range(0, len(out), ROWS))


def resample(
    image: Raster,
    orientation: RelativeOrientation,
    k: int,
    synthetic: Camera,
    window: tuple[int, int, int, int],
) -> Raster:
    """Return one head's image in the synthetic geometry, not equalised; 0 where it does not see.

    Parameters
    ----------
    image : ndarray, shape (rows, cols, bands)
        As for `render_into`.
    orientation : RelativeOrientation
    k : int
        Number of the head.
    synthetic : Camera
    window : tuple of int
        First row, row after the last, first column, column after the last.
    """
    step = fitting_step(orientation, synthetic)
    head = levelled(window_map(orientation, k, synthetic, window, step_px=step))
    height, width = window[1] - window[0], window[3] - window[2]
    return render(RenderPlan(maps=(head,), width_px=width, height_px=height), [image])


def stack(plan: RenderPlan, images: Sequence[Raster], start: int, stop: int) -> Raster:
    """Return rows of an image whose bands are those of all heads, head after head, not blended."""
    parts = []
    for head, image in zip(plan.maps, images, strict=True):
        parts.append(np.empty((stop - start, plan.width_px, image.shape[2]), image.dtype))
        render_into(parts[-1], replace(plan, maps=(head,), feather_px=0.0), [image], start)
    return np.concatenate(parts, axis=2)


def halve(small: Raster, image: Raster) -> None:
    """Fill an image of half the size, as `compiled.halve_into` does."""
    halve_into(small, image)


def _require_images(plan: RenderPlan, images: Sequence[Raster]) -> None:
    """Raise a ValueError where images do not match a plan or each other."""
    bands, dtype = images[0].shape[2] if images[0].ndim == 3 else 0, images[0].dtype
    if plan.response is not None and plan.response.coefficients.shape[1] != bands:
        raise ValueError(f"images of {bands} bands do not fit the plan's response")
    for head, image in zip(plan.maps, images, strict=True):
        shape = (head.height_px, head.width_px, bands)
        if image.shape != shape or image.dtype != dtype or dtype not in (np.uint8, np.uint16):
            msg = (
                f"expected images of shape {shape}, all uint8 or uint16, got {image.shape}, "
                f"{image.dtype}"
            )
            raise ValueError(msg)


def _factors(plan: RenderPlan, nodes: Array, bands: int) -> NDArray[np.float32]:
    """Return 1 / exp(g + a q + b q^2) at nodes, shape (n_heads, rows, cols, bands)."""
    factors = np.ones((*nodes.shape[:3], bands), np.float32)
    if plan.response is None:
        return factors
    for k, head in enumerate(plan.maps):
        x, y = np.moveaxis(2 * nodes[k].astype(np.float32), -1, 0)
        x, y = x - np.float32(head.width_px - 1), y - np.float32(head.height_px - 1)
        q = (x * x + y * y) * np.float32(1 / (head.width_px**2 + head.height_px**2))
        for band, (g, a, b) in enumerate(plan.response.coefficients[k].astype(np.float32)):
            factors[k, ..., band] = np.exp(-(g + q * (a + q * b)))
    return factors
