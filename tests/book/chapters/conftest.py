"""The paper's flight and an ideal one, simulated and calibrated; and heads not the paper's."""

import pytest

from acx4files import flight as flights
from acx4files.stages import heads
from acx4lib.calibration import mounting
from acx4lib.model import Model
from support.flights import in_heads
from support.flights.simulated import fly


@pytest.fixture(scope="session")
def flown():
    return fly("acx4", seed=1, blocks=("heads",))


@pytest.fixture(scope="session")
def flight(flown):
    return flown.flight


@pytest.fixture(scope="session")
def stage(flight):
    return heads.calibrate(flight)


@pytest.fixture(scope="session")
def ideal():
    return fly("acx4-ideal", seed=1).flight


@pytest.fixture(scope="session")
def mountings(ideal):
    return mounting.calibrate(ideal.calibration, Model(free=ideal.estimate_mounting))


@pytest.fixture(scope="session")
def other(tmp_path_factory):
    return flights.read(in_heads.write_other_heads(tmp_path_factory.mktemp("other") / "flight"))
