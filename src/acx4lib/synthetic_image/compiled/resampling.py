"""Requests for memory before it is needed, for compiled code that reads it in jumps."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from acx4lib.compiling import compiled, uncounted, uncounted_inlined
from acx4lib.expected import Array, Index
from acx4lib.synthetic_image.compiled.blend_weights import (
    UNSEEN,
    WITHIN,
    Heads,
    Recipe,
    Window,
    Work,
    find_heads,
)
from acx4lib.synthetic_image.compiled.interpolation import (
    SHOULDER,
    add_line,
    read_number,
    sample_line,
    write_line,
)

_INT = ir.IntType(32)
_EMIT: Any = cgutils  # it has no types, nor has `intrinsic`
_emitted: Callable[[Callable[..., Any]], Callable[..., Any]] = intrinsic


@_emitted
def ask_to_read(_typing: Any, address: Any) -> Any:
    """Ask the processor to load memory that will be read: ``ask_to_read(address)``."""
    return types.void(address), lambda *given: _ask(given[0], given[1], given[3][0], 0)


@_emitted
def ask_to_write(_typing: Any, address: Any) -> Any:
    """Ask the processor to load memory that will be written: ``ask_to_write(address)``."""
    return types.void(address), lambda *given: _ask(given[0], given[1], given[3][0], 1)


def _ask(context: Any, builder: ir.IRBuilder, address: Any, write: int) -> Any:
    pointer = ir.IntType(8).as_pointer()
    kind = ir.FunctionType(ir.VoidType(), [pointer, _INT, _INT, _INT])
    ask = _EMIT.get_or_insert_function(builder.module, kind, "llvm.prefetch.p0")
    how = [ir.Constant(_INT, number) for number in (write, 3, 1)]  # 3: nearest cache, 1: data
    builder.call(ask, [builder.inttoptr(address, pointer), *how])
    return context.get_dummy_value()


# --- Means of small patches of an image, and what of them is saturated, compiled


@compiled
def patch_means(image: Array, at: Array, mean: Array, peak: Array, often: Index) -> None:
    """Fill in the means of bilinear samples, and the largest of the pixels that they are made of.

    Count how often the pixel right of and below each sample has each value: enough pixels to tell
    how frequent a value is.

    Parameters
    ----------
    image : ndarray, shape (rows, cols, bands)
    at : ndarray, shape (n, samples, 2)
        col, row of the samples of each patch; they have pixels on all sides.
    mean : ndarray, shape (n, bands)
    peak : ndarray of the image's type, shape (n, bands)
    often : ndarray of int64, shape (bands, values)
        To be added to.
    """
    n, samples = at.shape[:2]
    bands = image.shape[2]
    total = np.empty(bands)
    for p in range(n):
        total[:] = 0.0
        peak[p] = 0
        for s in range(samples):
            col, row = int(at[p, s, 0]), int(at[p, s, 1])
            x, y = np.float32(at[p, s, 0] - col), np.float32(at[p, s, 1] - row)
            for k in range(4):
                down, across = k // 2, k % 2
                weight = abs(np.float32(1 - across) - x) * abs(np.float32(1 - down) - y)
                for band in range(bands):
                    value = image[row + down, col + across, band]
                    total[band] += np.float64(value) * np.float64(weight)
                    peak[p, band] = max(peak[p, band], value)
                    if k == 3:
                        often[band, value] += 1
        for band in range(bands):
            mean[p, band] = total[band] / samples


# --- Images sampled at the positions of maps and blended, in compiled code
#
# The cells of the maps' grid are made one by one. If only one head has weight in a cell, its
# samples are equalised and written. Otherwise the heads' samples are equalised, weighted and added
# first. This module knows neither cameras nor files.


LINE = 64  # bytes that the processor loads from memory at a time


@uncounted
def resample_cells(heads: Heads, recipe: Recipe, window: Window, work: Work) -> None:
    """Make a part of an image.

    Cells are processed downwards. The heads are usually mounted crosswise, so this reads along
    the rows of their images, and the pixels of one cell are still in the cache for the next.
    """
    step = recipe.step
    n_heads = len(heads.addresses)
    for j in range(window.cells):
        for i in range(window.rows[0] // step, (window.rows[1] + step - 1) // step):
            only = find_heads(heads, recipe, i, j, work)
            if only < 0:
                work.total[:] = 0
            for k in range(n_heads):
                if work.kinds[k] == UNSEEN:
                    continue
                _ask_ahead(heads, recipe, k, i + 1, j)
                _sample_cell(heads, recipe, k, work)
                _set_factors(heads.factors, k, recipe, i, j, work)
                if only < 0:
                    _add_weighted(k, recipe, work)
            if only < 0 and recipe.out_bits == 32:
                _mark_unseen(recipe, work)
            if only < 0:
                _write_cell(recipe, window, i, j, work.total, work.unity, work.line)
            else:
                _write_cell(recipe, window, i, j, work.block, work.factors, work.line)


# --- samples -------------------------------------------------------------------------------------


@uncounted_inlined
def _sample_cell(heads: Heads, recipe: Recipe, k: int, work: Work) -> None:
    """Sample an image at the pixels of a cell, in lines along the rows of the image."""
    step, bands = recipe.step, recipe.bands
    place = _place(work.places, k)
    turned = abs(place[3]) > abs(place[5])  # right in the cell is down in the image
    a, b = (2, 4) if turned else (4, 2)
    at_line, at_sample = (bands, work.line) if turned else (work.line, bands)
    pixel = bands * recipe.bits // 8
    row = heads.sizes[k, 0] * pixel
    # positions count from a pixel left of and above all others: single precision is then enough
    col_0, row_0 = _before(place, 0, step), _before(place, 1, step)
    for m in range(step):
        start = (
            np.float32(place[0] - col_0 + m * place[a]),
            np.float32(place[1] - row_0 + m * place[a + 1]),
        )
        growth = np.float32(place[b] + m * place[6]), np.float32(place[b + 1] + m * place[7])
        if work.kinds[k] == WITHIN:
            image = heads.addresses[k] + row_0 * row + col_0 * pixel, row, pixel
            out = work.block, m * at_line, at_sample
            sample_line(recipe.method, step, image, start, growth, work.scratch, out)
        else:
            for p in range(step):
                x = start[0] + np.float32(p) * growth[0]
                y = start[1] + np.float32(p) * growth[1]
                out_at = m * at_line + p * at_sample
                _sample_at_border(heads, recipe, k, (col_0, row_0), (x, y), (work.block, out_at))


@uncounted_inlined
def _place(places: np.ndarray, k: int) -> Any:
    return (
        places[k, 0],
        places[k, 1],
        places[k, 2],
        places[k, 3],
        places[k, 4],
        places[k, 5],
        places[k, 6],
        places[k, 7],
    )


@uncounted_inlined
def _before(place: Any, axis: int, step: int) -> int:
    """Return a column or row that lies at least one before all pixels of a cell."""
    n = step - 1
    a, b = place[axis], place[axis] + n * place[2 + axis]
    down = n * place[4 + axis]
    c, d = a + down, b + down + n * n * place[6 + axis]
    return int(min(a, b, c, d)) - 1


@uncounted
def _sample_at_border(
    heads: Heads, recipe: Recipe, k: int, before: Any, way: Any, out: Any
) -> None:
    """Sample an image as if its outermost pixels were repeated without end."""
    width, height = heads.sizes[k, 0], heads.sizes[k, 1]
    x = min(max(way[0], np.float32(-before[0])), np.float32(width - 1 - before[0]))
    y = min(max(way[1], np.float32(-before[1])), np.float32(height - 1 - before[1]))
    col, row = int(x), int(y)
    size = recipe.bits // 8
    for band in range(recipe.bands):
        total = 0.0
        for r in range(-1, 3):
            for c in range(-1, 3):
                i = min(max(before[1] + row + r, 0), height - 1)
                j = min(max(before[0] + col + c, 0), width - 1)
                at = heads.addresses[k] + ((i * width + j) * recipe.bands + band) * size
                weight = _weight(recipe.cubic, y - row - r) * _weight(recipe.cubic, x - col - c)
                total += weight * read_number(recipe.bits, at)
        out[0][out[1] + band] = total


@uncounted_inlined
def _weight(cubic: bool, way: float) -> float:
    """Return the weight of a pixel at a distance, px: linear, or Catmull and Rom's cubic."""
    d = abs(way)
    if not cubic:
        return max(1 - d, 0.0)
    if d < 1:
        return 1 + d * d * (1.5 * d - 2.5)
    return 2 + d * (-4 + d * (2.5 - 0.5 * d)) if d < 2 else 0.0


