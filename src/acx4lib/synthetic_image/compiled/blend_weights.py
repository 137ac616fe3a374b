"""Which heads see a cell of the maps' grid, and how much each of them counts, compiled."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from acx4lib.compiling import uncounted_inlined
from acx4lib.synthetic_image.compiled.pixel_lanes import LANES, MOST_BANDS

MARGIN = 4  # px; so far from its border an image can be read without looking
TALLEST = 1024  # px; so many rows of an image can be reached from one place in it

UNSEEN, PARTLY, AT_BORDER, WITHIN = 0, 1, 2, 3


class Heads(NamedTuple):
    """The heads' images, and where they see the nodes.

    Attributes
    ----------
    nodes : ndarray, shape (n_heads, cols, rows, 2)
        col, row, px; NaN where a head sees nothing. Nodes below each other stand side by side,
        for that is how cells are walked.
    factors : ndarray of float32, shape (n_heads, cols, rows, bands) or (n_heads, 0, 0, bands)
        What an image's numbers are multiplied by at the nodes.
    addresses : ndarray of int64, shape (n_heads,)
        Of the images' first pixels.
    sizes : ndarray of int64, shape (n_heads, 2)
        Columns and rows of the images.
    """

    nodes: np.ndarray
    factors: np.ndarray
    addresses: np.ndarray
    sizes: np.ndarray


class Recipe(NamedTuple):
    """What is made of the images.

    Attributes
    ----------
    step : int
        Pixels from node to node.
    bands, bits : int
        Of the images.
    out_bits : int
        Of the result; 32 makes it floats, NaN where no head sees.
    method : int
        Of `pixel_lanes.method_number`.
    cubic : bool
    feather : float
        Width of the ramp between heads, px; 0 for a seam.
    """

    step: int
    bands: int
    bits: int
    out_bits: int
    method: int
    cubic: bool
    feather: float


class Window(NamedTuple):
    """Which part is made, and where it is written to.

    Attributes
    ----------
    rows : tuple of int
        The first, and the one behind the last, from the first node on.
    left, cells : int
        Columns of cells left of the part, and in it.
    width : int
        Pixels of a row.
    address : int
        Of the first row's first pixel.
    """

    rows: tuple[int, int]
    left: int
    cells: int
    width: int
    address: int


class Work(NamedTuple):
    """Room for one cell; lines of samples stand `line` numbers apart.

    Attributes
    ----------
    line : int
    block, total : ndarray of float32
        Samples of one head; those of all, weighted.
    factors, unity : tuple of ndarray of float32, shape (line,)
        What the first row of a cell is multiplied by, and what each further row adds to that.
    spread : ndarray of float32, shape (line,)
        Weights of a row, one for each number.
    scratch : tuple of ndarray
        For `pixel_lanes.sample_line`.
    weights : ndarray of float32, shape (n_heads, step * step)
    best, norm : ndarray of float32, shape (step * step,)
        The largest border distance, px; the sum of the weights.
    places : ndarray, shape (n_heads, 8)
        Where a head sees a cell: a corner (col, row), its growth by column, by row, by both.
    kinds : ndarray of int64, shape (n_heads,)
        Whether it does.
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
    """Return room for the cells that one thread makes."""
    n = -(-step * bands // LANES) * LANES
    line = n + MOST_BANDS  # a sample is written as so many numbers
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
    """Find the heads that count in a cell, and their weights; return the only one, or -1."""
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
    """Find where a head sees a cell, and whether it does."""
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
    """Set what one coordinate is made of; return its least and its most, NaN where unknown."""
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
    """Weigh the heads at each pixel of a cell; return the one that alone counts, or -1.

    A head that counts nowhere is struck out.
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
                if feather > 0:
                    w = max(np.float32(0), min(d, d - best[p] + feather))
                else:
                    # the first of those that are equally deep
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
    """Set how far from a head's border the pixels of a cell lie, px, and the most of all heads."""
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
    """Divide weights by their sum; tell whether any is positive, and whether all are 1."""
    n_some, n_alone = 0, 0
    for p in range(len(norm)):
        w = weights[k, p]
        alone = w == norm[p] and w > 0
        n_some += w > 0
        n_alone += alone
        weights[k, p] = np.float32(1) if alone else w / max(norm[p], np.float32(1e-30))
    return int(n_some > 0), int(n_alone == len(norm))
