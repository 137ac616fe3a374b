"""A small plan of one camera, and targets with candidates over the middle of its field."""

import tomllib

import pytest

from acx4lib.planning import text

PLAN = """
name = "small"
crs = "EPSG:32633"
heights = "ellipsoidal"
[apriori]
image_point_px = 0.4
gnss_horizontal_m = 0.02
gnss_vertical_m = 0.03
roll_pitch_deg = 0.006
heading_deg = 0.015
[cameras.CAM]
width_px = 11608
height_px = 8708
pixel_um = 4.6
focal_mm = 50.0
[stages.mounting]
estimate = ["f_mm", "xp_mm", "yp_mm"]
gnss = ["shift"]
[field]
east_m = 385000.0
north_m = 5518000.0
height_m = 430.0
relief_m = 20.0
[control]
layout = "corners"
number = 4
area_m = [500.0, 500.0]
[calibration]
tie_points = 90
tie_area_m = [900.0, 900.0]
[calibration.strips]
there = {flying_height_m = 900, course_deg = 90, length_m = 600, overlap = 0.75}
[validation]
[validation.check]
layout = "grid"
number = [3, 3]
area_m = [500.0, 500.0]
[validation.strips]
a = {flying_height_m = 700, course_deg = 0, length_m = 600, overlap = 0.6, left_m = 250}
b = {flying_height_m = 700, course_deg = 180, length_m = 600, overlap = 0.6, left_m = -250}
"""

CANDIDATES = {
    "c": {
        "flying_height_m": [500, 900],
        "course_deg": [0, 90, 180, 270],
        "length_m": 600,
        "overlap": 0.75,
    }
}


@pytest.fixture(scope="session")
def plan():
    return text.from_values(tomllib.loads(PLAN))
