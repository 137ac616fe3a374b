"""What a plan determines: closed forms, the adjustment itself, what no plan can tell."""

import numpy as np
import pytest

from acx4book.planning import design, tables
from acx4book.planning import plan as plans
from acx4lib.bundle.adjust import adjust
from acx4lib.calibration.estimates import from_bundle, parameters
from acx4lib.errors import AdjustmentError, FlightError
from support.flights.planned import strip, values

PERFECT = {
    "image_point_px": 1e-3,
    "gnss_horizontal_m": 0.02,
    "gnss_vertical_m": 0.03,
    "roll_pitch_deg": 1e-6,
    "heading_deg": 1e-6,
}
"""Nothing but GNSS has an error."""


def only(fix, **apriori):
    """Return sigma where one part of the mounting is the only unknown, by parameter."""
    plan = plans.from_values(
        values(
            apriori={**PERFECT, **apriori},
            control={"sigma_m": [1e-5, 1e-5, 1e-5]},
            stages={"mounting": {"estimate": [], "fix": [fix]}},
        )
    )
    mounting = design.of(plan).mountings["single_step"]
    n = len(mounting.bundle.network.pose_names)
    return {p.key: p.sigma for p in parameters(mounting.calibration)}, n


def test_a_lever_arm_alone_has_the_sigma_of_the_mean_of_all_positions():
    sigma, n = only("boresight")
    # the lever arm turns with the body, whose four courses mix east and north of equal sigma
    assert sigma["lever_x"] == pytest.approx(0.02 / np.sqrt(n), rel=0.01)
    assert sigma["lever_y"] == pytest.approx(0.02 / np.sqrt(n), rel=0.01)
    assert sigma["lever_z"] == pytest.approx(0.03 / np.sqrt(n), rel=0.01)


def test_a_boresight_alone_has_the_sigma_of_the_mean_of_all_attitudes():
    gnss = {"gnss_horizontal_m": 1e-5, "gnss_vertical_m": 1e-5}
    sigma, n = only("lever_arm", **gnss, roll_pitch_deg=0.01, heading_deg=0.02)
    for axis, expected in (("x", 0.01), ("y", 0.01), ("z", 0.02)):
        assert sigma[f"boresight_{axis}"] == pytest.approx(expected / np.sqrt(n), rel=0.01)


def test_the_covariance_is_that_of_an_adjustment_of_the_same_block():
    planned = design.of(plans.from_values(values())).mountings["single_step"]
    adjusted = adjust(planned.bundle.network)
    assert planned.bundle.solution.sigma0_sq == 1.0
    assert planned.calibration.sigma0_sq == 1.0
    cov = from_bundle(adjusted).cov
    np.testing.assert_allclose(planned.calibration.cov, cov, rtol=1e-4, atol=1e-20)
    # what it adjusts has no errors
    assert adjusted.solution.cost < 1e-6


def test_twice_all_sigma_are_twice_the_sigma_of_all_unknowns():
    apriori = {key: 2 * value for key, value in values()["apriori"].items()}
    control = {"sigma_m": [0.02, 0.02, 0.04]}
    one, two = (
        design.of(plans.from_values(plan)).mountings["single_step"].calibration
        for plan in (values(), values(apriori=apriori, control=control))
    )
    np.testing.assert_allclose(two.cov, 4 * one.cov, rtol=1e-6)


def test_one_strip_leaves_open_what_two_directions_determine():
    lonely = {"strips": {"s": strip("north")}, "tie_points": 100}
    found = design.of(plans.from_values(values(calibration=lonely, control={"number": [0, 0]})))
    said = tables.not_determined(found)
    assert any("lever_" in line for line in said)
    assert all(line.startswith("mounting/single_step: CAM ") for line in said)
    assert not tables.not_determined(design.of(plans.from_values(values())))


VALIDATION = {
    "check": {"number": [3, 3], "area_m": [600.0, 600.0], "sigma_px": 1.0},
    "strips": {"a": strip("north", 800.0, overlap=0.6), "b": strip("south", 800.0, overlap=0.6)},
}


def test_the_rms_of_check_points_falls_with_the_height_of_the_mapping_flight():
    low = {key: {**one, "flying_height_m": 500.0} for key, one in VALIDATION["strips"].items()}
    high, lower = (
        design.of(plans.from_values(values(validation={**VALIDATION, "strips": strips})))
        for strips in (VALIDATION["strips"], low)
    )
    tall, small = (
        tables.rms_table(found).set_index(["differences", "of"]) for found in (high, lower)
    )
    axes = [*tables.AXES]
    assert (small.loc["pairs"].loc["all", axes] < tall.loc["pairs"].loc["all", axes]).all()
    points = high.validations["single_step"].points
    assert np.abs(points.d).max() < 1e-6
    assert (tall.loc["points", "n"] == len(points)).all()
    squares = (points.sigma**2).mean(axis=0)
    by_source = tall.loc["points", axes] ** 2
    assert by_source.loc["all"].to_numpy(float) == pytest.approx(squares)
    assert by_source.drop("all").sum().to_numpy(float) == pytest.approx(squares)


def test_a_plan_that_shows_no_point_or_too_few_is_named():
    aside = {"layout": "at", "at_m": [[9000.0, 0.0]]}
    nothing = values(control=aside, calibration={"tie_points": 0})
    for table in ("number", "area_m"):
        del nothing["control"][table]
    with pytest.raises(FlightError, match="no image shows a point"):
        design.of(plans.from_values(nothing))
    sparse = {"s": strip("north", overlap=0.1)}
    with pytest.raises(FlightError, match=r"calibration\.tie_points: of 400, three images"):
        design.of(plans.from_values(values(calibration={"strips": sparse})))
    few = {"strips": {"s": {**strip("north"), "length_m": 0.0}}, "tie_points": 0}
    with pytest.raises(AdjustmentError, match="observations cannot determine"):
        design.of(plans.from_values(values(calibration=few, control={"number": [1, 1]})))


# --- What a plan determines on average over winds


N_WINDS = 6


def test_covariance_and_rms_are_the_means_of_those_of_all_winds():
    found = design.of(plans.from_values(values(validation=VALIDATION)), winds=N_WINDS)
    all_cov = found.covariances("single_step")
    assert len(all_cov) == N_WINDS
    assert np.ptp([np.sqrt(np.diag(cov)) for cov in all_cov], axis=0).min() > 0
    sigma = np.sqrt(np.mean([np.diag(cov) for cov in all_cov], axis=0))
    np.testing.assert_allclose(tables.parameter_table(found)["sigma"], sigma)
    one = tables.parameter_table(design.of(found.plan))
    np.testing.assert_allclose(one["sigma"], sigma, rtol=0.1)
    points = [wind.validations["single_step"].points for wind in found.winds]
    of_winds = [np.mean(one.sigma**2, axis=0) for one in points]
    rms = tables.rms_table(found).iloc[0]
    assert rms[[*tables.AXES]].to_numpy(float) == pytest.approx(np.sqrt(np.mean(of_winds, axis=0)))
