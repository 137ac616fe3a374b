"""Points carried into synthetic images: written, read back, and refused where they are stale."""

import json
import shutil
from dataclasses import replace

import pytest
from numpy.testing import assert_array_equal

from acx4lib import flight as flights
from acx4lib.errors import FlightError
from acx4lib.results import adjustments, folder
from acx4lib.results.carried import METHOD, mounted_block, of_carried
from acx4lib.synthetic_image.carried import carry, synthetic_block
from support.flights import in_heads, pictured


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    return flights.read(in_heads.write(tmp_path_factory.mktemp("in_heads") / "flight"))


@pytest.fixture(scope="module")
def carried(flight):
    orientation, camera = pictured.orientation(), flight.synthetic_camera
    return {name: carry(flight.block(name), orientation, camera) for name in flight.carried}


@pytest.fixture(scope="module")
def kept(tmp_path_factory, flight, carried):
    path = tmp_path_factory.mktemp("results")
    adjustments.write(path, "synthetic", [of_carried(flight, carried)])
    return path


def test_both_blocks_come_back_as_they_were_carried(flight, carried, kept):
    assert flight.carried == ("calibration", "validation") == tuple(carried)
    for name, points in carried.items():
        block = mounted_block(flight, name, folder.read(kept))
        expected = synthetic_block(flight.block(name), points, flight.synthetic_camera)
        assert block.images.names == expected.images.names
        assert [camera.name for camera in block.cameras] == ["CAM"]
        for field in ("image_idx", "point_idx", "colrow", "sigma_px"):
            assert_array_equal(
                getattr(block.image_points, field), getattr(expected.image_points, field)
            )
        assert len(block.image_points) == len(points) > 40


def test_the_table_has_a_row_for_every_image_and_point(flight, carried, kept):
    table = folder.rows(folder.read(kept), "synthetic_points", METHOD)
    assert list(table) == [
        *("block", "image", "point", "head"),
        *("col_px", "row_px", "sigma_col_px", "sigma_row_px"),
    ]
    assert len(table) == sum(map(len, carried.values()))
    assert not table.duplicated(["block", "image", "point"]).any()
    assert set(table["head"]) == {"LEFT", "RIGHT"}
    assert set(table["image"]) == set(flight.calibration.trajectory.exposures)
    entry = folder.read(kept).summary[METHOD]
    assert entry["n_left_out"] == sum(points.n_left_out for points in carried.values())


def test_a_block_measured_in_synthetic_images_is_taken_as_it_is(flight, tmp_path):
    plain = replace(flight, synthetic=replace(flight.synthetic, measured_in="synthetic"))
    assert plain.carried == ()
    assert mounted_block(plain, "calibration", folder.read(tmp_path)) is flight.calibration


def test_without_carried_points_the_stage_to_run_is_named(flight, tmp_path):
    with pytest.raises(FlightError, match=r"no results of synthetic/points; run stage synthetic"):
        mounted_block(flight, "calibration", folder.read(tmp_path))


@pytest.mark.parametrize("change", ["measured again", "table edited"])
def test_points_of_other_measurements_are_refused(flight, kept, tmp_path, change):
    copy = shutil.copytree(kept, tmp_path / "results")
    if change == "measured again":
        changed = replace(
            flight, sha256={**flight.sha256, "calibration/image_points.csv": "another"}
        )
    else:
        changed = flight
        table = copy / "synthetic_points.csv"
        table.write_text(table.read_text().replace("calibration,E0,", "calibration,E99,"))
    with pytest.raises(FlightError) as error:
        mounted_block(changed, "calibration", folder.read(copy))
    assert error.value.problems == (
        f"{copy}: block calibration is not the one whose points were carried into the synthetic "
        "image; run stage synthetic again",
    )


def test_a_results_folder_without_the_table_is_read_as_empty(kept, tmp_path):
    copy = shutil.copytree(kept, tmp_path / "results")
    (copy / "synthetic_points.csv").unlink()
    assert folder.read(copy).synthetic_points.empty
    summary = json.loads((copy / "summary.json").read_text())
    assert METHOD in summary
