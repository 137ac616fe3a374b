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
    assert "1 exposures without position and angles, with their images" in brought.left_out


def test_slaves_without_a_rotation_are_said(tmp_path):
    path = metashape.write(tmp_path / "c.xml")
    text = path.read_text()
    begin = text.index('<sensor id="1"')
    path.write_text(text[:begin] + re.sub("<rotation>.*?</rotation>", "", text[begin:], count=1))
    said = "1 slaves have no rotation: their mountings are the master's"
    assert said in reading.read(path).left_out
