"""One ordinary camera, turned by 90 degrees: another zone, lat/lon, roll, pitch, heading.

What holds for the paper's flight holds here; see test_acx4 for the why.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import acx4sim
from acx4lib.calibration import mounting
from acx4lib.calibration.estimates import METHODS
from acx4lib.georeferencing import validation
from support.flights import simulated as flown
from support.flights.simulated import SEEDS
from support.helpers import repeats

DESIGN = "single-head"


@pytest.mark.parametrize("method", METHODS)
def test_every_parameter_of_seed_1_is_within_4_sigma(method):
    found = flown.mounting_estimates(DESIGN, method, seed=1)
    flown.assert_within_4_sigma(flown.mounting_errors(DESIGN, method, seed=1), found)


@pytest.mark.parametrize("method", ["single_step", "two_step"])
def test_exact_data_give_back_the_truth(method):
    """Files round to a micrometre and a millionth of a pixel, 1e-4 of every sigma in them."""
    found = flown.of_calibration(flown.exact_calibration(DESIGN, method, seed=1))
    errors = found.values - flown.true_mounting(DESIGN)
    assert np.all(np.abs(errors) < 1e-4 * np.sqrt(np.diag(found.cov)))


@pytest.mark.parametrize("method", ["single_step", "two_step"])
def test_exact_data_meet_the_check_points(method):
    block = flown.fly(DESIGN, seed=1, exact=True).flight.validation
    found = flown.exact_calibration(DESIGN, method, seed=1)
    pairs = validation.validate(block, found, method=method).pairs
    assert_allclose(pairs.d, 0.0, atol=2e-5)  # m; files round to a micrometre


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_errors_of_20_flights_have_the_claimed_joint_covariance(method):
    flown.assert_errors_fit(
        [
            flown.chi_square(
                flown.mounting_errors(DESIGN, method, seed=seed),
                flown.mounting_estimates(DESIGN, method, seed=seed).cov,
            )
            for seed in SEEDS
        ]
    )


@pytest.mark.slow
@pytest.mark.parametrize("flights", [50, repeats(200)])
def test_two_step_claims_the_scatter_of_its_errors(flights):
    flown.assert_two_step_claims_its_scatter(DESIGN, flights)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["single_step", "two_step"])
def test_check_points_scatter_as_predicted(method):
    flown.assert_check_points_fit(DESIGN, method)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_gross_errors_are_found_and_do_no_harm(seed):
    simulated = acx4sim.DESIGNS["single-head"](
        seed=seed, options=acx4sim.Options(blocks=("calibration",))
    )
    tables = {name: table.copy() for name, table in simulated.tables.items()}
    control, trajectory = tables["control_points.csv"], tables["calibration/trajectory.csv"]
    planted = flown.shift_image_points(
        tables["calibration/image_points.csv"], (20, 40, 60, 100), size=(11608, 8708)
    )
    control.loc[7, "north_m"] -= 1.0
    trajectory.loc[11, "height_m"] += 3.0
    trajectory.loc[25, "heading_deg"] += 0.3
    planted |= {
        ("control_point", "", control["point"][7]),
        ("gnss", trajectory["exposure"][11], ""),
        ("attitude", trajectory["exposure"][25], ""),
    }
    found = flown.read_back(replace(simulated, tables=tables)).flight
    methods = mounting.calibrate(found.calibration, free=found.estimate_mounting)
    rejected = flown.named(found.calibration, methods["single_step"].bundle.rejected)
    assert planted <= rejected
    assert len(rejected - planted) <= 4  # 0.8 are expected at 0.01 % of 8 000 components
    for method in ("single_step", "two_step"):
        estimates = flown.of_calibration(methods[method].calibration)
        flown.assert_within_4_sigma(estimates.values - flown.true_mounting(DESIGN), estimates)
