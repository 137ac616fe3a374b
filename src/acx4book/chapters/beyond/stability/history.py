"""Six simulated campaigns of one camera, whose focal length follows the temperature."""

from __future__ import annotations

import datetime as dt
from dataclasses import dataclass, replace

import numpy as np

from acx4book.notebooks.simulated.flown import read
from acx4lib.flight.reader import Flight
from acx4sim.designs import single_head_plan
from acx4sim.files.flights import simulate_plan
from acx4sim.plan import Options, Plan

CAMERA, BLOCK = "CAM", "calibration"

UM_PER_DEGREE = 0.6
"""What a degree adds to the true focal length."""

AT_DEGREES = 15.0
"""Temperature at which the camera has the parameters of the design."""

REPAIR_DEG = (0.012, -0.008, 0.015)
"""By how much the true boresight is another one after the repair: omega, phi, kappa."""


@dataclass(frozen=True, kw_only=True)
class Flown:
    """When a campaign was flown, at which temperature, and whether after the repair."""

    date: dt.date
    temperature_c: float
    repaired: bool = False


HISTORY = (
    Flown(date=dt.date(2021, 4, 14), temperature_c=8.0),
    Flown(date=dt.date(2021, 8, 30), temperature_c=27.0),
    Flown(date=dt.date(2022, 5, 11), temperature_c=15.0),
    Flown(date=dt.date(2023, 7, 6), temperature_c=31.0),
    Flown(date=dt.date(2024, 3, 22), temperature_c=10.0, repaired=True),
    Flown(date=dt.date(2025, 8, 12), temperature_c=29.0, repaired=True),
)
BEFORE = 4
"""Campaigns before the repair."""


def flights(seed: int) -> tuple[Flight, ...]:
    """Return the flights of all campaigns of `HISTORY`, as their files say.

    Parameters
    ----------
    seed : int
        Of the first; the others follow.
    """
    return tuple(flight(seed + i, flown) for i, flown in enumerate(HISTORY))


def flight(seed: int, flown: Flown) -> Flight:
    """Return the flight of one campaign, with its date and temperature."""
    simulated = simulate_plan(plan_of(flown), seed, Options(blocks=(BLOCK,)))
    session = f"\n[session]\ndate = {flown.date}\ntemperature_c = {flown.temperature_c}\n"
    return read(replace(simulated, toml=simulated.toml + session))


def plan_of(flown: Flown) -> Plan:
    """Return the plan of a campaign: the design's, with the camera as it is then."""
    plan = single_head_plan()
    camera = plan.cameras[CAMERA]
    warm = UM_PER_DEGREE / 1000 * (flown.temperature_c - AT_DEGREES)
    turned = np.add(camera.boresight_deg, REPAIR_DEG if flown.repaired else (0.0, 0.0, 0.0))
    omega, phi, kappa = turned.tolist()
    then = replace(camera, f_mm=camera.f_mm + warm, boresight_deg=(omega, phi, kappa))
    return replace(plan, cameras={CAMERA: then})
