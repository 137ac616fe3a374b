"""Chapters beyond the paper: designs, failures, and weights."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pyproj
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters import design, failures, weights
from acx4book.chapters.design import papers
from acx4book.chapters.failures import (
    TRAJECTORY,
)
from acx4book.notebooks.simulated import fly_and_read
from acx4book.planning.design import sigmas
from acx4book.planning.plan import strip_of
from acx4lib.calibration import mounting
from acx4lib.calibration.mounting import single_step
from acx4lib.design import flying_heights
from acx4lib.geometry.collinearity import refraction_taken_up
from acx4lib.model import Model
from acx4sim.designs import acx4_ideal_plan

# --- design ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def plan():
    return papers()


@pytest.fixture(scope="module")
def table(plan):
    return pd.DataFrame({n: sigmas(plan.with_control(n, (1300.0, 1000.0))) for n in (2, 5)})


@pytest.fixture(scope="module")
def explorer_plan():
    return papers(gnss=("shift",))


@pytest.fixture(scope="module")
def shown(explorer_plan):
    return design.explorer(explorer_plan)


@pytest.mark.parametrize("values", [(1.5, 180.0, 5.0), (1.25, 90.0, 8.0), (1.0, 0.0, 2.0)])
def test_readings_are_those_of_a_plan_of_these_strips(shown, explorer_plan, values):
    ratio, turn, control = values
    camera = explorer_plan.cameras("calibration")[0]
    strips = [
        strip_of(camera, height_m, 28.0 + turned, images=5)
        for height_m in (1000.0, 1000.0 * ratio)
        for turned in (0.0, turn)
    ]
    flown = explorer_plan.with_strips(strips).with_control(int(control), (1300.0, 1000.0))
    expected = sigmas(flown)
    for row, (name, (_, factor)) in zip(shown.readings(values), design.SHOWN.items(), strict=True):
        assert float(row[0]) == pytest.approx(factor * expected[name], rel=0.1, abs=0.006)


def test_the_second_strip_turns_clockwise(shown):
    """Up is the first course, so a quarter turn flies to the right."""
    turned = shown.panels[0].marks[0].response.at([1.5, 90.0, 5.0]).reshape(-1, 2)
    start, end = turned[0], turned[1]
    assert end[0] > start[0] + 0.2
    assert end[1] == pytest.approx(start[1], abs=1e-6)


def test_the_papers_block_is_the_simulators():
    plan = papers(gnss=("shift",))
    block, simulated = plan.blocks["calibration"], acx4_ideal_plan().blocks["calibration"]
    assert [s.n_exposures for s in block.strips.values()] == [s.n for s in simulated.strips]
    heights = [s.flying_height_m for s in block.strips.values()]
    assert heights == [s.height_m for s in simulated.strips]
    assert {*heights} == {1000.0, 1500.0}
    assert plan.setup.gnss == ("shift",)
    assert papers().setup.gnss == ()


# --- What plants mistakes changes what it is to change, by what it is to change it


@pytest.fixture(scope="module")
def flight():
    return failures.flown(1)


def test_the_convergence_is_that_of_proj(flight):
    table = flight.tables[TRAJECTORY]
    factors = pyproj.Proj(flight.plan.crs).get_factors(table["lon_deg"], table["lat_deg"])
    assert_allclose(failures.convergence_deg(flight), factors.meridian_convergence)


def test_a_delay_moves_positions_along_the_flight(flight):
    late = failures.late(flight, by_s=0.1)
    now = flight.tables[TRAJECTORY]
    geod = pyproj.Geod(ellps="GRS80")
    azimuth, _, metres = geod.inv(now["lon_deg"], now["lat_deg"], late["lon_deg"], late["lat_deg"])
    assert_allclose(metres, 70 * 0.1, rtol=0.3)  # 70 m/s, less regular exposures
    off = (azimuth - now["heading_deg"] + 180) % 360 - 180
    assert np.all(np.abs(off) < 20)  # crab and wind


def test_one_direction_is_one_height_and_one_direction(flight):
    track = failures.only(flight, ("1", "3")).tables[TRAJECTORY]
    assert np.ptp(track["height_m"]) < 60
    turns = np.exp(1j * np.radians(track["heading_deg"]))
    assert abs(turns.mean()) > 0.99


# --- Slow errors and shifts of trajectories do to simulated calibrations what the book says


SHIFTED, UNKNOWN = "shifted, none", "shifted, shift"


@pytest.fixture(scope="module")
def errors():
    return weights.calibrated(range(1, 13), weights.SLOWLY)


@pytest.fixture(scope="module")
def shifts():
    return weights.calibrated(range(1, 9), weights.SHIFTS)


def ratios(errors, kind, prefix):
    table = weights.scatter(errors)
    own = table[(table["kind"] == kind) & table["parameter"].str.startswith(prefix)]
    return own["ratio"].to_numpy()


def of(errors, kind, parameter):
    own = errors[(errors["kind"] == kind) & (errors["parameter"] == parameter)]
    return own["error"].to_numpy(), own["sigma"].to_numpy()


def test_slow_errors_make_a_boresight_worse_than_its_sigma_says(errors):
    """12 flights: a ratio is known to a fifth, and parameters of one flight hang together."""
    assert np.all(ratios(errors, "white", "boresight") < 1.7)
    assert np.all(ratios(errors, "slow", "boresight") > 2)
    assert np.all(ratios(errors, "slow", "k") < 1.7)  # distortion is the images' alone


def test_the_variance_factor_does_not_give_slow_errors_away(errors):
    mean = errors.groupby("kind")["sigma0_squared"].mean()
    assert mean["slow"] < mean["white"] < 1.05


def test_weights_that_know_the_correlation_keep_their_promise(errors):
    """The chi-square of 12 flights, 99 % two-sided, of what slow errors hurt most."""
    for name in ("boresight_kappa_deg", "boresight_phi_deg", "boresight_omega_deg", "lever_x_m"):
        error, sigma = of(errors, weights.MODELLED, name)
        assert 3.07 < np.sum((error / sigma) ** 2) < 28.3  # 12 degrees of freedom


def test_a_shift_in_plan_no_longer_moves_the_lever_arm_when_it_is_unknown(shifts):
    """Across the strips its effect is 0.19 m, four sigma; eight flights average its noise out."""
    for kind, low, high in ((SHIFTED, 3.0, 6.0), (UNKNOWN, 0.0, 1.1)):
        error, sigma = of(shifts, kind, "lever_y_m")
        assert low < abs(np.mean(error / sigma)) < high  # the mean's sigma is 0.35


def test_a_shift_in_height_is_in_the_lever_arm_either_way(shifts):
    for kind in (SHIFTED, UNKNOWN):
        error, sigma = of(shifts, kind, "lever_z_m")
        assert abs(np.mean(error) + weights.SHIFT_M[2]) < 3.3 * sigma.mean() / np.sqrt(8)


def test_the_variance_of_unit_weight_gives_a_shift_away(shifts):
    mean = shifts.groupby("kind")["sigma0_squared"].mean()
    assert mean[SHIFTED] > 1.15
    assert mean[UNKNOWN] == pytest.approx(1.0, abs=0.03)


# --- The printed standard deviations, and the noise of GNSS heights that would give them


def test_noisier_heights_are_seen_in_f_and_lever_z():
    flown = fly_and_read("acx4-ideal", 1, weights.WHITE)
    noisy = {s: weights.with_height_noise(flown.block, s) for s in (0.005, 0.02, 0.08)}
    model = Model(free=flown.flight.estimate_mounting)
    table = weights.height_noise_table(
        {s: mounting.single_step(block, model, snooping=False) for s, block in noisy.items()}
    )
    for name in ("sigma_f_mm", "sigma_lever_z_m"):
        assert table[name].is_monotonic_increasing
    # as large as it is, the noise of 52 heights is what determines both
    assert table["sigma_lever_z_m"].iloc[2] > 2 * table["sigma_lever_z_m"].iloc[1]
    assert len(weights.height_noise(table, beside_print=True).axes) == 2


# --- refraction that is left out ---


@pytest.mark.slow
def test_refraction_taken_up_is_what_a_calibration_is_wrong_by():
    """The simulator bends its rays by Snell's law; the measurements have no noise.

    The block's points are in other places of the images than on a radius: within a sixth.
    """
    exact = fly_and_read("acx4-ideal", 1, replace(weights.EXACT, refraction="standard"))
    fit = single_step(exact.block, Model(free=exact.flight.estimate_mounting), snooping=False)
    errors = weights.errors(exact, fit)["value"]
    block = exact.block
    camera, height = block.cameras[0], block.frame.to_geographic(block.trajectory.T_m_b.r)[:, 2]
    f_mm, z_m = refraction_taken_up(
        camera.interior.f,
        0.5 * camera.pixel_mm * np.hypot(camera.width_px, camera.height_px),
        height,
        height[0] - flying_heights(block)[0],
        lever_arm=True,
    )
    assert f_mm == pytest.approx(errors.loc[("f", "mm")], rel=1 / 6)
    assert z_m == pytest.approx(errors.loc[("lever z", "m")], rel=1 / 6)
