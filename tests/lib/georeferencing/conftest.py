"""A block with check points that several test files validate on."""

import pytest

from acx4lib.calibration.estimates import given
from support import blocks


@pytest.fixture(scope="package")
def block():
    """Four check points; the survey in the CRS differs from the mapping frame's axes by 0.7 deg."""
    return blocks.simulate(blocks.fly(), check=blocks.terrain(4, half_m=200.0, seed=8))


@pytest.fixture(scope="package")
def cameras(block):
    return given(block.cameras)


@pytest.fixture(scope="package")
def rig():
    """Two cameras on one body."""
    return blocks.pair()


@pytest.fixture(scope="package")
def calibration(rig):
    return blocks.calibrated(rig)
