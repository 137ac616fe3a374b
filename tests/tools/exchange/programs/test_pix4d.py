"""Pix4Dmapper's folder params: OpenCV's pixels are met, its matrices and angles are the proof."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError
from acx4tools.exchange.programs import pix4d
from support.projects import pix4d as written
from support.projects import scene

POINTS = scene.scene().points_enh


@pytest.fixture
def folder(tmp_path):
    written.write(tmp_path)
    return tmp_path


def test_points_are_where_opencv_sees_them(folder):
    found = pix4d.project(folder)
    lens, T = found.lenses["CAM"], found.images.T_w_c
    for k, (R, centre) in enumerate(zip(*written.poses(), strict=True)):
        pixels = scene.seen(R.T, centre, POINTS) - 0.5
        x_c = (POINTS - T.r[k]) @ T.R[k]
        assert_allclose(lens.colrow(x_c[:, :2] / -x_c[:, 2:] * [1, -1]), pixels, atol=1e-6)


def test_the_trajectory_is_pix4ds_own_angles_and_positions(folder):
    brought = pix4d.read(folder)
    table = brought.tables["calibration/trajectory.csv"]
    R, centres = written.poses()
    angles = np.array([table[f"{name}_deg"] for name in ("omega", "phi", "kappa")]).T
    assert_allclose(angles, [written.opk(one) for one in R], atol=1e-8)
    assert_allclose(np.array([table["east_m"], table["height_m"]]).T, centres[:, [0, 2]], atol=1e-5)
    assert brought.settings["crs"] == scene.CRS
    assert brought.settings["cameras"]["CAM"]["pixel_um"] == 3.75
    assert any("mean nothing" in one for one in brought.assumed)


def test_matrices_and_angles_are_the_proof(folder):
    found = pix4d.read(folder).found
    assert any(one.startswith("4 matrices of *_pmatrix.txt are K [R | -R t], to ") for one in found)
    proof = next(one for one in found if one.startswith("places in all images, by Pix4D's own"))
    assert float(proof.split(" px rms")[0].split()[-1]) < 0.01  # what the refit leaves
    assert "(36 measurements)" in proof
    said = next(one for one in found if one.startswith("Omega, Phi, Kappa and positions"))
    off = said.split(" to ")[1].split()
    assert max(float(off[0]), float(off[3])) < 1e-5


def test_images_of_two_lenses_are_two_cameras(folder):
    path = folder / "p_calibrated_camera_parameters.txt"
    (folder / "p_pmatrix.txt").unlink()
    path.write_text(path.read_text().replace("1450.0", "1460.0", 2))
    brought = pix4d.read(folder, orientations="none")
    assert brought.tables["calibration/images.csv"]["camera"] == ["CAM1", "CAM2", "CAM2", "CAM2"]
    assert list(brought.settings["cameras"]) == ["CAM1", "CAM2"]


def test_without_a_crs_or_an_offset_lenses_alone_are_read(folder):
    (folder / "p_wkt.prj").unlink()
    with pytest.raises(FlightError, match=r"no \*_wkt\.prj says the CRS; give it by --crs"):
        pix4d.read(folder)
    assert "calibration/trajectory.csv" in pix4d.read(folder, crs=scene.CRS).tables
    assert "calibration/trajectory.csv" not in pix4d.read(folder, orientations="none").tables
    (folder / "p_offset.xyz").unlink()
    with pytest.raises(FlightError, match=r"\*_offset\.xyz is not there; must be beside it"):
        pix4d.read(folder, crs=scene.CRS)


def test_another_crs_than_that_of_the_files_is_refused(folder):
    with pytest.raises(FlightError, match=r"its CRS is not EPSG:31983; give that of Pix4D"):
        pix4d.read(folder, crs="EPSG:31983")


def test_a_projects_folder_is_enough(tmp_path):
    inside = tmp_path / "1_initial" / "params"
    inside.mkdir(parents=True)
    written.write(inside)
    assert len(pix4d.project(tmp_path).images.names) == 4
    assert len(pix4d.project(inside / "p_offset.xyz").images.names) == 4
