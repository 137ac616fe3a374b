"""Errors that change slowly, taken for independent or not, as a part of the page on coverage."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from acx4book.pages.benchmarks import stored
from acx4book.typesetting.labels import LABELS
from acx4book.typesetting.myst import myst_table
from acx4lib.least_squares.adjustment import two_sided_p

ALPHA = 0.01
"""Two-sided probability of a chi-square outside its bounds."""

CHECKED = "Independent check points"
"""The question of a report that the validation answers."""

HEADINGS = {"white": "Taken for independent", "correlated": "Weights of their correlation"}


def read(folder: Path) -> pd.DataFrame:
    """Read what ``make coverage`` left of its flights with slow errors.

    Returns
    -------
    DataFrame
        Columns seed, weights (a key of `HEADINGS`), parameter, error, sigma (a priori), and the
        error made independent of those of the other parameters and divided by its sigma.
    """
    _, (errors,) = stored.read(folder, "slow_errors", make="coverage")
    return errors


def ratios(errors: pd.DataFrame, weights: str) -> pd.Series:
    """Return the RMS of the normalised errors, by parameter."""
    own = errors[errors["weights"] == weights]
    squares = (own["error"] / own["sigma"]) ** 2
    return squares.groupby(own["parameter"], sort=False).mean() ** 0.5


def chi_square(errors: pd.DataFrame, weights: str) -> tuple[float, int]:
    """Return the sum of squares of the independent normalised errors, and how many there are."""
    own = errors.loc[errors["weights"] == weights, "decorrelated"]
    return float(np.sum(own**2)), len(own)


def page(errors: pd.DataFrame) -> str:
    """Return verdict and table as MyST text."""
    caption = "RMS of the errors of the single step over their σ, slow errors of the trajectory"
    return f"{verdict(errors)}\n\n{myst_table(table(errors), caption, name='tab-coverage-slow')}\n"


def read_validated(folder: Path) -> pd.DataFrame:
    """Read what reports say of flights of a plan whose validation has slow errors, too.

    Returns
    -------
    DataFrame
        A row for each flight: fault, what is declared of the errors; size, the share of σ that
        changes slowly; holds, of the report as a whole; a column with the state of every question.
    """
    _, (flights,) = stored.read(folder, "slow_validations", make="coverage")
    return flights


def validated(flights: pd.DataFrame) -> str:
    """Return what reports say of validations with slow errors, as MyST text."""
    counts = {kind: _counts(own) for kind, own in flights.groupby("fault", sort=False)}
    known, n, _ = counts["declared"]
    unknown, m, _ = counts["not declared"]
    said = (
        f"With slow errors in calibration and validation, the question of independent check points "
        f"fails in {known} of {n} flights where σ, share and time constant are declared, and in "
        f"{unknown} of {m} where `flight.toml` says nothing of them."
    )
    rows = [
        {
            "Slow errors": str(kind),
            "Flights": of,
            "Independent check points fail": failed,
            "The report does not hold": lost,
        }
        for kind, (failed, of, lost) in counts.items()
    ]
    caption = "Reports of flights whose trajectory's errors change slowly"
    return f"{said}\n\n{myst_table(pd.DataFrame(rows), caption, name='tab-coverage-validated')}\n"


def _counts(flights: pd.DataFrame) -> tuple[int, int, int]:
    """Return in how many flights the question fails, how many there are, and failing reports."""
    failed = (flights[CHECKED] == "fails").sum()
    return int(failed), len(flights), int((flights["holds"] != 1).sum())


def verdict(errors: pd.DataFrame) -> str:
    """Say what chi-square says of all parameters together, for both weights."""
    value, n = chi_square(errors, "correlated")
    white, _ = chi_square(errors, "white")
    p = two_sided_p(value, n)
    where = "within" if p >= ALPHA else "outside"
    return (
        f"Over {errors['seed'].nunique()} flights the $\\chi^2$ of all parameters together is "
        f"{white:,.0f} at {n:,} degrees of freedom where the errors are taken for independent. "
        f"With the weights of their correlation it is {value:,.0f} ($p$ = {p:.2f}): {where} its "
        f"two-sided bounds of {100 * (1 - ALPHA):.0f} %."
    )


def table(errors: pd.DataFrame) -> pd.DataFrame:
    """Return the RMS of the normalised errors, a row per parameter."""
    columns = {heading: ratios(errors, weights) for weights, heading in HEADINGS.items()}
    names = columns[HEADINGS["white"]].index
    shown = {
        heading: [f"{value:.2f}" for value in own.loc[names]] for heading, own in columns.items()
    }
    return pd.DataFrame({"Parameter": [LABELS[str(name)] for name in names], **shown})
