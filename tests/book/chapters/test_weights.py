"""Slow errors and shifts of trajectories do to simulated calibrations what the book says."""

import numpy as np
import pandas as pd
import pytest

from acx4book.chapters import weights
from acx4book.notebooks.simulated import fly_and_read
from acx4lib.calibration import mounting, trajectory_errors

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
