"""Chapter 3 changed as it suggests: one argument, and everything below follows."""

import numpy as np
import pytest

import acx4sim
from support.changed_notebook import changed

CHOICES = "free, fix, gnss = flight.estimate_mounting, flight.fix, flight.gnss"
MEASURED = "block = mounting.measured(flight, results_path)\n"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """What the cells define, by the change; each into results of its own."""
    flight = tmp_path_factory.mktemp("flight") / "small"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1), flight)

    def one(**changes):
        results = tmp_path_factory.mktemp("results")
        return changed("03", dict(changes.values()), flight_path=flight, results_path=results)

    return one


@pytest.fixture(scope="module")
def as_it_is(run):
    return run()


def sigma(names, parameter):
    return float(names["single"].table().droplevel("unit")["sigma"][parameter])


def test_the_two_methods_by_hand_are_the_librarys(as_it_is):
    np.testing.assert_allclose(as_it_is["by_hand"], as_it_is["ray"].residual_px, atol=1e-6)
    np.testing.assert_allclose(as_it_is["lever_arm"], as_it_is["T_b_c"].r, atol=1e-9)
    np.testing.assert_allclose(as_it_is["boresight"], as_it_is["T_b_c"].R, atol=1e-9)


def test_a_held_lever_arm_is_held_in_every_table_below(run, as_it_is):
    held = run(fix=(CHOICES, f'{CHOICES}\nfix = ("lever_arm",)'))
    for axis in "xyz":
        assert np.isnan(sigma(held, f"lever {axis}"))
        assert sigma(as_it_is, f"lever {axis}") > 0
    assert sigma(held, "f") < sigma(as_it_is, "f")
    columns = held["table"].columns.get_level_values(0)
    assert {"two-step", "two-step, GNSS positions", "single-step"} <= set(columns)


def test_from_one_height_focal_length_and_lever_arm_are_not_told_apart(run, as_it_is):
    lowest = run(block=(MEASURED, f"{MEASURED}block = design.lowest_height(block)\n"))
    for parameter in ("f", "lever z"):
        assert sigma(lowest, parameter) > 3 * sigma(as_it_is, parameter)
    assert len(lowest["block"].images) < len(as_it_is["block"].images)


def test_without_control_the_boresight_stays_and_the_two_step_method_is_left_out(run, as_it_is):
    without = run(block=(MEASURED, f"{MEASURED}block = design.without_control(block)\n"))
    assert not without["two"]
    assert "two_step" in without["methods"].failures
    for axis in "ωφκ":
        before = sigma(as_it_is, f"boresight {axis}")
        assert sigma(without, f"boresight {axis}") == pytest.approx(before, rel=0.25)
    assert sigma(without, "lever z") > 3 * sigma(as_it_is, "lever z")
