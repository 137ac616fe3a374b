"""Figures of the error budget: shares, flying heights, and the format."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from acx4book.chapters.beyond.error_budget.examined import BARE, PAPERS, Examined, plan_and_height
from acx4book.chapters.beyond.error_budget.heights import Heights
from acx4book.chapters.beyond.error_budget.tables import COORDINATES
from acx4book.typesetting import style
from acx4book.typesetting.labels import TITLES, inside
from acx4lib.expected import Array
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing import budget

STACKED = {
    "image points": ("image points",),
    "survey": ("survey",),
    "GNSS": ("GNSS",),
    "roll": ("roll",),
    "pitch": ("pitch",),
    "heading": ("heading",),
    "calibration": budget.CALIBRATION,
}
"""Sources by the name of their part of a bar; the parts of the calibration are one."""

COLOURS = (style.BLUE, style.INK, style.TEAL, style.ORANGE, style.BRICK, style.SKY, style.PLUM)


def stacked(found: Examined) -> Figure:
    """Draw the shares of all sources, a bar for every method and coordinate.

    Parameters
    ----------
    found : Examined
    """
    methods = [*found.validations]
    with style.applied():
        fig, axes = style.subplots(1, 3, figsize=(style.WIDTH, 2.5), sharey=True)
        means = [found.points(method).mean for method in methods]
        for axis, ax in enumerate(axes):
            left = np.zeros(len(methods))
            for (name, sources), colour in zip(STACKED.items(), COLOURS, strict=True):
                share = np.array([_share(mean[axis], sources) for mean in means])
                ax.barh(np.arange(len(methods)), share, 0.62, left, color=colour, label=name)
                left = left + share
            ax.set_title(AXES[axis])
            ax.set(xlim=(0, 100), xlabel="share of the variance (%)")
            ax.grid(axis="y", visible=False)
        axes[0].set_yticks(range(len(methods)), [TITLES[m].replace(", ", ",\n") for m in methods])
        axes[0].invert_yaxis()
        style.legend_below(fig, axes[0].get_legend_handles_labels()[0], ncols=7)
    return fig


def _share(variance: Array, sources: tuple[str, ...]) -> float:
    own = [budget.SOURCES.index(source) for source in sources]
    return float(100 * variance[own].sum() / variance.sum())


def calibration(found: Examined) -> Figure:
    """Draw the parts of the calibration, groups and correlations, which may be negative.

    Parameters
    ----------
    found : Examined
    """
    names = [*budget.CALIBRATION, "together"]
    at = np.arange(len(names))
    with style.applied():
        fig, axes = style.subplots(1, 2, figsize=(style.WIDTH, 2.9), sharey=True)
        for k, (ax, title) in enumerate(zip(axes, COORDINATES, strict=True)):
            for i, method in enumerate((BARE, PAPERS)):
                part = plan_and_height(found.points(method).mean)[k]
                share = [_share(part, (name,)) for name in names[:-1]]
                share.append(_share(part, budget.CALIBRATION))
                label = TITLES[method]
                ax.barh(at + 0.4 * i - 0.2, share, 0.36, color=style.colour(i), label=label)
            ax.axvline(0, color=style.INK, lw=0.8)
            ax.set_title(title)
            ax.set_xlabel("share of the variance (%)")
            ax.grid(axis="y", visible=False)
        axes[0].set_yticks(at, names)
        axes[0].invert_yaxis()
        style.legend_below(fig, axes[0].get_legend_handles_labels()[0])
    return fig


def over_heights(flown: Heights) -> Figure:
    """Draw the standard deviations of the groups of sources over the flying height.

    Parameters
    ----------
    flown : Heights
    """
    with style.applied():
        fig, axes = style.subplots(1, 2, figsize=(style.WIDTH, 3.0))
        for k, (ax, title) in enumerate(zip(axes, COORDINATES, strict=True)):
            _draw_heights(ax, flown, k)
            ax.set_title(title)
            ax.set(xlabel="flying height over ground (m)", ylim=(0, None))
        axes[0].set_ylabel("σ of a ground point (m)")
        style.legend_below(fig, axes[0].get_legend_handles_labels()[0], ncols=3)
    return fig


def _draw_heights(ax: Axes, flown: Heights, k: int) -> None:
    own = flown.variance[PAPERS][:, k]
    ax.plot(flown.height_m, np.sqrt(own.sum(axis=-1)), color=style.INK, label="all together")
    for i, (name, sources) in enumerate(budget.GROUPS.items()):
        columns = [budget.SOURCES.index(source) for source in sources]
        ax.plot(
            *(flown.height_m, np.sqrt(own[:, columns].sum(axis=-1))),
            color=style.colour(i),
            label=name,
        )
    bare = flown.variance[BARE][:, k][:, -len(budget.CALIBRATION) :]
    ax.plot(
        *(flown.height_m, np.sqrt(np.maximum(bare.sum(axis=-1), 0.0)), "--"),
        color=style.colour(2),
        label=f"calibration, {inside(TITLES[BARE])}",
    )
