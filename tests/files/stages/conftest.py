"""The heads of the paper's flight, calibrated, and the results folder that they leave."""

import pytest

from acx4files.stages import heads
from support.flights.simulated import fly


@pytest.fixture(scope="session")
def flight():
    return fly("acx4", seed=1, blocks=("heads",)).flight


@pytest.fixture(scope="session")
def stage(flight):
    return heads.calibrate(flight)


@pytest.fixture(scope="session")
def folder(tmp_path_factory, flight, stage):
    """Return a results folder that the heads stage has left."""
    folder = tmp_path_factory.mktemp("results")
    heads.write(flight, folder, stage.heads, stage.orientation)
    return folder
