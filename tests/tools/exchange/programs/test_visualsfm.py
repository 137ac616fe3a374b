"""VisualSFM's .nvm, written by its documentation: points are met, what is cut off is refused."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError
from acx4tools.exchange import flight_folder
from acx4tools.exchange.programs import visualsfm
from support.projects import visualsfm as written


def read(folder, content, size=written.SIZE):
    path = folder / "model.nvm"
    path.write_text(content)
    return visualsfm.read(path, size=size)


def test_points_are_met_and_names_are_read(tmp_path):
    brought = read(tmp_path, written.text())
    assert brought.source == "VisualSFM NVM_V3"
    assert brought.tables["calibration/images.csv"]["image"] == ["a.jpg", "b.jpg"]
    assert list(brought.settings["cameras"]) == ["CAM"]
    points = brought.tables["calibration/image_points.csv"]
    first = [points["col_px"][0], points["row_px"][0]]
    assert_allclose(first, np.array([319.5, 239.5]) + written.seen(0)[0], atol=1e-4)
    said = next(one for one in brought.found if one.startswith("the program's own points"))
    assert float(said.split(" to ")[1].split(" px")[0]) < 0.01
    assert brought.left_out == ("2 adjusted orientations: their coordinates are in no CRS",)


def test_the_radial_coefficient_takes_measured_points_to_ideal_ones(tmp_path):
    path = tmp_path / "model.nvm"
    path.write_text(written.text())
    lens = visualsfm.project(path, size=written.SIZE).lenses["CAM"]
    m = np.array([[0.3, -0.2], [-0.4, 0.1]])
    found = lens.ideal(written.F * m + [319.5, 239.5])
    assert_allclose(found, m * (1 + written.R * np.array([[0.13], [0.17]])), atol=1e-12)


def test_different_lenses_are_different_cameras(tmp_path):
    brought = read(tmp_path, written.text(second_lens=(800.0, 0.0)))
    assert brought.tables["calibration/images.csv"]["camera"] == ["CAM1", "CAM2"]
    assert brought.settings["cameras"]["CAM2"]["focal_mm"] == 4.0


def test_a_fixed_calibration_says_from_where_measurements_count(tmp_path):
    brought = read(tmp_path, written.text(head="NVM_V3 FixedK 700 330 700 250"))
    points = brought.tables["calibration/image_points.csv"]
    assert_allclose(points["col_px"][0], 329.5 + written.seen(0)[0, 0], atol=1e-4)


def test_a_size_that_is_too_small_for_the_measurements_is_refused(tmp_path):
    small = read(tmp_path, written.text(), size=(220, 160))
    with pytest.raises(FlightError, match=r"measurements lie outside their pictures"):
        flight_folder.write(small, tmp_path / "flight")
    assert not (tmp_path / "flight").exists()


def test_further_models_are_counted(tmp_path):
    found = read(tmp_path, written.text().replace("\n0\n", "\n5\n", 1)).left_out
    assert "5 cameras of further models in the file" in found


def test_local_coordinates_are_taken_as_they_are(tmp_path):
    path = tmp_path / "model.nvm"
    path.write_text(written.text())
    brought = visualsfm.read(path, size=written.SIZE, crs="local")
    assert_allclose(brought.tables["calibration/trajectory.csv"]["east_m"], [0.0, 0.5])
    with pytest.raises(FlightError, match=r"--crs: 'EPSG:4326'; must be 'local': VisualSFM's"):
        visualsfm.read(path, size=written.SIZE, crs="EPSG:4326")
