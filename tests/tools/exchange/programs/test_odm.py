"""ODM's list of control points: its ways to write a CRS, missing heights, wrong lines."""

import pytest
from numpy.testing import assert_allclose

from acx4book.reference import data
from acx4tools.exchange.programs import odm
from support.reference_files import needs

ROWS = """544256.7 5320919.9 5 3044 2622 a.jpg north
544256.7 5320919.9 5 100.5 200.25 b.jpg north
544157.7 5320899.2 NaN 4193 1552 b.jpg south
"""


def read(folder, text, **options):
    path = folder / "gcp_list.txt"
    path.write_text(text)
    return odm.read(path, **options)


@pytest.mark.parametrize(
    ("text", "crs"),
    [
        ("WGS84 UTM 10N", "EPSG:32610"),
        ("WGS84 UTM 22S", "EPSG:32722"),
        ("wgs84 utm 10", "EPSG:32610"),
        ("EPSG:31982", "EPSG:31982"),
        ("WGS84", "EPSG:4326"),
        (" '+proj=utm +zone=10 +datum=WGS84'", "+proj=utm +zone=10 +datum=WGS84"),
        ("WGS84 UTM 61N", "WGS84 UTM 61N"),
    ],
)
def test_first_lines(text, crs):
    assert odm.crs_of(text) == crs


@pytest.mark.parametrize(
    "crs",
    [
        "WGS84 UTM 10N",
        "epsg:32610",
        "+proj=utm +zone=10 +ellps=WGS84 +datum=WGS84 +units=m +no_defs",
    ],
)
def test_points_and_measurements(tmp_path, crs):
    brought = read(tmp_path, f"# remark\n{crs}\n\n{ROWS}")
    assert brought.settings == {"crs": "EPSG:32610", "heights": "ellipsoidal"}
    control = brought.tables["control_points.csv"]
    assert control == {
        "point": ["north"],
        "east_m": [544256.7],
        "north_m": [5320919.9],
        "height_m": [5.0],
    }
    points = brought.tables["calibration/image_points.csv"]
    assert points["point"] == ["north", "north", "south"]
    assert points["col_px"] == [3044.0, 100.5, 4193.0]
    assert brought.left_out == ("1 points without a height: south",)
    assert "calibration/images.csv" not in brought.tables


def test_longitudes_and_latitudes_are_written_in_their_utm_zone(tmp_path):
    brought = read(tmp_path, "WGS84\n13.400740745 52.519134104 12.08 2335.0 1416.7 01.jpg\n")
    assert brought.settings["crs"] == "EPSG:32633"
    control = brought.tables["control_points.csv"]
    assert control["point"] == ["GCP1"]
    assert_allclose([control["east_m"][0], control["north_m"][0]], [391466.6, 5820000], atol=60)


def test_images_are_written_for_a_named_camera(tmp_path):
    brought = read(tmp_path, f"EPSG:32610\n{ROWS}", camera="C")
    assert brought.tables["calibration/images.csv"] == {
        "image": ["a.jpg", "b.jpg"],
        "camera": ["C", "C"],
        "exposure": ["a.jpg", "b.jpg"],
    }


@needs("formats/odm")
def test_a_real_list():
    brought = odm.read(data.path("formats/odm/gcp_list.txt"))
    assert brought.settings["crs"] == "EPSG:32617"
    assert "4 measurements of 4 points" in brought.found
    assert brought.tables["control_points.csv"]["height_m"][0] == 345.16893
