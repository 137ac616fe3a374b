"""What errors leave in the mean of noise and its negative, as a part of the page on coverage."""

from __future__ import annotations

from pathlib import Path

import pandas as pd

from acx4book.pages.benchmarks import stored
from acx4book.typesetting.labels import LABELS
from acx4book.typesetting.myst import myst_table

GOAL = 0.02
"""Largest bias of a parameter, in its sigma."""

GOAL_ERROR = 0.005
"""Largest standard error with which the bias is to be known."""

OWN = "adjusted"
"""Where the library evaluates distortion unless told otherwise."""

HEADINGS = {"adjusted": "Adjusted point", "measured": "Measured point"}


def read(folder: Path) -> pd.DataFrame:
    """Read what ``make coverage`` left of its pairs of flights.

    Returns
    -------
    DataFrame
        Columns seed, distortion_at, parameter, error (the mean of a pair), sigma (of one flight).
    """
    _, (pairs,) = stored.read(folder, "coverage", "bias", make="coverage")
    return pairs


def biases(pairs: pd.DataFrame, distortion_at: str) -> pd.DataFrame:
    """Return bias and standard error over sigma, a row per parameter."""
    own = pairs[pairs["distortion_at"] == distortion_at]
    z = (own["error"] / own["sigma"]).groupby(own["parameter"], sort=False)
    return pd.DataFrame({"bias": z.mean(), "error": z.sem()})


def page(pairs: pd.DataFrame) -> str:
    """Return the biases of the single step and the goal as MyST text."""
    caption = (
        "Bias of the single step in thousandths of σ, distortion at adjusted or at measured points"
    )
    return f"{verdict(pairs)}\n\n{myst_table(table(pairs), caption, name='tab-coverage-bias')}\n"


def verdict(pairs: pd.DataFrame) -> str:
    """Say how large the largest biases are, and whether the goal is reached."""
    own = biases(pairs, OWN)
    largest, least_known = own.iloc[int(own["bias"].abs().argmax())], own["error"].max()
    reached = abs(largest["bias"]) < GOAL and least_known < GOAL_ERROR
    return (
        f"In {pairs['seed'].nunique()} pairs the largest bias of the single step is "
        f"{_shown(largest, digits=4)} σ, of {LABELS[str(largest.name)]}; all are known to "
        f"{least_known:.4f} σ or better. The goal, less than {GOAL:g} σ known to {GOAL_ERROR:g} σ, "
        f"is {'reached' if reached else 'not reached'}."
    )


def table(pairs: pd.DataFrame) -> pd.DataFrame:
    """Return the bias of every parameter in thousandths of sigma, by where distortion is taken."""
    found = {heading: 1000 * biases(pairs, where) for where, heading in HEADINGS.items()}
    names = found[HEADINGS[OWN]].index
    columns = {
        heading: [_shown(row, digits=2) for _, row in own.iterrows()]
        for heading, own in found.items()
    }
    return pd.DataFrame({"Parameter": [LABELS[str(name)] for name in names], **columns})


def _shown(found: pd.Series, *, digits: int) -> str:
    return f"{found['bias']:+z.{digits}f} ± {found['error']:.{digits}f}".replace("-", "−")
