"""A synthetic image in stripes, from top to bottom: heads blended, or stacked as its bands."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np

from acx4lib.expected import Raster
from acx4lib.production.tiff import TILE
from acx4lib.synthetic_image.rendering import RenderPlan, render_into, render_rows

TellRows = Callable[[str, int, int], None]
"""It is called with the exposure, the number of finished rows and the number of all rows."""

Fill = Callable[[Raster, int], Any]
"""Fills an array with the rows of the image from one on."""


def blended(plan: RenderPlan, images: Sequence[Raster], threads: int | None) -> Fill:
    """Return what fills stripes with one image of all heads."""
    return lambda out, start: render_into(out, plan, images, start, threads)


def stacked(plan: RenderPlan, images: Sequence[Raster], threads: int | None) -> Fill:
    """Return what fills stripes with the bands of all heads, head after head, side by side."""
    alone = [replace(plan, maps=(head,), feather_px=0.0) for head in plan.maps]

    def fill(out: Raster, start: int) -> None:
        stop = start + len(out)
        parts = (
            render_rows(one, [image], start, stop, threads=threads)
            for one, image in zip(alone, images, strict=True)
        )
        np.concatenate(list(parts), axis=2, out=out)

    return fill


def stripes(
    fill: Fill, shape: tuple[int, int, int], dtype: np.dtype, tell: Callable[[int, int], None]
) -> Iterator[Raster]:
    """Yield the image from top to bottom; the next stripe is made while one is written.

    A stripe is overwritten after the next one. Rendering runs in a thread of its own, which
    signals do not interrupt.

    Parameters
    ----------
    fill : callable
    shape : tuple of int
        Rows, columns and bands of the image.
    dtype : dtype
    tell : callable
        Called with the number of finished rows and of all.
    """
    rows = shape[0]
    rooms = np.empty((2, TILE, *shape[1:]), dtype)

    def stripe(start: int) -> Raster:
        out = rooms[start // TILE % 2, : rows - start]
        fill(out, start)
        return out

    with ThreadPoolExecutor(1) as pool:
        ahead = pool.submit(stripe, 0)
        for start in range(TILE, rows + TILE, TILE):
            done = ahead.result()
            if start < rows:
                ahead = pool.submit(stripe, start)
            yield done
            tell(min(start, rows), rows)
