"""What the chapter says with the numbers of its flight."""

from __future__ import annotations

from importlib import resources
from pathlib import Path

import numpy as np
import pandas as pd

from acx4book.chapters.beyond.from_pictures.exact import Errors
from acx4book.chapters.beyond.from_pictures.whole import REDUCE, Whole
from acx4book.typesetting.plain_text import shown
from acx4lib.expected import Mask

STORED = Path(str(resources.files("acx4book.chapters.beyond.from_pictures") / "stored"))
"""Folder of the measured flights that the project brings."""


def said(whole: Whole, *, most: int = 6) -> str:
    """Return the lines that the command prints, some of those on points that it missed."""
    lines = list(whole.outcome.sentences)
    more = [f"… and {len(lines) - most} more"] if len(lines) > most else []
    return (
        "~~~text\n"
        + "\n".join(shown(line, "terminal") for line in [*lines[:most], *more])
        + "\n~~~"
    )


def ties(errors: Errors, alike: Mask) -> str:
    """Say how large the errors of tie points are."""
    own, other = (errors.of_points(which).rms for which in (alike, ~alike))
    ratio = np.median(np.abs(errors.off) / errors.sigma[:, None]) / 0.6745
    n = len(errors.off)
    return (
        f"The root mean square of a coordinate is {errors.rms:.3f} px of these pictures, "
        f"{errors.rms * REDUCE:.2f} px of the full size. Of {n} measurements "
        f"{_none_or(errors.wrong)} off by more than a pixel. Points that pictures of one height "
        f"alone show are good to {own:.3f} px, the others to {other:.3f} px. Half of the "
        f"errors are below {0.6745 * ratio:.2f} of their standard deviations; of normal "
        "errors it would be 0.67."
    )


def control(errors: Errors) -> str:
    """Say how well the control points were centred."""
    z = float(np.sqrt(np.mean((errors.off / errors.sigma[:, None]) ** 2)))
    return (
        f"{len(errors.off)} discs were centred, with a root mean square error of "
        f"{errors.rms:.3f} px in a coordinate; over their standard deviations it is {z:.1f}. "
        f"{_none_or(errors.wrong).capitalize()} off by more than a pixel."
    )


def _none_or(count: int) -> str:
    return {0: "none is", 1: "one is"}.get(count, f"{count} are")


def over_flights(folder: Path = STORED) -> str:
    """Say how far the parameters of several measured flights are from the truth.

    Parameters
    ----------
    folder : Path
        With what ``make coverage`` left of measured flights.
    """
    found = pd.read_csv(folder / "measured_flights.csv")
    z = (found["error"] / found["sigma"]).abs()
    factor = found.groupby("seed")["sigma0_squared"].first()
    n, beyond = len(z), int((z > 2).sum())
    return (
        f"One flight is one draw. Over {len(factor)} flights, {beyond} of {n} errors exceed two "
        f"standard deviations, where {0.0455 * n:.0f} would be expected, and the largest is "
        f"{z.max():.1f} standard deviations. The variance of unit weight is {factor.min():.2f} to "
        f"{factor.max():.2f}." + (BETTER_MATCHES if factor.max() < SMALL_FACTOR else "")
    )


SMALL_FACTOR = 0.9
"""Variance of unit weight below which matches are called better than their sigma."""

BETTER_MATCHES = (
    " The matches are better than their standard deviations say. A posteriori that factor makes "
    "the standard deviations of GNSS and IMU smaller too, which are right, and with them those of "
    "the parameters."
)


def answer(whole: Whole, errors: Errors) -> str:
    """Answer the question of the chapter."""
    off = [(one.value - whole.truth[one.name]) / one.sigma for one in whole.parameters]
    k = int(np.argmax(np.abs(off)))
    sigma = {one.name: one.sigma for one in whole.parameters}
    angles = max(sigma[f"boresight_{name}_deg"] for name in ("omega", "phi", "kappa"))
    return (
        f"Yes. From {len(whole.block.images)} pictures at 1/{REDUCE} of their size, "
        f"{whole.block.image_points.sigma_px.size} measurements were taken without anybody "
        f"pointing at anything, good to {errors.rms:.2f} px of these pictures, "
        f"{errors.rms * REDUCE:.2f} px of the full size. With the trajectory and the control "
        f"points they give all {len(off)} parameters of the camera on this flight within "
        f"{np.ceil(10 * abs(off[k])) / 10:.1f} standard deviations of the truth, and the boresight "
        f"to {angles:.4f}° and better."
    )
