"""Whether the single step beats the two-step method: one verdict, for the page of questions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from acx4book.pages.benchmarks import stored
from acx4book.typesetting.labels import LABELS
from acx4lib.geometry.parameters import BORESIGHT_ANGLES
from acx4lib.results import folder

COMPARED = ("f_mm", "lever_z_m", "boresight_omega_deg")
"""Parameters whose standard deviations are compared."""


def page(found: folder.Results, camera: str, benchmarks: Path) -> str:
    """Return the verdict on the two methods as MyST text; empty where one of them is missing.

    Parameters
    ----------
    found : Results
        With the stages mounting and validation.
    camera : str
    benchmarks : Path
        Folder with what ``make coverage`` left.
    """
    names = ("two_step", "single_step")
    if not {f"{stage}/{m}" for stage in ("mounting", "validation") for m in names} <= {
        *found.summary
    }:
        return ""
    two, single = (folder.parameters(found, f"mounting/{m}", camera) for m in names)
    ratios = {name: two["sigma"][name] / single["sigma"][name] for name in COMPARED}
    rms = [_rms(found.summary[f"validation/{m}"]) for m in names]
    return (
        "## Does the single step beat the two-step method?\n\n"
        "In what it determines, yes; in maps from the heights at which it was calibrated, hardly. "
        f"Its {LABELS['f_mm']} has a standard deviation {ratios['f_mm']:.0f} times smaller, its "
        f"{LABELS['lever_z_m']} {ratios['lever_z_m']:.0f} times, and its boresight about the same "
        f"({ratios['boresight_omega_deg']:.1f} times for {LABELS['boresight_omega_deg']}). At the "
        f"check points of this one flight the RMS is {rms[1][0]:.2f} m in plan and "
        f"{rms[1][1]:.2f} m in height with the single step, {rms[0][0]:.2f} and {rms[0][1]:.2f} m "
        "with the two-step method. What "
        "the two-step method leaves undetermined compensates itself near the flying heights of "
        "the calibration. Farther away it does not: {doc}`_executed/16-error-budget` has its share "
        "in the variance on the ground by flying height.\n\n"
        f"{slow_errors(benchmarks)}"
    )


def _rms(entry: dict[str, Any]) -> tuple[float, float]:
    """Return the RMS over the check points in plan and in height, m."""
    east, north, height = entry["points"]["rms"]
    return float(np.hypot(east, north)), float(height)


def slow_errors(benchmarks: Path) -> str:
    """Say what errors of the trajectory that change slowly do to the boresight."""
    _, (errors,) = stored.read(benchmarks, "slow_errors", make="coverage")
    own = errors[(errors["weights"] == "white") & errors["parameter"].isin(BORESIGHT_ANGLES)]
    ratio = ((own["error"] / own["sigma"]) ** 2).groupby(own["parameter"]).mean() ** 0.5
    return (
        "All these standard deviations hold where the errors of the trajectory are independent "
        f"from image to image. Over {own['seed'].nunique()} flights with errors that change "
        f"slowly, the boresight was off by {ratio.min():.1f} to {ratio.max():.1f} times its "
        "standard deviation by axis (RMS), if they are taken for independent "
        "({doc}`coverage`, {doc}`_executed/09-weights`)."
    )
