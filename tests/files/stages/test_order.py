"""The stages one after the other on a flight, without notebooks and without the book."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import acx4sim
from acx4files import flight as flights
from acx4files.results import folder, read_back
from acx4files.results.read_back import mounted_block
from acx4files.stages import heads, mounting, order, rig, synthetic, validation
from acx4lib.block import select_cameras
from acx4lib.calibration.estimates import reported_covariance
from acx4lib.errors import FlightError
from acx4lib.georeferencing.validation import validate
from support.flights import in_heads
from support.flights.simulated import HEADS


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    path = tmp_path_factory.mktemp("alone") / "flight"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1), path)
    return path


@pytest.fixture(scope="module")
def flight(path):
    return flights.read(path)


def test_results_of_the_mounting_are_what_the_validation_takes(flight, tmp_path):
    calibrated = mounting.run(flight, tmp_path)
    checked = validation.run(flight, tmp_path)
    assert set(checked) == set(calibrated.methods)
    keys = {f"{stage}/{m}" for stage in ("mounting", "validation") for m in checked}
    assert set(folder.read(tmp_path).summary) == keys


def test_a_validation_without_a_calibration_says_what_to_run(flight, tmp_path):
    with pytest.raises(FlightError, match="no results of stage mounting; run first"):
        validation.run(flight, tmp_path)


def test_what_a_flight_does_not_have_is_said(flight):
    reasons = {stage: order.missing(flight, stage) for stage in ("heads", "mounting", "rig")}
    assert reasons == {
        "heads": "the flight has no block heads",
        "mounting": "",
        "rig": order.NO_RIG,
    }
    assert order.missing(flight, "validation") == ""


def test_a_validation_without_check_points_runs_for_what_its_calibration_predicts(flight):
    block = flight.validation
    none = replace(block, check=block.check[:0])
    assert order.missing(replace(flight, blocks={"validation": none}), "validation") == ""
    alone = replace(none, image_points=none.image_points[:0])
    reason = order.missing(replace(flight, blocks={"validation": alone}), "validation")
    assert reason.startswith("nothing is measured")


# --- a flight that is measured in its heads ----------------------------------------------------


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    path = tmp_path_factory.mktemp("in_heads") / "flight"
    acx4sim.write(in_heads.small(), path)
    return flights.read(path)


@pytest.fixture(scope="module")
def gone_through(flown, tmp_path_factory):
    """Return the results of all stages, and what mounting and validation return."""
    results = tmp_path_factory.mktemp("through")
    for stage in (heads, synthetic):
        stage.run(flown, results)
    calibrated = mounting.run(flown, results)
    rig.run(flown, results)
    return results, calibrated, validation.run(flown, results)


def test_a_flight_measured_in_heads_goes_on_with_its_synthetic_camera(flown, gone_through):
    results, calibrated, _ = gone_through
    block = calibrated["single_step"].bundle.network.block
    assert [camera.name for camera in block.cameras] == ["SYN"]
    assert block.images.names == flown.calibration.trajectory.exposures
    found = folder.read(results)
    assert folder.cameras(found, "mounting/single_step") == ("SYN",)
    assert set(calibrated.methods) == {"two_step", "two_step_gnss", "single_step"}
    residuals = folder.rows(found, "residuals", "mounting/single_step")
    of_points = residuals[residuals["kind"] == "image_point"]
    assert set(of_points["image_or_exposure"]) <= set(block.images.names)
    assert of_points["sigma"].nunique() > 100  # transferred, each by the map where it lies


def test_what_errors_of_the_heads_add_is_in_every_sigma_and_stands_beside_it(gone_through):
    results, calibrated, _ = gone_through
    found = folder.read(results)
    for method, outcome in calibrated.methods.items():
        rows = folder.rows(found, "parameters", f"mounting/{method}")
        own = reported_covariance(replace(outcome.calibration, cov_before=None))
        total = np.diag(folder.covariance(found, f"mounting/{method}"))
        assert_allclose(rows["sigma"] ** 2, np.diag(own) + rows["sigma_before"] ** 2)
        assert_allclose(total, rows["sigma"] ** 2)
        added = rows["sigma_before"] / np.sqrt(np.diag(own))
        assert np.all(added > 0)
        # heads that were calibrated with as many points are as good as the camera made of them
        assert 0.1 < np.median(added) < 10
    for method in ("heads/bundle", "mounting/rig"):
        assert not folder.rows(found, "parameters", method)["sigma_before"].any()


def test_the_validation_takes_the_total(flown, gone_through):
    results, calibrated, checked = gone_through
    block = mounted_block(flown, "validation", folder.read(results))
    for name in calibrated.methods:
        one, calibration = checked[name], calibrated[name].calibration
        with_heads = validate(block, calibration, method=one.method).points
        alone = validate(block, replace(calibration, cov_before=None), method=one.method).points
        assert_allclose(one.points.sigma, with_heads.sigma, rtol=1e-6)
        assert np.all(with_heads.sigma > alone.sigma)


def test_measurements_of_heads_are_not_calibrated_as_if_they_were_of_one_camera(flown):
    with pytest.raises(ValueError, match="block calibration is measured in heads"):
        mounting.calibrate(flown)


def test_the_rig_of_the_calibration_block_stands_beside_that_of_the_heads(gone_through):
    found = folder.read(gone_through[0])
    for method in ("mounting/rig", "mounting/rig_calibration"):
        assert folder.cameras(found, method) == HEADS
        assert found.summary[method]["left_out"] == []
    images = folder.rows(found, "exterior_orientation", "mounting/rig_calibration")["image"]
    assert set(images.str[0]) == {"C"}


def test_both_rigs_are_validated_in_the_images_of_the_heads(flown, gone_through):
    results, _, checked = gone_through
    methods = ["two_step", "two_step_gnss", "single_step", "rig", "rig_calibration"]
    assert [*checked] == methods
    found = folder.read(results)
    assert set(found.validation["method"]) == set(methods)
    exposure = dict(
        zip(flown.validation.images.names, flown.validation.images.exposure_idx, strict=True)
    )
    for one in (checked["rig"], checked["rig_calibration"]):
        pairs = found.validation[found.validation["method"] == one.method]
        a, b = pairs["image_a"].map(exposure), pairs["image_b"].map(exposure)
        assert (a != b).all()  # two heads of one exposure have no base
        assert one.n_failed > 0
        normalised = one.points.d / one.points.sigma
        # one flight, and points that share its parameters: no more than a coarse bound
        assert 0.5 < normalised.std() < 1.6


def test_without_one_of_its_heads_a_rig_is_not_validated(flown, gone_through):
    results = folder.read(gone_through[0])
    rows = results.parameters
    kept = (rows["method"] != "rig_calibration") | (rows["camera"] != "CAM3")
    fewer = replace(results, parameters=rows[kept])
    assert set(read_back.rigs_for(fewer, flown.validation.cameras)) == {"rig"}
    some = select_cameras(flown.validation, ["CAM1", "CAM2"])
    assert set(read_back.rigs_for(fewer, some.cameras)) == {"rig", "rig_calibration"}


def test_points_are_carried_before_the_mounting_is_calibrated(flown, tmp_path):
    with pytest.raises(FlightError, match="no results of stage synthetic; run first"):
        mounting.run(flown, tmp_path)
    assert not order.is_end(flown, "synthetic")


def test_without_the_heads_block_there_is_nothing_to_carry_by(flown, flight):
    bare = replace(flown, blocks={k: v for k, v in flown.blocks.items() if k != "heads"})
    for stage in ("mounting", "validation"):
        assert "is measured in heads" in order.missing(bare, stage)
        assert order.missing(flown, stage) == ""
    assert order.is_end(flight, "synthetic")
