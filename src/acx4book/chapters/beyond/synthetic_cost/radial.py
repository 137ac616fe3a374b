"""Radial distortion of the synthetic image beside Table 3's: what makes it, and what does not."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.synthetic_cost import study
from acx4book.chapters.beyond.synthetic_cost.study import SYNTHETIC, Study
from acx4book.paper import printed
from acx4lib.expected import Array

RADIAL = ("k1", "k2", "k3")
HEADS = ("refined", "calibrated")
"""Kinds of heads, through which points are carried."""


def printed_with_sigma() -> tuple[Array, Array]:
    """Return k1, k2, k3 of Table 3's single step, and their sigma."""
    of = [(3, name, "single_step") for name in RADIAL]
    return np.array([printed.value(*o) for o in of]), np.array([printed.sigma(*o) for o in of])


def in_sigma(found: Study) -> dict[str, pd.DataFrame]:
    """Return k1-k3 of exact data less Table 3's over its sigma, by kind of heads: rows are f_1."""
    each = zip(RADIAL, *printed_with_sigma(), strict=True)
    wide = {name: (study.exact(found.sweep, "SYN", name) - v) / s for name, v, s in each}
    return {
        heads: pd.DataFrame({name: own[heads] for name, own in wide.items()}) for heads in HEADS
    }


def focal_lengths(differences: pd.DataFrame) -> Array:
    """Return the focal length of head 1 at which each coefficient is the printed one, mm.

    Parameters
    ----------
    differences : DataFrame
        As `in_sigma` has it for one kind of heads: in it each coefficient is a line.
    """
    lines = [np.polyfit(differences.index, own, 1) for _, own in differences.items()]
    return np.array([-offset / slope for slope, offset in lines])


def squares(found: Study) -> pd.DataFrame:
    """Return k1, k2, k3 of exact data: a row for every side of the square of lens centres."""
    wide = found.squares.pivot_table(index="side_m", columns="parameter", values="value")
    return wide[list(RADIAL)]


def weakest_correlation(found: Study) -> float:
    """Return the smallest absolute correlation of k1-k3, over flights."""
    own = found.parameters[found.parameters["way"] == SYNTHETIC]
    values = own.pivot_table(index="seed", columns="parameter", values="value")[list(RADIAL)]
    return float(np.abs(np.corrcoef(values.to_numpy().T)).min())


def radius_mm() -> Array:
    """Return radii from the middle of the synthetic image to its corner, mm."""
    return np.linspace(0, float(np.hypot(*printed.corners("SYN")[0])), 60)


def radial_um(coefficients: Array, r_mm: Array) -> Array:
    """Return radial distortion at radii, micrometres (eqs 7-8: the polynomial times the radius)."""
    powers = r_mm[:, None] ** [3, 5, 7]
    return 1000 * powers @ np.asarray(coefficients)
