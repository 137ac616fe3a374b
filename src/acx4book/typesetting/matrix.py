"""Figures of matrices: correlations with their numbers, and the pattern of what is not zero."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path

from acx4book.typesetting import style
from acx4book.typesetting.labels import LABELS
from acx4lib.expected import Array, Mask

LEVELS = 20
"""Shades of a colour, each a shape of the drawing."""


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
        signed_cells(ax, values)
        ax.set_xticks(np.arange(n) + 0.5, names, rotation=55, ha="right", rotation_mode="anchor")
        ax.set_yticks(np.arange(n) + 0.5, names)
        for i, j in zip(*np.nonzero(np.abs(values) >= 0.3), strict=True):
            if i != j:
                write(ax, i, j, values[i, j], f"{values[i, j]:+.2f}".replace("0.", "."))
        scale(fig, ax, shrink=0.6, aspect=28)
    return fig


def signed_cells(ax: Axes, values: Array, *, gap: float = 0.08) -> None:
    """Draw the cells of a matrix from -1 (orange) over zero (nothing) to 1 (blue).

    The colours are those of the page, by day and by night. Cell (i, j) is from j to j + 1 and from
    i to i + 1, downwards.

    Parameters
    ----------
    ax : Axes
    values : ndarray, shape (rows, columns)
    gap : float
        As in `cells`.
    """
    style.bare(ax)
    level = np.rint(LEVELS * np.abs(values)).astype(int)
    for colour, sign in ((style.BLUE, values > 0), (style.ORANGE, values < 0)):
        for own in np.unique(level[sign & (level > 0)]):
            cells(ax, sign & (level == own), colour, gap=gap, alpha=own / LEVELS)
    rows, columns = values.shape
    ax.set(xlim=(0, columns), ylim=(rows, 0), aspect="equal")
    ax.tick_params(length=0)
    ax.grid(visible=False)


def write(ax: Axes, i: int, j: int, value: float, text: str) -> None:
    """Write into a cell of `signed_cells`, in what can be read on its colour by day and night."""
    strong = style.PAPER if value > 0 else style.BLACK
    ax.text(
        *(j + 0.5, i + 0.5, text.replace("-", "\N{MINUS SIGN}")),
        ha="center",
        va="center",
        fontsize=style.SMALL,
        color=strong if abs(value) > 0.6 else style.INK,
        in_layout=False,  # inside their cells: measuring each takes half the time
    )


def scale(
    fig: Figure, axes: Axes | Sequence[Axes], *, location: str = "right", **sizes: float
) -> None:
    """Draw the scale of the colours of `signed_cells` beside axes, or below them.

    Parameters
    ----------
    fig : Figure
    axes : Axes or sequence of Axes
    location : str
        ``"right"`` or ``"bottom"``.
    sizes : float
        As of `Figure.colorbar`: shrink, aspect.
    """
    shown: Any = ScalarMappable(Normalize(-1, 1))
    bar = fig.colorbar(shown, ax=axes, location=location, **sizes)  # type: ignore[arg-type] # one or more
    if bar.solids is not None:
        bar.solids.remove()
    bar.set_label("correlation (no unit)")
    bar.outline.set_visible(False)
    span = bar.ax.axhspan if location == "right" else bar.ax.axvspan
    for k in range(-LEVELS, LEVELS):
        near = max(abs(k), abs(k + 1)) / LEVELS
        span(
            k / LEVELS, (k + 1) / LEVELS, fc=style.ORANGE if k < 0 else style.BLUE, alpha=near, lw=0
        )


def _label(name: str) -> str:
    """Return the label for readers of ``parameter`` or ``camera/parameter``."""
    camera, _, parameter = name.rpartition("/")
    if parameter not in LABELS:
        return style.plain(name)
    return f"{style.plain(camera)} {LABELS[parameter]}" if camera else LABELS[parameter]


def cells(ax: Axes, filled: Mask, colour: str, *, gap: float = 0.1, alpha: float = 1.0) -> None:
    """Draw cells of a matrix as one shape, so that a drawing of thousands is small.

    Parameters
    ----------
    ax : Axes
        Row 0 is from 0 to 1, and so is column 0.
    filled : ndarray of bool, shape (rows, columns)
    colour : str
    gap : float
        Between two cells, in cells; without it, neighbours in a row are one bar.
    alpha : float
        How much of what is below they cover.
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
    ax.add_patch(PathPatch(Path(corners, codes), fc=colour, lw=0, alpha=alpha))
