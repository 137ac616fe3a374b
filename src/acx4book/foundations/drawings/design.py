"""Figures of the chapter on block design: planned lines, correlations, and the second height."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from acx4book.foundations import example
from acx4book.foundations.designs import CONTROL_M, Line
from acx4book.typesetting import matrix, style
from acx4lib.expected import Array

DIRECTIONS = {90.0: style.BLUE, 270.0: style.ORANGE, 0.0: style.TEAL, 180.0: style.PLUM}
"""Colours of lines by their azimuth."""

ASIDE_M = 22.0
"""Lines are drawn this far left of their direction, so that opposite ones do not coincide."""

READABLE = 0.3
"""Smallest correlation whose number is written."""


def plans(designs: Mapping[str, Sequence[Line]]) -> Figure:
    """Draw the lines of designs, the footprints of their middle images, and the control points."""
    with style.applied():
        fig, axes = style.subplots(
            1, len(designs), figsize=(style.WIDTH, 2.1), sharex=True, sharey=True
        )
        for ax, (name, lines) in zip(axes, designs.items(), strict=True):
            style.bare(ax)
            ax.set(title=name, aspect="equal", xticks=[], yticks=[], xlim=(-430, 430))
            ax.set(ylim=(-320, 320), facecolor="none")
            for line in lines:
                _line(ax, line, lowest=min(each.height_m for each in lines))
            ax.plot(*np.transpose(CONTROL_M), "D", color=style.INK, mfc="none", ms=4)
    return fig


def _line(ax: Axes, line: Line, *, lowest: float) -> None:
    """Draw one line; a higher one is dashed."""
    azimuth = np.radians(line.azimuth_deg)
    forward = np.array([np.sin(azimuth), np.cos(azimuth)])
    left = np.array([-forward[1], forward[0]])
    colour, high = DIRECTIONS[line.azimuth_deg], line.height_m > lowest
    half = 0.5 * line.base_m * (line.n - 1) * forward
    middle = (ASIDE_M + (2 * ASIDE_M if high else 0.0)) * left
    arrow = {
        "arrowstyle": "-|>",
        "color": colour,
        "lw": 1.6,
        "ls": "--" if high else "-",
        "shrinkA": 0,
        "shrinkB": 0,
    }
    ax.annotate("", xy=tuple(middle + half), xytext=tuple(middle - half), arrowprops=arrow)
    ax.plot(*_footprint(line).T, color=colour, lw=0.7, ls="--" if high else "-")


def _footprint(line: Line) -> Array:
    """Return the corners of the middle image on flat ground, east and north, m, shape (5, 2)."""
    azimuth = np.radians(line.azimuth_deg)
    forward = np.array([np.sin(azimuth), np.cos(azimuth)])
    left = np.array([-forward[1], forward[0]])
    half = 0.5 * example.PIXEL_MM * line.height_m / example.F_MM
    x, y = half * example.WIDTH_PX, half * example.HEIGHT_PX
    corners = np.array([[x, y], [-x, y], [-x, -y], [x, -y], [x, y]])
    return corners @ np.array([forward, left])


def correlations(designs: Mapping[str, pd.DataFrame]) -> Figure:
    """Draw correlation matrices side by side, with numbers where they are `READABLE` or more.

    Parameters
    ----------
    designs : mapping of str to DataFrame
        By the name of the design: square, with the same names.
    """
    with style.applied():
        fig, axes = style.subplots(1, len(designs), figsize=(style.WIDTH, 4.0), sharey=True)
        for ax, (title, table) in zip(axes, designs.items(), strict=True):
            names = [str(name).partition(",")[0] for name in table.index]
            _matrix(ax, table.to_numpy(), names)
            ax.set_title(title)
        matrix.scale(fig, axes, location="bottom", shrink=0.5, aspect=24)
    return fig


def _matrix(ax: Axes, values: Array, names: Sequence[str]) -> None:
    n = len(names)
    matrix.signed_cells(ax, values)
    ax.set_xticks(np.arange(n) + 0.5, names, rotation=90)
    ax.set_yticks(np.arange(n) + 0.5, names)
    for i, j in zip(*np.nonzero(np.abs(values) >= READABLE), strict=True):
        if i != j:
            shown = f"{values[i, j]:.2f}".replace("0.", ".").replace("1.00", "1.0")
            matrix.write(ax, i, j, values[i, j], shown)


def against_ratio(table: pd.DataFrame) -> Figure:
    """Draw standard deviations against the ratio of two flying heights, on logarithmic scales.

    Parameters
    ----------
    table : DataFrame
        A row for each unknown, named with its unit; columns are the ratios.
    """
    groups = (("lever x, m", "lever y, m", "lever z, m"), ("xp, mm", "yp, mm", "f, mm"))
    with style.applied():
        fig, axes = style.subplots(1, 2, figsize=(style.WIDTH, 3.0))
        for ax, names in zip(axes, groups, strict=True):
            for name, colour in zip(names, (style.BLUE, style.ORANGE, style.TEAL), strict=True):
                label, unit = name.split(", ")
                ax.plot(table.columns, table.loc[name], "o-", color=colour, label=label)
            ax.set(yscale="log", xlabel="second height over first", ylabel=f"σ ({unit})")
            ax.legend()
    return fig
