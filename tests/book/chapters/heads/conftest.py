"""The orientation of the paper's heads, and what held focal lengths make of it."""

import pytest

from acx4book.chapters.heads.held_focal_length import all_heads
from acx4lib.calibration.heads import Heads, relative_orientation
from acx4lib.stages.heads import HeadsStage


@pytest.fixture(scope="session")
def synthetic(flown):
    return flown.flight.cameras["SYN"]


@pytest.fixture(scope="session")
def orientation(fits, synthetic):
    return relative_orientation(Heads(bundles=fits, failures={}), synthetic)


@pytest.fixture(scope="session")
def held(flown, fits, orientation):
    stage = HeadsStage(heads=Heads(bundles=fits, failures={}), orientation=orientation)
    return all_heads(flown.flight, stage, (-0.5, 0.0, 0.5))
