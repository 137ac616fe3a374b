"""What a simulated flight was given is said from its truth, and from nothing else."""

import pytest

from acx4book.pages import simulation
from acx4book.paper import printed
from support.flights.simulated import fly


@pytest.fixture(scope="module")
def acx4():
    flown = fly("acx4-ideal", seed=1)
    return simulation.page(flown.flight, flown.truth)


def test_the_true_values_are_those_of_the_truth(acx4):
    f = printed.value(3, "f_mm", "single_step")
    assert f"| {f:.4f} |" in acx4
    f = fly("acx4-ideal", seed=1).truth["cameras"]["CAM1"]["f_mm"]
    assert f"{f:.4f} mm, follows from Table 3" in acx4


def test_all_of_table_3_was_given_to_the_ideal_camera(acx4):
    assert "The synthetic camera's 14 values are those" in acx4


def test_what_was_chosen_is_said_beside_what_the_paper_says(acx4):
    assert "tab-chosen" in acx4


def test_another_flight_is_not_said_to_be_the_papers():
    flown = fly("single-head", seed=1)
    page = simulation.page(flown.flight, flown.truth)
    assert "Table 1" not in page
    assert "tab-noise" in page


def test_a_flight_without_truth_is_not_said_to_be_simulated():
    flight = fly("single-head", seed=1).flight
    page = simulation.page(flight, None)
    assert "no truth beside it" in page
    assert "is simulated" not in page
