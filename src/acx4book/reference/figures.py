"""Figures of the comparisons."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from acx4book.typesetting import style

LEFT_OUT = ("statement",)
"""Kinds without numbers."""


def last_digits(tables: Mapping[str, pd.DataFrame]) -> Figure:
    """Draw the differences of all printed numbers in units of their last digit.

    Parameters
    ----------
    tables : mapping of str to DataFrame
        Comparisons by the titles of the reports.

    Returns
    -------
    Figure
        One dot per number; numbers in the band round to the printed digits.
    """
    kinds = list(dict.fromkeys(kind for table in tables.values() for kind in table["kind"]))
    kinds = [kind for kind in kinds if kind not in LEFT_OUT]
    with style.applied():
        fig, axes = style.subplots(
            1, len(tables), figsize=(style.WIDTH, 3.4), sharey=True, squeeze=False
        )
        for i, (ax, (title, table)) in enumerate(zip(axes.flat, tables.items(), strict=True)):
            ax.axvspan(-0.5, 0.5, color=style.colour(i), alpha=0.10, lw=0)
            for row, kind in enumerate(kinds):
                units = table.loc[table["kind"] == kind, "units"].to_numpy(dtype=float)
                # spread in a fixed pattern, so that equal values do not hide each other
                spread = 0.6 * ((np.arange(len(units)) * 0.618) % 1 - 0.5)
                ax.plot(units, row + spread, ".", ms=3, alpha=0.6, color=style.colour(i))
            numbers = int((~table["kind"].isin(LEFT_OUT)).sum())
            ax.set_title(f"{title}: {numbers} numbers")
            ax.set(xlim=(-1.05, 1.05), xlabel="difference (units of the last printed digit)")
            ax.set_yticks(range(len(kinds)), kinds)
        axes.flat[0].invert_yaxis()
    return fig


def forgotten_steps(table: pd.DataFrame) -> Figure:
    """Draw the errors in the image and in height that each forgotten step causes.

    Parameters
    ----------
    table : DataFrame
        As `points.forgotten_steps` returns it.

    Returns
    -------
    Figure
        Bars on logarithmic axes; dotted lines show the complete chain.
    """
    columns = (
        ("misfit_px", "RMS residual of IGN's coordinates (px)", style.BLUE),
        ("mean_height_m", "mean difference in height (m)", style.ORANGE),
    )
    rows = np.arange(len(table))
    with style.applied():
        fig, axes = style.subplots(1, 2, figsize=(style.WIDTH, 2.9), sharey=True)
        for ax, (column, label, fill) in zip(axes, columns, strict=True):
            size = table[column].abs().to_numpy(dtype=float)
            ax.barh(rows, size, color=[style.SOFT, *[fill] * (len(rows) - 1)], height=0.6)
            ax.axvline(size[0], color=style.INK, ls=":", lw=1)
            ax.set(xscale="log", xlabel=label)
            ax.grid(visible=False, axis="y")
        axes[0].set_yticks(rows, table["reading"])
        axes[0].invert_yaxis()
    return fig
