"""A flight without surveyed points."""

from dataclasses import replace

import numpy as np
import pytest


@pytest.fixture(scope="session")
def without_ground(flight):
    block = flight.heads
    nothing = np.zeros(len(block.control), dtype=bool)
    return replace(flight, blocks={"heads": replace(block, control=block.control[nothing])})
