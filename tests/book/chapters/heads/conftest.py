"""The paper's heads, simulated and calibrated."""

import pytest

from acx4book.chapters.heads.held_focal_length import all_heads
from acx4lib.calibration.heads import Heads, calibrate_heads, relative_orientation
from acx4lib.stages.heads import HeadsStage
from support.flights.simulated import HEADS, fly


@pytest.fixture(scope="session")
def flown():
    return fly("acx4", seed=1, blocks=("heads",))


@pytest.fixture(scope="session")
def synthetic(flown):
    return flown.flight.cameras["SYN"]


@pytest.fixture(scope="session")
def fits(flown):
    free = flown.flight.estimate_heads
    return calibrate_heads(flown.flight.heads, HEADS, free=free).bundles


@pytest.fixture(scope="session")
def orientation(fits, synthetic):
    return relative_orientation(fits, synthetic)


@pytest.fixture(scope="session")
def held(flown, fits, orientation):
    stage = HeadsStage(heads=Heads(bundles=fits, failures={}), orientation=orientation)
    return all_heads(flown.flight, stage, (-0.5, 0.0, 0.5))
