"""Figures of the time that an adjustment takes."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from acx4book.typesetting import style

SOLVERS = {
    "ours": ("acx4lib, with covariance", style.BLUE, "o-"),
    "ceres_automatic_dense_1": ("Ceres, automatic derivatives", style.ORANGE, "s-"),
}


def seconds_by_points(medians: pd.DataFrame) -> Figure:
    """Draw CPU seconds against the number of points, in all and for each measurement.

    Parameters
    ----------
    medians : DataFrame
        Indexed by problem and solver, columns ``points``, ``image_points`` and ``cpu_s``.
    """
    if medians.empty:
        return style.nothing("No numbers of tie points were compared.")
    with style.applied():
        fig, (total, each) = style.subplots(1, 2, figsize=(style.WIDTH, 2.9))
        for solver, (label, colour, line) in SOLVERS.items():
            own = medians[medians.index.get_level_values("solver") == solver]
            own = own.sort_values("points")
            points, seconds = own["points"].to_numpy(), own["cpu_s"].to_numpy()
            total.plot(points / 1000, seconds, line[0], color=colour, label=label)
            if len(own) > 1:
                slope, start = np.polyfit(points, seconds, 1)
                total.plot(points / 1000, start + slope * points, color=colour, lw=1.0)
            each.plot(points / 1000, 1e6 * seconds / own["image_points"], line, color=colour)
        total.set(xlabel="points (1000)", ylabel="CPU time (s)", ylim=(0, None), xlim=(0, None))
        each.set(xscale="log", xlabel="points (1000)", ylim=(0, None))
        each.set_ylabel("CPU time for an image point (\N{MICRO SIGN}s)")
        ticks = np.unique(medians["points"]) / 1000
        each.set_xticks(ticks, [f"{tick:.2g}" for tick in ticks])
        each.set_xticks([], minor=True)
        style.legend_below(fig, total.get_legend_handles_labels()[0])
    return fig
