"""The residual pattern of the synthetic image at any flying height.

A ray of a head starts d beside the lens centre of the synthetic camera. On ground at distance H it
is f d / H beside where that camera expects it, and the adjustment takes up a part that does not
depend on H: the pattern is linear in 1 / H. Two flying heights tell it for all.
"""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4lib.expected import Array

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
