"""Campaigns of one simulated camera, the same in all of them, each adjusted for itself."""

from dataclasses import replace
from functools import cache

import pytest

import acx4sim
from acx4lib.calibration.mounting import single_step
from acx4lib.flight.settings import Session
from acx4sim.designs import single_head_plan
from acx4sim.files import simulate_plan
from acx4tools.campaigns import comparison
from support.flights.simulated import read_back

TIES = {"calibration": 120}


@cache
def flown(seed, *, f_um=0.0, free=()):
    """Fly and adjust a campaign; the true focal length is longer by some micrometres."""
    plan = single_head_plan()
    camera = plan.cameras["CAM"]
    changed = {"CAM": replace(camera, f_mm=camera.f_mm + f_um / 1000)}
    options = acx4sim.Options(blocks=("calibration",), tie_points=TIES)
    flight = read_back(simulate_plan(replace(plan, cameras=changed), seed, options)).flight
    return single_step(flight.calibration, free=free or flight.estimate_mounting)


def one(seed, *, name="", date=None, temperature_c=float("nan"), **changes):
    session = Session(date=date, temperature_c=temperature_c)
    return comparison.of_mounting(
        flown(seed, **changes), name=name or f"campaign {seed}", session=session
    )


@pytest.fixture
def fly():
    return one
