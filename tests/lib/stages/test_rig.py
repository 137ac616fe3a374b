"""The stage of the rig: what it leaves, and the order of its heads."""

from dataclasses import replace

import pytest

import acx4sim
from acx4lib import flight as flights
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
