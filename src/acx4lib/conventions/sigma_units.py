"""Standard deviations in another unit: what the residuals are in terms of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from acx4lib.conventions.mounted import Mounted, measuring_noise
from acx4lib.conventions.sightings import Sightings
from acx4lib.expected import Array
from acx4lib.flight.block import Block

OFF = 2.0
"""Ratio of residuals to sigma, or its inverse, from which another unit is looked for."""

RIGHT = 1.6
"""The same within which a unit is right: neighbouring units differ by ten and more."""

ANGLE_UNITS = {"seconds of arc": 1 / 3600, "minutes of arc": 1 / 60, "radians": 180 / np.pi}
LENGTH_UNITS = {"mm": 1e-3, "cm": 1e-2}

ALONE_M = 0.5, 15.0
"""Standard deviations of positions that a receiver without corrections states."""

SHARED = (
    "this sigma is rather that of an error which neighbouring exposures share, as of a receiver "
    "without corrections; gnss in flight.toml makes a common shift an unknown"
)
"""What is said in the place of another unit: such an error leaves small residuals."""


@dataclass(frozen=True, kw_only=True)
class Unit:
    """Another unit of some standard deviations.

    Attributes
    ----------
    name : str
        As in "sigma of attitude in seconds of arc", or `SHARED`.
    quantity : str
    given, found : float
        Residuals in terms of sigma, as given and in this unit; NaN where it is no unit.
    """

    name: str
    quantity: str
    given: float
    found: float


def other_unit(block: Block, seen: Sightings, given: Mounted) -> Unit | None:
    """Return the unit in which standard deviations agree with residuals; None if they do anyway.

    Nothing is said where no plausible mounting fits: residuals are no errors of observation then.

    Parameters
    ----------
    block : Block
    seen : Sightings
        Of this block.
    given : Mounted
        The block as it is given.
    """
    if given.held:
        return None
    T_m_b = block.trajectory.T_m_b[seen.exposures]
    noise = measuring_noise(seen, T_m_b, given)
    camera = given.cameras[0]
    px = camera.pixel_mm / camera.interior.f
    measured = px * _usual(block.image_points.sigma_px)
    units = [("image measurements", {"mm": 1 / camera.pixel_mm}, noise / measured, 0.0)]
    away = given.x_m[seen.point_idx] - T_m_b.r[seen.exposure_idx]
    range_m = float(np.nanmedian(np.linalg.norm(away, axis=1)))
    position = _usual(block.trajectory.sigma_position[seen.exposures]) / range_m
    attitude = _usual(block.trajectory.sigma_attitude[seen.exposures, :2])
    for quantity, known, sigma, other in (
        ("attitude", ANGLE_UNITS, attitude, position),
        ("position", LENGTH_UNITS, position, attitude),
    ):
        units.append((quantity, known, given.misfit / sigma, np.hypot(other, noise) / sigma))
    if ALONE_M[0] <= position * range_m <= ALONE_M[1]:
        _, _, misfit, rest = units.pop()
        units.append(("position", {SHARED: np.nan}, misfit, rest))
    return next((unit for row in units for unit in _right(*row)), None)


def _usual(sigma: Array) -> float:
    """Return the median of the standard deviations that are known, NaN for none."""
    known = sigma[np.isfinite(sigma)]
    return float(np.median(known)) if len(known) else np.nan


def _right(quantity: str, units: dict[str, float], misfit: float, rest: float) -> Iterator[Unit]:
    """Yield the units in which a misfit agrees with sigma.

    Parameters
    ----------
    quantity : str
    units : dict of str to float
        What a standard deviation must be multiplied by.
    misfit, rest : float
        In terms of sigma: the residuals, and the part of them that is expected of other
        observations.
    """
    before = misfit / np.hypot(1.0, rest)
    if not (before > OFF or before < 1 / OFF):
        return
    for unit, factor in units.items():
        if np.isnan(factor) and before < 1 / OFF:
            yield Unit(name=unit, quantity=quantity, given=before, found=np.nan)
        after = misfit / np.hypot(factor, rest)
        if 1 / RIGHT < after < RIGHT:
            name = f"sigma of {quantity} in {unit}"
            yield Unit(name=name, quantity=quantity, given=before, found=after)
