"""The budgets of the design acx4-ideal, against figures that others computed for it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.beyond.error_budget.examined import BARE, plan_and_height
from acx4lib.georeferencing import budget


def test_shares_of_pairs_are_those_computed_independently(found):
    """Plan: 52 % image and survey, 48 % trajectory, below 1 % calibration; height: 50, 47, 3."""
    plan, height = plan_and_height(found.pairs(BARE).mean)
    image, trajectory, calibration = (float(share) for share in budget.shares(plan).values())
    assert image == pytest.approx(0.52, abs=0.01)
    assert trajectory == pytest.approx(0.48, abs=0.01)
    assert 0 < calibration < 0.01
    shares = [float(share) for share in budget.shares(height).values()]
    assert shares == pytest.approx([0.50, 0.47, 0.03], abs=0.011)


@pytest.mark.parametrize("kind", ["points", "pairs"])
def test_budgets_are_those_of_the_validation(found, kind):
    for method, validation in found.validations.items():
        split, differences = getattr(found, kind)(method), getattr(validation, kind)
        assert_allclose(split.sigma, differences.sigma, rtol=1e-12)


def test_the_mapping_flight_has_the_sigma_of_the_block(found):
    flight = found.mapping(2000.0)
    assert flight.height_m == 2000.0
    assert_allclose(flight.sigma_position_m, found.block.trajectory.sigma_position[0])
    assert_allclose(np.degrees(flight.sigma_attitude), [0.005, 0.005, 0.008])
    assert flight.sigma_px == pytest.approx(1.5, abs=0.1)
