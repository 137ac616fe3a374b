"""Chapters beyond the paper: designs, failures, and weights."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pyproj
import pytest
from matplotlib.colors import to_rgba
from numpy.testing import assert_allclose

from acx4book.chapters import design, failures, weights
from acx4book.chapters.design import papers
from acx4book.chapters.failures import (
    CONTROL,
    TRAJECTORY,
    changed,
    examine,
    flown,
    late,
    standardised,
)
from acx4book.notebooks.simulated import fly_and_read
from acx4book.planning.design import sigmas
from acx4book.planning.plan import strip_of
from acx4book.typesetting import style
from acx4lib.calibration import mounting, trajectory_errors
from acx4lib.calibration.mounting import single_step
from acx4lib.design import flying_heights
from acx4lib.geometry.collinearity import refraction_taken_up
from acx4sim.designs import acx4_ideal_plan
from support.figures import drawn, panels

# --- design ----------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def plan():
    return papers()


@pytest.fixture(scope="module")
def table(plan):
    return pd.DataFrame({n: sigmas(plan.with_control(n, (1300.0, 1000.0))) for n in (2, 5)})


def test_curves_are_the_table_in_readable_units(table):
    fig = design.curves(table, "control points")
    interior, lever, _ = fig.axes
    assert interior.lines[0].get_ydata() == pytest.approx(1000 * table.loc["f_mm"])
    assert lever.lines[0].get_ydata() == pytest.approx(100 * table.loc["lever_z_m"])
    assert all(ax.get_ylim()[1] / ax.get_ylim()[0] > 0.99 * design.LEAST_RANGE for ax in fig.axes)
    both = design.curves(table, "control points", beside=2 * table)
    assert len(both.axes[0].lines) == 6


def test_a_map_shows_strips_where_they_are_flown(plan):
    strips = plan.blocks["calibration"].strips
    flights = {"all": plan, "one": plan.with_strips({"C1": strips["C1"]})}
    fig = design.maps(flights)
    first = fig.axes[0]
    assert [ax.get_title() or ax.get_title(loc="left") for ax in fig.axes] == [*flights]
    arrows = [text for text in first.texts if getattr(text, "arrow_patch", None) is not None]
    assert len(arrows) == 5
    strip = strips["C2"]
    start, end = np.array(arrows[1].xyann), np.array(arrows[1].xy)
    length = 0.001 * strip.base_m * (strip.n_exposures - 1)
    assert np.hypot(*(end - start)) == pytest.approx(length)
    course = np.degrees(np.arctan2(*(end - start))) % 360
    assert course == pytest.approx(strip.course_deg % 360, abs=0.1)


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


# --- Some flights with mistakes, examined once -----------------------------------------------


@pytest.fixture(scope="session")
def found():
    flight = flown(1)
    control = flight.tables[CONTROL]
    exchanged = {"east_m": control["north_m"], "north_m": control["east_m"]}
    flights = {
        "no mistake": flight,
        "coordinates exchanged": changed(flight, {CONTROL: exchanged}),
        "delay": changed(flight, {TRAJECTORY: late(flight, by_s=0.1)}),
    }
    return {name: examine(one) for name, one in flights.items()}


# --- What plants mistakes changes what it is to change, by what it is to change it


@pytest.fixture(scope="module")
def flight():
    return failures.flown(1)


def test_only_the_named_columns_are_changed(flight):
    heights = flight.tables[CONTROL]["height_m"] - 45.0
    other = failures.changed(flight, {CONTROL: {"height_m": heights}})
    different = {
        (path, column)
        for path, table in flight.tables.items()
        for column in table
        if not table[column].equals(other.tables[path][column])
    }
    assert different == {(CONTROL, "height_m")}
    assert failures.changed(flight, {}).tables.keys() == flight.tables.keys()


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


def test_gross_errors_are_told_by_the_truth(flight):
    spoiled = failures.flown(1, gross_errors=True)
    assert {one["kind"] for one in spoiled.truth["gross_errors"]} >= {"image_point", "gnss"}
    kept = pd.DataFrame(spoiled.tables[TRAJECTORY]["heading_deg"])
    assert (kept.ne(flight.tables[TRAJECTORY][["heading_deg"]])).sum().item() == 1


# --- Panels of one scale, a mark for what stands out, a sentence for what was refused


def test_bars_are_the_residuals_and_red_where_they_stand_out(found):
    fig = drawn(failures.fingerprints(found))
    by_title = {ax.get_title(loc="left"): ax for ax in panels(fig)}
    for name in ("no mistake", "delay"):
        bars = by_title[name].patches
        ends = [bar.get_x() + bar.get_width() for bar in bars]
        rms = standardised(found[name])
        np.testing.assert_allclose(ends, rms)
        red = [bar.get_facecolor() == to_rgba(style.BRICK) for bar in bars]
        assert red == list(rms > failures.SEEN)
    assert len({ax.get_xlim() for ax in by_title.values()}) == 1


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


def test_scatter_is_the_rms_of_errors_over_that_of_sigma(errors):
    error, sigma = of(errors, "slow", "f_mm")
    table = weights.scatter(errors)
    row = table.set_index(["kind", "parameter"]).loc["slow", "f_mm"]
    assert row["rms"] == pytest.approx(np.sqrt(np.mean(error**2)), rel=1e-12)
    assert row["ratio"] == pytest.approx(row["rms"] / np.sqrt(np.mean(sigma**2)), rel=1e-9)
    assert row["sigma_ratio"] == pytest.approx(row["ratio"] / np.sqrt(24), rel=1e-12)
    spans = weights.spans(table, "slow")
    assert spans["boresight"] == (
        ratios(errors, "slow", "boresight").min(),
        ratios(errors, "slow", "boresight").max(),
    )


def test_height_errors_are_those_of_the_same_flight(errors):
    table = weights.height_errors(1)
    white, slow = (table[table["kind"] == kind]["error_m"] for kind in ("white", "slow"))
    assert len(white) == len(slow) == 52
    assert white.std() == pytest.approx(0.015, rel=0.35)  # the design's; 52 of them
    assert slow.diff().std() < 0.6 * white.diff().std()  # sqrt(1 - 0.95^2) and the drift
    figure = weights.trajectory_errors(table, weights.scatter(errors))
    assert len(figure.axes) == 2


def test_errors_of_one_flight_stand_by_their_parameters():
    flown = fly_and_read("acx4-ideal", 1, weights.WHITE)
    found = mounting.single_step(flown.block, free=flown.flight.estimate_mounting, snooping=False)
    table = weights.errors(flown, found)
    lever = found.calibration.cameras[0].T_b_c.r
    for axis in range(3):
        row = table.loc[(f"lever {'xyz'[axis]}", "m")]
        assert row["value"] == pytest.approx(lever[axis] - flown.truth[f"lever_{'xyz'[axis]}_m"])
        assert row["error / σ"] == pytest.approx(row["value"] / row["sigma"])


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


def test_a_lever_arm_that_is_held_has_no_errors_to_show(shifts):
    found = weights.scatter(shifts)
    table = weights.ratios(found)
    assert table.loc["lever arm $z$"].isna().sum() == 1
    row = found.set_index(["kind", "parameter"]).loc[(UNKNOWN, "f_mm")]
    assert table.loc["$f$", "Shifted; unknown: shift"] == row["ratio"]
    assert not any("k_1" in name for name in table.index)


def test_the_mounting_page_says_what_was_estimated_or_that_nothing_was():
    flown = fly_and_read("single-head", 1, weights.SHIFTED)
    settings = {"free": flown.flight.estimate_mounting}
    found = mounting.single_step(flown.block, **settings, gnss=("shift",))
    notes = trajectory_errors.notes(found.bundle)
    assert len(notes) == 3
    assert "height of the GNSS shift is held, since it and the lever arm's z" in notes[1]
    without = mounting.single_step(flown.block, **settings)
    assert trajectory_errors.notes(without.bundle) == []


# --- The printed standard deviations, and the noise of GNSS heights that would give them


def test_noisier_heights_are_seen_in_f_and_lever_z():
    flown = fly_and_read("acx4-ideal", 1, weights.WHITE)
    noisy = {s: weights.with_height_noise(flown.block, s) for s in (0.005, 0.02, 0.08)}
    how = {"free": flown.flight.estimate_mounting, "snooping": False}
    table = weights.height_noise_table(
        {s: mounting.single_step(block, **how) for s, block in noisy.items()}
    )
    for name in ("sigma_f_mm", "sigma_lever_z_m"):
        assert table[name].is_monotonic_increasing
    # as large as it is, the noise of 52 heights is what determines both
    assert table["sigma_lever_z_m"].iloc[2] > 2 * table["sigma_lever_z_m"].iloc[1]
    assert len(weights.height_noise(table, beside_print=True).axes) == 2


@pytest.mark.parametrize(
    ("sigma_f_mm", "met"), [((0.0008, 0.0012), 1.0), ((0.0022, 0.0027), np.nan)]
)
def test_a_printed_sigma_outside_of_the_curve_is_met_nowhere(sigma_f_mm, met):
    noise = {"gnss_height_m": (0.005, 0.015), "sigma_lever_z_m": (0.01, 0.02)}
    table = pd.DataFrame(noise | {"sigma_f_mm": sigma_f_mm})
    assert weights.met_at_cm(table, "f_mm") == pytest.approx(met, nan_ok=True)


# --- refraction that is left out ---


@pytest.mark.slow
def test_refraction_taken_up_is_what_a_calibration_is_wrong_by():
    """The simulator bends its rays by Snell's law; the measurements have no noise.

    The block's points are in other places of the images than on a radius: within a sixth.
    """
    exact = fly_and_read("acx4-ideal", 1, replace(weights.EXACT, refraction="standard"))
    fit = single_step(exact.block, free=exact.flight.estimate_mounting, snooping=False)
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
