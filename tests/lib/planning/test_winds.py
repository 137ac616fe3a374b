"""What a plan determines on average over winds, and what a later campaign of it would find."""

import numpy as np
import pandas as pd
import pytest

from acx4lib.planning import design, tables, text
from acx4lib.results.campaigns.estimates import KNOWN, joint_test
from support.flights.planned import strip, values

MAPPING = {
    "check": {"number": [3, 3], "area_m": [600.0, 600.0]},
    "strips": {"a": strip("north", 800.0, overlap=0.6), "b": strip("south", 800.0, overlap=0.6)},
}
N_WINDS = 6


@pytest.fixture(scope="module")
def found():
    return design.of(text.from_values(values(validation=MAPPING)), winds=N_WINDS)


def test_the_covariance_is_the_mean_of_those_of_all_winds(found):
    assert len(found.outcomes) == N_WINDS
    all_cov = [one.covariances["single_step"] for one in found.outcomes]
    assert np.ptp([np.sqrt(np.diag(cov)) for cov in all_cov], axis=0).min() > 0
    sigma = np.sqrt(np.mean([np.diag(cov) for cov in all_cov], axis=0))
    table = tables.parameter_table(found)
    np.testing.assert_allclose(table["sigma"], sigma)
    each = np.array([np.sqrt(np.diag(cov)) for cov in all_cov])
    np.testing.assert_allclose(table["spread"], each.std(axis=0, ddof=1) / each.mean(axis=0))
    one = tables.parameter_table(design.of(found.plan))
    assert one["spread"].isna().all()
    np.testing.assert_allclose(one["sigma"], table["sigma"], rtol=0.1)


def test_the_rms_is_that_of_all_winds_and_its_tolerance_that_of_their_mean(found):
    told = tables.summary(found)["validation/single_step"]["points"]
    of_winds = [np.mean([*one.points["single_step"].values()], axis=0) for one in found.outcomes]
    assert told["rms"] == pytest.approx(np.sqrt(np.mean(of_winds, axis=0)))
    error = np.std(of_winds, axis=0, ddof=1) / np.sqrt(N_WINDS)
    # the relative error of a root is half of that of its square
    assert told["tolerance"] == pytest.approx(error / np.mean(of_winds, axis=0))
    assert told["n"] == pytest.approx(
        np.mean([len(o.points["single_step"]) for o in found.outcomes])
    )
    table = tables.check_point_table(found)
    squares = (table.filter(like="sigma_") ** 2).mean()
    assert told["rms"] == pytest.approx(np.sqrt(squares.to_numpy()), rel=0.02)


def test_all_winds_have_the_same_tie_points(found):
    places = [design.flown.over(found.plan, "calibration").tie_places() for _ in range(2)]
    np.testing.assert_array_equal(*places)
    windy = design.flown.block(found.plan, "calibration", wind=3, tie_places=places[0])
    even = found.blocks["calibration"]
    assert len(windy.points) == pytest.approx(len(even.points), rel=0.02)


def test_large_blocks_have_fewer_winds():
    assert design.usual_winds(text.from_values(values())) == design.MOST
    long = {name: {**s, "base_m": 5.0} for name, s in values()["calibration"]["strips"].items()}
    assert (
        design.usual_winds(text.from_values(values(calibration={"strips": long}))) == design.FEWEST
    )


def test_a_change_of_the_smallest_size_is_found_by_four_comparisons_of_five():
    """20 000 pairs of campaigns, tested as `acx4 compare` tests them; 80 % to four sigma."""
    rng, sigma = np.random.default_rng(8), 0.03
    change = tables.smallest_change(sigma)
    d = change + rng.normal(0, sigma, 20_000) - rng.normal(0, sigma, 20_000)
    cov = np.array([[2 * sigma**2]])
    p = [joint_test(one[None], cov, redundancy=KNOWN).p for one in d[:2000]]
    assert np.mean(np.array(p) < 0.05) == pytest.approx(0.8, abs=0.036)
    assert np.mean(np.abs(d) > 1.959964 * np.sqrt(2) * sigma) == pytest.approx(0.8, abs=0.0114)


def test_the_change_that_is_found_stands_beside_every_sigma(found):
    table = tables.parameter_table(found)
    np.testing.assert_allclose(table["detectable_change"] / table["sigma"], 3.962, atol=1e-3)
    assert isinstance(table, pd.DataFrame)