# --- equalised, weighted, written ----------------------------------------------------------------


@uncounted_inlined
def _set_factors(nodes: np.ndarray, k: int, recipe: Recipe, i: int, j: int, work: Work) -> None:
    """Set the factors of a cell's first row, and their increase from row to row."""
    if nodes.shape[1] == 0:
        return
    first, growth = work.factors
    share = np.float32(1) / np.float32(recipe.step)
    for b in range(recipe.bands):
        upper, lower = nodes[k, j, i, b], nodes[k, j, i + 1, b]
        upper_step = (nodes[k, j + 1, i, b] - upper) * share
        lower_step = (nodes[k, j + 1, i + 1, b] - lower) * share
        slope, slope_step = (lower - upper) * share, (lower_step - upper_step) * share
        for c in range(recipe.step):
            first[c * recipe.bands + b] = upper + np.float32(c) * upper_step
            growth[c * recipe.bands + b] = slope + np.float32(c) * slope_step


@uncounted_inlined
def _saturation(recipe: Recipe) -> tuple[np.float32, np.float32]:
    """Return the largest value, and what to subtract from samples times `SHOULDER`."""
    top = np.float32(2**recipe.bits - 1)
    return top, np.float32(SHOULDER - 1) * top


@uncounted_inlined
def _add_weighted(k: int, recipe: Recipe, work: Work) -> None:
    """Add the samples of a head, each times its factor and its weight."""
    step, bands = recipe.step, recipe.bands
    factors = work.factors[0], work.factors[1], _saturation(recipe)
    for r in range(step):
        for c in range(step):
            for b in range(bands):
                work.spread[c * bands + b] = work.weights[k, r * step + c]
        at = r * work.line
        line, total = (work.block, at), (work.total, at)
        add_line(step * bands, line, factors, np.float32(r), work.spread, total)


