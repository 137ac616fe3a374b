"""Sentences of the validation stage, with the numbers of a run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import stats

from acx4book.chapters.mounting.sentences import listed
from acx4book.typesetting.labels import TITLES, inside
from acx4lib.georeferencing.validation import Validation

NOTHING = "No method has all its parameters determined, so there is nothing to validate."


def validation(validations: Sequence[Validation]) -> str:
    """Say how the RMS found compares with the one predicted, for the last method."""
    if not validations:
        return NOTHING
    last = validations[-1]
    found = np.sqrt(np.mean(last.pairs.d**2, axis=0))
    predicted = np.sqrt(np.mean(last.pairs.sigma**2, axis=0))
    points = np.sqrt(np.mean(last.points.d**2, axis=0))
    return (
        f"With the parameters of the {inside(TITLES[last.method])} method, the RMS over "
        f"{len(last.pairs)} pairs is {listed(found / predicted, '.2f')} times the predicted one "
        f"in east, north and height. From all rays of a point it is {listed(points, '.2f')} m."
    )


def normalised(validations: Sequence[Validation]) -> str:
    """Say how large the points' differences are in predicted sigmas, and what chance allows."""
    if not validations:
        return NOTHING
    n = len(validations[-1].points)
    low, high = np.sqrt(stats.chi2.ppf((0.025, 0.975), n) / n)
    ratios = "; ".join(
        f"{listed(np.sqrt(np.mean((v.points.d / v.points.sigma) ** 2, axis=0)), '.2f')} "
        f"({inside(TITLES[v.method])})"
        for v in validations
    )
    return (
        f"The RMS of the normalised differences, east, north and height, is {ratios}. Where the "
        f"prediction is right, {n} independent points leave it between {low:.2f} and {high:.2f} in "
        "95 of 100 flights."
    )
