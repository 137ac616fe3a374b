"""Chapter 16 changed as it suggests, and what it computes by hand and in its exercises."""

import numpy as np
import pytest

import acx4sim
from acx4book.chapters.beyond.error_budget import tables
from acx4lib import flight as flights
from acx4lib.georeferencing import budget
from acx4lib.stages import mounting
from support.changed_notebook import changed

pytestmark = pytest.mark.repeats
"""Chapters of the paper are changed in every run of the tests; these take minutes."""

READ = "calibrations = validation.calibrations(flight, results_path)\n"
POOR = "height_m, sigma_position_m=(0.3, 0.3, 0.3))"
FLIGHTS = "replace(mapping, height_m=height_m) for height_m in heights_m"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """What the cells define, by the change, on the flight of an ideal camera."""
    flight, results = tmp_path_factory.mktemp("flight") / "ideal", tmp_path_factory.mktemp("run")
    acx4sim.write(acx4sim.DESIGNS["acx4-ideal"](seed=1), flight)
    mounting.run(flights.read(flight), results)

    def one(changes=None):
        return changed("16", changes, flight_path=flight, results_path=results)

    return one


def forgotten(part):
    """Return the change that forgets a part of every calibration."""
    each = f"{{name: forgotten.{part}(one) for name, one in calibrations.items()}}"
    how = "from acx4lib.georeferencing import forgotten\n"
    return {READ: f"{READ}{how}calibrations = {each}\n"}


@pytest.fixture(scope="module")
def as_it_is(run):
    return run()


def groups(names):
    return tables.groups(names["validations"], names["points"], names["pairs"])


def test_a_point_by_hand_has_the_sigma_of_the_library(as_it_is):
    np.testing.assert_allclose(as_it_is["by_hand"], as_it_is["library"], rtol=1e-9)


def test_exercises_are_solved_in_two_ways(as_it_is):
    found = as_it_is
    assert found["by_roll"] == pytest.approx(found["by_image"], rel=1e-6)
    assert np.degrees(found["half"]) == pytest.approx(0.002155, abs=1e-6)  # 2.8 um / 74.44 mm
    ratio = np.sqrt(np.sum(found["x_few"] ** 2) / np.sum(found["x_many"] ** 2))
    assert found["many"] / found["few"] == pytest.approx(ratio, rel=1e-6)
    assert found["best"] == pytest.approx(found["trials"][np.argmin(found["harm"])], abs=50)
    assert 1000 <= found["best"] <= 1500
    assert found["after"].rms[2] == pytest.approx(0.8 * found["before"].rms[2], rel=1e-3)


def test_poor_positions_have_a_larger_part_of_the_plan_most_at_low_heights(run, as_it_is):
    def of_trajectory(names, at):
        plan = tables.plan_and_height(names["at_heights"]["single_step"][at].mean)[0]
        return budget.shares(plan)["trajectory"]

    poor = run({FLIGHTS: FLIGHTS.replace("height_m)", POOR)})
    low, high = (of_trajectory(poor, at) - of_trajectory(as_it_is, at) for at in (0, -1))
    assert low > high > 0


def test_a_forgotten_lever_arm_leaves_the_shares_and_makes_larger_differences(run, as_it_is):
    row, share = ("Single-step", "all", "height"), "calibration (%)"
    before, after = groups(as_it_is).loc[row], groups(run(forgotten("lever_arm"))).loc[row]
    assert after[share] == pytest.approx(before[share], rel=0.2)
    assert after["RMS of d / σ"] > 1.2 * before["RMS of d / σ"]


def test_no_budget_knows_of_distortion_that_is_forgotten(run, as_it_is):
    straight = groups(run(forgotten("distortion")))
    assert straight["RMS of d / σ"].max() > 1.5 * groups(as_it_is)["RMS of d / σ"].max()


def test_a_flight_of_another_camera_ends_before_the_papers_budget(tmp_path):
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1), tmp_path / "flight")
    mounting.run(flights.read(tmp_path / "flight"), tmp_path / "results")
    names = changed("16", flight_path=tmp_path / "flight", results_path=tmp_path / "results")
    assert "the flight of the study" in names["ended"]
    assert "at_heights" in names
