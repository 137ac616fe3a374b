"""Chapter 16 changed as it suggests, and what it computes by hand and in its exercises."""

import numpy as np
import pytest

from acx4book.chapters.beyond.error_budget import tables
from acx4lib.georeferencing import budget
from support.changed_notebook import changed

pytestmark = pytest.mark.repeats
"""Chapters of the paper are changed in every run of the tests; these take minutes."""

SINGLE = "single = single_step(calibration, free=free)"
FREE = "free = flight.estimate_mounting"
POOR = "height_m, sigma_position_m=(0.3, 0.3, 0.3))"
FLIGHTS = "replace(mapping, height_m=height_m) for height_m in heights_m"


@pytest.fixture(scope="module")
def as_it_is():
    return changed("16")


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


def test_poor_positions_become_the_largest_part_of_the_plan(as_it_is):
    def shares(names):
        plan = tables.plan_and_height(names["at_heights"]["single_step"][0].mean)[0]
        return budget.shares(plan)

    poor = changed("16", {FLIGHTS: FLIGHTS.replace("height_m)", POOR)})
    assert max(shares(poor), key=shares(poor).get) == "trajectory"
    assert max(shares(as_it_is), key=shares(as_it_is).get) == "image and survey"


def test_a_held_lever_arm_has_a_smaller_part_and_larger_differences(as_it_is):
    held = changed("16", {SINGLE: f'{SINGLE[:-1]}, fix=("lever_arm",))'})
    row = ("Single-step", "all", "height")
    before, after = groups(as_it_is).loc[row], groups(held).loc[row]
    assert after["calibration (%)"] < before["calibration (%)"]
    assert after["RMS of d / σ"] > before["RMS of d / σ"]


def test_no_budget_knows_of_distortion_that_is_left_out(as_it_is):
    straight = changed("16", {FREE: 'free = ("f", "xp", "yp")'})
    assert groups(straight)["RMS of d / σ"].max() > 2 * groups(as_it_is)["RMS of d / σ"].max()
