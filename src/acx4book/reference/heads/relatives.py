"""The readings of `RigRelatives`, told apart by pixels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pandas as pd
from scipy.spatial.transform import Rotation

from acx4book.reference.heads.solved import Solved, solved
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.exchange.lens import FLIP
from acx4lib.expected import Array
from acx4lib.geometry.frames import opk_from_rotation
from acx4lib.tie_points.ties import overlaps

READINGS: Mapping[str, tuple[str, bool]] = {
    "Rx(a) Ry(b) Rz(c), head to reference": ("XYZ", False),
    "Rz(c) Ry(b) Rx(a), head to reference": ("xyz", False),
    "Rx(a) Ry(b) Rz(c), reference to head": ("XYZ", True),
    "Rz(c) Ry(b) Rx(a), reference to head": ("xyz", True),
}
"""By what they mean: the order of the three rotations, as SciPy has it, and whether transposed."""


def relatives(files: str) -> pd.DataFrame:
    """Return a row for every reading: misfits at the ties of a head and its reference.

    Returns
    -------
    DataFrame
        Reading; median misfit of all pairs, the least and the largest of a pair, px.
    """
    found = solved(files)
    rows = []
    for reading, (order, transposed) in READINGS.items():
        medians = misfits(found, read_as(found, order, transposed=transposed))
        rows.append(
            {
                "reading": reading,
                "median_px": float(np.median(medians)),
                "least_px": float(np.min(medians)),
                "largest_px": float(np.max(medians)),
            }
        )
    return pd.DataFrame(rows)


def read_as(found: Solved, order: str, *, transposed: bool) -> RelativeOrientation:
    """Return the heads with their angles in one of the readings."""
    flip = np.diag([*FLIP, -1.0])
    angles = [head.relatives_deg or (0.0, 0.0, 0.0) for head in found.heads]
    turned = np.stack(
        [flip @ Rotation.from_euler(order, a, degrees=True).as_matrix() @ flip for a in angles]
    )
    R = np.swapaxes(turned, 1, 2) if transposed else turned
    return replace(found.factory, opk=opk_from_rotation(R))


def misfits(found: Solved, orientation: RelativeOrientation) -> Array:
    """Return the median misfits of heads to the references of their rigs, px."""
    ties = found.found.ties[~found.fits["rotations"].rejected]
    own = [(k, found.reference(k)) for k in range(len(found.heads)) if not found.leads(k)]
    wanted = {(min(pair), max(pair)) for pair in own}
    return np.array(
        [
            np.median(np.hypot(*one.d.T)) / found.synthetic.pixel_mm
            for one in overlaps(ties, orientation)
            if (one.head_a, one.head_b) in wanted
        ]
    )
