"""The synthetic image from the heads' images (section 2.1): sampled, equalised, blended."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from acx4lib import expected
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Mask, Raster
from acx4lib.geometry.camera import Camera
from acx4lib.least_squares import processors
from acx4lib.synthetic_image.compiled import (
    MOST_BANDS,
    add_samples,
    halve_into,
    set_depths,
    weigh,
)
from acx4lib.synthetic_image.head_map import HeadMap, fitting_step, head_map, levelled, window_map
from acx4lib.synthetic_image.response import Response

Interpolation = Literal["bilinear", "cubic"]

FEATHER_PX = 150.0
"""Usual width of the blend of two heads, px of a head at full size."""

NARROWEST_PX = 0.01  # of a blend; single precision tells 10 000 px to a thousandth
BLOCK = 128  # rows and columns that a thread renders at a time


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
    interpolation : str
        ``"bilinear"``, or ``"cubic"`` after Catmull and Rom, which is sharper.
    """

    maps: tuple[HeadMap, ...]
    width_px: int
    height_px: int
    response: Response | None = None
    feather_px: float = FEATHER_PX
    interpolation: Interpolation = "bilinear"

    def __post_init__(self) -> None:
        if not self.maps or not self.feather_px >= 0:
            msg = f"{len(self.maps)} heads, feather_px={self.feather_px}; 1 and 0 are the least"
            raise ValueError(msg)
        expected.one_of("interpolation", self.interpolation, ("bilinear", "cubic"))
        if len({(m.step_px, m.nodes.shape) for m in self.maps}) > 1:
            raise ValueError("the maps of the heads must have their nodes at the same pixels")
        cells = np.array(self.maps[0].nodes.shape[:2]) - 1
        if np.any(cells * self.step_px < [self.height_px, self.width_px]):
            msg = f"{cells[1]} x {cells[0]} cells of {self.step_px} px do not cover the image"
            raise ValueError(msg)
        heads = len(self.maps) if self.response is None else len(self.response.coefficients)
        if heads != len(self.maps):
            raise ValueError(f"a response of {heads} heads for {len(self.maps)}")

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
    interpolation: Interpolation = "bilinear",
    step_px: int | None = None,
) -> RenderPlan:
    """Return the plan of a synthetic image; it serves all exposures of the same orientation.

    Parameters
    ----------
    orientation : RelativeOrientation
        Its heads have the size of the images.
    synthetic : Camera
    response : Response, optional
        Response by which the heads are equalised.
    feather_px, interpolation
        As in `RenderPlan`.
    step_px : int, optional
        Pixels from node to node of the maps; `head_map.fitting_step` by default.
    """
    expected.whole("step_px", 1 if step_px is None else step_px)
    step = step_px or fitting_step(orientation, synthetic)
    heads = range(len(orientation.heads))
    maps = processors.in_order(
        lambda k: levelled(head_map(orientation, k, synthetic, step_px=step)), heads
    )
    return RenderPlan(
        maps=tuple(maps),
        width_px=synthetic.width_px,
        height_px=synthetic.height_px,
        response=response,
        feather_px=feather_px,
        interpolation=interpolation,
    )


def render(
    plan: RenderPlan, images: Sequence[np.ndarray], *, threads: int | None = None
) -> np.ndarray:
    """Return the whole image; the arguments are those of `render_rows`."""
    return render_rows(plan, images, 0, plan.height_px, threads=threads)


