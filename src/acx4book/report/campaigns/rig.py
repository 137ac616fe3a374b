"""The rigidity of the rig of one flight: from its results to a table, a figure and sentences."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from acx4book.report.campaigns.units import rows_of
from acx4book.report.words import listed
from acx4book.typesetting import style
from acx4book.typesetting.labels import p_value
from acx4book.typesetting.plain_text import shown
from acx4lib.calibration.trust.rigidity import Rigidity, rigidity
from acx4lib.errors import AdjustmentError, FlightError
from acx4lib.results.provenance import read_run
from acx4lib.stages import rig

HOW = (
    "In the rigid rig every head has one boresight and one lever arm at all exposures. In the free "
    "rig the heads turn: by three angles each, against the first head that measured at the "
    "exposure. With Ω the weighted sum of squared residuals, r the redundancy, and q angles "
    "more, F = ((Ω(rigid) - Ω(free)) / q) / (Ω(free) / (r - q)). In a row the heads of this "
    "exposure alone are free; in the last row all are, where what the boresights take up does not "
    "count. "
    "*p, joint* is Holm's: the probability of one false alarm or more among the exposures is at "
    "most {level:g}."
)
"""How the numbers were obtained, as Markdown."""

NAMED = 5
MOST_ROWS = 60
"""Exposures that a page lists; of more, those that deviate."""

MOST_NAMES = 40
"""Exposures whose names an axis can have."""


def read(folder: str | Path) -> Rigidity:
    """Adjust the heads of a run's flight together again, and test whether they turn.

    Parameters
    ----------
    folder : path
        Results of a run, with its flight.

    Raises
    ------
    FlightError
        Where the flight has no block of heads.
    AdjustmentError
        Where the heads cannot be adjusted together.
    """
    run = read_run(folder)
    at, flight = run.folder, run.flight
    if flight.heads is None or len(flight.heads.cameras) < 2:
        problem = (
            f"{at}: one results folder without a block of several heads; name two or more folders "
            "to compare campaigns"
        )
        raise FlightError([problem])
    stage = rig.calibrate(flight)
    if stage.rig is None:
        raise AdjustmentError(f"{at}: the heads cannot be adjusted together: {stage.left_out}")
    return rigidity(stage.rig.bundle)


def table(found: pd.DataFrame, *, level: float) -> pd.DataFrame:
    """Return the tests by exposure for readers; of many exposures, those that deviate.

    Parameters
    ----------
    found : DataFrame
        As `acx4lib.results.campaigns.tables.rigidity` returns it.
    level : float
    """
    if len(found) > MOST_ROWS:
        found = found[(found["p_joint"] < level) | (found["exposure"] == "")]
    return pd.DataFrame(
        [
            {
                "Exposure": row.exposure or "all at once",
                "Degrees of freedom": f"{row.dof}, {row.redundancy:,}",
                "F": f"{row.f:.2f}",
                "p": p_value(row.p),
                "p, joint": p_value(row.p_joint),
                "Turned": "yes" if row.p_joint < level else "no",
                "Head that turned most": row.head or None,
                "by (″)": f"{row.turn_arcsec:+.1f} ± {row.sigma_arcsec:.1f}" if row.head else None,
            }
            for row in rows_of(found)
        ]
    )


def verdict(found: Rigidity, *, level: float) -> str:
    """Say whether the rig is rigid, as Markdown."""
    whole, turned = found.whole, np.flatnonzero(found.p_joint < level)
    p = p_value(whole.p)
    text = (
        f"**The heads {'keep their places' if whole.p >= level else 'turn against each other'}.** "
        f"All {len(found.exposures)} exposures at once: F = {whole.f:.2f} with {whole.dof} and "
        f"{whole.redundancy:,} degrees of freedom, p {p if p.startswith('<') else f'= {p}'}; the "
        f"level is {level:g}."
    )
    if not len(turned):
        return f"{text} No exposure by itself deviates at the joint level."
    names = [shown(found.exposures[i]) for i in turned[:NAMED]]
    more = f", and {len(turned) - NAMED} more" if len(turned) > NAMED else ""
    return f"{text} At the joint level these exposures deviate: {listed(names)}{more}."


def for_terminal(found: Rigidity, *, level: float) -> list[str]:
    """Return the verdict in lines without markup."""
    whole = found.whole
    keeps = "keep their places" if whole.p >= level else "turn against each other"
    lines = [
        f"{len(found.exposures)} exposures: the heads {keeps}; F {whole.f:.2f}, {whole.dof} and "
        f"{whole.redundancy} degrees of freedom, p {p_value(whole.p)}"
    ]
    turned = np.flatnonzero(found.p_joint < level)
    said = [f"exposure {found.exposures[i]} deviates: F {found.tests[i].f:.2f}" for i in turned]
    return [*lines, *said]


def turns(found: Rigidity) -> Figure:
    """Draw how every head turned at every exposure, axis by axis, with error bars.

    Parameters
    ----------
    found : Rigidity
    """
    at = np.arange(len(found.exposures))
    arcsec = 3600 * np.degrees(np.stack([found.turns, found.sigma]))
    with style.applied():
        fig, axes = style.subplots(3, 1, figsize=(style.WIDTH, 4.8), sharex=True)
        for axis, ax in enumerate(axes):
            for k, head in enumerate(found.heads):
                value, sigma = arcsec[:, :, k, axis]
                own = sigma > 0
                shift = 0.5 * (k / max(1, len(found.heads) - 1) - 0.5)
                bars: dict[str, Any] = {"fmt": "o", "ms": 2.8, "lw": 0.8, "color": style.colour(k)}
                if own.any():
                    ax.errorbar(
                        *(at[own] + shift, value[own]),
                        yerr=2 * sigma[own],
                        label=style.plain(head),
                        **bars,
                    )
            ax.axhline(0, color=style.INK, lw=0.7)
            ax.set_ylabel(f"about {'xyz'[axis]} (″)")
            ax.grid(visible=False, axis="x")
        if len(at) <= MOST_NAMES:
            names = [style.plain(name, longest=10) for name in found.exposures]
            axes[-1].set_xticks(at, names, rotation=90)
        axes[-1].set_xlabel("exposure")
        style.legend_below(fig, axes[0].get_legend_handles_labels()[0])
    return fig
