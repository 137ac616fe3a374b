"""What of the rotations is parallax: the heads stand apart, and the ground is near."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4book.reference.heads.solved import Solved, solved, turned_deg

BASES_M = (0.02, 0.03)
"""Usual distances of lenses in such a camera."""


def parallax(files: str) -> pd.DataFrame:
    """Return a row for every head that the factory oriented.

    Returns
    -------
    DataFrame
        Head and reference; how far the rotations lie from the factory's, as px along columns and
        rows in the middle of the image: `x_px`, `y_px` of rotations alone, `x_left_px`, `y_left_px`
        with the places of the heads free; the place relative to the reference that is then found,
        mm: `base_x_mm` along columns, `base_y_mm` against rows; height, m, and focal length, px.
    """
    found = solved(files)
    rows = []
    for k in range(len(found.heads)):
        if found.leads(k):
            continue
        reference = found.reference(k)
        turns = [_shift_px(found, way, k, reference) for way in ("rotations", "six")]
        xyz = found.fits["six"].orientation.xyz_mm
        base = 1000 * (xyz[k] - xyz[reference]) * found.height_m / found.factory.xyz_mm[0, 2]
        rows.append(
            {
                "head": found.names[k],
                "reference": found.names[reference],
                "x_px": turns[0][0],
                "y_px": turns[0][1],
                "x_left_px": turns[1][0],
                "y_left_px": turns[1][1],
                "base_x_mm": float(base[0]),
                "base_y_mm": float(base[1]),
                "height_m": found.height_m,
                "f_px": float(1 / np.radians(found.pixel_deg)),
            }
        )
    return pd.DataFrame(rows)


def _shift_px(found: Solved, way: str, k: int, reference: int) -> tuple[float, float]:
    """Return by how much a head shifts its image against the factory's angles, px."""
    ours = turned_deg(found.fits[way].orientation, k, reference)
    x, y, _ = (ours - turned_deg(found.factory, k, reference)) / found.pixel_deg
    # about y the image moves along columns, about x against rows
    return float(y), -float(x)


def predicted_px(base_m: float, *, height_m: float, f_px: float) -> float:
    """Return the shift between two heads that a base makes at a distance, px.

    Parameters
    ----------
    base_m, height_m : float
    f_px : float
        Focal length, px.
    """
    return f_px * base_m / height_m
