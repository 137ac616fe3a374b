"""The paper's heads, simulated and calibrated."""

import numpy as np
import pytest

from acx4book.chapters.heads.held_focal_length import held_focal_length
from acx4lib.calibration.heads import calibrate_heads, relative_orientation
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
def held(flown, fits, synthetic):
    free = flown.flight.estimate_heads
    return [
        held_focal_length(fits, free, synthetic=synthetic, change_mm=np.full(4, c))
        for c in (-0.5, 0.0, 0.5)
    ]
