"""Three exposures of a simulated flight, measured once."""

import json
from dataclasses import dataclass
from pathlib import Path

import pytest

from acx4files.measuring.measure import measure_flight
from support.pictures import measured


@dataclass(frozen=True, eq=False)
class Whole:
    """A flight, the measured one, and what the measurement returned."""

    flight: Path
    measured: Path
    outcome: object
    truth: dict


@pytest.fixture(scope="session")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("measuring")
    flight = measured.flown(folder)
    (outcome,) = measure_flight(flight, folder / "measured")
    truth = json.loads((folder / "flight.truth.json").read_text())
    return Whole(flight, folder / "measured", outcome, truth)


@pytest.fixture(scope="session")
def views(whole):
    """The three views with their refined orientations, and the ground."""
    return whole.outcome.matched.views


@pytest.fixture(scope="session")
def surface(whole):
    return whole.outcome.matched.surface
