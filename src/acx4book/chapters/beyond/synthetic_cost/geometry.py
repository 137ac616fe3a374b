"""What the geometry of four lens centres makes of one synthetic camera.

The residual pattern: a ray of a head starts d beside the lens centre of the synthetic camera. On
ground at distance H it is f d / H beside where that camera expects it, and the adjustment takes up
a part that does not depend on H: the pattern is linear in 1 / H. Two flying heights tell it.

The lever arm: the centres of four heads form a square, and each head looks outward over its corner.
What it sees is shifted outward on the ground by as much as its centre lies beside the square's. A
camera in the middle sees ground at the distances t H from below it; if it were higher by c, at
t (H + c). The shift does not depend on H, and at all flying heights it looks like a higher camera,
with the factor of least squares over the image: c = sum(d t) / sum(t t).

The radial distortion of the synthetic image beside Table 3's: what makes it, and what does not.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.synthetic_cost import study
from acx4book.chapters.beyond.synthetic_cost.study import SYNTHETIC, Study
from acx4book.paper import printed
from acx4lib.expected import Array
from acx4sim.optics import head_truth

# --- the pattern of residuals -----------------------------------------------------------------

D = ["d_col_px", "d_row_px"]
AT = ["row_px", "col_px"]


def at_height(pattern: pd.DataFrame, height_m: float) -> pd.DataFrame:
    """Return the pattern at a flying height above the ground.

    Parameters
    ----------
    pattern : DataFrame
        As `study.Study` has it, of two flying heights.
    height_m : float

    Returns
    -------
    DataFrame
        head, col_px, row_px, d_col_px, d_row_px.
    """
    low, high = np.unique(pattern["height_m"])
    lower, higher = (
        pattern[pattern["height_m"] == h].sort_values(AT, ignore_index=True) for h in (low, high)
    )
    share = (1 / height_m - 1 / high) / (1 / low - 1 / high)
    return higher.assign(**{d: higher[d] + share * (lower[d] - higher[d]) for d in D}).drop(
        columns="height_m"
    )


def rms_px(found: pd.DataFrame) -> float:
    """Return the root mean square of a pattern's vectors, by coordinate, px."""
    return float(np.sqrt(np.mean(found[D].to_numpy() ** 2)))


def largest_px(found: pd.DataFrame) -> float:
    """Return the length of the longest vector, px."""
    return float(np.hypot(found[D[0]], found[D[1]]).max())


def largest_step_px(found: pd.DataFrame) -> float:
    """Return the largest step between neighbouring nodes of different heads, px."""
    head = grid(found, "head")
    d = np.stack([grid(found, name).astype(float) for name in D], axis=-1)
    return float(max(_steps(head, d), _steps(head.T, np.swapaxes(d, 0, 1))))


def grid(found: pd.DataFrame, name: str) -> Array:
    """Return a column of a pattern as rows and columns of the image; None where no head sees it."""
    return found.pivot_table(
        index="row_px", columns="col_px", values=name, aggfunc="first"
    ).to_numpy()


def _steps(head: Array, d: Array) -> float:
    """Return the largest step over seams between the rows of a grid."""
    seam = (head[1:] != head[:-1]) & ~pd.isna(head[1:]) & ~pd.isna(head[:-1])
    lengths = np.hypot(*(d[1:] - d[:-1])[seam].T)
    return float(lengths.max(initial=0.0))


# --- the lever arm -----------------------------------------------------------------------------


def apparent_rise_m(side_m: float, f_mm: float, size_mm: Array) -> float:
    """Return how much higher the lens centre of the synthetic camera appears, m.

    Parameters
    ----------
    side_m : float
        Of the square of the heads' lens centres, parallel to the image.
    f_mm : float
    size_mm : ndarray, shape (2,)
        Of the image, evenly filled with points, each head in its quarter.
    """
    mean_t = size_mm / 4 / f_mm
    mean_t_t = size_mm**2 / 12 / f_mm**2
    return float(side_m / 2 * mean_t.sum() / mean_t_t.sum())


def true_centre_m() -> Array:
    """Return the mean of the lens centres of the simulated heads in the body frame, shape (3,)."""
    centre: Array = np.mean([head.lever_m for head in head_truth.HEADS.values()], axis=0)
    return centre


# --- radial distortion -------------------------------------------------------------------------

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


def by_side(found: Study) -> pd.DataFrame:
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
