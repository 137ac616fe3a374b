"""Tables of the error budget."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.error_budget import as_printed
from acx4book.chapters.beyond.error_budget.examined import Examined, plan_and_height
from acx4book.typesetting.labels import TITLES
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing import budget

COORDINATES = ("plan", "height")

SHARES = tuple(f"{name} (%)" for name in budget.GROUPS)
SIZES = ("RMS predicted (m)", "RMS of d / σ")
RMS = tuple(f"{axis} (m)" for axis in AXES)
"""Columns of numbers, by what they have."""


def groups(found: Examined) -> pd.DataFrame:
    """Return the predicted RMS at the check points, whether it holds, and the shares of groups.

    Parameters
    ----------
    found : Examined
    """
    rows = []
    for method, validation in found.validations.items():
        for rays, split, own in (
            ("all", found.points(method), validation.points),
            ("pairs", found.pairs(method), validation.pairs),
        ):
            square = np.mean((own.d / own.sigma) ** 2, axis=0)
            held = np.sqrt([square[:2].mean(), square[2]])
            parts = plan_and_height(split.mean)
            for name, part, normalised in zip(COORDINATES, parts, held, strict=True):
                share = [100 * float(value) for value in budget.shares(part).values()]
                rows.append((TITLES[method], rays, name, np.sqrt(part.sum()), normalised, *share))
    head = ("Method", "Rays", "Coordinate", *SIZES, *SHARES)
    return pd.DataFrame(rows, columns=list(head))


def printed_flight(found: Examined) -> pd.DataFrame:
    """Return what the paper's own accuracies predict, and what they leave of its RMS.

    Parameters
    ----------
    found : Examined
    """
    rms = as_printed.rms()
    rows = []
    for assumed in as_printed.assumptions():
        said = as_printed.predicted(found, assumed).rms
        left = as_printed.unexplained(rms, said)
        case = (f"{assumed.sigma_px:.1f}", f"{assumed.sigma_gnss_m:.2f}")
        rows.append((*case, *map(_pair, said, left)))
    head = ("Image σ (px)", "GNSS σ (m)", *(f"{axis}: predicted, left (m)" for axis in AXES))
    return pd.DataFrame(rows, columns=list(head))


def _pair(said: float, left: float) -> str:
    return f"{said:.2f}, {left:.2f}" if left > 0 else f"{said:.2f}, nothing"


def suspects(found: Examined) -> pd.DataFrame:
    """Return which single error would explain what is left in plan, and what it does to heights.

    Parameters
    ----------
    found : Examined
    """
    rows = [(one.name, one.needed, *one.rms) for one in as_printed.suspects(found)]
    return pd.DataFrame(rows, columns=["Error", "Size needed", *RMS])
