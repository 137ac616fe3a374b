"""Figures of two of the findings."""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from acx4lib import paper
from acx4lib.errata.mounting import lever_arm_in_interior
from acx4lib.errata.validation import implied_sample_sizes

LABELS = {"two_step": "two-step", "single_step": "single-step"}
INTERIOR_LABELS = {
    "f_mm": "$f$, lever $z$",
    "xp_mm": "$x_p$, lever $x$",
    "yp_mm": "$y_p$, lever $y$",
}


def sample_sizes() -> Figure:
    """Draw the numbers of errors that Table 4's mean, deviation and RMS belong to (item 5).

    Returns
    -------
    Figure
        Bars: what rounding leaves open. Line: the number of points that the paper gives.
    """
    sizes = implied_sample_sizes()
    fig, ax = plt.subplots(figsize=(6.4, 2.8), layout="constrained")
    for i, (method, rows) in enumerate(sizes.groupby("method", sort=False)):
        height = np.arange(len(rows)) + 0.2 * (2 * i - 1)
        ax.hlines(height, rows["n_low"], rows["n_high"], color=f"C{i}", linewidth=5, alpha=0.4)
        ax.plot(rows["n"], height, "o", color=f"C{i}", label=LABELS[str(method)])
    n_points = paper.value(4, "n_points", "two_step")
    ax.axvline(n_points, color="0.3", linestyle="--", label="points in Table 4")
    ax.set(xscale="log", xlim=(2, 60), xlabel="number of errors n")
    ax.set_xticks([2, 3, 4, 5, 10, 20, int(n_points)], minor=False)
    ax.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    ax.xaxis.set_minor_formatter("")
    ax.set(ylim=(2.5, -0.5))
    ax.set_yticks(range(3), ["east", "north", "height"])
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, frameon=False)
    plt.close(fig)
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
    fig, ax = plt.subplots(figsize=(6.4, 2.8), layout="constrained")
    ax.barh(
        place - 0.18,
        table["at_ground_m"],
        0.32,
        label="two-step minus single-step",
    )
    ax.barh(
        place + 0.18,
        -table["lever_m"],
        0.32,
        xerr=table["sigma_sum_m"],
        error_kw={"ecolor": "0.3", "capsize": 3},
        label="lever arm, sign changed",
    )
    ax.axvline(0.0, color="0.3", linewidth=0.8)
    ax.set(xlabel="at the ground, mean flying height (m)", xlim=(-0.5, 0.5))
    ax.set_yticks(place, [INTERIOR_LABELS[name] for name in table.index])
    ax.invert_yaxis()
    ax.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, frameon=False)
    plt.close(fig)
    return fig
