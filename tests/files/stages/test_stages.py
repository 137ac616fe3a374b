"""Stages one by one: heads, rig, the synthetic image and its pictures."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
import tifffile

import acx4sim
from acx4book.paper import errata
from acx4files import flight as flights
from acx4files.flight.reader import PLACE
from acx4files.results import folder as results
from acx4files.stages import Failed, attempt, heads, order, rig, synthetic
from acx4files.stages import pictures as taken
from acx4lib.block import select_images
from acx4lib.calibration.heads import Heads
from acx4lib.calibration.heads import relative_orientation as of_heads
from acx4lib.calibration.rig import relative_orientation
from acx4lib.errors import AdjustmentError, FlightError
from acx4lib.synthetic_image.frame import reduced_heads
from acx4lib.synthetic_image.rendering import render, render_plan
from acx4lib.tie_points.refinement import tie_differences
from support.flights import pictured
from support.flights.simulated import HEADS

# --- the stage of the heads: what it leaves, also where heads fail ---------------------------


def without_control(block):
    nothing = np.zeros(len(block.control), dtype=bool)
    return replace(block, control=block.control[nothing])


def test_the_stage_leaves_every_head_its_orientation_and_its_correlations(folder):
    found = results.read(folder)
    keys = {f"heads/bundle/{name}" for name in HEADS} | {"heads/relative_orientation"}
    assert set(found.summary) == keys
    assert results.cameras(found, "heads/relative_orientation") == HEADS
    run = errata.read_run(folder)
    largest = run.correlations
    assert {name.split()[0] for name in largest} == set(HEADS)
    assert all(0.1 < value <= 1 for value in largest.values())
    assert "Cannot be the maximum" in errata.audit(run)[10].verdict


def test_a_head_that_fails_leaves_the_orientation_out(flight, stage, tmp_path):
    kept = {name: fit for name, fit in stage.heads.bundles.items() if name != "CAM2"}
    failed = Heads(bundles=kept, failures={"CAM2": "too few"})
    heads.write(flight, tmp_path, failed, attempt(of_heads, failed, flight.synthetic_camera))
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["heads/bundle/CAM2"]["not_determined"] == ["heads/bundle/CAM2: too few"]
    assert summary["heads/bundle/CAM1"]["converged"] is True
    (reason,) = summary["heads/relative_orientation"]["left_out"]
    assert reason == "heads/relative_orientation: CAM2 could not be adjusted"
    with pytest.raises(AdjustmentError, match="CAM2 could not be adjusted"):
        synthetic.read_heads(flight, tmp_path)


def test_heads_without_control_points_are_told_so(flight):
    block = without_control(flight.heads)
    said = heads.calibrate(replace(flight, blocks={"heads": block})).heads
    assert set(said.failures) == set(HEADS)
    assert said.failures["CAM1"].startswith("0 control points in images do not orient the block")


@pytest.mark.parametrize("n", [0, 1, 2])
def test_heads_whose_block_has_tie_points_alone_are_taken_as_declared(flight, tmp_path, n):
    """So a flight that `acx4 measure` found tie points for goes on as it did before."""
    control = flight.heads.control
    tied = replace(flight.heads, control=control[np.arange(len(control)) < n])
    flight = replace(flight, blocks={**flight.blocks, "heads": tied})
    reason = order.missing(flight, "heads")
    assert reason.endswith("and three are needed; its heads are as flight.toml has them")
    assert reason.startswith(("no control points are", "1 control point is", "2 control points"))
    declared = synthetic.read_heads(flight, tmp_path)
    assert [head.interior for head in declared.heads] == [
        flight.cameras[name].interior for name in HEADS
    ]


def test_heads_of_which_nothing_is_estimated_go_all_the_way(flight, tmp_path):
    as_declared = replace(flight, estimate_heads=())
    heads.run(as_declared, tmp_path)
    read = synthetic.read_heads(as_declared, tmp_path)
    assert [head.interior.k1 for head in read.heads] == [0.0] * 4


# --- the stage of the rig: what it leaves, and the order of its heads ------------------------


@pytest.fixture(scope="module")
def rig_flight(tmp_path_factory):
    """The heads of a simulated flight, its truth beside it."""
    path = tmp_path_factory.mktemp("rig") / "flight"
    options = acx4sim.Options(blocks=("heads",), tie_points={"heads": 60})
    acx4sim.write(acx4sim.DESIGNS["acx4"](seed=3, options=options), path)
    return flights.read(path)


@pytest.fixture(scope="module")
def rig_stage(rig_flight):
    return rig.calibrate(rig_flight)


def test_the_rig_leaves_rows_in_every_table_beside_other_methods(tmp_path, rig_flight, rig_stage):
    results.replace(tmp_path, ["mounting"], tables={}, summary={"mounting/single_step": {}})
    rig.write(replace(rig_flight, path=PLACE), tmp_path, {"rig": rig_stage})
    found = results.read(tmp_path)
    assert set(found.summary) == {"mounting/single_step", "mounting/rig"}
    assert results.cameras(found, "mounting/rig") == ("CAM1", "CAM2", "CAM3", "CAM4")
    head = results.parameters(found, "mounting/rig", "CAM3")
    assert list(head.index[:3]) == ["f_mm", "xp_mm", "yp_mm"]
    assert len(head) == 12
    assert results.covariance(found, "mounting/rig").shape == (48, 48)
    images = results.rows(found, "exterior_orientation", "mounting/rig")
    assert len(images) == len(rig_stage.bundle.network.block.images)
    kinds = results.rows(found, "residuals", "mounting/rig")["kind"]
    assert set(kinds) == {"image_point", "control_point", "gnss", "attitude"}
    entry = found.summary["mounting/rig"]
    assert entry["converged"]
    assert entry["not_determined"] == entry["left_out"] == []


def test_heads_stand_in_the_order_of_the_synthetic_table(rig_flight, rig_stage):
    names = ("CAM4", "CAM2")
    some = replace(rig_flight, synthetic=replace(rig_flight.synthetic, heads=names))
    block = rig.calibrate(some).bundle.network.block
    assert tuple(camera.name for camera in block.cameras) == names
    assert len(block.images) == len(rig_stage.bundle.network.block.images) / 2


def test_two_blocks_of_the_same_pictures_have_one_rig(rig_flight):
    heads = rig_flight.blocks["heads"]
    synthetic = replace(rig_flight.synthetic, measured_in="heads")
    same = replace(rig_flight, synthetic=synthetic, blocks={"heads": heads, "calibration": heads})
    assert rig.methods(same) == ("rig",)
    other = replace(heads, image_points=heads.image_points[:-1])
    two = replace(same, blocks={"heads": heads, "calibration": other})
    assert rig.methods(two) == ("rig", "rig_calibration")
    assert rig.methods(rig_flight) == ("rig",)


# --- no rig, or a weak one -------------------------------------------------------------------


def with_block(flight, block):
    return replace(flight, blocks={"heads": block})


def left_by(flight, stage, folder):
    rig.write(replace(flight, path=PLACE), folder, {"rig": stage})
    return results.read(folder).summary["mounting/rig"]


def test_a_rig_that_is_not_determined_ends_no_run(rig_flight, tmp_path):
    """From one strip without control points, a lever arm is a shift of all tie points."""
    block = rig_flight.blocks["heads"]
    block = select_images(block, np.array(block.images.strips) == block.images.strips[0])
    points = block.image_points
    kept = ~np.isin(points.point_idx, block.control.point_idx)
    changed = with_block(rig_flight, replace(block, image_points=points[kept]))
    stage = rig.calibrate(changed)
    entry = left_by(changed, stage, tmp_path)
    assert any("lever" in line and "control points" in line for line in entry["left_out"])
    synthetic = rig_flight.synthetic_camera
    with pytest.raises(AdjustmentError, match=r"CAM1 .* is not determined.*; so are \d+ others"):
        relative_orientation(stage, synthetic)
    assert relative_orientation(stage, synthetic, weak=True).n_exposures > 0


def test_a_rig_that_cannot_be_adjusted_is_left_out_with_the_reason(rig_flight, rig_stage, tmp_path):
    failed = Failed(method="rig", reason="it does not converge", error=AdjustmentError())
    entry = left_by(rig_flight, failed, tmp_path)
    assert entry["left_out"] == ["mounting/rig: it does not converge"]
    assert not entry["converged"]


def test_a_flight_without_a_synthetic_image_has_a_rig_all_the_same(rig_flight):
    stage = rig.calibrate(replace(rig_flight, synthetic=None))
    with pytest.raises(AdjustmentError, match=r"flight.toml has no table \[synthetic\]"):
        relative_orientation(stage, None)


def test_points_of_one_exposure_only_are_said(rig_flight, tmp_path):
    """A tie point that two heads share loses its measurements at all other exposures."""
    block = rig_flight.blocks["heads"]
    points = block.image_points
    exposure = block.images.exposure_idx[points.image_idx]
    together = exposure * len(block.points) + points.point_idx
    tie = ~np.isin(points.point_idx, block.control.point_idx)
    row = np.flatnonzero(tie & (np.bincount(together)[together] == 2))[0]
    kept = (points.point_idx != points.point_idx[row]) | (exposure == exposure[row])
    changed = with_block(rig_flight, replace(block, image_points=points[kept]))
    stage = rig.calibrate(changed)
    entry = left_by(changed, stage, tmp_path)
    assert entry["notes"] == [
        "mounting/rig: 1 point is shared by heads at one exposure only, as high as the nearest"
    ]
    assert entry["n_left_out"] == 0


# --- the stage of the synthetic image: heads refined by tie points, or left as they are ------


@pytest.fixture(scope="module")
def refined(flight, folder, tmp_path_factory):
    copy = shutil.copytree(folder, tmp_path_factory.mktemp("refined") / "results")
    return synthetic.run(flight, copy), copy


@pytest.fixture(scope="module")
def refinement(refined):
    return refined[0]


def test_results_of_the_heads_are_asked_for(flight, tmp_path):
    with pytest.raises(FlightError, match="no results of stage heads; run first"):
        synthetic.read_heads(flight, tmp_path)


def test_the_refined_heads_are_written(refinement, refined):
    found = results.read(refined[1])
    assert results.cameras(found, "synthetic/refined") == HEADS
    said = found.summary["synthetic/refined"]
    assert said["n_unknowns"] == 9
    assert said["n_observations"] == 2 * (len(refinement.ties) - said["n_rejected"])
    assert 0.3 < said["sigma0_squared"] < 3
    (note,) = said["notes"]
    assert "beyond the noise of tie points" in note  # parallax of two flying heights


def test_without_tie_points_the_refinement_is_left_out(flight, folder, tmp_path):
    block = flight.blocks["heads"]
    rows = block.images.camera_idx[block.image_points.image_idx] == 0
    alone = replace(block, image_points=block.image_points[rows])
    bare = replace(flight, blocks={"heads": alone})
    copy = shutil.copytree(folder, tmp_path / "results")
    refinement = synthetic.run(bare, copy)
    entry = results.read(copy).summary["synthetic/refined"]
    (reason,) = results.messages(entry, "left_out")
    assert reason.startswith("synthetic/refined: ")
    assert list(refinement.orientations) == ["before"]


# --- pictures of a flight are read, averaged and searched for tie points ---------------------


K = pictured.REDUCTION


def test_pixels_can_be_averaged_first(scene_flight, scene_orientation, scene_pictures):
    half = taken.read_pictures(scene_flight, scene_orientation, reduce=2)
    assert half.reduction == 2 * K
    one, two = (read.exposed[0].images[0].astype(float) for read in (scene_pictures, half))
    rows, cols = two.shape[:2]
    top, left = (one.shape[0] - 2 * rows) // 2, (one.shape[1] - 2 * cols) // 2
    assert two[3, 5] == pytest.approx(
        one[top + 6 : top + 8, left + 10 : left + 12].mean(axis=(0, 1)), abs=0.5
    )


def test_the_middle_of_a_picture_is_the_middle_of_the_sensor(scene_orientation):
    head = scene_orientation.heads[0]
    reduced = np.array([[head.width_px // K - 1, head.height_px // K - 1]]) / 2
    full = taken.full_size(reduced, np.array([0]), scene_orientation, K)
    assert full[0] == pytest.approx([(head.width_px - 1) / 2, (head.height_px - 1) / 2], abs=1e-12)


def test_tie_points_are_where_both_heads_see_one_place(scene_ties, scene_orientation):
    """The orientation is exact; a tenth of a pixel of the reduced pictures is a poor match."""
    d = np.hypot(*tie_differences(scene_orientation, scene_ties.ties).T) / pictured.REDUCED.pixel_mm
    assert len(d) > 400  # of 432 cells
    assert np.quantile(d, 0.95) < 0.1
    assert set(scene_ties.ties.exposure_idx) == {0, 1}


def test_a_picture_turned_by_180_degrees_ties_nothing_which_is_said(
    scene_path, scene_orientation, tmp_path
):
    spoilt = shutil.copytree(scene_path, tmp_path / "flight")
    file = pictured.head_path(spoilt, "E1", "RIGHT")
    tifffile.imwrite(file, tifffile.imread(file)[::-1, ::-1], photometric="rgb")
    pictures = taken.read_pictures(flights.read(spoilt), scene_orientation)
    found = taken.find(pictures, scene_orientation)
    assert set(found.ties.exposure_idx) == {0}
    (warning,) = found.warnings
    assert warning.startswith("E1, LEFT and RIGHT: ")
    assert "exchanged, of different exposures or turned by 180 degrees" in warning


def test_grey_values_of_heads_agree_once_their_response_is_found(scene_pictures, scene_orientation):
    fit = taken.find_response(scene_pictures, scene_orientation, seed=1)
    assert all(np.max(one.after) < 0.01 for one in fit.overlaps)


@pytest.mark.parametrize("feather_px", [0.0, 150.0])
def test_the_image_that_is_rendered_of_pictures_is_the_scene(
    scene_pictures, scene_orientation, feather_px
):
    """Interpolated twice, cubic and bilinear: a few per cent of the scene's contrast."""
    plan = render_plan(
        reduced_heads(scene_orientation, scene_pictures.reduction),
        scene_pictures.synthetic,
        feather_px=feather_px / scene_pictures.reduction,
    )
    image = render(plan, scene_pictures.middle.images)
    scene = pictured.frame_of(pictured.scene(2))  # the middle one of two exposures is the second
    assert image.shape == scene.shape
    seen = (image > 0).all(axis=2)
    assert seen.mean() > 0.5
    left = image[seen].astype(float) - scene[seen]
    assert np.sqrt(np.mean(left**2)) < 0.15 * scene.std()
