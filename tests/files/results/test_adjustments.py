"""What stands in a results folder is what was computed, and can be read back."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from acx4files import flight as flights
from acx4files.results import folder as results
from acx4files.results import read_back, tables
from acx4files.results.read_back import mounted_block
from acx4files.results.tables import of_transferred
from acx4files.stages import diagnosed
from acx4lib.block import select_images
from acx4lib.calibration import estimates, mounting
from acx4lib.calibration import heads as calibration_heads
from acx4lib.errors import FlightError
from acx4lib.georeferencing import validation
from acx4lib.model import Model
from acx4lib.synthetic_image.transferred_points import synthetic_block, transfer
from support.flights import in_heads, pictured, simulated
from support.run_results import put

MODEL = Model(free=("f", "xp", "yp", "k1", "k2", "k3", "p1", "p2"))


@pytest.fixture(scope="module")
def flown():
    return simulated.fly("single-head", seed=1).flight


@pytest.fixture(scope="module")
def mountings(flown):
    return mounting.calibrate(flown.calibration, MODEL)


@pytest.fixture(scope="module")
def folder(tmp_path_factory, flown, mountings):
    path = tmp_path_factory.mktemp("results")
    put(path, "mounting", diagnosed.of_mountings(mountings))
    found = results.read(path)
    validations = [
        validation.validate(flown.validation, said, method=method)
        for method, said in read_back.calibrations_for(
            flown, found, flown.validation.cameras
        ).items()
    ]
    put(path, "validation", diagnosed.of_validations(validations))
    return path


@pytest.mark.parametrize("method", estimates.METHODS)
def test_a_calibration_comes_back_from_its_files_as_it_was(flown, mountings, folder, method):
    said = mountings[method].calibration
    back = read_back.read_calibration(
        results.read(folder), f"mounting/{method}", flown.calibration.cameras
    )
    (a,), (b,) = said.cameras, back.cameras
    assert_allclose(b.interior.to_array(), a.interior.to_array(), rtol=1e-14)
    assert_allclose(b.T_b_c.R, a.T_b_c.R, atol=1e-14)  # rad
    assert_allclose(b.T_b_c.r, a.T_b_c.r, atol=1e-15)  # m
    assert_allclose(back.cov, said.cov, rtol=1e-9)
    assert_allclose(estimates.reported_covariance(back), estimates.reported_covariance(said))


def test_sigma_in_parameters_is_the_root_of_the_covariance(folder):
    found = results.read(folder)
    for method in estimates.METHODS:
        cov = results.covariance(found, f"mounting/{method}")
        listed = results.rows(found, "parameters", f"mounting/{method}")
        names = listed["camera"] + "/" + listed["parameter"]
        sigma = np.sqrt(np.diag(cov.loc[names, names]))
        assert_allclose(listed["sigma"], sigma, rtol=1e-12)


def test_every_residual_stands_in_the_table_and_sums_up_to_the_cost(mountings, folder):
    found = results.read(folder)
    for method in estimates.METHODS:
        rows = results.rows(found, "residuals", f"mounting/{method}")
        solution = mountings[method].bundle.solution
        assert len(rows) == solution.n_observations
        assert_allclose(np.sum((rows["v"] / rows["sigma"]) ** 2), solution.cost, rtol=1e-10)
        assert_allclose(rows["redundancy"].sum(), solution.redundancy, rtol=1e-8)
        # Baarda's w is v over its own standard deviation
        w = rows["v"] / (rows["sigma"] * np.sqrt(rows["redundancy"]))
        assert_allclose(rows["w"], w, rtol=1e-9)


def test_the_summary_of_a_validation_counts_the_rows_of_its_tables(folder):
    found = results.read(folder)
    for method in estimates.METHODS:
        entry = found.summary[f"validation/{method}"]
        pairs = results.rows(found, "validation", f"validation/{method}")
        points = results.rows(found, "check_points", f"validation/{method}")
        assert entry["n_pairs"] == len(pairs)
        assert entry["n_points"] == len(points)
        d = pairs[["d_east_m", "d_north_m", "d_height_m"]]
        assert_allclose(entry["rms"], np.sqrt((d**2).mean()), rtol=1e-12)
        assert_allclose(entry["std"], d.std(ddof=1), rtol=1e-12)
        assert 0.5 < entry["sigma0_squared"] < 1.7  # chi-square of some eighty observations


def test_a_flight_without_calibration_block_is_validated_as_given(flown, tmp_path):
    without = read_back.calibrations_for(
        replace(flown, blocks={"validation": flown.validation}),
        results.read(tmp_path),
        flown.validation.cameras,
    )
    assert list(without) == ["given"]
    assert without["given"].n_columns == 0
    checked = validation.validate(flown.validation, without["given"], method="given")
    # a nominal calibration is metres off, and its sigma has no part of the parameters
    assert np.sqrt(np.mean(checked.points.d**2)) > 3 * np.sqrt(np.mean(checked.points.sigma**2))


def test_a_wrong_focal_length_is_seen_as_a_scale_of_control_against_trajectory(flown):
    block = flown.calibration
    camera = block.cameras[0]
    wrong = camera.with_interior(replace(camera.interior, f=1.03 * camera.interior.f))
    spoilt = replace(block, cameras=(wrong,))
    (record,) = diagnosed.of_mountings(
        mounting.Mountings(
            methods={"two_step": mounting.two_step(spoilt, Model(free=("xp", "yp")))}, failures={}
        )
    )
    note = record.summary["mounting/two_step"]["notes"][-1]
    percent = re.search(r"trajectory differ by (\S+) % in scale: the height system", note)[1]
    assert 1 + float(percent) / 100 == pytest.approx(1.03 * 50 / 50.128, abs=0.005)


def test_a_scale_that_the_focal_length_may_have_by_chance_is_not_said(flown):
    """Twelve images with errors of 20 px and 5 m tell the focal length to 2.3 %."""
    rng = np.random.default_rng(1)
    block = select_images(flown.calibration, np.arange(len(flown.calibration.images)) < 12)
    points, flight = block.image_points, block.trajectory
    off_px, off_m = rng.normal(0, 20, points.colrow.shape), rng.normal(0, 5, flight.T_m_b.r.shape)
    loose = replace(
        block,
        image_points=replace(
            points, colrow=points.colrow + off_px, sigma_px=np.full(len(off_px), 20.0)
        ),
        trajectory=replace(
            flight,
            T_m_b=replace(flight.T_m_b, r=flight.T_m_b.r + off_m),
            sigma_position=np.full_like(off_m, 5.0),
        ),
    )
    record = diagnosed.of_mounting(mounting.single_step(loose, Model(free=("f",))))
    entry = record.summary["mounting/single_step"]
    assert abs(entry["height_scale_error"]) > 0.01
    assert entry["height_scale_sigma"] == pytest.approx(0.023, abs=0.002)
    assert not [note for note in entry["notes"] if "in scale" in note]


def test_heads_come_back_from_their_files_as_they_were(tmp_path):
    flown = simulated.fly("acx4", seed=1, blocks=("heads",)).flight
    heads = calibration_heads.calibrate_heads(
        flown.heads, flown.synthetic.heads, Model(free=flown.estimate_heads)
    )
    said = calibration_heads.relative_orientation(heads, flown.cameras["SYN"])
    bundles = [diagnosed.of_head(name, fit) for name, fit in heads.bundles.items()]
    oriented = tables.of_relative_orientation("heads/relative_orientation", said)
    put(tmp_path, "heads", [*bundles, oriented])
    back = read_back.read_relative_orientation(
        results.read(tmp_path), "heads/relative_orientation", flown.cameras
    )
    assert_allclose(back.xyz_mm, said.xyz_mm, atol=1e-12)
    assert_allclose(back.opk, said.opk, atol=1e-14)
    assert_allclose(back.cov, said.cov, atol=1e-18)
    assert back.n_exposures == said.n_exposures == 31
    for a, b in zip(said.heads, back.heads, strict=True):
        assert_allclose(b.interior.to_array(), a.interior.to_array(), rtol=1e-14)


def test_every_object_of_the_summary_has_the_same_keys(tmp_path, folder):
    put(tmp_path, "heads", [tables.not_adjusted("heads/relative_orientation", "no")])
    left_out = results.read(tmp_path).summary["heads/relative_orientation"]
    assert left_out["n_observations"] is None
    for entry in results.read(folder).summary.values():
        assert tables.NO_ADJUSTMENT.keys() < entry.keys()


def test_the_summary_judges_the_sigma_of_every_group_and_says_which_are_wrong(flown):
    block = mounting.scaled(flown.calibration, {"heading": 0.25})
    record = diagnosed.of_mounting(mounting.single_step(block, MODEL))
    entry = json.loads(json.dumps(record.summary["mounting/single_step"]))
    heading = entry["sigma_factors"]["heading"]
    assert heading["factor"] == pytest.approx(4, abs=3.3 * 4 * heading["sigma"])
    assert heading["applied"] == 1
    assert entry["sigma_factors"]["control height"]["factor"] is None
    said = f"the sigma of heading are {heading['factor']:.1f} times too optimistic"
    assert entry["notes"] == [f"mounting/single_step: {said}"]


def test_the_summary_says_by_what_sigma_were_multiplied(flown):
    applied = {"GNSS": 1.5}
    block = mounting.scaled(flown.calibration, applied)
    record = diagnosed.of_mounting(mounting.single_step(block, MODEL), applied=applied)
    entry = record.summary["mounting/single_step"]
    assert entry["sigma_factors"]["GNSS"]["applied"] == 1.5
    assert "the sigma were multiplied by 1.50 ± " in entry["notes"][0]
    assert entry["notes"][0].endswith("(GNSS)")


def test_one_of_two_calibrated_cameras_can_be_validated(flown, tmp_path):
    block = flown.calibration
    (camera,) = block.cameras
    turns = np.arange(len(block.images)) % 2
    images = replace(block.images, camera_idx=turns)
    both = replace(block, cameras=(replace(camera, name="A/B"), camera), images=images)
    said = mounting.single_step(both, MODEL)
    put(tmp_path, "mounting", [diagnosed.of_mounting(said)])
    found = results.read(tmp_path)
    back = read_back.read_calibration(found, "mounting/single_step", block.cameras)
    assert back.n_columns == said.calibration.n_columns // 2 == 14
    sigma = results.parameters(found, "mounting/single_step", "CAM")["sigma"]
    reported = estimates.reported_covariance(back)
    assert_allclose(np.sort(np.sqrt(np.diag(reported))), np.sort(sigma), rtol=1e-9)


def test_a_calibration_of_nothing_is_validated_with_what_is_held(flown, mountings, tmp_path):
    known = replace(flown.calibration, cameras=mountings["single_step"].calibration.cameras)
    held = mounting.single_step(known, Model(fix=("lever_arm", "boresight")))
    put(tmp_path, "mounting", [diagnosed.of_mounting(held)])
    (method,) = read_back.calibrated_methods(results.read(tmp_path))
    back = read_back.read_calibration(results.read(tmp_path), f"mounting/{method}", known.cameras)
    assert back.n_columns == 0
    assert back.cameras[0].interior == known.cameras[0].interior


def test_a_calibration_that_contradicts_its_data_is_written_but_not_validated(flown, tmp_path):
    """Held at approximate values, the camera leaves control points decimetres off."""
    held = mounting.single_step(flown.calibration, Model(fix=("lever_arm", "boresight")))
    put(tmp_path, "mounting", [diagnosed.of_mounting(held)])
    found = results.read(tmp_path)
    assert read_back.calibrated_methods(found) == ()
    entry = found.summary["mounting/single_step"]
    ((group, n_rejected, n),) = entry["stopped_groups"]
    assert group.startswith("control points")
    assert n_rejected > n / 10
    (line,) = entry["stopped"]
    assert line.startswith(f"mounting/single_step: data snooping would reject {n_rejected} of {n}")
    assert entry["not_determined"] == []
    assert entry["expected_rejections"] == pytest.approx(0.73, abs=0.1)  # of 3725 rays and 300 more


def test_a_validation_says_what_spoils_all_of_its_points(flown):
    """45 m is the undulation there: the check points orthometric, the trajectory ellipsoidal."""
    block = flown.validation
    said = estimates.given(block.cameras)
    checked = validation.validate(block, said, method="given")
    (record,) = diagnosed.of_validations([checked])
    entry = record.summary["validation/given"]
    assert entry["stopped_groups"] == [["rays of camera CAM", 24, 75]]
    assert entry["n_rejected"] == 0
    check = block.check
    lower = replace(block, check=replace(check, x_m=check.x_m - [0.0, 0.0, 45.0]))
    checked = validation.validate(lower, said, method="given")
    (record,) = diagnosed.of_validations([checked])
    (note,) = record.summary["validation/given"]["notes"]
    assert " m too high, " in note
    assert note.endswith("points or trajectory, or the focal length, is wrong")


def test_a_validation_says_how_many_measurements_chance_rejects(flown):
    """Two components of every ray of points in three images or more, at 0.0096 % each."""
    found = mounting.single_step(flown.calibration, MODEL)
    checked = validation.validate(flown.validation, found.calibration, method="single_step")
    (record,) = diagnosed.of_validations([checked])
    (entry,) = record.summary.values()
    n = sum(int(n) for n in checked.points.n_images if n >= 3)
    assert n > 0
    assert entry["expected_rejections"] == pytest.approx(2 * n * 9.62e-5, rel=1e-3)


# --- Points transferred into synthetic images: written, read back, and refused where they are stale


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    return flights.read(in_heads.write(tmp_path_factory.mktemp("in_heads") / "flight"))


@pytest.fixture(scope="module")
def transferred(flight):
    orientation, camera = pictured.orientation(), flight.synthetic_camera
    return {name: transfer(flight.block(name), orientation, camera) for name in flight.transferred}


@pytest.fixture(scope="module")
def kept(tmp_path_factory, flight, transferred):
    path = tmp_path_factory.mktemp("results")
    put(path, "synthetic", [of_transferred(flight, transferred)])
    return path


def test_both_blocks_come_back_as_they_were_transferred(flight, transferred, kept):
    assert flight.transferred == ("calibration", "validation") == tuple(transferred)
    for name, points in transferred.items():
        block = mounted_block(flight, name, results.read(kept))
        expected = synthetic_block(flight.block(name), points, flight.synthetic_camera)
        assert block.images.names == expected.images.names
        assert [camera.name for camera in block.cameras] == ["CAM"]
        for field in ("image_idx", "point_idx", "colrow", "sigma_px"):
            assert_array_equal(
                getattr(block.image_points, field), getattr(expected.image_points, field)
            )
        assert len(block.image_points) == len(points) > 40


def test_a_block_measured_in_synthetic_images_is_taken_as_it_is(flight, tmp_path):
    plain = replace(flight, synthetic=replace(flight.synthetic, measured_in="synthetic"))
    assert plain.transferred == ()
    assert mounted_block(plain, "calibration", results.read(tmp_path)) is flight.calibration


def test_without_transferred_points_the_stage_to_run_is_named(flight, tmp_path):
    with pytest.raises(FlightError, match=r"no results of synthetic/points; run stage synthetic"):
        mounted_block(flight, "calibration", results.read(tmp_path))


def test_points_of_other_measurements_are_refused(flight, kept):
    another = {**flight.sha256, "calibration/image_points.csv": "another"}
    changed = replace(flight, sha256=another)
    with pytest.raises(FlightError) as error:
        mounted_block(changed, "calibration", results.read(kept))
    assert error.value.problems == (
        f"{kept}: block calibration is not the one whose points were transferred into the "
        "synthetic image; run stage synthetic again",
    )


# --- held values, and those known from a laboratory ------------------------------------------


def test_what_the_data_say_of_held_values_comes_back(flown, mountings, folder):
    """A focal length off by 0.4 mm costs most, and moves the lever arm's z and the ground."""
    assert "held_effect_m" not in results.read(folder).summary["mounting/single_step"]
    (camera,) = flown.calibration.cameras
    f = mountings["single_step"].calibration.cameras[0].interior.f
    wrong = camera.with_interior(replace(camera.interior, f=f + 0.4))
    block = replace(flown.calibration, cameras=(wrong,))
    said = mounting.single_step(block, Model(free=MODEL.free[1:]))
    put(folder.parent / "wrong", "mounting", [diagnosed.of_mounting(said)])
    entry = results.read(folder.parent / "wrong").summary["mounting/single_step"]
    found = entry["held"]["CAM/f_mm"]
    assert found["value"] == f + 0.4
    assert abs(found["estimate"] - f) < 0.1 * found["sigma"]
    assert entry["held_rejected"][0] == "CAM/f_mm"
    assert max(abs(m) for m in found["moves"].values()) == abs(found["moves"]["CAM/lever_z_m"])
    assert entry["held"]["gnss_shift_height_m"]["value"] == 0.0
    assert entry["held_p"] < 1e-6
    assert entry["held_effect_m"][2] > 1.0
    assert entry["held_effect_sigma"][2] > 10.0


def test_a_known_focal_length_is_a_residual_of_its_camera(flown, tmp_path):
    (camera,) = flown.calibration.cameras
    known = replace(camera, prior=replace(camera.prior, interior=(0.01, np.inf, np.inf)))
    said = mounting.single_step(replace(flown.calibration, cameras=(known,)), MODEL)
    put(tmp_path, "mounting", [diagnosed.of_mounting(said)])
    rows = results.read(tmp_path).residuals
    (row,) = rows[rows["kind"] == "interior"].to_dict("records")
    assert (row["image_or_exposure"], row["component"]) == (camera.name, "f_mm")
    f = said.calibration.cameras[0].interior.f
    assert_allclose([row["v"], row["sigma"]], [f - camera.interior.f, 0.01], rtol=1e-9)