@uncounted_inlined
def _mark_unseen(recipe: Recipe, work: Work) -> None:
    step, bands = recipe.step, recipe.bands
    for p in range(step * step):
        if work.norm[p] == 0:
            at = p // step * work.line + p % step * bands
            work.total[at : at + bands] = np.nan


@uncounted_inlined
def _write_cell(
    recipe: Recipe, window: Window, i: int, j: int, block: np.ndarray, factors: Any, line: int
) -> None:
    """Write the part of a cell that lies in the window."""
    step = recipe.step
    given = factors[0], factors[1], _saturation(recipe)
    col = (window.left + j) * step
    n = min(step, window.width - col) * recipe.bands
    size = recipe.out_bits // 8 * recipe.bands
    first, end = window.rows
    for r in range(max(first, i * step), min(end, (i + 1) * step)):
        to = window.address + ((r - first) * window.width + col) * size
        m = r - i * step
        write_line(recipe.out_bits, n, (block, m * line), given, np.float32(m), to)
        ask_to_write(to + step * window.width * size)  # for the next cell, which lies below
        ask_to_write(to + step * window.width * size + LINE)


@uncounted_inlined
def _ask_ahead(heads: Heads, recipe: Recipe, k: int, i: int, j: int) -> None:
    """Ask for the pixels of an image that a cell reads, as the processor cannot predict them."""
    nodes = heads.nodes
    if i + 1 >= nodes.shape[2]:
        return
    a, b = nodes[k, j, i, 0], nodes[k, j, i, 1]
    c, d = nodes[k, j + 1, i + 1, 0], nodes[k, j + 1, i + 1, 1]
    x_0, x_1, y_0, y_1 = min(a, c), max(a, c), min(b, d), max(b, d)
    few = 4 * recipe.step
    if not (x_0 >= 0 and y_0 >= 0 and x_1 < x_0 + few and y_1 < y_0 + few):
        return
    pixel = recipe.bands * recipe.bits // 8
    row = heads.sizes[k, 0] * pixel
    for r in range(int(y_0), int(y_1) + 2):
        at = heads.addresses[k] + r * row + int(x_0) * pixel
        end = heads.addresses[k] + r * row + (int(x_1) + 2) * pixel
        while at < end:
            ask_to_read(at)
            at += LINE
        ask_to_read(end)
