"""Units of standard deviations, by what the residuals are in terms of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acx4lib.conventions.mounted import mounted
from acx4lib.conventions.sightings import sightings
from acx4lib.conventions.sigma_units import SHARED, other_unit
from support.flights import simulated


@pytest.fixture(scope="module")
def block():
    return simulated.fly("single-head", seed=1, blocks=("calibration",)).flight.calibration


def unit_of(block):
    seen = sightings(block)
    return other_unit(block, seen, mounted(seen, block.trajectory.T_m_b[seen.exposures]))


def with_sigma(block, *, attitude=1.0, position=1.0, image=1.0):
    trajectory, points = block.trajectory, block.image_points
    return replace(
        block,
        trajectory=replace(
            trajectory,
            sigma_attitude=attitude * trajectory.sigma_attitude,
            sigma_position=position * trajectory.sigma_position,
        ),
        image_points=replace(points, sigma_px=image * points.sigma_px),
    )


@pytest.mark.parametrize(
    ("factors", "name"),
    [
        ({"attitude": 3600.0}, "sigma of attitude in seconds of arc"),
        ({"attitude": 60.0}, "sigma of attitude in minutes of arc"),
        ({"attitude": np.pi / 180}, "sigma of attitude in radians"),
        ({"position": 1000.0}, "sigma of position in mm"),
        ({"image": 0.0046}, "sigma of image measurements in mm"),
    ],
)
def test_a_sigma_in_another_unit_is_named(block, factors, name):
    found = unit_of(with_sigma(block, **factors))
    assert found is not None
    assert found.name == name
    assert 0.6 < found.found < 1.6  # residuals agree with sigma then


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0, 4.0])
def test_a_sigma_that_is_a_little_wrong_is_no_other_unit(block, factor):
    assert unit_of(with_sigma(block, attitude=factor, position=factor, image=factor)) is None


def test_metres_of_a_receiver_without_corrections_are_no_millimetres(block):
    """Its error hardly changes from exposure to exposure, so that residuals are small."""
    sigma = np.full_like(block.trajectory.sigma_position, 3.0)
    found = unit_of(replace(block, trajectory=replace(block.trajectory, sigma_position=sigma)))
    assert found is not None
    assert (found.name, found.quantity) == (SHARED, "position")
    assert found.given < 0.1


def test_what_is_not_known_has_no_unit(block):
    assert unit_of(with_sigma(block, attitude=np.inf)) is None
