"""The heads' rotations, beside those of the factory and of an independent trial."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4book.reference.heads.pairs import pair_sigma_deg
from acx4book.reference.heads.printed import TRIAL
from acx4book.reference.heads.solved import Solved, solved, turned_deg
from acx4lib.expected import Array
from acx4lib.least_squares.covariance import sigmas

XYZ = ("x", "y", "z")


def rotations(files: str) -> pd.DataFrame:
    """Return a row for every head but the first.

    Returns
    -------
    DataFrame
        Head and reference; rotations, degrees; sigma of them by the loops of pairs, and the largest
        by the noise of matching alone; less the factory's, NaN without; less the trial's.
    """
    found = solved(files)
    loops = pair_sigma_deg(found) * np.sqrt(2 / len(found.heads))
    rows = []
    for k, name in enumerate(found.names):
        reference = found.reference(k)
        if k == reference:
            continue
        ours = turned_deg(found.fits["rotations"].orientation, k, reference)
        rows.append(
            {
                "head": name,
                "reference": found.names[reference],
                **_three("deg", ours),
                **_three("sigma_deg", loops),
                "noise_deg": _noise_deg(found, k),
                **_three("minus_factory_deg", ours - _factory(found, k, reference)),
                **_three("minus_trial_deg", ours - np.array(TRIAL[files][name])),
            }
        )
    return pd.DataFrame(rows)


def _three(name: str, values: Array) -> dict[str, float]:
    return {f"{axis}_{name}": float(v) for axis, v in zip(XYZ, values, strict=True)}


def _factory(found: Solved, k: int, reference: int) -> Array:
    """Return the factory's rotations; NaN where it has none between the two."""
    known = bool(found.heads[k].relatives_deg) and not found.leads(k)
    return turned_deg(found.factory, k, reference) if known else np.full(3, np.nan)


def _noise_deg(found: Solved, k: int) -> float:
    sigma = sigmas(found.fits["rotations"].cov).reshape(-1, 6)[k, 3:]
    return float(np.degrees(sigma.max()))
