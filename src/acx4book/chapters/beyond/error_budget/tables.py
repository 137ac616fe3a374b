"""Tables of the error budget."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.error_budget import as_printed
from acx4book.chapters.beyond.error_budget.as_printed import Assumed, Suspect
from acx4book.typesetting.labels import TITLES
from acx4lib.expected import Array
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing import budget
from acx4lib.georeferencing.budget import Budget
from acx4lib.georeferencing.differences import Differences
from acx4lib.georeferencing.validation import Validation

COORDINATES = ("plan", "height")


def plan_and_height(variance: Array) -> Array:
    """Return variances in plan, east and north together, and in height.

    Parameters
    ----------
    variance : ndarray, shape (3, n_sources)

    Returns
    -------
    ndarray, shape (2, n_sources)
    """
    return np.stack([variance[0] + variance[1], variance[2]])


def percent(variance: Array, *sources: str) -> float:
    """Return which part of a variance some sources have, %.

    Parameters
    ----------
    variance : ndarray, shape (n_sources,)
    *sources : str
        Names of `budget.SOURCES`.
    """
    own = [budget.SOURCES.index(source) for source in sources]
    return float(100 * variance[own].sum() / variance.sum())


def groups(
    validations: Mapping[str, Validation],
    points: Mapping[str, Budget],
    pairs: Mapping[str, Budget],
) -> pd.DataFrame:
    """Return the predicted RMS at the check points, whether it holds, and the shares of groups.

    Parameters
    ----------
    validations : mapping of str to Validation
        By method.
    points, pairs : mapping of str to Budget
        Of their points, each from all its rays, and of their pairs.
    """
    rows = {}
    for method, found in validations.items():
        for rays, split, own in (
            ("all", points[method], found.points),
            ("pairs", pairs[method], found.pairs),
        ):
            for name, row in _by_coordinate(split, own).items():
                rows[TITLES[method], rays, name] = row
    table = pd.DataFrame(rows.values())
    table.index = pd.MultiIndex.from_tuples(rows, names=["method", "rays", "coordinate"])
    sizes = dict.fromkeys(("RMS predicted (m)", "RMS of d / σ"), ".2f")
    table.attrs["formats"] = sizes | dict.fromkeys(table.columns[2:], ".1f")
    return table


def _by_coordinate(split: Budget, own: Differences) -> dict[str, dict[str, float]]:
    square = np.mean((own.d / own.sigma) ** 2, axis=0)
    normalised = np.sqrt([square[:2].mean(), square[2]])
    return {
        name: {
            "RMS predicted (m)": float(np.sqrt(part.sum())),
            "RMS of d / σ": float(normalised[k]),
            **{f"{group} (%)": 100 * float(v) for group, v in budget.shares(part).items()},
        }
        for k, (name, part) in enumerate(zip(COORDINATES, plan_and_height(split.mean), strict=True))
    }


def printed_flight(cases: Sequence[Assumed], budgets: Sequence[Budget]) -> pd.DataFrame:
    """Return what the paper's own accuracies predict, and what they leave of its RMS.

    Parameters
    ----------
    cases : sequence of Assumed
    budgets : sequence of Budget
        Of pairs of rays, one for each case.
    """
    rms, rows = as_printed.rms(), []
    for assumed, split in zip(cases, budgets, strict=True):
        left = as_printed.unexplained(rms, split.rms)
        row = {"image σ (px)": assumed.sigma_px, "GNSS σ (m)": assumed.sigma_gnss_m}
        for axis, predicted, rest in zip(AXES, split.rms, left, strict=True):
            row[f"{axis}: predicted (m)"] = predicted
            row[f"{axis}: left (m)"] = rest if rest > 0 else np.nan
        rows.append(row)
    table = pd.DataFrame(rows)
    table.attrs["formats"] = dict.fromkeys(table, ".2f") | {"image σ (px)": ".1f"}
    return table


def suspects(found: Sequence[Suspect]) -> pd.DataFrame:
    """Return which single error would explain what is left in plan, and what it does to heights."""
    rows = {one.name: dict(zip(AXES, one.rms, strict=True)) for one in found}
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("error")
    table.insert(0, "size needed", [one.needed for one in found])
    table.columns = ["size needed", *(f"{axis} (m)" for axis in AXES)]
    table.attrs["formats"] = dict.fromkeys(table.columns[1:], ".2f")
    return table
