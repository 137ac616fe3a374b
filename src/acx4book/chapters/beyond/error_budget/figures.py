"""Figures of the error budget: shares, flying heights, and the format."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from acx4book.chapters.beyond.error_budget.tables import COORDINATES, percent, plan_and_height
from acx4book.typesetting import style
from acx4book.typesetting.labels import TITLES, inside
from acx4lib.expected import Array
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing import budget
from acx4lib.georeferencing.budget import Budget

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


def stacked(budgets: Mapping[str, Budget]) -> Figure:
    """Draw the shares of all sources, a bar for every method and coordinate.

    Parameters
    ----------
    budgets : mapping of str to Budget
        By method.
    """
    methods = [*budgets]
    with style.applied():
        fig, axes = style.subplots(1, 3, figsize=(style.WIDTH, 2.5), sharey=True)
        means = [of.mean for of in budgets.values()]
        for axis, ax in enumerate(axes):
            left = np.zeros(len(methods))
            for (name, sources), colour in zip(STACKED.items(), COLOURS, strict=True):
                share = np.array([percent(mean[axis], *sources) for mean in means])
                ax.barh(np.arange(len(methods)), share, 0.62, left, color=colour, label=name)
                left = left + share
            ax.set_title(AXES[axis])
            ax.set(xlim=(0, 100), xlabel="share of the variance (%)")
            ax.grid(axis="y", visible=False)
        axes[0].set_yticks(range(len(methods)), [TITLES[m].replace(", ", ",\n") for m in methods])
        axes[0].invert_yaxis()
        style.legend_below(fig, axes[0].get_legend_handles_labels()[0], ncols=7)
    return fig


def calibration(budgets: Mapping[str, Budget]) -> Figure:
    """Draw the parts of the calibration, groups and correlations, which may be negative.

    Parameters
    ----------
    budgets : mapping of str to Budget
        Of two methods.
    """
    names = [*budget.CALIBRATION, "together"]
    at = np.arange(len(names))
    with style.applied():
        fig, axes = style.subplots(1, 2, figsize=(style.WIDTH, 2.9), sharey=True)
        for k, (ax, title) in enumerate(zip(axes, COORDINATES, strict=True)):
            for i, (method, split) in enumerate(budgets.items()):
                part = plan_and_height(split.mean)[k]
                share = [percent(part, name) for name in names[:-1]]
                share.append(percent(part, *budget.CALIBRATION))
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


def over_heights(
    heights_m: Array, budgets: Mapping[str, Sequence[Budget]], *, method: str
) -> Figure:
    """Draw the standard deviations of the groups of sources over the flying height.

    Parameters
    ----------
    heights_m : ndarray, shape (n,)
    budgets : mapping of str to sequence of Budget
        By method, one for each height. Of the others, the part of the calibration is drawn.
    method : str
        Of which all is drawn.
    """
    by_method = {
        name: np.array([plan_and_height(split.mean) for split in each])
        for name, each in budgets.items()
    }
    with style.applied():
        fig, axes = style.subplots(1, 2, figsize=(style.WIDTH, 3.0))
        for k, (ax, title) in enumerate(zip(axes, COORDINATES, strict=True)):
            _draw_heights(ax, heights_m, by_method[method][:, k])
            for dashed in by_method.keys() - {method}:
                part = by_method[dashed][:, k, -len(budget.CALIBRATION) :].sum(axis=-1)
                ax.plot(
                    *(heights_m, np.sqrt(np.maximum(part, 0.0)), "--"),
                    color=style.colour(2),
                    label=f"calibration, {inside(TITLES[dashed])}",
                )
            ax.set_title(title)
            ax.set(xlabel="flying height over ground (m)", ylim=(0, None))
        axes[0].set_ylabel("σ of a ground point (m)")
        style.legend_below(fig, axes[0].get_legend_handles_labels()[0], ncols=3)
    return fig


def _draw_heights(ax: Axes, heights_m: Array, own: Array) -> None:
    ax.plot(heights_m, np.sqrt(own.sum(axis=-1)), color=style.INK, label="all together")
    for i, (name, sources) in enumerate(budget.GROUPS.items()):
        columns = [budget.SOURCES.index(source) for source in sources]
        ax.plot(
            *(heights_m, np.sqrt(own[:, columns].sum(axis=-1))),
            color=style.colour(i),
            label=name,
        )
