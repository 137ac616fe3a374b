"""Figures of two of the findings."""

from __future__ import annotations

import numpy as np
from matplotlib.figure import Figure

from acx4book.paper import printed
from acx4book.paper.errata.mounting import lever_arm_in_interior
from acx4book.paper.errata.validation import implied_sample_sizes
from acx4book.typesetting import style
from acx4lib.calibration.absorption import Absorption
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
        fig, ax = style.subplots(figsize=(style.WIDTH, 2.7))
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


def lever_arm(absorbed: Absorption | None = None) -> Figure:
    """Draw the differences in interior orientation beside the lever arm (item 14).

    Parameters
    ----------
    absorbed : Absorption, optional
        From a run of the study's flight.

    Returns
    -------
    Figure
        Two-step minus single-step at the mean flying height and, with a run, at the effective
        heights; and the single-step's lever arm with its sign changed.
    """
    table = lever_arm_in_interior(absorbed)
    bars = {"at the mean flying height": (table["at_ground_m"], style.SOFT)}
    if absorbed is not None:
        seen = table["sum_effective_m"] - table["lever_m"]
        bars["at the effective heights"] = (seen, style.ORANGE)
    bars["lever arm of the single step, sign changed"] = (-table["lever_m"], style.BLUE)
    place, width = np.arange(len(table)), 0.8 / len(bars)
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 2.9))
        for i, (label, (values, colour)) in enumerate(bars.items()):
            offset = (i - (len(bars) - 1) / 2) * width
            ax.barh(place + offset, values, 0.9 * width, color=colour, label=label)
        ax.axvline(0.0, color=style.INK, linewidth=0.8)
        ax.set(xlabel="metres", xlim=(-0.5, 0.5))
        ax.set_yticks(place, [INTERIOR_LABELS[name] for name in table.index])
        ax.grid(visible=False, axis="y")
        ax.invert_yaxis()
        fig.legend(loc="outside lower center", ncols=len(bars))
    return fig
