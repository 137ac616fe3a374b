"""Models of COLMAP become flights; the scene, COLMAP's own code and its points prove it."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.reference import data
from acx4files.exchange.programs import colmap as reading
from acx4files.flight.settings import camera_of
from acx4lib.errors import FlightError
from acx4lib.geometry.frames import rotation_from_opk
from support.helpers import needs
from support.projects import colmap, scene


def rms(brought):
    """Return the rms that the proof says, px."""
    said = next(one for one in brought.found if one.startswith("COLMAP's own points"))
    return float(re.search(r"to ([\d.e-]+) px rms", said)[1])


def test_a_model_becomes_a_part_of_a_flight(tmp_path):
    brought = reading.read(colmap.write_text(tmp_path / "m"))
    assert rms(brought) < 0.02  # what the refit of the lens leaves
    images = brought.tables["heads/images.csv"]
    assert images["image"][:3] == ["cam0/one.jpg", "cam1/one.jpg", "cam0/two.jpg"]
    assert images["camera"][:2] == ["camera 1", "camera 2"]
    assert images["exposure"][:3] == ["cam0/one.jpg", "cam0/one.jpg", "cam0/two.jpg"]
    points = brought.tables["heads/image_points.csv"]
    assert len(points["point"]) == 8 * 9
    first = next(colmap.rows())[-1][0]
    assert_allclose([points["col_px"][0], points["row_px"][0]], first - 0.5, atol=1e-4)
    assert "8 measurements that belong to no point" in brought.left_out
    assert "heads/trajectory.csv" not in brought.tables


def test_text_and_binary_files_say_the_same(tmp_path):
    text = reading.read(colmap.write_text(tmp_path / "m"))
    binary = reading.read(colmap.write_binary(tmp_path / "b" / "m"))
    assert binary.tables == text.tables
    assert binary.settings == text.settings
    assert binary.found == text.found


def test_a_rig_has_its_mountings_and_with_a_crs_its_lever_arms(tmp_path):
    folder = colmap.write_text(tmp_path / "m")
    flip = np.diag([1.0, -1.0, -1.0])
    for crs, lever in ((None, np.zeros(3)), (scene.CRS, flip @ colmap.BASE)):
        brought = reading.read(folder, crs=crs)
        table = brought.settings["cameras"]["camera 2"]
        mount = camera_of("c", table).T_b_c
        assert_allclose(mount.R, flip @ scene.SLAVE @ flip, atol=1e-10)
        assert_allclose(mount.r, lever, atol=1e-9)
    assert any("1 lever arms" in one for one in reading.read(folder).left_out)


def test_adjusted_orientations_are_those_of_the_model(tmp_path):
    folder = colmap.write_text(tmp_path / "m")
    brought = reading.read(folder, crs=scene.CRS, orientations="adjusted")
    table = brought.tables["heads/trajectory.csv"]
    assert table["exposure"] == [f"cam0/{name}" for name in scene.NAMES]
    opk = np.radians([table[f"{name}_deg"] for name in ("omega", "phi", "kappa")]).T
    flip = np.diag([1.0, -1.0, -1.0])
    assert_allclose(rotation_from_opk(opk), colmap.axes_of_map(scene.scene()) @ flip, atol=1e-9)
    assert any("east, north and ellipsoidal height" in one for one in brought.assumed)


def test_colmap_s_own_code_writes_what_is_read(tmp_path):
    pycolmap = pytest.importorskip("pycolmap", reason="environment-test.txt has it")
    folder = colmap.write_binary(tmp_path / "m")
    model = pycolmap.Reconstruction(str(folder))
    again = tmp_path / "again" / "m"
    again.mkdir(parents=True)
    model.write_text(str(again))
    found, own = reading.read(again), reading.read(folder)
    assert found.found[:2] == own.found[:2]
    for table, values in own.tables.items():
        order = np.argsort(found.tables[table]["image"], kind="stable")
        assert sorted(found.tables[table]["image"]) == sorted(values["image"]), order


@pytest.mark.parametrize("file", ["cameras", "images", "points3D", "rigs", "frames"])
def test_a_binary_file_that_is_cut_off_is_told(tmp_path, file):
    folder = colmap.write_binary(tmp_path / "m")
    path = folder / f"{file}.bin"
    whole = path.read_bytes()
    for size in (3, len(whole) // 2, len(whole) - 1):
        path.write_bytes(whole[:size])
        with pytest.raises(FlightError, match=rf"{file}\.bin:1: "):
            reading.read(folder)
    path.write_bytes(b"\xff" * 8 + whole[8:])
    with pytest.raises(FlightError, match=rf"{file}\.bin:1: "):
        reading.read(folder)


@needs("formats/colmap")
@pytest.mark.parametrize("form", ["txt", "bin"])
def test_eleven_pictures_are_met_as_colmap_meets_them(form):
    """COLMAP's code finds 0.797 px rms of the same measurements."""
    brought = reading.read(data.path(f"formats/colmap/{form}/cameras.{form}").parent)
    assert rms(brought) == pytest.approx(0.797, abs=0.002)
    assert len(brought.tables["calibration/images.csv"]["image"]) == 11
    assert "79314 measurements that belong to no point" in brought.left_out
