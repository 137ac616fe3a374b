"""Control points of OpenSfM and their measurements."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError
from acx4lib.exchange.programs.opensfm import control
from acx4lib.exchange.safe import opened
from acx4lib.exchange.safe.opened import Opened
from acx4lib.geometry.geodesy import GridSystem

CRS = "EPSG:32722"
POINT = {
    "id": "A",
    "position": {"latitude": -25.4, "longitude": -49.3, "altitude": 905.0},
    "observations": [
        {"shot_id": "0.jpg", "projection": [0.0, 0.0]},
        {"shot_id": "x.jpg", "projection": [0.5, 0.375]},
    ],
}
FLAT = POINT | {"id": "B", "position": {"latitude": -25.4, "longitude": -49.3}}


SIZES = {"0.jpg": (400, 300)}


def read(*points):
    text = json.dumps({"points": points}).encode()
    return control.read(Opened(file="g.json", data=text), SIZES, CRS)


def test_a_list_of_odm_is_the_same_as_the_json(tmp_path):
    path = tmp_path / "gcp_list.txt"
    path.write_text("WGS84\n-49.3 -25.4 905.0 199.5 149.5 0.jpg A\n-49.3 -25.4 905 1 2 x.jpg A\n")
    listed, found = control.read(opened.read(path), SIZES, CRS), read(POINT)
    assert listed.names == found.names
    assert_allclose(listed.lonlath, found.lonlath, atol=1e-9)
    for one in (listed, found):
        known, colrow = control.colrow(one, SIZES)
        assert known == [0]
        assert_allclose(colrow, [[199.5, 149.5]])


def test_points_measurements_and_missing_heights():
    found = read(POINT, FLAT)
    assert found.flat == 1
    assert found.images == ("0.jpg", "x.jpg") * 2
    table = found.table(GridSystem(crs=CRS, heights="ellipsoidal"))
    assert table["point"] == ["A"]
    assert_allclose([table["east_m"][0], table["height_m"][0]], [671005, 905], atol=500)
    known, colrow = control.colrow(found, SIZES)
    assert known == [0, 2]
    assert_allclose(colrow, np.full((2, 2), [199.5, 149.5]))


def test_a_position_outside_the_earth_is_refused():
    wrong = POINT | {"position": {"latitude": -95.4, "longitude": 0}}
    with pytest.raises(FlightError, match=r"points.0.position.latitude: -95.4; must lie between"):
        read(wrong)
