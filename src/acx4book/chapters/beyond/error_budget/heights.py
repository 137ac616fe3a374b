"""Mapping flights at many heights: what grows with the height, and what does not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4book.chapters.beyond.error_budget.examined import Examined, plan_and_height
from acx4lib.expected import Array
from acx4lib.georeferencing.mapping_flight import over_ground

HEIGHTS_M = np.arange(500.0, 3001.0, 250.0)
"""Flying heights over ground."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Heights:
    """Mean variances of ground points at every height.

    Attributes
    ----------
    height_m : ndarray, shape (n,)
    variance : dict of str to ndarray, shape (n, 2, n_sources)
        By method: in plan and in height, m^2.
    """

    height_m: Array
    variance: dict[str, Array]


def of(found: Examined, height_m: Array = HEIGHTS_M) -> Heights:
    """Predict the budgets of mapping flights with the calibrations of a flight.

    Parameters
    ----------
    found : Examined
    height_m : ndarray, shape (n,)
    """
    return Heights(
        height_m=height_m,
        variance={
            method: np.array(
                [plan_and_height(over_ground(calibration, found.mapping(h)).mean) for h in height_m]
            )
            for method, calibration in found.calibrations.items()
        },
    )
