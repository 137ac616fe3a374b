"""Which pairs of heads tie, and how well they fit when all heads are turned together."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4book.reference.heads.solved import Solved, solved
from acx4lib.expected import Array
from acx4lib.tie_points.search import strongest_chain
from acx4lib.tie_points.ties import Overlap, overlaps


def pairs(files: str) -> pd.DataFrame:
    """Return a row for every pair of heads.

    Returns
    -------
    DataFrame
        Heads; corners with texture, those that found a partner, their share; mean and rms
        difference after the refinement, px; whether the pair is of the strongest chain.
    """
    found = solved(files)
    chain = {(one.head_a, one.head_b) for one in strongest_chain(found.found.overlaps)}
    left = {(one.head_a, one.head_b): one for one in differences(found)}
    rows = []
    for one in found.found.overlaps:
        pair = one.head_a, one.head_b
        d = left[pair].d / found.synthetic.pixel_mm if pair in left else np.full((1, 2), np.nan)
        rows.append(
            {
                "head": found.names[pair[0]],
                "other": found.names[pair[1]],
                "textured": one.n_textured,
                "ties": one.n_ties,
                "share": one.n_ties / max(one.n_textured, 1),
                "mean_px": float(np.hypot(*d.mean(axis=0))),
                "rms_px": float(np.sqrt(np.mean(d**2))),
                "chain": pair in chain,
            }
        )
    return pd.DataFrame(rows)


def differences(found: Solved) -> list[Overlap]:
    """Return the differences of all pairs after the refinement by rotations."""
    fit = found.fits["rotations"]
    return overlaps(found.found.ties[~fit.rejected], fit.orientation)


def pair_sigma_deg(found: Solved) -> Array:
    """Return sigma of the rotation of one pair about x, y and z, degrees, from closed loops.

    Every pair of heads is turned once more by itself. How far these rotations are from zero is what
    the pairs contradict each other by; neighbouring ties share errors, which their number hides.
    """
    f = found.factory.heads[0].interior.f
    left = np.array([_turn(one, f) for one in differences(found)])
    redundancy = max(len(left) - len(found.heads) + 1, 1)
    return np.asarray(np.degrees(np.sqrt(np.sum(left**2, axis=0) / redundancy)))


def _turn(one: Overlap, f: float) -> Array:
    """Return the rotation of rays (x, y, -f) that removes the differences of a pair, radians."""
    x, y = one.xy.T
    zero = np.zeros(len(x))
    by_x = np.stack([x * y / f, -f - x * x / f, -y])
    by_y = np.stack([f + y * y / f, -x * y / f, x + zero])
    A = np.concatenate([by_x.T, by_y.T])
    return np.asarray(np.linalg.lstsq(A, one.d.T.ravel(), rcond=None)[0])
