"""Figures of the chapter: which bands tie, what is parallax, falloff, and a stack."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from acx4book.reference.heads.parallax import BASES_M, predicted_px
from acx4book.reference.heads.solved import FIVE, here
from acx4book.typesetting import style
from acx4book.typesetting.pictures import HALO
from acx4lib.expected import Raster
from acx4lib.production.stripes import stacked
from acx4lib.synthetic_image.rendering import render_plan

COMPOSITES = {
    "red, green, blue": ("3 Red", "2 Green", "1 Blue"),
    "infrared, red, green": ("4 NIR", "3 Red", "2 Green"),
}
WINDOW = np.s_[200:680, 320:960]
SHADES = LinearSegmentedColormap.from_list("shades", ["#f3f6f9", style.SKY, style.BLUE])
LEVELS = 24
"""Grey values of a band in the picture; more can hardly be seen, and make it large."""


def shares(table: pd.DataFrame) -> Figure:
    """Draw for every pair of heads the share of corners that found their partner.

    Parameters
    ----------
    table : DataFrame
        As `pairs.pairs` returns it.

    Returns
    -------
    Figure
        A cell for each pair, below the diagonal; those of the strongest chain have a frame.
    """
    names = list(dict.fromkeys([*table["head"], *table["other"]]))
    n, place = len(names), {name: k for k, name in enumerate(names)}
    values = np.full((n, n), np.nan)
    pairs: list[Any] = table.to_dict("records")
    for pair in pairs:
        values[place[pair["other"]], place[pair["head"]]] = 100 * pair["share"]
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 0.42 * n + 1.2))
        style.bare(ax)
        ax.imshow(values, cmap=SHADES, vmin=0, vmax=100, aspect="auto")
        labels = [style.plain(name) for name in names]
        ax.set_xticks(range(n - 1), labels[:-1], rotation=35, ha="right", rotation_mode="anchor")
        ax.set_yticks(range(1, n), labels[1:])
        ax.set(ylim=(n - 0.5, 0.5), xlim=(-0.5, n - 1.5))
        for pair in pairs:
            cell = place[pair["head"]], place[pair["other"]]
            _cell(ax, *cell, 100 * pair["share"], chained=pair["chain"])
    return fig


def _cell(ax: Axes, col: int, row: int, share: float, *, chained: bool) -> None:
    ax.text(
        *(col, row, f"{share:.0f}"),
        ha="center",
        va="center",
        fontsize=style.SMALL,
        color="white" if share > 55 else style.BLACK,
        fontweight="bold" if chained else "normal",
    )
    if chained:
        x, y = np.array([-1, 1, 1, -1, -1]) * 0.46, np.array([-1, -1, 1, 1, -1]) * 0.44
        ax.plot(col + x, row + y, color=style.ORANGE, lw=2)


def shifts(table: pd.DataFrame) -> Figure:
    """Draw by how much heads lie from the factory's angles, with and without parallax.

    Parameters
    ----------
    table : DataFrame
        As `parallax.parallax` returns it.

    Returns
    -------
    Figure
        A line for each head, from rotations alone to rotations with the places free; circles: what
        the parallax of usual bases makes.
    """
    height, f = table["height_m"].iloc[0], table["f_px"].iloc[0]
    with style.applied():
        fig, ax = style.subplots(figsize=(0.75 * style.WIDTH, 0.7 * style.WIDTH))
        for base in BASES_M:
            radius = predicted_px(base, height_m=height, f_px=f)
            ax.add_patch(Circle((0, 0), radius, fill=False, color=style.SOFT, lw=1, ls="--"))
            ax.annotate(
                f"{1000 * base:.0f} mm",
                (0, radius),
                ha="center",
                va="bottom",
                fontsize=style.SMALL,
                color=style.SOFT,
            )
        heads: list[Any] = table.to_dict("records")
        for head in heads:
            x, y = ([head[f"{axis}_px"], head[f"{axis}_left_px"]] for axis in "xy")
            ax.plot(x, y, color=style.EDGE, lw=1.2)
            ax.annotate(
                style.plain(head["head"]),
                (x[0], y[0]),
                xytext=(5, 4),
                textcoords="offset points",
                fontsize=style.SMALL,
                path_effects=HALO,
            )
        ax.plot(table["x_px"], table["y_px"], "o", color=style.BRICK, label="rotations alone")
        ax.plot(table["x_left_px"], table["y_left_px"], "s", color=style.BLUE, label="places free")
        ax.axhline(0, color=style.GRID, lw=1, zorder=0)
        ax.axvline(0, color=style.GRID, lw=1, zorder=0)
        ax.set(xlabel="along columns (px)", ylabel="along rows (px)", aspect="equal")
        ax.set(xlim=(-1.9, 1.9), ylim=(1.9, -1.9))
        style.legend_below(fig, ax.get_legend_handles_labels()[0], ncols=2)
    return fig


def falloffs(table: pd.DataFrame) -> Figure:
    """Draw the falloff of similar heads against each other: seen, stated, and fitted.

    Parameters
    ----------
    table : DataFrame
        As `vignetting.vignetting` returns it.

    Returns
    -------
    Figure
        A panel for each pair.
    """
    groups = list(table.groupby(["head", "other"], sort=False))
    with style.applied():
        fig, axes = style.subplots(2, 2, figsize=(style.WIDTH, 4.6), sharex=True, sharey=True)
        for ax, (names, own) in zip(axes.flat, groups, strict=True):
            ax.plot(own["radius_px"], own["seen"], "o", color=style.INK, ms=4, label="tie points")
            for name, colour in (("factory", style.ORANGE), ("library", style.BLUE)):
                ax.plot(own["radius_px"], own[name], color=colour, label=name)
            ax.set_title(" over ".join(style.plain(str(name)) for name in names))
        for ax in axes[1]:
            ax.set_xlabel("radius (px)")
        for ax in axes[:, 0]:
            ax.set_ylabel("ratio (%)")
        style.legend_below(fig, axes[0, 0].get_legend_handles_labels()[0], ncols=3)
    return fig


def stack(*, folder: str = "") -> Figure | None:
    """Draw a part of the five heads' stack in two composites; None without the pictures.

    Parameters
    ----------
    folder : str
        Of the reference data; the usual one if empty.
    """
    found = here(FIVE, folder=folder)
    if found is None:
        return None
    shape = found.synthetic.height_px, found.synthetic.width_px, len(found.images)
    bands = np.empty(shape, np.uint16)
    plan = render_plan(found.fits["rotations"].orientation, found.synthetic)
    stacked(plan, found.images, None)(bands, 0)
    with style.applied():
        fig, axes = style.subplots(1, 2, figsize=(style.WIDTH, 2.9))
        for ax, (title, names) in zip(axes, COMPOSITES.items(), strict=True):
            picked = [_shown(bands[..., found.place(name)][WINDOW]) for name in names]
            ax.imshow(np.stack(picked, axis=-1), interpolation="nearest")
            ax.set_title(title)
            ax.set(xticks=[], yticks=[])
            style.bare(ax)
    return fig


def _shown(band: Raster) -> Raster:
    """Return a band in 8 bit, stretched between its percentiles."""
    low, high = np.percentile(band, [1, 99])
    unit = np.clip((band - low) / (high - low), 0, 1) ** (1 / 1.6)
    return (np.rint(unit * LEVELS) * (255 / LEVELS)).astype(np.uint8)
