"""Figures of two of the findings."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from acx4book.paper import printed
from acx4book.paper.errata.mounting import lever_arm_in_interior
from acx4book.paper.errata.validation import implied_sample_sizes
from acx4book.typesetting import style
from acx4lib.geometry.parameters import AXES

LABELS = {"two_step": "two-step", "single_step": "single-step"}
INTERIOR_LABELS = {
    "f_mm": "$f$, lever arm $z$",
    "xp_mm": "$x_p$, lever arm $x$",
    "yp_mm": "$y_p$, lever arm $y$",
}


def sample_sizes() -> Figure:
    """Draw the numbers of errors that Table 4's mean, deviation and RMS belong to (item 5).

    Returns
    -------
    Figure
        Bars: numbers that rounding allows. Line: the number of points given by the paper.
    """
    sizes = implied_sample_sizes()
    n_points = printed.value(4, "n_points", "two_step")
    with style.applied():
        fig, ax = plt.subplots(figsize=(style.WIDTH, 2.7))
        for i, (method, rows) in enumerate(sizes.groupby("method", sort=False)):
            height = np.arange(len(rows)) + 0.16 * (2 * i - 1)
            ax.hlines(
                height, rows["n_low"], rows["n_high"], color=style.colour(i), lw=6, alpha=0.35
            )
            ax.plot(rows["n"], height, "o", ms=5, color=style.colour(i), label=LABELS[str(method)])
        ax.axvline(n_points, color=style.INK, lw=1, linestyle="--", label="points in Table 4")
        ax.set(xscale="log", xlim=(2, 60), xlabel="number of errors n")
        ax.set_xticks([2, 3, 4, 5, 10, 20, int(n_points)], minor=False)
        ax.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
        ax.xaxis.set_minor_formatter("")
        ax.set(ylim=(2.5, -0.5))
        ax.set_yticks(range(3), AXES)
        fig.legend(loc="outside lower center", ncols=3)
    return fig


def lever_arm() -> Figure:
    """Draw the differences in interior orientation beside the lever arm (item 14).

    Returns
    -------
    Figure
        Two-step minus single-step at the mean flying height, and the single-step's lever arm
        with its sign changed; the error bars are one standard deviation of their difference.
    """
    table = lever_arm_in_interior()
    place = np.arange(len(table))
    with style.applied():
        fig, ax = plt.subplots(figsize=(style.WIDTH, 2.7))
        ax.barh(
            *(place - 0.18, table["at_ground_m"], 0.32),
            color=style.ORANGE,
            label="two-step minus single-step, at the ground",
        )
        ax.barh(
            *(place + 0.18, -table["lever_m"], 0.32),
            color=style.BLUE,
            xerr=table["sigma_sum_m"],
            error_kw={"ecolor": style.INK, "capsize": 3, "lw": 1},
            label="lever arm of the single step, sign changed",
        )
        ax.axvline(0.0, color=style.INK, linewidth=0.8)
        ax.set(xlabel="metres at the mean flying height", xlim=(-0.5, 0.5))
        ax.set_yticks(place, [INTERIOR_LABELS[name] for name in table.index])
        ax.grid(visible=False, axis="y")
        ax.invert_yaxis()
        fig.legend(loc="outside lower center", ncols=2)
    return fig
