"""Chapter 8 changed as it suggests: one line, and everything below follows."""

import numpy as np
import pytest

import acx4sim
from support.changed_notebook import changed

MEASURED = "block = stage.measured(flight)\n"
IN_OVERLAPS = "misfit in overlaps, predicted RMS (px)"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """What the cells define, by what happens to the block; each into results of its own."""
    flight = tmp_path_factory.mktemp("flight") / "heads"
    options = acx4sim.Options(blocks=("heads",), tie_points={"heads": 100})
    acx4sim.write(acx4sim.DESIGNS["acx4"](seed=1, options=options), flight)

    def one(line=""):
        results = tmp_path_factory.mktemp("results")
        change = {MEASURED: f"{MEASURED}{line}\n"}
        return changed("08", change, flight_path=flight, results_path=results)

    return one


@pytest.fixture(scope="module")
def as_it_is(run):
    return run()


def sigma(names, parameter):
    """Return the largest standard deviation of a parameter; zero where it is held."""
    return float(names["estimates"]["sigma"].xs(parameter, level="parameter").fillna(0).max())


def test_the_equations_by_hand_are_the_librarys(as_it_is):
    np.testing.assert_allclose(as_it_is["ideal"], as_it_is["measured"], atol=1e-6)
    for ours, theirs in zip(as_it_is["by_hand"], as_it_is["library"], strict=True):
        np.testing.assert_allclose(ours, theirs, atol=1e-9)


def test_without_shared_points_the_overlaps_of_the_rig_misfit_more(run, as_it_is):
    apart = run("block = design.unshared(block)")
    assert apart["at_once"][2:].sum() < 0.3 * as_it_is["at_once"][2:].sum()  # control stays
    before = as_it_is["in_pixels"][IN_OVERLAPS]
    found = apart["in_pixels"][IN_OVERLAPS]
    assert found["rig"] > 1.4 * before["rig"]
    assert found["rig"] == pytest.approx(before["rig, no shared points"], rel=0.02)


def test_from_one_height_the_focal_length_is_poorly_known_or_held(run, as_it_is):
    lowest = run("block = design.lowest_height(block)")
    assert sigma(as_it_is, "f") > 0
    assert sigma(lowest, "lever z") > 2 * sigma(as_it_is, "lever z")
    assert sigma(lowest, "f") == 0 or sigma(lowest, "f") > 5 * sigma(as_it_is, "f")


def test_without_control_only_the_rig_orients_the_heads(run, as_it_is):
    without = run("block = design.without_control(block)")
    assert not without["one_by_one"]
    assert as_it_is["one_by_one"]
    assert "one by one" not in without["in_pixels"].index
    before, after = (names["rigid"].sigma[:, 3:] for names in (as_it_is, without))
    np.testing.assert_allclose(after, before, rtol=0.3)
