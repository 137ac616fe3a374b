"""Which heads see a cell of the maps' grid, and the weight of each of them, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from acx4lib.compiling import uncounted_inlined
from acx4lib.synthetic_image.compiled.interpolation import LANES, MOST_BANDS

MARGIN = 4  # px; at this distance from its border an image is read without a check
TALLEST = 1024  # px; number of rows of an image that can be reached from one position in it
HARD_SEAM = np.float32(0.01)  # px; distances from a border are rounded to 0.001

UNSEEN, PARTLY, AT_BORDER, WITHIN = 0, 1, 2, 3


class Heads(NamedTuple):
    """The heads' images, and the positions of the nodes in them.

    Attributes
    ----------
    nodes : ndarray, shape (n_heads, cols, rows, 2)
        col, row, px; NaN where a head sees nothing. The nodes of a column are neighbours in
        memory, because cells are processed column by column.
    factors : ndarray of float32, shape (n_heads, cols, rows, bands) or (n_heads, 0, 0, bands)
        Factors of the images' numbers at the nodes.
    addresses : ndarray of int64, shape (n_heads,)
        Addresses of the images' first pixels.
    sizes : ndarray of int64, shape (n_heads, 2)
        Columns and rows of the images.
    """

    nodes: np.ndarray
    factors: np.ndarray
    addresses: np.ndarray
    sizes: np.ndarray


class Recipe(NamedTuple):
    """How the result is made from the images.

    Attributes
    ----------
    step : int
        Pixels from node to node.
    bands, bits : int
        Bands and bits per number of the images.
    out_bits : int
        Bits of the result; 32 makes it floats, NaN where no head sees.
    method : int
        An `interpolation.method_number`.
    cubic : bool
    feather : float
        Width of the transition between heads, px; 0 for a seam.
    """

    step: int
    bands: int
    bits: int
    out_bits: int
    method: int
    cubic: bool
    feather: float


class Window(NamedTuple):
    """The part of the image to make, and the memory to write it to.

    Attributes
    ----------
    rows : tuple of int
        First row, and row after the last, counted from the first node.
    left, cells : int
        Numbers of columns of cells: left of the part, and in it.
    width : int
        Pixels of a row.
    address : int
        Address of the first row's first pixel.
    """

    rows: tuple[int, int]
    left: int
    cells: int
    width: int
    address: int


class Work(NamedTuple):
    """Working memory for one cell; lines of samples begin `line` numbers apart.

    Attributes
    ----------
    line : int
    block, total : ndarray of float32
        Samples of one head; weighted sum of all heads' samples.
    factors, unity : tuple of ndarray of float32, shape (line,)
        Factors of the first row of a cell, and their increase from row to row.
    spread : ndarray of float32, shape (line,)
        Weights of a row, one for each number.
    scratch : tuple of ndarray
        For `interpolation.sample_line`.
    weights : ndarray of float32, shape (n_heads, step * step)
    best, norm : ndarray of float32, shape (step * step,)
        The largest distance from a border, px; the sum of the weights.
    places : ndarray, shape (n_heads, 8)
        Position of a cell in a head: a corner (col, row), its change by column, row and both.
    kinds : ndarray of int64, shape (n_heads,)
        Whether a head sees the cell: `UNSEEN` and so on.
    """

    line: int
    block: np.ndarray
    total: np.ndarray
    factors: tuple[np.ndarray, np.ndarray]
    unity: tuple[np.ndarray, np.ndarray]
    spread: np.ndarray
    scratch: tuple[np.ndarray, np.ndarray, np.ndarray]
    weights: np.ndarray
    best: np.ndarray
    norm: np.ndarray
    places: np.ndarray
    kinds: np.ndarray


def room(n_heads: int, step: int, bands: int) -> Work:
    """Return the working memory of one thread."""
    n = -(-step * bands // LANES) * LANES
    line = n + MOST_BANDS  # every sample is written as `MOST_BANDS` numbers
    n_scratch = -(-step // LANES) * LANES
    real = np.float32
    return Work(
        line,
        np.zeros(step * line, real),
        np.zeros(step * line, real),
        (np.ones(line, real), np.zeros(line, real)),
        (np.ones(line, real), np.zeros(line, real)),
        np.zeros(line, real),
        (np.zeros(n_scratch, np.int32), np.zeros(n_scratch, real), np.zeros(n_scratch, real)),
        np.zeros((n_heads, step * step), real),
        np.zeros(step * step, real),
        np.zeros(step * step, real),
        np.zeros((n_heads, 8)),
        np.zeros(n_heads, np.int64),
    )


@uncounted_inlined
def find_heads(heads: Heads, recipe: Recipe, i: int, j: int, work: Work) -> int:
    """Set the weights of the heads in a cell; return the only one with weight, -1 for several."""
    n_used, only = 0, -1
    for k in range(len(heads.addresses)):
        work.kinds[k] = _place_cell(heads, k, i, j, recipe.step, work.places)
        if work.kinds[k] != UNSEEN:
            n_used, only = n_used + 1, k
    if n_used == 1 and work.kinds[only] != PARTLY:
        return only
    work.norm[:] = 0
    if n_used == 0:
        return -1
    return _weigh(heads.sizes, recipe, work)


@uncounted_inlined
def _place_cell(heads: Heads, k: int, i: int, j: int, step: int, places: np.ndarray) -> int:
    """Set the position of a cell in a head; return whether the head sees it."""
    width, height = heads.sizes[k, 0], heads.sizes[k, 1]
    left, right = _place_axis(heads.nodes, k, (i, j), 0, step, places)
    if not (right > -0.5 and left < width - 0.5):
        return UNSEEN
    upper, lower = _place_axis(heads.nodes, k, (i, j), 1, step, places)
    if not (lower > -0.5 and upper < height - 0.5):
        return UNSEEN
    if left < -0.5 or upper < -0.5 or right > width - 0.5 or lower > height - 0.5:
        return PARTLY
    within = left >= MARGIN and right <= width - 1 - MARGIN
    within = within and upper >= MARGIN and lower <= height - 1 - MARGIN
    return WITHIN if within and lower - upper < TALLEST else AT_BORDER


@uncounted_inlined
def _place_axis(
    nodes: np.ndarray, k: int, cell: tuple[int, int], axis: int, step: int, places: np.ndarray
) -> tuple[float, float]:
    """Set the terms of one coordinate; return its smallest and largest value, NaN if unknown."""
    i, j = cell
    a, b = nodes[k, j, i, axis], nodes[k, j + 1, i, axis]
    c, d = nodes[k, j, i + 1, axis], nodes[k, j + 1, i + 1, axis]
    if np.isnan(a + b + c + d):
        return np.nan, np.nan
    share = 1 / step
    places[k, axis] = a
    places[k, 2 + axis] = (b - a) * share
    places[k, 4 + axis] = (c - a) * share
    places[k, 6 + axis] = ((d - c) - (b - a)) * (share * share)
    return min(a, b, c, d), max(a, b, c, d)


@uncounted_inlined
def _weigh(sizes: np.ndarray, recipe: Recipe, work: Work) -> int:
    """Set the heads' weights at each pixel of a cell; return the only head with weight, or -1.

    A head without weight at any pixel is marked as unseen.
    """
    n = recipe.step * recipe.step
    feather = np.float32(recipe.feather)
    best, norm, kinds, weights = work.best, work.norm, work.kinds, work.weights
    best[:] = 0
    for k in range(len(kinds)):
        if kinds[k] != UNSEEN:
            _set_depths(sizes, k, recipe.step, work)
    for k in range(len(kinds)):
        if kinds[k] != UNSEEN:
            for p in range(n):
                d = weights[k, p]
                if feather >= HARD_SEAM:
                    w = max(np.float32(0), min(d, d - best[p] + feather))
                else:
                    # of several heads with the same distance, the first
                    first = d == best[p] and d > 0 and norm[p] == 0
                    w = np.float32(1) if first else np.float32(0)
                weights[k, p] = w
                norm[p] += w
    only, n_used = -1, 0
    for k in range(len(kinds)):
        if kinds[k] != UNSEEN:
            some, everywhere = _normalise(weights, k, norm)
            n_used += some
            kinds[k] = kinds[k] if some else UNSEEN
            only = k if everywhere else only
    return only if n_used == 1 else -1


@uncounted_inlined
def _set_depths(sizes: np.ndarray, k: int, step: int, work: Work) -> None:
    """Set the distances of a cell's pixels from a head's border, px; update the largest ones."""
    places, depths, best = work.places, work.weights, work.best
    right, bottom = np.float32(sizes[k, 0] - 0.5), np.float32(sizes[k, 1] - 0.5)
    half = np.float32(0.5)
    for i in range(step):
        x_0, dx = places[k, 0] + i * places[k, 4], places[k, 2] + i * places[k, 6]
        y_0, dy = places[k, 1] + i * places[k, 5], places[k, 3] + i * places[k, 7]
        start, growth = (np.float32(x_0), np.float32(y_0)), (np.float32(dx), np.float32(dy))
        for j in range(step):
            x, y = start[0] + np.float32(j) * growth[0], start[1] + np.float32(j) * growth[1]
            d = min(x + half, right - x, y + half, bottom - y)
            depths[k, i * step + j] = d
            best[i * step + j] = max(best[i * step + j], d)


@uncounted_inlined
def _normalise(weights: np.ndarray, k: int, norm: np.ndarray) -> tuple[int, int]:
    """Divide weights by their sum; return whether one is positive, and whether all are 1."""
    n_some, n_alone = 0, 0
    for p in range(len(norm)):
        w = weights[k, p]
        alone = w == norm[p] and w > 0
        n_some += w > 0
        n_alone += alone
        weights[k, p] = np.float32(1) if alone else w / max(norm[p], np.float32(1e-30))
    return int(n_some > 0), int(n_alone == len(norm))
