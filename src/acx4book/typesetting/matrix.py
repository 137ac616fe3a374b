"""Figures of matrices: correlations with their numbers, and the pattern of what is not zero."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from acx4book.typesetting import style
from acx4book.typesetting.labels import LABELS
from acx4lib.expected import Mask


def correlation_matrix(correlations: pd.DataFrame) -> Figure:
    """Draw a correlation matrix, with numbers where they are 0.3 or more.

    Parameters
    ----------
    correlations : DataFrame
        Square; rows and columns are named ``parameter`` or ``camera/parameter``.
    """
    if correlations.empty:
        return style.nothing("The single step gave no result.")
    values, names = correlations.to_numpy(), [_label(str(n)) for n in correlations.index]
    n = len(names)
    with style.applied():
        width = min(style.WIDTH, 2.8 + 0.34 * n)
        fig, ax = style.subplots(figsize=(width, width - 0.6))
        image = ax.imshow(values, cmap=style.DIVERGING, vmin=-1, vmax=1)
        style.bare(ax)
        ax.set_xticks(range(n), names, rotation=55, ha="right", rotation_mode="anchor")
        ax.set_yticks(range(n), names)
        ax.set_xticks(np.arange(1, n) - 0.5, minor=True)
        ax.set_yticks(np.arange(1, n) - 0.5, minor=True)
        ax.grid(visible=True, which="minor", color=style.PAPER, linewidth=1.2)
        ax.tick_params(which="minor", length=0)
        for i, j in zip(*np.nonzero(np.abs(values) >= 0.3), strict=True):
            if i != j:
                dark = abs(values[i, j]) > 0.6
                ax.text(
                    *(j, i, f"{values[i, j]:+.2f}".replace("0.", ".")),
                    ha="center",
                    va="center",
                    fontsize=style.SMALL,
                    color="white" if dark else style.BLACK,
                    in_layout=False,  # inside their cells: measuring each takes half the time
                )
        bar = fig.colorbar(image, ax=ax, shrink=0.6, aspect=28)
        bar.set_label("correlation (no unit)")
        bar.outline.set_visible(False)
    return fig


def _label(name: str) -> str:
    """Return the label for readers of ``parameter`` or ``camera/parameter``."""
    camera, _, parameter = name.rpartition("/")
    if parameter not in LABELS:
        return style.plain(name)
    return f"{style.plain(camera)} {LABELS[parameter]}" if camera else LABELS[parameter]


def cells(ax: Axes, filled: Mask, colour: str, *, gap: float = 0.1) -> None:
    """Draw cells of a matrix as one shape, so that a drawing of thousands is small.

    Parameters
    ----------
    ax : Axes
        Row 0 is from 0 to 1, and so is column 0.
    filled : ndarray of bool, shape (rows, columns)
    colour : str
    gap : float
        Between two cells, in cells; without it, neighbours in a row are one bar.
    """
    if gap:
        rows, left = np.nonzero(filled)
        right = left + 1
    else:
        ends = np.diff(np.pad(filled, ((0, 0), (1, 1))).astype(int), axis=1)
        (rows, left), (_, right) = np.nonzero(ends == 1), np.nonzero(ends == -1)
    x0, x1, y0, y1 = left + gap / 2, right - gap / 2, rows + gap / 2, rows + 1 - gap / 2
    corners = np.stack([x0, y0, x1, y0, x1, y1, x0, y1, x0, y0], axis=1).reshape(-1, 2)
    codes = np.tile([Path.MOVETO, *3 * [Path.LINETO], Path.CLOSEPOLY], len(rows))
    ax.add_patch(PathPatch(Path(corners, codes), fc=colour, lw=0))
