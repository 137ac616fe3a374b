"""Grey values of the same ground in neighbouring cameras."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acx4book.reference.surround.views import View
from acx4lib.expected import Array, Mask
from acx4lib.synthetic_image.grey_samples import DARK_DN, Samples

CELL_PX = 8
"""Side of the cells of ground whose mean grey values are compared."""

EVEN = 0.1
"""Ratio of scatter and mean of the grey values in a cell up to which misfits do not matter."""


def overlapping(views: Sequence[View]) -> list[tuple[int, int]]:
    """Return the pairs of views that show common ground."""
    pairs = combinations(range(len(views)), 2)
    return [(a, b) for a, b in pairs if (views[a].seen & views[b].seen).any()]


def grey_correlation(a: View, b: View) -> float:
    """Return the correlation of the grey values of two views; NaN without common ground."""
    both = a.seen & b.seen
    if not both.any():
        return float("nan")
    return float(np.corrcoef(*(v.image[both].mean(axis=1) for v in (a, b)))[0, 1])


def grey_samples(views: Sequence[View]) -> list[Samples]:
    """Return grey values of the same even ground for all pairs of cameras that overlap.

    Parameters
    ----------
    views : sequence of View
        Original views, not equalised.

    Returns
    -------
    list of Samples
        For `response.fit_response`; positions are pixels of the frame. All samples are given the
        position of the image centre, so that only gains are estimated: the overlaps cover only a
        narrow belt of the lenses, which cannot determine the falloff.
    """
    n_rows, n_cols = (n // CELL_PX for n in views[0].seen.shape)
    middle = np.stack(np.meshgrid(np.arange(n_cols), np.arange(n_rows)), axis=-1) + 0.5
    means, even = zip(*map(_even_cells, views), strict=True)
    saturated = [(_cells(v.image) == np.iinfo(v.image.dtype).max).any(axis=2) for v in views]
    out = []
    for a, b in overlapping(views):
        used = even[a] & even[b]
        xy, clipped = CELL_PX * middle[used] - 0.5, (saturated[a] | saturated[b])[used]
        dark = ~clipped & (np.minimum(means[a], means[b])[used] < DARK_DN)
        ratio = np.where(clipped | dark, np.nan, means[a][used] / means[b][used])
        out.append(
            Samples(
                head_a=a,
                head_b=b,
                xy=xy,
                q_a=np.zeros(len(xy)),
                q_b=np.zeros(len(xy)),
                log_ratio=np.log(ratio),
                saturated=clipped,
                dark=dark,
            )
        )
    return out


def _cells(values: NDArray[Any]) -> NDArray[Any]:
    """Return the pixels of square cells along the third axis."""
    rows, cols = (n // CELL_PX for n in values.shape[:2])
    whole = values[: rows * CELL_PX, : cols * CELL_PX]
    split = whole.reshape(rows, CELL_PX, cols, CELL_PX, *values.shape[2:])
    return split.swapaxes(1, 2).reshape(rows, cols, CELL_PX**2, *values.shape[2:])


def _even_cells(view: View) -> tuple[Array, Mask]:
    """Return mean grey values of cells, and whether a cell is seen and has even grey values."""
    pixels = _cells(view.image).astype(float)
    mean = pixels.mean(axis=2)
    scatter = pixels.std(axis=2) / np.maximum(mean, 1)
    return np.maximum(mean, 1), _cells(view.seen).all(axis=2) & (scatter.max(axis=2) < EVEN)
