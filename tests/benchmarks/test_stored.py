"""What data/benchmarks stores, and pages show, is what is computed again."""

import numpy as np
import pandas as pd
import pytest

from acx4book.chapters.from_pictures import STORED
from acx4book.paper import printed
from benchmarks import closed_chain, coverage_flights, harness, imports
from support.flights import simulated
from support.helpers import needs, repeats

# --- imports of real files -------------------------------------------------------------------

QUICK = ("sbet", "orientations")


@needs("ign-uce-m3")
@needs("applanix_pdal")
@needs("formats")
@pytest.mark.parametrize("names", [QUICK, repeats({*imports.RUNS} - {*QUICK})], ids=len)
def test_imports_say_what_is_stored(names):
    known = pd.read_csv(harness.OUT / "imports.csv")
    expected = known[known["kind"].isin(names)]["line"].tolist()
    assert [
        row["line"] for row in imports.said([n for n in imports.RUNS if n in names])
    ] == expected


# --- orders of the images --------------------------------------------------------------------


def test_no_order_of_the_images_and_no_course_takes_a_tenth_longer_than_the_design():
    known = pd.read_csv(harness.OUT / "orders.csv")
    assert len(known) == 20
    assert set(known["band"]) == {known["band"][0]}
    assert known["ratio"].max() < 1.1


# --- errors over their sigma -----------------------------------------------------------------


def test_errors_of_all_parameters_of_six_flights_are_stored():
    found = pd.read_csv(STORED / "measured_flights.csv")
    assert found.groupby("seed").size().tolist() == [14] * 6
    assert np.abs(found["error"] / found["sigma"]).max() < 4


def test_squares_of_independent_errors_add_up_to_the_joint_chi_square():
    table = pd.DataFrame(coverage_flights.mountings(1)["parameters"])
    rows = table[table["method"] == "single_step"]
    errors = simulated.mounting_errors("acx4-ideal", "single_step", seed=1)
    assert rows["error"].tolist() == errors.tolist()
    cov = simulated.mounting_estimates("acx4-ideal", "single_step", seed=1).cov
    total, n = simulated.chi_square(errors, cov)
    assert n == len(rows) == 14
    # the closest correlations leave 1e-6 of the digits
    assert np.sum(rows["decorrelated"] ** 2) == pytest.approx(total, rel=1e-6)


def test_what_is_odd_in_the_noise_cancels_in_a_pair():
    """One pair shows the bias of f at measured points, a fifteenth of sigma; the error is 0.2."""
    found = pd.DataFrame(coverage_flights.pair(1)["bias"]).set_index(["distortion_at", "parameter"])
    z = found["error"] / found["sigma"]
    assert z["adjusted"].abs().max() < 0.02
    assert -0.08 < z["measured", "f_mm"] < -0.05


# --- the closed chain ------------------------------------------------------------------------


def stored(name):
    table = pd.read_csv(closed_chain.OUT / f"closed_chain_{name}.csv", keep_default_na=False)
    return table[table["seed"] == 1]


@pytest.mark.slow
@pytest.mark.repeats
def test_a_flight_of_the_closed_chain_is_the_stored_one():
    parameters, points, _ = map(pd.DataFrame, closed_chain.of_seed(1))
    kept = stored("parameters")
    assert parameters["parameter"].tolist() == kept["parameter"].tolist()
    # stored to seven digits; k3 is correlated to -0.99, and machines differ in the last digits
    assert parameters["value"].to_numpy() == pytest.approx(kept["value"].astype(float), rel=1e-5)
    for name in ("rms_m", "mean_m", "sigma_m"):
        assert points[name].to_numpy() == pytest.approx(stored("points")[name], rel=1e-5, abs=1e-5)
    noise, kept = pd.DataFrame(closed_chain.with_noise_and_without(1)), stored("noise")
    for name in ("value", "exact", "sigma", "sigma_before"):
        assert noise[name].to_numpy() == pytest.approx(kept[name].astype(float), rel=1e-4)


@pytest.mark.slow
@pytest.mark.repeats
def test_lens_centres_in_one_point_give_the_true_lever_arm_and_the_printed_shift():
    table = pd.DataFrame(closed_chain.at_side(0.0, 0.0))
    found = table.pivot_table(index="parameter", columns="method", values="value")
    assert found["single_step"]["lever_z_m"] == pytest.approx(-0.201, abs=0.01)
    assert found["single_step"]["sigma0_squared"] < 0.01
    for name in ("f_mm", "xp_mm", "yp_mm"):
        two, single = (printed.value(3, name, column) for column in ("two_step", "single_step"))
        own = found["two_step_gnss"][name] - found["single_step"][name]
        assert own == pytest.approx(two - single, rel=0.1)
        assert own == pytest.approx(found["expected"][name], rel=0.01)
