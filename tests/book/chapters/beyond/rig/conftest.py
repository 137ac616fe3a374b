"""The heads of a simulated flight as a rig, the truth beside them."""

import pytest

import acx4sim
from acx4lib import flight as flights
from acx4lib.stages import rig


@pytest.fixture(scope="session")
def flight(tmp_path_factory):
    """The heads of a simulated flight, its truth beside it."""
    path = tmp_path_factory.mktemp("rig") / "flight"
    options = acx4sim.Options(blocks=("heads",), tie_points={"heads": 60})
    acx4sim.write(acx4sim.DESIGNS["acx4"](seed=3, options=options), path)
    return flights.read(path)


@pytest.fixture(scope="session")
def stage(flight):
    return rig.calibrate(flight)
