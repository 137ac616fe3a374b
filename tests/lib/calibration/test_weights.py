"""Sigma estimated from the residuals."""

from dataclasses import replace

import pytest
from numpy.testing import assert_allclose

import acx4sim
from acx4lib.bundle import variance_components
from acx4lib.bundle.adjust import adjust, mounted_orientation
from acx4lib.calibration import mounting
from acx4lib.errors import AdjustmentError
from support import blocks
from support.flights import simulated as flown

FREE = ("f", "xp", "yp", "k1")


def adjusted(block):
    return adjust(mounted_orientation(block, free=FREE))


@pytest.fixture(scope="module")
def block():
    return blocks.balanced()


@pytest.fixture(scope="module")
def factors(block):
    return mounting.estimated_factors(block, adjusted)


def test_with_estimated_sigma_every_group_fits_its_residuals(block, factors):
    found = variance_components.components(
        adjusted(mounting.scaled(block, factors)), applied=factors
    )
    moved = [c for c in found if c.applied != 1]
    assert len(moved) >= 3
    for c in moved:
        assert c.factor == pytest.approx(c.applied, rel=2e-3)


def test_estimated_sigma_do_not_depend_on_those_given(block, factors):
    """The same sigma come out, in m and px, from weights that were wrong by up to three."""
    off = {"image points": 0.6, "GNSS": 2.0, "heading": 0.4}
    again = mounting.estimated_factors(mounting.scaled(block, off), adjusted)
    for group in ("image points", "GNSS", "roll, pitch", "heading"):
        assert off.get(group, 1.0) * again[group] == pytest.approx(factors[group], rel=5e-3)


def test_a_group_with_too_little_redundancy_keeps_its_sigma(block):
    two = replace(block, control=block.control[:2])
    bare = mounting.estimated_factors(two, adjusted)
    assert bare["control height"] == 1.0
    assert bare["control plan"] == 1.0
    assert bare["image points"] != 1.0


def test_given_sigma_stay_as_they_are(block):
    same, none = mounting.weighted(block, weights="given", free=FREE)
    assert same is block
    assert none == {}
    with pytest.raises(ValueError, match="one of given, estimated, got 'both'"):
        mounting.weighted(block, weights="both", free=FREE)


def test_scaling_multiplies_the_sigma_of_its_groups_only(block):
    scaled = mounting.scaled(block, {"GNSS": 2.0, "roll, pitch": 3.0, "control height": 5.0})
    was, now = block.trajectory, scaled.trajectory
    assert_allclose(now.sigma_position, 2 * was.sigma_position)
    assert_allclose(now.sigma_attitude, was.sigma_attitude * [3, 3, 1])
    assert_allclose(scaled.control.sigma_m, block.control.sigma_m * [1, 1, 5])
    assert_allclose(scaled.image_points.sigma_px, block.image_points.sigma_px)


def test_factors_that_do_not_settle_are_an_error_that_names_them(block, monkeypatch):
    monkeypatch.setattr(mounting, "MAX_ITERATIONS", 1)
    with pytest.raises(AdjustmentError, match=r'still change by .* %; use weights = "given"'):
        mounting.estimated_factors(mounting.scaled(block, {"heading": 0.4}), adjusted)


def test_a_flights_gnss_that_is_2_5_times_worse_than_stated_is_found_so():
    """Through the flight's files; the bound is 3.3 of the factor's own standard deviations."""
    options = {"blocks": ("calibration",), "tie_points": {"calibration": 100}}
    true = acx4sim.DESIGNS["single-head"](
        seed=2, options=acx4sim.Options(**options, gnss_noise=2.5)
    )
    told = acx4sim.DESIGNS["single-head"](seed=2, options=acx4sim.Options(**options))
    toml = told.toml + 'weights = "estimated"\n'
    flight = flown.read_back(replace(true, toml=toml)).flight
    assert flight.weights == "estimated"
    settings = {"free": flight.estimate_mounting, "fix": flight.fix}
    block, factors = mounting.weighted(flight.calibration, weights=flight.weights, **settings)
    found = variance_components.components(
        adjust(mounted_orientation(block, free=flight.estimate_mounting)), applied=factors
    )
    gnss = next(c for c in found if c.group == "GNSS")
    assert abs(gnss.applied - 2.5) < 3.3 * gnss.sigma
    assert gnss.sigma < 0.5
