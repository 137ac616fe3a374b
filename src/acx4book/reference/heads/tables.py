"""Tables of the chapter, with headings for readers, and numbers that its sentences need."""

from __future__ import annotations

import numpy as np
import pandas as pd

from acx4lib.expected import Array

ROUNDED_DEG = 0.001
"""The last digit of the trial's angles."""

# --- tables ----------------------------------------------------------------------------------


def rotations(table: pd.DataFrame) -> pd.DataFrame:
    """Return the heads' rotations and their sigma."""
    values = {f"{axis} (°)": table[f"{axis}_deg"] for axis in "xyz"}
    sigmas = {f"σ {axis} (°)": table[f"{axis}_sigma_deg"] for axis in "xyz"}
    formats = {**dict.fromkeys(values, ".3f"), **dict.fromkeys(sigmas, ".4f")}
    return _of_heads(table, {**values, **sigmas}, formats)


def beside(table: pd.DataFrame) -> pd.DataFrame:
    """Return the heads' rotations less those of the factory, and of the trial."""
    columns = {
        f"{whose} {axis} (°)": table[f"{axis}_minus_{whose}_deg"]
        for whose in ("factory", "trial")
        if not table[f"x_minus_{whose}_deg"].isna().all()
        for axis in "xyz"
    }
    return _of_heads(table, columns, dict.fromkeys(columns, "+z.3f"))


def readings(table: pd.DataFrame) -> pd.DataFrame:
    """Return the readings of the factory's angles."""
    names = {
        "median_px": "median (px)",
        "least_px": "of the best head (px)",
        "largest_px": "of the worst head (px)",
    }
    shown = table.rename(columns=names)
    shown.attrs["formats"] = dict.fromkeys(names.values(), ".2f")
    return shown


def places(table: pd.DataFrame) -> pd.DataFrame:
    """Return what the free places of the heads take from the rotations."""
    names = {
        "x_px": "columns (px)",
        "y_px": "rows (px)",
        "x_left_px": "columns, places free (px)",
        "y_left_px": "rows, places free (px)",
        "base_x_mm": "base along columns (mm)",
        "base_y_mm": "base against rows (mm)",
    }
    columns = {title: table[key] for key, title in names.items()}
    formats = {title: "+.2f" if "px" in title else "+.0f" for title in columns}
    return _of_heads(table, columns, formats)


def _of_heads(
    table: pd.DataFrame, columns: dict[str, pd.Series], formats: dict[str, str]
) -> pd.DataFrame:
    shown = pd.DataFrame({"head": table["head"], "to": table["reference"], **columns})
    shown.attrs["formats"] = formats
    return shown


# --- numbers ---------------------------------------------------------------------------------


def less(table: pd.DataFrame, axes: str, whose: str) -> Array:
    """Return the rotations less those of others, degrees, shape (n, axes)."""
    return table.filter(regex=f"[{axes}]_minus_{whose}").to_numpy(dtype=float)


def rms(values: Array) -> float:
    """Return the root mean square of what is known."""
    return float(np.sqrt(np.nanmean(np.asarray(values, dtype=float) ** 2)))


def left_px(pairs: pd.DataFrame) -> float:
    """Return the RMS of all tie points in a coordinate, px."""
    return float(np.sqrt(np.average(pairs["rms_px"] ** 2, weights=pairs["ties"])))


def chi_square(table: pd.DataFrame) -> tuple[float, int]:
    """Return χ² of the rotations less the trial's, and its degrees of freedom.

    By σ of the loops, and by the trial's rounding.
    """
    trial = less(table, "xyz", "trial")
    sigma = table.filter(regex="[xyz]_sigma").to_numpy(dtype=float)
    return float(np.sum(trial**2 / (sigma**2 + ROUNDED_DEG**2 / 12))), trial.size
