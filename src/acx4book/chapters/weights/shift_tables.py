"""Tables and sentences on shifts and drifts of GNSS positions."""

from __future__ import annotations

import pandas as pd

from acx4book.chapters.weights.shifted import SHIFT_M
from acx4book.typesetting.labels import LABELS
from acx4book.typesetting.plain_text import shown
from acx4lib.calibration import gnss_shift
from acx4lib.calibration.mounting import Mounting

FREE_OF_SHIFT = (
    "GNSS positions are taken to be free of a common shift; `gnss` in flight.toml makes one an "
    "unknown."
)


def said(single: Mounting | None) -> str:
    """Say what the single step estimated of GNSS positions and what it held, as a list."""
    if single is None:
        return "There is no single step, and so no shift of GNSS positions."
    lines = [*gnss_shift.notes(single.bundle), *gnss_shift.not_determined(single.bundle)]
    return "\n".join(f"- {shown(line[0].upper() + line[1:])}." for line in lines) or FREE_OF_SHIFT


def ratio_table(scatter: pd.DataFrame) -> pd.DataFrame:
    """Return how large errors are against their sigma, a column for each kind.

    Parameters
    ----------
    scatter : DataFrame
        `experiments.scatter` of what `experiments.shifted_trajectories` returns.
    """
    rows = []
    for name, own in scatter.groupby("parameter", sort=False):
        if name in LABELS and str(name)[0] not in "kp":  # distortion is the images' alone
            ratio = {k: f"{r:.1f}" for k, r in zip(own["kind"], own["ratio"], strict=True)}
            cells = {_title(kind): ratio.get(kind, "held") for kind in scatter["kind"].unique()}
            rows.append({"Parameter": LABELS[str(name)], **cells})
    return pd.DataFrame(rows)


def _title(kind: str) -> str:
    """Return the heading of a column."""
    flight, _, unknown = kind.partition(", ")
    return f"{flight.capitalize()}; unknown: {unknown}"


def ratio_sentence(errors: pd.DataFrame) -> str:
    """Say what the shift does to the residuals and to the lever arm, with and without unknowns.

    Parameters
    ----------
    errors : DataFrame
        As `experiments.shifted_trajectories` returns it.
    """
    variance = errors.groupby("kind")["sigma0_squared"].mean()
    lever_z = errors[errors["parameter"] == "lever_z_m"].groupby("kind")["error"].mean()
    east, north, height = SHIFT_M
    return (
        f"Over {errors['seed'].nunique()} flights with a shift of {east:+.2f} m, {north:+.2f} m "
        f"and {height:+.2f} m in east, north and height, the variance of unit weight is "
        f"{variance['shifted, none']:.2f} on average, and {variance['shifted, shift']:.2f} with "
        f"the shift as an unknown. The lever arm's $z$ is off by "
        f"{lever_z['shifted, none']:+.2f} m and {lever_z['shifted, shift']:+.2f} m."
    )
