"""Some flights with mistakes, examined once."""

import pytest

from acx4book.chapters.beyond.failures.examined import examine
from acx4book.chapters.beyond.failures.mistakes import CONTROL, TRAJECTORY, changed, flown, late


@pytest.fixture(scope="session")
def found():
    flight = flown(1)
    control = flight.tables[CONTROL]
    exchanged = {"east_m": control["north_m"], "north_m": control["east_m"]}
    flights = {
        "no mistake": flight,
        "coordinates exchanged": changed(flight, {CONTROL: exchanged}),
        "delay": changed(flight, {TRAJECTORY: late(flight, by_s=0.1)}),
    }
    return {name: examine(one) for name, one in flights.items()}
