"""Chapter 9 changed as it suggests, and what one flight of each kind says."""

import numpy as np
import pytest

from support.changed_notebook import changed

pytestmark = pytest.mark.repeats
"""Chapters of the paper are changed in every run of the tests; these take minutes."""

WRONG = 'wrong = {"GNSS": 0.4, "heading": 2.0}'
TIME = "share, constant_s = 0.95, 600.0"
AIR = 'replace(study.EXACT, refraction="standard")'


@pytest.fixture(scope="module")
def as_it_is():
    return changed("09", n_flights=2)


def diagnosis(names):
    return {one.group: one for one in names["diagnosis"]}


def test_sigma_that_are_wrong_are_diagnosed_and_estimated(as_it_is):
    heading = diagnosis(as_it_is)["heading"]
    assert abs(heading.factor - 0.5) < 3.3 * heading.sigma
    factors = as_it_is["factors"]
    assert factors["heading"] == pytest.approx(heading.factor, rel=0.05)
    assert factors["control plan"] == 1.0


def test_the_covariance_by_hand_is_that_of_the_weights(as_it_is):
    assert as_it_is["by_hand"] == pytest.approx(as_it_is["library"], rel=1e-9)


def test_the_library_undoes_the_simulators_refraction(as_it_is):
    """Two implementations: Snell's law by layers, and the integral of the density."""
    without, within = (as_it_is["ratio"][model].droplevel("unit") for model in ("none", "standard"))
    assert abs(without["f"]) > 1
    assert abs(without["lever z"]) > 0.8
    # refractive indices differ by 0.1 %, and so do K and what is left of it
    assert np.all(np.abs(within) <= 0.003)


def test_a_head_that_is_wrong_by_a_factor_is_found_by_it():
    names = changed("09", {WRONG: 'wrong = {"image points CAM1": 0.5}'}, n_flights=1)
    for name, factor in names["factors"].items():
        if name.startswith("image"):
            assert factor == pytest.approx(2.0 if name.endswith("CAM1") else 1.0, abs=0.05)


def test_another_time_constant_makes_the_boresight_worse_than_its_sigma(as_it_is):
    def largest(names):
        ratio = names["study"].errors(names["flights"]["slow"], names["known"])["error / σ"]
        return ratio.droplevel("unit").filter(like="boresight").abs().max()

    short = changed("09", {TIME: "share, constant_s = 0.95, 60.0"}, n_flights=1)
    assert largest(short) > 1.5 * largest(as_it_is)
    assert short["by_hand"] == pytest.approx(short["library"], rel=1e-9)


def test_a_model_of_refraction_that_is_not_there_does_harm(as_it_is):
    vacuum = changed("09", {AIR: "study.EXACT"}, n_flights=1)
    with_model = vacuum["ratio"]["standard"].droplevel("unit")
    assert with_model["f"] == pytest.approx(-as_it_is["ratio"]["none"][("f", "mm")], rel=0.05)
    assert np.all(np.abs(vacuum["ratio"]["none"]) <= 0.003)
