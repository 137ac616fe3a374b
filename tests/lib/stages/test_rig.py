"""The stage of the rig: what it leaves, and the order of its heads."""

from dataclasses import replace

import numpy as np
import pytest

import acx4sim
from acx4lib import flight as flights
from acx4lib.calibration.rig import relative_orientation
from acx4lib.errors import AdjustmentError
from acx4lib.flight.block import select_images
from acx4lib.results import adjustments, folder
from acx4lib.stages import rig


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    """The heads of a simulated flight, its truth beside it."""
    path = tmp_path_factory.mktemp("rig") / "flight"
    options = acx4sim.Options(blocks=("heads",), tie_points={"heads": 60})
    acx4sim.write(acx4sim.DESIGNS["acx4"](seed=3, options=options), path)
    return flights.read(path)


@pytest.fixture(scope="module")
def stage(flight):
    return rig.calibrate(flight)


def test_the_rig_leaves_rows_in_every_table_beside_other_methods(tmp_path, stage):
    folder.replace(tmp_path, ["mounting"], tables={}, summary={"mounting/single_step": {}})
    adjustments.write(tmp_path, "mounting/rig", rig.records(stage))
    found = folder.read(tmp_path)
    assert set(found.summary) == {"mounting/single_step", "mounting/rig"}
    assert folder.cameras(found, "mounting/rig") == ("CAM1", "CAM2", "CAM3", "CAM4")
    head = folder.parameters(found, "mounting/rig", "CAM3")
    assert list(head.index[:3]) == ["f_mm", "xp_mm", "yp_mm"]
    assert len(head) == 12
    assert folder.covariance(found, "mounting/rig").shape == (48, 48)
    images = folder.rows(found, "exterior_orientation", "mounting/rig")
    assert len(images) == len(stage.block.images)
    kinds = folder.rows(found, "residuals", "mounting/rig")["kind"]
    assert set(kinds) == {"image_point", "control_point", "gnss", "attitude"}
    entry = found.summary["mounting/rig"]
    assert entry["converged"]
    assert entry["not_determined"] == entry["left_out"] == []


def test_heads_stand_in_the_order_of_the_synthetic_table(flight, stage):
    names = ("CAM4", "CAM2")
    some = replace(flight, synthetic=replace(flight.synthetic, heads=names))
    found = rig.calibrate(some)
    assert tuple(camera.name for camera in found.block.cameras) == names
    assert len(found.block.images) == len(stage.block.images) / 2


def test_two_blocks_of_the_same_pictures_have_one_rig(flight):
    heads = flight.blocks["heads"]
    synthetic = replace(flight.synthetic, measured_in="heads")
    same = replace(flight, synthetic=synthetic, blocks={"heads": heads, "calibration": heads})
    assert rig.methods(same) == ("rig",)
    other = replace(heads, image_points=heads.image_points[:-1])
    two = replace(same, blocks={"heads": heads, "calibration": other})
    assert rig.methods(two) == ("rig", "rig_calibration")
    assert rig.methods(flight) == ("rig",)


# --- no rig, or a weak one -------------------------------------------------------------------


def with_block(flight, block):
    return replace(flight, blocks={"heads": block})


def test_a_rig_that_is_not_determined_ends_no_run(flight):
    """From one strip without control points, a lever arm is a shift of all tie points."""
    block = flight.blocks["heads"]
    block = select_images(block, np.array(block.images.strips) == block.images.strips[0])
    points = block.image_points
    kept = ~np.isin(points.point_idx, block.control.point_idx)
    stage = rig.calibrate(with_block(flight, replace(block, image_points=points[kept])))
    entry = rig.records(stage)[0].summary["mounting/rig"]
    assert any("lever" in line and "control points" in line for line in entry["left_out"])
    synthetic = flight.synthetic_camera
    with pytest.raises(AdjustmentError, match=r"CAM1 .* is not determined.*; so are \d+ others"):
        relative_orientation(stage.rig, synthetic)
    assert relative_orientation(stage.rig, synthetic, weak=True).n_exposures > 0


def test_a_rig_that_cannot_be_adjusted_is_left_out_with_the_reason(stage):
    failed = replace(stage, rig=None, left_out="it does not converge")
    (record,) = rig.records(failed)
    entry = record.summary["mounting/rig"]
    assert entry["left_out"] == ["mounting/rig: it does not converge"]
    assert not entry["converged"]


def test_a_flight_without_a_synthetic_image_has_a_rig_all_the_same(flight):
    stage = rig.calibrate(replace(flight, synthetic=None))
    with pytest.raises(AdjustmentError, match=r"flight.toml has no table \[synthetic\]"):
        relative_orientation(stage.rig, None)


def test_points_of_one_exposure_only_are_said(flight):
    """A tie point that two heads share loses its measurements at all other exposures."""
    block = flight.blocks["heads"]
    points = block.image_points
    exposure = block.images.exposure_idx[points.image_idx]
    together = exposure * len(block.points) + points.point_idx
    tie = ~np.isin(points.point_idx, block.control.point_idx)
    row = np.flatnonzero(tie & (np.bincount(together)[together] == 2))[0]
    kept = (points.point_idx != points.point_idx[row]) | (exposure == exposure[row])
    stage = rig.calibrate(with_block(flight, replace(block, image_points=points[kept])))
    entry = rig.records(stage)[0].summary["mounting/rig"]
    assert entry["notes"] == [
        "mounting/rig: 1 point is shared by heads at one exposure only, as high as the nearest"
    ]
    assert entry["n_left_out"] == 0
