"""The residual pattern of the synthetic image at two flying heights, drawn as a vector field."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from acx4book.chapters.beyond.synthetic_cost import heights
from acx4book.chapters.beyond.synthetic_cost.study import Study
from acx4book.paper import printed
from acx4book.typesetting import style

EVERY = 2
"""Of so many nodes in a row or column, one has an arrow."""


def pattern(found: Study) -> Figure:
    """Draw what a single step of exact data leaves over the synthetic image."""
    width, height = (printed.value(2, name, "SYN") for name in ("width_px", "height_px"))
    flown = np.unique(found.pattern["height_m"])
    fields = {h: found.pattern[found.pattern["height_m"] == h] for h in flown}
    key = style.round_length(max(map(heights.largest_px, fields.values())))
    names = sorted(found.pattern["head"].unique())
    with style.applied():
        fig, axes = style.subplots(1, len(fields), figsize=(style.WIDTH, 4.9), sharey=True)
        for ax, (height_m, own) in zip(np.atleast_1d(axes), fields.items(), strict=True):
            _draw_vectors(ax, own, names, key)
            _draw_seams(ax, own, names)
            ax.set(xlim=(0, width), ylim=(height, 0), aspect="equal")
            ax.set(xlabel="column (px)")
            ax.locator_params(nbins=5)
            rms = heights.rms_px(own)
            style.heading(ax, f"From {height_m:.0f} m", f"RMS {rms:.2f} px")
        np.atleast_1d(axes)[0].set_ylabel("row (px)")
        handles = [Line2D([], [], color=style.colour(k), label=n) for k, n in enumerate(names)]
        style.legend_below(fig, handles)
    return fig


def _draw_vectors(ax: Axes, own: pd.DataFrame, names: list[str], key: float) -> None:
    """Draw the vectors of every `EVERY`-th node, in the colours of the heads."""
    places = [np.unique(own[name], return_inverse=True)[1] for name in heights.AT]
    some = own[(places[0] % EVERY == 0) & (places[1] % EVERY == 0)]
    gap = EVERY * float(np.min(np.diff(np.unique(own["col_px"]))))
    arrows = ax.quiver(
        *(some["col_px"], some["row_px"]),
        *(gap / key * some[name] for name in heights.D),
        color=[style.colour(names.index(head)) for head in some["head"]],
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.005,
        zorder=3,
    )
    label, place = f"{key:g} px", (0.86, 1.03)
    ax.quiverkey(
        arrows, *place, gap, label, labelpos="W", color=style.INK, fontproperties=style.LETTERS
    )


def _draw_seams(ax: Axes, own: pd.DataFrame, names: list[str]) -> None:
    """Draw where the head changes from which a pixel is taken."""
    head = heights.grid(own, "head")
    rows, cols = (np.unique(own[name]) for name in heights.AT)
    for name in names:
        inside = (head == name).astype(float)
        ax.contour(cols, rows, inside, levels=[0.5], colors=style.SOFT, linewidths=0.9)
