"""Where a chunk lies, and what is said where it lies nowhere."""

import re

import pytest

from acx4lib.errors import FlightError
from acx4lib.exchange.programs.metashape import reading
from support.projects import metashape

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