def render_rows(
    plan: RenderPlan,
    images: Sequence[np.ndarray],
    start: int,
    stop: int,
    *,
    threads: int | None = None,
) -> np.ndarray:
    """Return some rows of the image.

    The result does not depend on the division into rows or on the number of threads.

    Parameters
    ----------
    plan : RenderPlan
    images : sequence of ndarray, shape (rows, cols, bands)
        Images of the heads in the order of the plan: uint8 or uint16, 1 to 4 bands, contiguous;
        they may be mapped from files.
    start, stop : int
        First row, and row after the last. A part of a cell takes as long as a whole one, so
        multiples of the plan's step are best.
    threads : int, optional
        Number of threads; by default one per core.

    Returns
    -------
    ndarray, shape (stop - start, width, bands)
        Same type as the images; 0 where no head sees. A head sees everything inside the outer
        edges of its pixels; the outermost pixels are extended to these edges.

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
    expected.places("stop", stop, plan.height_px + 1)
    expected.places("start", start, stop + 1)
    _require_images(plan, images)
    out = np.empty((stop - start, plan.width_px, images[0].shape[2]), images[0].dtype)
    render_into(out, plan, images, start, threads)
    return out


def render_into(
    out: np.ndarray, plan: RenderPlan, images: Sequence[np.ndarray], start: int, threads: int | None
) -> None:
    """Fill `out`, shape (rows, width, bands), with the rows of the image from `start` on.

    Used for stripe after stripe in the same memory; raises a ValueError as `render_rows`.
    """
    expected.whole("threads", 1 if threads is None else threads)
    _require_images(plan, images)
    expected.places("start", start, plan.height_px - len(out) + 1)
    expected.shape("out", out, ("rows", plan.width_px, images[0].shape[2]))
    if (out.dtype, out.flags.c_contiguous) != (images[0].dtype, True):
        raise ValueError(f"out must be contiguous, of {images[0].dtype}, like the images")
    _resample(plan, images, (start, start + len(out)), out, threads)


def resample(
    image: np.ndarray,
    orientation: RelativeOrientation,
    k: int,
    synthetic: Camera,
    window: tuple[int, int, int, int],
) -> tuple[Array, Mask]:
    """Return one head's image in the synthetic geometry, neither equalised nor rounded.

    Parameters
    ----------
    image : ndarray, shape (rows, cols, bands)
        As for `render_rows`.
    orientation : RelativeOrientation
    k : int
        Number of the head.
    synthetic : Camera
    window : tuple of int
        First row, row after the last, first column, column after the last.

    Returns
    -------
    out : ndarray of float32, shape (rows, cols, bands)
        0 where the head does not see.
    seen : ndarray of bool, shape (rows, cols)
    """
    height, width = window[1] - window[0], window[3] - window[2]
    expected.positive("height and width of window", np.array([height, width]))
    step = fitting_step(orientation, synthetic)
    head = levelled(window_map(orientation, k, synthetic, window, step_px=step))
    plan = RenderPlan(maps=(head,), width_px=width, height_px=height)
    _require_images(plan, [image])
    out = np.empty((height, width, image.shape[2]), np.float32)
    _resample(plan, [image], (0, height), out, None)
    seen = np.isfinite(out[..., 0])
    out[~seen] = 0
    return out, seen


def _require_images(plan: RenderPlan, images: Sequence[np.ndarray]) -> None:
    """Raise a ValueError where images do not match a plan or each other."""
    if len(images) != len(plan.maps):
        raise ValueError(f"{len(images)} images for {len(plan.maps)} heads")
    first = images[0]
    for k, (image, head) in enumerate(zip(images, plan.maps, strict=True)):
        if image.ndim != 3 or image.shape[:2] != (head.height_px, head.width_px):
            msg = (
                f"the image of head {k + 1} has shape {image.shape}; must be "
                f"({head.height_px}, {head.width_px}, bands)"
            )
            raise ValueError(msg)
        if image.dtype not in (np.uint8, np.uint16) or not 1 <= image.shape[2] <= MOST_BANDS:
            msg = (
                f"the image of head {k + 1} is {image.dtype} with {image.shape[2]} bands; must "
                f"be uint8 or uint16 in this machine's byte order, with 1 to {MOST_BANDS}"
            )
            raise ValueError(msg)
        if (image.dtype, image.shape[2]) != (first.dtype, first.shape[2]):
            msg = (
                f"the image of head {k + 1} is {image.dtype} with {image.shape[2]} bands, that of "
                f"head 1 {first.dtype} with {first.shape[2]}; they must be alike"
            )
            raise ValueError(msg)
        if not image.flags.c_contiguous:
            raise ValueError(f"the image of head {k + 1} is a view with gaps; must be contiguous")
    bands = first.shape[2] if plan.response is None else plan.response.coefficients.shape[1]
    if bands != first.shape[2]:
        raise ValueError(f"a response of {bands} bands for {first.shape[2]}")


def _resample(
    plan: RenderPlan,
    images: Sequence[np.ndarray],
    rows: tuple[int, int],
    out: np.ndarray,
    threads: int | None,
) -> None:
    """Fill `out`, NaN where no head sees if it has floats; threads take blocks of cells in turn."""
    step = plan.step_px
    above, below = rows[0] // step, -(-rows[1] // step)
    nodes = np.stack([m.nodes[above : below + 1] for m in plan.maps])
    factors = _factors(plan, nodes)
    readable = [image.view() for image in images]
    for image in readable:
        image.flags.writeable = False  # so that code is compiled once, also for mapped files
    size = max(BLOCK // step, 1)
    feather = float(plan.feather_px) if plan.feather_px >= NARROWEST_PX else 0.0

    def fill(block: tuple[int, int]) -> None:
        i, j = block
        part = np.s_[:, i : i + size + 1, j : j + size + 1]
        blended, weights = _blended(plan, readable, nodes[part], factors[part], feather)
        if out.dtype == np.float32:
            blended[~weights.any(axis=0)] = np.nan
        else:
            clipped = np.clip(blended, 0, np.iinfo(out.dtype).max)
            blended = (clipped + np.float32(0.5)).astype(out.dtype)
        first = (above + i) * step - rows[0]  # of the block's rows in `out`
        target = out[max(first, 0) : first + len(blended), j * step : (j + size) * step]
        target[:] = blended[max(-first, 0) :][: len(target), : target.shape[1]]

    blocks = product(range(0, below - above, size), range(0, -(-plan.width_px // step), size))
    with ThreadPoolExecutor(threads or processors.cores()) as pool:
        list(pool.map(fill, blocks))


def _blended(
    plan: RenderPlan,
    images: Sequence[np.ndarray],
    nodes: Array,
    factors: NDArray[np.float32],
    feather: float,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return a block of whole cells, not rounded, and the weights of the heads."""
    nodes, factors = np.ascontiguousarray(nodes), np.ascontiguousarray(factors)
    step, (_, rows, cols, _) = plan.step_px, nodes.shape
    shape = (rows - 1) * step, (cols - 1) * step
    weights = np.empty((len(images), *shape), np.float32)
    for depths, image, corners in zip(weights, images, nodes, strict=True):
        set_depths(depths, corners, step, image.shape[1], image.shape[0])
    weigh(weights, feather)
    total = np.zeros((*shape, images[0].shape[2]), np.float32)
    for k, image in enumerate(images):
        if weights[k].any():
            add_samples(
                total, weights[k], image, nodes[k], factors[k], plan.interpolation == "cubic"
            )
    return total, weights


def _factors(plan: RenderPlan, nodes: Array) -> NDArray[np.float32]:
    """Return 1 / exp(g + a q + b q^2) at nodes, (n_heads, rows, cols, n_bands); no bands for 1."""
    if plan.response is None:
        return np.zeros((*nodes.shape[:3], 0), np.float32)
    coefficients = plan.response.coefficients
    factors = np.empty((*nodes.shape[:3], coefficients.shape[1]), np.float32)
    for k, head in enumerate(plan.maps):
        x, y = np.moveaxis(2 * nodes[k].astype(np.float32), -1, 0)
        x, y = x - np.float32(head.width_px - 1), y - np.float32(head.height_px - 1)
        q = (x * x + y * y) * np.float32(1 / (head.width_px**2 + head.height_px**2))
        q = plan.response.within(k, q)
        for band, (g, a, b) in enumerate(coefficients[k].astype(np.float32)):
            factors[k, ..., band] = np.exp(-(g + q * (a + q * b)))
    return factors


# --- Overviews of an image


def halve(small: Raster, image: Raster) -> None:
    """Fill an image of half the size, as `compiled.halve_into` does."""
    halve_into(small, image)
