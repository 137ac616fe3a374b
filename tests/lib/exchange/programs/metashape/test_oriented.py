"""Where a chunk lies, and what is said where it lies nowhere."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError
from acx4lib.exchange.programs.metashape import reading
from acx4lib.geometry.geodesy import GridSystem
from support.projects import metashape, scene

LOCAL = 'LOCAL_CS["Local Coordinates (m)",LOCAL_DATUM["Local Datum",0],UNIT["metre",1]]'


def without(path, pattern):
    """Take out all elements that a pattern finds."""
    path.write_text(re.sub(pattern, "", path.read_text(), flags=re.DOTALL))
    return path


def test_a_chunk_without_a_place_is_brought_without_one(tmp_path):
    path = without(metashape.write(tmp_path / "c.xml"), "<components>.*</components>")
    found = reading.read(path).found
    assert any(one.startswith("the measured locations of each marker meet") for one in found)
    assert not any(one.startswith("the surveyed markers") for one in found)
    with pytest.raises(FlightError, match="chunk: <transform> is missing"):
        reading.read(path, orientations="adjusted")


def test_local_coordinates_are_no_flight_s(tmp_path):
    path = metashape.write(tmp_path / "c.xml", wkt=LOCAL)
    brought = reading.read(path)
    assert "crs" not in brought.settings
    assert set(brought.tables) == {"heads/images.csv", "heads/image_points.csv"}
    assert any("the chunk has no coordinate system" in one for one in brought.left_out)
    with pytest.raises(FlightError, match="reference: is no coordinate system on the Earth"):
        reading.read(path, orientations="adjusted")


def test_local_coordinates_may_be_those_of_a_crs(tmp_path):
    """With --crs local coordinates are the map's; what Metashape calls north is that of the map."""
    path = metashape.write(tmp_path / "c.xml", wkt=LOCAL)
    grid = GridSystem(crs=scene.CRS, heights="ellipsoidal")

    def on_map(found):
        lonlat = np.array([[float(found[1]), float(found[2])]])
        east, north = grid.grid_from_lonlat(lonlat)[0]
        return f'<reference x="{east:.6f}" y="{north:.6f}"'

    path.write_text(re.sub(r'<reference x="(-49.*?)" y="(-25.*?)"', on_map, path.read_text()))
    known = reading.read(metashape.write(tmp_path / "known.xml"))
    brought = reading.read(path, crs=scene.CRS)
    assert any("are local: they are taken for those of" in one for one in brought.assumed)
    assert brought.tables["control_points.csv"] == known.tables["control_points.csv"]
    ours, theirs = (one.tables["heads/trajectory.csv"] for one in (brought, known))
    assert_allclose(ours["lat_deg"], theirs["lat_deg"], atol=1e-9)
    lonlat = np.column_stack([theirs["lon_deg"], theirs["lat_deg"]])
    gamma = np.degrees(grid.convergence(lonlat))
    turned = np.subtract(ours["heading_deg"], theirs["heading_deg"])
    assert_allclose(turned, gamma, atol=1e-8)


def test_adjusted_orientations_in_local_coordinates_are_the_maps(tmp_path):
    path = metashape.write(tmp_path / "c.xml", wkt=LOCAL)
    brought = reading.read(path, crs=scene.CRS, orientations="adjusted")
    table = brought.tables["heads/trajectory.csv"]
    text = path.read_text().split("<components>")[1]
    R, r, scale, T = (
        np.array(re.search(f"<{tag}>(.*?)</{tag}>", text)[1].split(), dtype=float)
        for tag in ("rotation", "translation", "scale", "transform")
    )
    there = r + scale * R.reshape(3, 3) @ T.reshape(4, 4)[:3, 3]
    ours = [table[name][0] for name in ("east_m", "north_m", "height_m")]
    assert_allclose(ours, there, atol=1e-4)


def test_a_sensor_without_images_needs_no_calibration(tmp_path):
    path = metashape.write(tmp_path / "c.xml")
    known = reading.read(path)
    bare = '<sensor id="77" label="unknown"><resolution width="9" height="9"/></sensor></sensors>'
    path.write_text(path.read_text().replace("</sensors>", bare))
    assert reading.read(path).settings == known.settings


