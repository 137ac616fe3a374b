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
from acx4book.report.mounting.stability import Drift, drifts, straight_line
from acx4book.report.parameters.tables import head_table
from acx4book.report.shown import Text, show, table
from acx4book.typesetting import style
from acx4book.typesetting.labels import value_and_sigma
from acx4lib.expected import Array


def section(material: Material, boresights: pd.DataFrame) -> Text:
    """Return the section on the mounting, with the tests of the boresights over time."""
    heads = head_table(material, "heads/relative_orientation")
    drift = drift_table(drifts(boresights))
    return show(
        lever_sentence(material)
        or table(lever_table(material), LEVERS, name="tab-report-lever", obtained=SURVEYED),
        "" if heads.empty else table(heads, HEADS, name="tab-report-relative", obtained=RELATIVE),
        table(drift, "Stability of the boresight", name="tab-report-drift", obtained=SCATTER),
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
SCATTER = "a straight line through the boresights of all images, tested against their scatter"


def drift_table(tested: Sequence[Drift]) -> pd.DataFrame:
    """Return the tests of the boresight over time."""
    rows = [
        {
            "Axis of the body": d.axis,
            "Change, first to last (°)": value_and_sigma(d.change_deg, d.sigma_deg),
            "p of the drift": d.p,
            "p of the strips": d.p_strips,
        }
        for d in tested
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
                line = straight_line(time.to_numpy(), values.to_numpy())
                ax.plot(ends, line.at_zero + line.slope * ends, "--", color=style.INK, lw=1.0)
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
