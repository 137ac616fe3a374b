"""The paper's heads, simulated and calibrated."""

import pytest

from acx4lib.calibration.heads import calibrate_heads
from support.flights.simulated import HEADS, fly


@pytest.fixture(scope="session")
def fits():
    flight = fly("acx4", seed=1, blocks=("heads",)).flight
    return calibrate_heads(flight.heads, HEADS, free=flight.estimate_heads).bundles
