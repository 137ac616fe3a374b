"""The figure of a correlation matrix."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from acx4book.typesetting import style
from acx4book.typesetting.labels import LABELS


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
        side = min(style.WIDTH, 2.2 + 0.34 * n)
        fig, ax = style.subplots(figsize=(side + 0.6, side))
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
