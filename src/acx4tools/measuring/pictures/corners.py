"""Corners that cover a picture evenly (Harris), one in each of its cells."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from acx4lib.expected import Array, Index
from acx4lib.tie_points.matching import response
from acx4lib.tie_points.overlaps import grey
from acx4tools.measuring.pictures.views import View, pixels_of_view


def corners(view: View, *, number: int, margin: int) -> Index:
    """Return the best corner of every cell of a picture, col, row, shape (n, 2).

    Parameters
    ----------
    view : View
    number : int
        Approximate number of cells.
    margin : int
        Distance from the picture's border, px.
    """
    image = pixels_of_view(view)
    rows, cols = image.shape[:2]
    side = np.sqrt(rows * cols / number)
    across, down = max(round(cols / side), 1), max(round(rows / side), 1)
    edges_x = np.linspace(margin, cols - margin, across + 1).astype(int)
    edges_y = np.linspace(margin, rows - margin, down + 1).astype(int)
    found = [
        best
        for top, bottom in pairwise(edges_y.tolist())
        for left, right in pairwise(edges_x.tolist())
        if (best := _best(image, (top, bottom, left, right))) is not None
    ]
    return np.array(found, dtype=np.intp).reshape(-1, 2)


def _best(image: Array, cell: tuple[int, int, int, int]) -> tuple[int, int] | None:
    """Return col, row of the strongest corner in a cell; None where it has no corner."""
    top, bottom, left, right = cell
    if bottom <= top or right <= left:
        return None
    values = response(grey(np.ascontiguousarray(image[top:bottom, left:right])))
    row, col = np.unravel_index(int(np.argmax(values)), values.shape)
    return (left + int(col), top + int(row)) if values[row, col] > 0 else None
