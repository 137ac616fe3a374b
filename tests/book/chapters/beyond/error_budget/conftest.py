"""The flight of the chapter, calibrated, validated and split by its sources once."""

from types import SimpleNamespace

import pytest

from acx4book.notebooks.simulated import flown
from acx4lib.calibration.mounting import single_step, two_step
from acx4lib.georeferencing import budget
from acx4lib.georeferencing.mapping_flight import like
from acx4lib.georeferencing.validation import validate


@pytest.fixture(scope="session")
def found():
    flight = flown.fly("acx4-ideal", 1, blocks=("calibration", "validation")).flight
    block, free = flight.block("validation"), flight.estimate_mounting
    single = single_step(flight.calibration, free=free)
    two = two_step(flight.calibration, free=free, after=single)
    methods = {"two_step": two.calibration, "single_step": single.calibration}
    validations = {name: validate(block, one, method=name) for name, one in methods.items()}

    def split(kind):
        return {
            name: budget.of(getattr(one, kind).sources, one.georeferenced.layout)
            for name, one in validations.items()
        }

    return SimpleNamespace(
        block=block,
        calibrations=methods,
        validations=validations,
        points=split("points"),
        pairs=split("pairs"),
        mapping=like(block, block.cameras[0]),
    )
