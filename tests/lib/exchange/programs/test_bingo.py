"""BINGO: pixels of Pix4D's documented example, control points beside it."""

import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError
from acx4lib.exchange.programs import bingo

LIST = "P1 CAMERA\n1006 -1.5 1.5\n1020 3.0 -0.75\n-99\n"
GEOIN = "C a remark\nCAPA CAMERA 1 8.07 0 0\nCONT 1006 1.0 2.0 3.0 0.1\nCHCK 1020 4 5 6\n"


def write(folder, geoin=GEOIN):
    (folder / "image.dat").write_text(LIST)
    (folder / "geoin.dat").write_text(geoin)
    return folder


def test_millimetres_from_the_middle_become_pixels(tmp_path):
    brought = bingo.read(write(tmp_path), size=(4000, 3000), pixel_um=1.5)
    points = brought.tables["calibration/image_points.csv"]
    assert_allclose([points["col_px"], points["row_px"]], [[999.5, 3999.5], [499.5, 1999.5]])
    assert brought.settings["cameras"] == {
        "CAMERA": {"width_px": 4000, "height_px": 3000, "pixel_um": 1.5}
    }


def test_control_points_are_read_and_said_to_be_untried(tmp_path):
    brought = bingo.read(write(tmp_path), size=(4000, 3000), pixel_um=1.5)
    assert brought.tables["control_points.csv"] == {
        "point": ["1006", "1020"],
        "east_m": [1.0, 4.0],
        "north_m": [2.0, 5.0],
        "height_m": [3.0, 6.0],
        "role": ["control", "check"],
    }
    assert bingo.UNTRIED in brought.assumed
    assert brought.left_out == ("1 other lines of geoin.dat: 1 'CAPA'",)
    assert set(brought.sha256) == {"image.dat", "geoin.dat"}


@pytest.mark.parametrize(
    ("geoin", "message"),
    [
        ("CONT 1 2 3\n", "geoin.dat:1: east, north, height: is missing, the line has 4 cells"),
        ("CONT 1 2 3 4\nCHCK 1 2 3 4\n", "geoin.dat:2: point: '1' stands twice; must stand once"),
    ],
)
def test_wrong_control_is_refused(tmp_path, geoin, message):
    with pytest.raises(FlightError, match=message):
        bingo.read(write(tmp_path, geoin), size=(4000, 3000), pixel_um=1.5)
