"""Six simulated campaigns of one camera, whose focal length follows the temperature."""

from __future__ import annotations

import datetime as dt
import tempfile
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from acx4lib.calibration.mounting import single_step
from acx4lib.flight import reader
from acx4lib.flight.setup import Session
from acx4lib.results.campaigns.campaign import Campaign, of_mounting
from acx4sim.designs import single_head_plan
from acx4sim.files import writer
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


def campaigns(seed: int) -> tuple[Campaign, ...]:
    """Fly and adjust all campaigns of `HISTORY`.

    Parameters
    ----------
    seed : int
        Of the first; the others follow.
    """
    return tuple(campaign(seed + i, flown, plan=plan_of(flown)) for i, flown in enumerate(HISTORY))


def plan_of(flown: Flown) -> Plan:
    """Return the plan of a campaign: the design's, with the camera as it is then."""
    plan = single_head_plan()
    camera = plan.cameras[CAMERA]
    warm = UM_PER_DEGREE / 1000 * (flown.temperature_c - AT_DEGREES)
    turned = np.add(camera.boresight_deg, REPAIR_DEG if flown.repaired else (0.0, 0.0, 0.0))
    omega, phi, kappa = turned.tolist()
    then = replace(camera, f_mm=camera.f_mm + warm, boresight_deg=(omega, phi, kappa))
    return replace(plan, cameras={CAMERA: then})


def campaign(seed: int, flown: Flown, *, plan: Plan) -> Campaign:
    """Fly a plan and adjust its calibration block in a single step.

    Parameters
    ----------
    seed : int
    flown : Flown
    plan : Plan
    """
    simulated = simulate_plan(plan, seed, Options(blocks=(BLOCK,)))
    with tempfile.TemporaryDirectory() as temporary:
        path = Path(temporary) / "flight"
        writer.write(simulated, path)
        flight = reader.read(path)
    found = single_step(flight.blocks[BLOCK], free=flight.estimate_mounting)
    session = Session(date=flown.date, temperature_c=flown.temperature_c)
    return of_mounting(found, name=f"{flown.date:%Y-%m}", session=session)
