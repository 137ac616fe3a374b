"""The mounting: surveyed against estimated, heads, and the boresight over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from acx4book.report.material import Material
from acx4book.report.mounting.lever_arm import lever_sentence, lever_table
from acx4book.report.mounting.stability import AXES, Turns, turns_of
from acx4book.report.parameters.tables import head_table
from acx4book.report.shown import Text, show, table
from acx4book.typesetting import style
from acx4book.typesetting.labels import p_value, value_and_sigma
from acx4lib.expected import Array


def section(material: Material) -> Text:
    """Return the section on the mounting, with the tests of the boresight over time."""
    heads = head_table(material, "heads/relative_orientation")
    turns = turn_table(turns_of(material))
    return show(
        lever_sentence(material)
        or table(lever_table(material), LEVERS, name="tab-report-lever", obtained=SURVEYED),
        "" if heads.empty else table(heads, HEADS, name="tab-report-relative", obtained=RELATIVE),
        table(turns, "Stability of the boresight", name="tab-report-drift", obtained=TURNED),
    )


LEVERS = "Lever arms, surveyed and estimated"
HEADS = "Heads in the synthetic frame"
SURVEYED = (
    "flight.toml and parameters.csv; the difference is that of all other observations, without the "
    "survey where its σ makes it one"
)
RELATIVE = (
    "orientations of the heads at the exposures that all share, averaged; σ from the covariance "
    "matrices of the heads"
)
TURNED = (
    "the residuals of all attitudes in the adjustment that is certified, tested with their joint "
    "covariance; turns of strips are less the mean, a drift is from the first exposure to the last"
)


def turn_table(tested: Sequence[Turns]) -> pd.DataFrame:
    """Return how far the boresight turned in every strip and over time, with the tests."""
    rows = [
        {
            "Turn": test.title if len(test.names) == 1 else f"strip {name}",
            **{
                f"about {axis} (°)": value_and_sigma(test.turns_deg[i, k], test.sigma_deg[i, k])
                for k, axis in enumerate(AXES)
            },
            "F": f"{test.f:.2f}" if i == 0 else "",
            "Degrees of freedom": f"{test.dof}; {test.redundancy:.0f}" if i == 0 else "",
            "p": p_value(test.p) if i == 0 else "",
        }
        for test in tested
        for i, name in enumerate(test.names)
    ]
    return pd.DataFrame(rows)


def boresight_over_time(boresights: pd.DataFrame) -> Figure:
    """Draw the boresights of the images minus their mean over time, with sigma and a line.

    Parameters
    ----------
    boresights : DataFrame
        As `stability.boresights` returns it.
    """
    if boresights.empty:
        return style.nothing("No bundle with free orientations gives boresights of single images.")
    timed = bool(boresights["time_s"].notna().all())
    time = boresights["time_s"] / 60 if timed else boresights["number"]
    with style.applied():
        fig, axes = style.subplots(3, 1, figsize=(style.WIDTH, 4.4), sharex=True)
        for ax, axis in zip(axes, "xyz", strict=True):
            values, sigma = boresights[f"{axis}_deg"], boresights[f"sigma_{axis}_deg"]
            _by_strip(ax, time.to_numpy(), values.to_numpy(), sigma.to_numpy(), boresights["strip"])
            ax.axhline(0, color=style.INK, lw=0.7)
            if np.ptp(time) > 0:
                ends = np.array([time.min(), time.max()])
                line = np.polyfit(time.to_numpy(), values.to_numpy(), 1)
                ax.plot(ends, np.polyval(line, ends), "--", color=style.INK, lw=1.0)
            ax.set_ylabel(f"about {axis} (°)")
        axes[-1].set_xlabel("time after the first image (min)" if timed else "image number")
        handles, labels = axes[0].get_legend_handles_labels()
        if any(labels):
            style.legend_below(fig, handles, ncols=8)
    return fig


def _by_strip(ax: Axes, time: Array, values: Array, sigma: Array, strips: pd.Series) -> None:
    for i, strip in enumerate(strips.unique()):
        own = (strips == strip).to_numpy()
        bars: dict[str, Any] = {"fmt": "o", "ms": 3, "lw": 0.7, "color": style.colour(i)}
        label = f"strip {style.plain(strip)}" if strip else ""
        ax.errorbar(time[own], values[own], yerr=sigma[own], label=label, **bars)
