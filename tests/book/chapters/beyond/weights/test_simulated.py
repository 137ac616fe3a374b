"""Wrong sigma, slow errors and refraction do to simulated calibrations what the book says."""

import numpy as np
import pytest

import acx4sim
from acx4book.chapters.beyond.weights import figures, tables
from acx4book.chapters.beyond.weights.simulated import (
    MODELLED,
    fly,
    height_errors,
    height_noise,
    refraction_effect,
    scatter,
    trajectory_errors,
    wrong_sigma,
)


@pytest.fixture(scope="module")
def errors():
    return trajectory_errors(range(1, 13))


@pytest.fixture(scope="module")
def refraction():
    return refraction_effect()


def ratios(errors, kind, prefix):
    table = scatter(errors)
    own = table[(table["kind"] == kind) & table["parameter"].str.startswith(prefix)]
    return own["ratio"].to_numpy()


def test_slow_errors_make_a_boresight_worse_than_its_sigma_says(errors):
    """12 flights: a ratio is known to a fifth, and parameters of one flight hang together."""
    assert np.all(ratios(errors, "white", "boresight") < 1.7)
    assert np.all(ratios(errors, "slow", "boresight") > 2)
    assert np.all(ratios(errors, "slow", "k") < 1.7)  # distortion is the images' alone


def test_the_variance_factor_does_not_give_slow_errors_away(errors):
    mean = errors.groupby("kind")["sigma0_squared"].mean()
    assert mean["slow"] < mean["white"] < 1.05
    said = tables.scatter_sentence(errors, scatter(errors))
    assert said.startswith("Over 12 flights")
    assert f"is {mean['slow']:.2f} on average" in said


def test_weights_that_know_the_correlation_keep_their_promise(errors):
    """The chi-square of 12 flights, 99 % two-sided, of what slow errors hurt most."""
    for name in ("boresight_kappa_deg", "boresight_phi_deg", "boresight_omega_deg", "lever_x_m"):
        own = errors[(errors["kind"] == MODELLED) & (errors["parameter"] == name)]
        assert 3.07 < np.sum((own["error"] / own["sigma"]) ** 2) < 28.3  # 12 degrees of freedom
    said = tables.modelled_sentence(errors, scatter(errors))
    low, high = ratios(errors, MODELLED, "boresight").min(), ratios(errors, MODELLED, "lever").max()
    assert f"is {low:.1f} to " in said
    assert f"to {high:.1f} (lever arm), and the variance" in said


def test_scatter_is_the_rms_of_errors_over_that_of_sigma(errors):
    own = errors[(errors["kind"] == "slow") & (errors["parameter"] == "f_mm")]
    row = scatter(errors).set_index(["kind", "parameter"]).loc["slow", "f_mm"]
    assert row["rms"] == pytest.approx(np.sqrt(np.mean(own["error"] ** 2)), rel=1e-12)
    assert row["ratio"] == pytest.approx(row["rms"] / np.sqrt(np.mean(own["sigma"] ** 2)), rel=1e-9)
    assert row["sigma_ratio"] == pytest.approx(row["ratio"] / np.sqrt(24), rel=1e-12)


def test_height_errors_are_those_of_the_same_flight(errors):
    table = height_errors(1)
    white, slow = (table[table["kind"] == kind]["error_m"] for kind in ("white", "slow"))
    assert len(white) == len(slow) == 52
    assert white.std() == pytest.approx(0.015, rel=0.35)  # the design's; 52 of them
    assert slow.diff().std() < 0.6 * white.diff().std()  # sqrt(1 - 0.95^2) and the drift
    figure = figures.trajectory_errors(table, scatter(errors))
    assert len(figure.axes) == 2


def test_the_library_undoes_the_simulators_refraction(refraction):
    """Two implementations: Snell's law by layers, and the integral of the density."""
    table = refraction.set_index("parameter")
    without, within = table["without_model"] / table["sigma"], table["with_model"] / table["sigma"]
    assert abs(without["f_mm"]) > 1
    assert abs(without["lever_z_m"]) > 0.8
    # refractive indices differ by 0.1 %, and so do K and what is left of it
    assert np.all(np.abs(within) < 0.003)
    assert f"{1000 * table['without_model']['f_mm']:+.1f} µm" in tables.refraction_sentence(
        refraction
    )
    shown = tables.refraction_table(refraction).set_index("Parameter")
    assert shown.loc["$f$ (mm)", "Error, left out (σ)"] == f"{without['f_mm']:+.3f}"
    assert shown.loc["boresight $\\kappa$ (°)", "Error, modelled (σ)"] == "0.000"


def test_noisier_heights_are_seen_in_f_and_lever_z():
    flown = fly("acx4-ideal", 1, acx4sim.Options(tie_points={"calibration": 150}))
    table = height_noise(flown, (0.005, 0.02, 0.08))
    for name in ("sigma_f_mm", "sigma_lever_z_m"):
        assert table[name].is_monotonic_increasing
    # as large as it is, the noise of 52 heights is what determines both
    assert table["sigma_lever_z_m"].iloc[2] > 2 * table["sigma_lever_z_m"].iloc[1]
    assert len(figures.height_noise(table).axes) == 2


def test_wrong_sigma_are_diagnosed_and_estimated():
    options = acx4sim.Options(tie_points={"calibration": 100})
    flown = fly("single-head", 1, options)
    found = wrong_sigma(flown, {"heading": 0.4}).set_index("group")
    assert found["true"]["heading"] == 2.5
    assert abs(found["factor"]["heading"] - 2.5) < 3.3 * 2.5 * found["sigma"]["heading"]
    assert found["estimated"]["heading"] == pytest.approx(found["factor"]["heading"], rel=0.05)
    assert np.isnan(found["factor"]["control height"])
    shown = tables.wrong_table(found.reset_index()).set_index("Observations")
    assert shown.loc["control height", "Diagnosis"] == tables.TOO_FEW
    assert shown.loc["control height", "Estimated"] == "as given"
