"""Sentences of the mounting and validation stages, with the numbers of a run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd
from scipy import stats

from acx4lib import paper
from acx4lib._typing import Array
from acx4lib.calibration import parameters
from acx4lib.frames import log
from acx4lib.mounting import Mounting
from acx4lib.tables import LABELS, TITLES
from acx4lib.validation import Validation

BORESIGHT = ("boresight_omega_deg", "boresight_phi_deg", "boresight_kappa_deg")
NOTHING = "No method has all its parameters determined, so there is nothing to validate."


def lever_arm(seen: pd.DataFrame) -> str:
    """Say by how much the lever arm read from the interior orientation misses the estimated one.

    Parameters
    ----------
    seen : DataFrame
        As `experiments.lever_arm_seen` returns it.
    """
    if seen.empty:
        return "One of the two methods gave no result, so there is nothing to compare."
    difference = seen["lever_seen_m"] - seen["lever_estimated_m"]
    sigma = np.hypot(seen["sigma_seen_m"], seen["sigma_estimated_m"])
    if not np.any(sigma > 0):
        return "Interior orientation and lever arm are held, so there is nothing to compare."
    largest = float(np.max(np.abs(difference[sigma > 0]) / sigma[sigma > 0]))
    shifts = ", ".join(
        f"{shift:+.4f} mm in {LABELS.get(f'{key}_mm', str(key))}"
        for shift, key in zip(seen["shift_mm"], seen["parameter"], strict=True)
    )
    return (
        f"The interior orientation of the two-step method with GNSS positions differs from that "
        f"of the single step by {shifts}. Read as a lever arm, this misses the one that the "
        f"single step estimates by {_listed(difference, '+.2f')} m, at most "
        f"{largest:.1f} combined standard deviations."
    )


def scatter(mounting: Mounting | None, *, beside_paper: bool) -> str:
    """Say how the boresights of single images scatter, beside the precision of their mean.

    Parameters
    ----------
    mounting : Mounting or None
        Of a two-step method with one camera; None where it was left out.
    beside_paper : bool
        Name the printed standard deviations too.
    """
    if mounting is None or mounting.per_image is None or mounting.averaged is None:
        return "There is no boresight of single images."
    turns = _turns_deg(mounting, mounting.per_image.R)[mounting.averaged]
    n, found = len(turns), np.std(turns, axis=0, ddof=1)
    sigma = {p.name: p.sigma for p in parameters(mounting.calibration)}
    mean = [sigma[name] for name in BORESIGHT if name in sigma]
    said = (
        f"The {n} boresights scatter by {_listed(found, '.4f')}° in $\\omega$, $\\varphi$, "
        f"$\\kappa$. That over $\\sqrt{{{n}}}$ is {_listed(found / np.sqrt(n), '.4f')}°; the "
        f"propagated standard deviations of the mean are {_listed(mean, '.4f')}°."
    )
    if not beside_paper:
        return said
    two, one = ([paper.sigma(3, name, method) for name in BORESIGHT] for method in paper.METHODS)
    return (
        f"{said} The paper prints {_listed(two, '.4f')}° for its two-step angles and "
        f"{_listed(one, '.4f')}° for the single-step ones: the former have the size of a scatter, "
        "the latter that of the precision of a mean."
    )


def _turns_deg(mounting: Mounting, R_b_c: Array) -> Array:
    """Return every image's boresight against its camera's, about the body's axes, degrees."""
    camera_idx = mounting.bundle.network.block.images.camera_idx
    R = np.stack([camera.T_b_c.R for camera in mounting.calibration.cameras])[camera_idx]
    turns: Array = np.degrees(log(R_b_c @ np.swapaxes(R, 1, 2)))
    return turns


def validation(validations: Sequence[Validation]) -> str:
    """Say how the RMS found compares with the one predicted, for the last method."""
    if not validations:
        return NOTHING
    last = validations[-1]
    found = np.sqrt(np.mean(last.pairs.d**2, axis=0))
    predicted = np.sqrt(np.mean(last.pairs.sigma**2, axis=0))
    points = np.sqrt(np.mean(last.points.d**2, axis=0))
    return (
        f"With the parameters of the {_title(last.method)} method, the RMS over "
        f"{len(last.pairs)} pairs is {_listed(found / predicted, '.2f')} times the predicted one "
        f"in east, north and height. From all rays of a point it is {_listed(points, '.2f')} m."
    )


def normalised(validations: Sequence[Validation]) -> str:
    """Say how large the points' differences are in predicted sigmas, and what chance allows."""
    if not validations:
        return NOTHING
    n = len(validations[-1].points)
    low, high = np.sqrt(stats.chi2.ppf((0.025, 0.975), n) / n)
    ratios = "; ".join(
        f"{_listed(np.sqrt(np.mean((v.points.d / v.points.sigma) ** 2, axis=0)), '.2f')} "
        f"({_title(v.method)})"
        for v in validations
    )
    return (
        f"The RMS of the normalised differences, east, north and height, is {ratios}. Where the "
        f"prediction is right, {n} independent points leave it between {low:.2f} and {high:.2f} in "
        "95 of 100 flights."
    )


def _title(method: str) -> str:
    """Return a method's name inside a sentence."""
    return TITLES[method][:1].lower() + TITLES[method][1:]


def _listed(values: Iterable[float], spec: str) -> str:
    return ", ".join(f"{value:{spec}}" for value in values)
