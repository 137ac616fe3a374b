"""Chapter 18: what it computes by hand, its tests and its exercises, and another seed."""

import numpy as np
import pytest

from acx4book.chapters.beyond.stability import figures, history
from support.changed_notebook import changed

pytestmark = pytest.mark.repeats
"""Chapters of the paper are changed in every run of the tests; these take minutes."""

FLIGHTS = "flights = history.flights(seed)"


@pytest.fixture(scope="module")
def as_it_is():
    return changed("18")


def test_chi_square_by_hand_is_the_library_s(as_it_is):
    assert as_it_is["chi_square"] == pytest.approx(as_it_is["test"].chi_square, rel=1e-6)
    assert as_it_is["by_hand"] == pytest.approx(as_it_is["one"].f, rel=1e-12)


def test_chi_squares_of_the_pair_and_of_the_others_add_up(as_it_is):
    others = np.flatnonzero(~as_it_is["own"])
    total = as_it_is["alone"].chi_square + as_it_is["later"].test(others).chi_square
    assert total == pytest.approx(as_it_is["later"].test().chi_square, rel=1e-6)


def test_the_pair_is_in_micrometres_and_millimetres(as_it_is):
    later, own = as_it_is["later"], as_it_is["own"]
    d, cov = as_it_is["pair"]
    np.testing.assert_allclose(d, 1e3 * later.d[own])
    np.testing.assert_allclose(np.sqrt(np.diag(cov)), 1e3 * later.sigma[own])


def test_holm_and_the_joint_test_keep_their_level(as_it_is):
    levels, shares = as_it_is["levels"], as_it_is["shares"]
    spread = np.sqrt(levels * (1 - levels) / 4000)
    assert np.all(np.abs(shares[figures.JOINT] - levels) < 4.5 * spread)
    assert np.all(shares[figures.HOLM] < levels + 4.5 * spread)
    assert np.all(shares[figures.EACH] > 3 * levels)


def test_the_slope_is_that_which_was_simulated(as_it_is):
    assert abs(as_it_is["slope"] - history.UM_PER_DEGREE) < 4 * as_it_is["sigma_slope"]


def test_exercises_are_solved_in_two_ways(as_it_is):
    found = as_it_is
    assert found["value"] == pytest.approx(0.4)
    assert found["both"].coefficients[0, 0] == pytest.approx(0.4)
    assert found["both"].chi_square == pytest.approx(0.8)
    assert found["most"] == np.sum(np.array(found["joint"]) < found["level"]) == 18
    assert found["moved_m"] == pytest.approx(found["by_rays"], rel=1e-6)
    assert found["moved_m"] == pytest.approx(0.134, abs=0.001)
    ratio = found["sigma_slopes"][0] / found["sigma_slopes"][1]
    assert found["smaller"] == pytest.approx(ratio, rel=1e-9)


def test_without_the_repaired_campaigns_the_camera_follows_temperature_alone(as_it_is):
    few = changed("18", {FLIGHTS: f"{FLIGHTS}[:4]"})
    assert few["stability"](few["compared"]).chi_square < as_it_is["same"].chi_square
    assert few["lines"].scatter.p > 1e-3
    whole = as_it_is["trend"](as_it_is["compared"], as_it_is["temperatures"](as_it_is["compared"]))
    assert whole.scatter.p < 1e-6