def test_images_without_a_measured_orientation_do_not_come_along(tmp_path):
    path = metashape.write(tmp_path / "c.xml")
    path.write_text(path.read_text().replace('yaw="38.0"', ""))
    brought = reading.read(path)
    assert "two.jpg" not in brought.tables["heads/trajectory.csv"]["exposure"]
    assert "slave 1" not in brought.tables["heads/images.csv"]["image"]
    assert "1 exposure without position and angles, images included" in brought.left_out


def test_slaves_without_a_rotation_are_said(tmp_path):
    path = metashape.write(tmp_path / "c.xml")
    text = path.read_text()
    begin = text.index('<sensor id="1"')
    path.write_text(text[:begin] + re.sub("<rotation>.*?</rotation>", "", text[begin:], count=1))
    said = "1 slaves have no rotation: their mountings are the master's"
    assert said in reading.read(path).left_out


def with_references(path, old, new):
    """Change the attributes of the cameras' references."""
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))
    return path


@pytest.mark.parametrize(
    ("given", "sigma"),
    [
        ('sxy="0.02" sz="0.03"', (0.02, 0.02, 0.03)),
        ('sx="0.01" sy="0.02" sz="0.03"', (0.01, 0.02, 0.03)),
        ('sxyz="0.05" sz="0.09"', (0.05, 0.05, 0.09)),
        ('sxy="0.02"', (0.02, 0.02, 10.0)),
    ],
)
def test_each_camera_s_own_accuracy_counts_in_every_spelling(tmp_path, given, sigma):
    path = metashape.write(tmp_path / "c.xml")
    setting = '<settings><property name="accuracy_cameras" value="10"/>'
    with_references(path, "<settings>", setting)
    with_references(path, 'sxyz="0.05"', given)
    table = reading.read(path).tables["heads/trajectory.csv"]
    found = [table[f"sigma_{name}"] for name in ("east_m", "north_m", "height_m")]
    assert_allclose(found, np.tile(sigma, (len(table["exposure"]), 1)).T)


def test_cameras_without_an_accuracy_of_their_own_have_the_chunk_s(tmp_path):
    path = metashape.write(tmp_path / "c.xml")
    path.write_text(path.read_text().replace('sxyz="0.05"', 'syaw="1" sypr="2"', 1))
    with pytest.raises(FlightError, match="reference: has no accuracy of x, y, z"):
        reading.read(path)
    settings = "".join(
        f'<property name="{name}" value="{value}"/>'
        for name, value in (("accuracy_cameras", 10), ("accuracy_cameras_ypr", 4))
    )
    brought = reading.read(with_references(path, "<settings>", f"<settings>{settings}"))
    table = brought.tables["heads/trajectory.csv"]
    assert sorted(table["sigma_east_m"])[-2:] == [0.05, 10.0]
    assert sorted(table["sigma_heading_deg"])[:2] == [1.0, 4.0]
    assert sorted(table["sigma_roll_deg"])[:2] == [2.0, 4.0]
    said = [one for one in brought.assumed if "an accuracy of their own" in one]
    assert len(said) == 2


def test_angles_that_are_switched_off_are_not_used(tmp_path):
    path = metashape.write(tmp_path / "c.xml")
    path.write_text(path.read_text().replace('sxyz="0.05"', 'rotation_enabled="false"', 1))
    path.write_text(path.read_text().replace('sxyz="0.05"', ""))
    known = len(reading.read(metashape.write(tmp_path / "all.xml")).tables["heads/trajectory.csv"])
    brought = reading.read(path)
    table = brought.tables["heads/trajectory.csv"]
    assert "one.jpg" not in table["exposure"]
    assert len(table["exposure"]) == 3
    assert len(table) == known - 3
    said = 'measured attitudes that are switched off (rotation_enabled="false"): they are not used'
    assert f"1 {said}" in brought.left_out


def test_positions_that_are_switched_off_are_not_used(tmp_path):
    path = metashape.write(tmp_path / "c.xml")
    off = 'sxyz="0.05" enabled="false"'
    brought = reading.read(with_references(path, 'sxyz="0.05" enabled="true"', off))
    assert "heads/trajectory.csv" not in brought.tables
    assert any(
        one.startswith("4 measured positions, with their angles") for one in brought.left_out
    )
