"""The paper's calibration block, seen by an ideal synthetic camera, and calibrated."""

import pytest

from acx4lib.calibration import mounting
from support.flights import simulated

FREE = ("f", "xp", "yp", "k1", "k2", "k3", "p1", "p2")


@pytest.fixture(scope="session")
def ideal():
    return simulated.fly("acx4-ideal", seed=1).flight


@pytest.fixture(scope="session")
def mountings(ideal):
    return mounting.calibrate(ideal.calibration, free=FREE)
