"""Chapter 9 changed as it suggests, and what one flight of each kind says."""

import numpy as np
import pandas as pd
import pytest

import acx4sim
from acx4book.chapters.beyond.weights import tables
from acx4lib import flight as flights
from acx4lib.bundle.variance_components import components
from acx4lib.stages import mounting
from support.changed_notebook import changed

pytestmark = pytest.mark.repeats
"""Chapters of the paper are changed in every run of the tests; these take minutes."""

WRONG = 'wrong = {"GNSS": 0.4, "heading": 2.0}'
TIME = "share, constant_s = 0.95, 600.0"
AIR = 'replace(study.EXACT, refraction="standard")'


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """What the cells define, by the change, on the flight of an ideal camera."""
    flight, results = tmp_path_factory.mktemp("flight") / "ideal", tmp_path_factory.mktemp("run")
    acx4sim.write(acx4sim.DESIGNS["acx4-ideal"](seed=1), flight)
    mounting.run(flights.read(flight), results)

    def one(changes=None, n_flights=1):
        places = {"flight_path": flight, "results_path": results}
        return changed("09", changes, **places, n_flights=n_flights)

    return one


@pytest.fixture(scope="module")
def as_it_is(run):
    return run(n_flights=2)


def diagnosis(names):
    return {one.group: one for one in names["diagnosis"]}


def test_sigma_that_are_wrong_are_diagnosed_and_estimated(as_it_is):
    heading = diagnosis(as_it_is)["heading"]
    assert abs(heading.factor - 0.5) < 3.3 * heading.sigma
    assert as_it_is["estimated"]["heading"] == pytest.approx(heading.factor, rel=0.05)
    assert as_it_is["estimated"]["control plan"] == 1.0


def test_the_geometry_promises_what_the_adjustment_states(as_it_is):
    """To the root of the variance of unit weight, and to how far the declared values are off."""
    found = tables.promised(as_it_is["promised"], as_it_is["single"].calibration)
    root = np.sqrt(as_it_is["single"].bundle.solution.sigma0_sq)
    np.testing.assert_allclose(found["ratio"], root, rtol=0.1)
    assert tables.outside(as_it_is["reached"]) == []


def test_the_covariance_by_hand_is_that_of_the_weights(as_it_is):
    assert as_it_is["by_hand"] == pytest.approx(as_it_is["library"], rel=1e-9)


def test_the_library_undoes_the_simulators_refraction(as_it_is):
    """Two implementations: Snell's law by layers, and the integral of the density."""
    without, within = (as_it_is["ratio"][model].droplevel("unit") for model in ("none", "standard"))
    assert abs(without["f"]) > 1
    assert abs(without["lever z"]) > 0.8
    # refractive indices differ by 0.1 %, and so do K and what is left of it
    assert np.all(np.abs(within) <= 0.003)


def test_images_that_are_wrong_by_a_factor_are_found_by_it(run, as_it_is):
    mistaken = run({WRONG: 'wrong = {"image points": 0.5}'})
    before, after = (diagnosis(n)["image points"].factor for n in (as_it_is, mistaken))
    own = components(as_it_is["single"].bundle)
    as_flown = {one.group: one.factor for one in own}["image points"]
    assert before == pytest.approx(as_flown, rel=1e-2)
    assert after == pytest.approx(2 * as_flown, rel=1e-2)  # the others take a little part in it


def test_errors_that_change_faster_average_out_better(run, as_it_is):
    def most(names):
        pair = {"independent": names["single"], "slow": names["slowly"]}
        return tables.of_boresight(tables.side_by_side(pair))[1]

    short = run({TIME: "share, constant_s = 0.95, 60.0"})
    assert 1 < most(short) < most(as_it_is)
    assert short["by_hand"] == pytest.approx(short["library"], rel=1e-9)


def test_a_model_of_refraction_that_is_not_there_does_harm(run, as_it_is):
    vacuum = run({AIR: "study.EXACT"})
    with_model = vacuum["ratio"]["standard"].droplevel("unit")
    assert with_model["f"] == pytest.approx(-as_it_is["ratio"]["none"][("f", "mm")], rel=0.05)
    assert np.all(np.abs(vacuum["ratio"]["none"]) <= 0.003)


def test_a_trajectory_without_times_says_so(tmp_path):
    flown = acx4sim.DESIGNS["single-head"](seed=1)
    acx4sim.write(flown, tmp_path / "flight")
    for path in (tmp_path / "flight").glob("*/trajectory.csv"):
        table = pd.read_csv(path, dtype=str).drop(columns="time_s")
        table.to_csv(path, index=False)
    mounting.run(flights.read(tmp_path / "flight"), tmp_path / "results")
    names = changed("09", flight_path=tmp_path / "flight", results_path=tmp_path / "results")
    assert not names["timed"]
    assert names["slowly"] is None
    assert "the study" in names["ended"]
