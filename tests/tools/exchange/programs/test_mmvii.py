"""MicMac's version 2: points and lenses are where the formulas of its source have them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError
from acx4tools.exchange.programs import micmac
from support.projects import mmvii as written

IDEAL = np.array([[0.0, 0.0], [0.4, -0.3], [-0.45, 0.35], [0.1, 0.2]])
ORI, POINTS = "MMVII-PhgrProj/Ori/A", "MMVII-PhgrProj/PointsMeasure/S"


@pytest.mark.parametrize("projection", written.DISTANCES)
def test_a_lens_is_that_of_the_formulas(tmp_path, projection):
    lens = micmac.project(written.write(tmp_path, projection)).lenses["C"]
    assert_allclose(lens.colrow(IDEAL), written.seen(IDEAL, projection), atol=1e-9)
    assert_allclose(lens.ideal(written.seen(IDEAL, projection)), IDEAL, atol=1e-9)


def test_surveyed_points_prove_the_import(tmp_path):
    brought = micmac.read(written.write(tmp_path), orientations="adjusted", crs="EPSG:31982")
    said = next(one for one in brought.found if one.startswith("surveyed points are"))
    assert float(said.split(" px rms")[0].split()[-1]) < 0.01  # what the refit leaves
    assert brought.source == "MicMac, version 2"
    assert brought.tables["control_points.csv"]["sigma_height_m"] == [0.02, 0.02, 0.02]
    assert brought.tables["calibration/trajectory.csv"]["kappa_deg"] == [0.0]
    assert_allclose(brought.settings["cameras"]["C"]["b2"], -4e-4 / (1 + 3e-4), rtol=1e-3)


@pytest.mark.parametrize("given", [".", "MMVII-PhgrProj", ORI])
def test_any_folder_of_the_project_is_enough(tmp_path, given):
    written.write(tmp_path)
    tables = micmac.read(tmp_path / given).tables
    assert tables["calibration/image_points.csv"]["point"] == ["P", "Q", "R"]


def test_a_calibration_alone_is_a_camera(tmp_path):
    written.write(tmp_path)
    brought = micmac.read(tmp_path / ORI / "Calib-PerspCentral-C.xml")
    assert list(brought.settings["cameras"]) == ["C"]


def test_early_versions_leave_out_the_elements_around(tmp_path):
    known = micmac.read(written.write(tmp_path)).tables
    for path in tmp_path.rglob("*.xml"):
        text = path.read_text()
        for tag in ("Data", "CameraPose", "InternalCalibration", "SetMesIm", "SetGCP"):
            text = text.replace(f"<{tag}>", "").replace(f"</{tag}>", "")
        path.write_text(text)
    assert micmac.read(tmp_path).tables == known


def test_one_of_several_orientations_must_be_chosen(tmp_path):
    written.write(tmp_path)
    other = tmp_path / "MMVII-PhgrProj/Ori/B"
    other.mkdir()
    (other / "Ori-PerspCentral-a.JPG.xml").write_text(written.POSE)
    with pytest.raises(FlightError, match=r"has orientations in .*Ori/A, .*Ori/B; give one of"):
        micmac.read(tmp_path)
    assert "control_points.csv" in micmac.read(tmp_path / ORI).tables
