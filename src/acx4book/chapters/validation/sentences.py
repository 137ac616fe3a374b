"""Sentences of the validation stage, with the numbers of a run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from acx4book.paper import printed
from acx4book.typesetting.labels import TITLES, inside
from acx4book.typesetting.plain_text import shown
from acx4lib.expected import Array
from acx4lib.flight.reader import Flight
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing import accuracy, standards
from acx4lib.georeferencing.differences import Differences
from acx4lib.georeferencing.validation import Validation
from acx4lib.least_squares.covariance import sigmas

UNLIKELY = 0.01
"""Probability below which differences do not agree with their covariance."""

NOTHING = "No method has all its parameters determined, so there is nothing to validate."


def whose(flight: Flight, earlier: str) -> str:
    """Say of which flight the calibration is that is validated.

    Parameters
    ----------
    flight : Flight
    earlier : str
        As the stage has it.
    """
    own = "this flight's own" if flight.calibration else "as flight.toml declares the cameras"
    return f"The calibration is {own}." if not earlier else f"T{shown(earlier[1:])}."


def validation(validations: Sequence[Validation]) -> str:
    """Say how the RMS found compares with the one predicted, for the last method."""
    if not validations:
        return NOTHING
    last = validations[-1]
    found = np.sqrt(np.mean(last.pairs.d**2, axis=0))
    predicted = np.sqrt(np.mean(last.pairs.sigma**2, axis=0))
    points = np.sqrt(np.mean(last.points.d**2, axis=0))
    return (
        f"With the parameters of the {inside(TITLES[last.method])} method, the RMS over "
        f"{len(last.pairs)} pairs is {listed(found / predicted, '.2f')} times the predicted one "
        f"in east, north and height. From all rays of a point it is {listed(points, '.2f')} m."
    )


def shared(validations: Sequence[Validation]) -> str:
    """Say where the mean of the points would seem known best if they were independent."""
    found = [validation for validation in validations if len(validation.points)]
    if not found:
        return NOTHING
    mean = np.array([sigmas(validation.mean_cov) for validation in found])
    apart = np.array([_sigma_if_independent(validation.points) for validation in found])
    method, axis = np.unravel_index(np.argmax(mean / apart), mean.shape)
    worst = found[method]
    return (
        f"Correlations matter most in {AXES[axis]} with the parameters of the "
        f"{inside(TITLES[worst.method])} method: the mean of its {len(worst.points)} points has a "
        f"standard deviation of {mean[method, axis]:.3f} m, and "
        f"{apart[method, axis]:.3f} m if they were independent."
    )


def _sigma_if_independent(points: Differences) -> Array:
    """Return the standard deviation of the mean without correlations, m, shape (3,)."""
    out: Array = np.sqrt(np.sum(points.sigma**2, axis=0)) / len(points)
    return out


# --- the answer ------------------------------------------------------------------------------


def answer(flight: Flight, validations: Sequence[Validation]) -> str:
    """Say how accurate direct georeferencing is: one sentence, then what it is good for.

    Parameters
    ----------
    flight : Flight
        The printed RMS is named where it has the paper's cameras.
    validations : sequence of Validation
        The last one is answered by.
    """
    found = [validation for validation in validations if len(validation.points)]
    if not found:
        return NOTHING
    last = found[-1]
    points, pairs = (np.sqrt(np.mean(of.d**2, axis=0)) for of in (last.points, last.pairs))
    first = (
        f"At {len(last.points)} check points, each from all its images, the RMS is "
        f"{np.hypot(*points[:2]):.2f} m in plan and {points[2]:.2f} m in height"
    )
    if printed.applies(flight):
        first += f"; over pairs of images, {_beside_print(pairs)}"
    return f"{first}.\n\n{_honest(last)} {_class(last)}"


def _beside_print(pairs: Array) -> str:
    """Return the RMS over pairs in plan and in height, with the printed one."""
    said = np.array([printed.value(4, f"rms_{axis}_m", "single_step") for axis in AXES])
    return (
        f"as the paper counts, it is {np.hypot(*pairs[:2]):.2f} m and {pairs[2]:.2f} m (printed: "
        f"{np.hypot(*said[:2]):.2f} and {said[2]:.2f} m)"
    )


def _honest(last: Validation) -> str:
    """Say whether the differences are as large as their covariance predicts."""
    p = last.joint_chi_square_p
    fits = "are as large as" if p >= UNLIKELY else "are not as large as"
    return (
        f"The differences {fits} their predicted covariance says: $\\chi^2$ = "
        f"{last.joint_chi_square:.1f} with {last.joint_dof} degrees of freedom (*p* = {p:.2f})."
    )


def _class(last: Validation) -> str:
    """Say at which scales the points reach class A of PEC-PCD, the largest first."""
    found = accuracy.from_differences(last.points.d)
    for scale in standards.scales():
        reached = standards.pec_pcd(found, scale)
        if reached.plan == reached.height == "A":
            return f"By the standard PEC-PCD that is class A at 1:{scale} in plan and in height."
    return "By the standard PEC-PCD no tabulated scale has class A in plan and in height."


def listed(values: Iterable[float], spec: str) -> str:
    """Return numbers one after the other, between commas."""
    return ", ".join(f"{value:{spec}}" for value in values)
