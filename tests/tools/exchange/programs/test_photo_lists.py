"""Lists of BINGO and PAT-B: pixels of Pix4D's documented example, blocks, units, control."""

import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError
from acx4tools.exchange.programs import photo_lists

BLOCK = {"size": (4000, 3000), "pixel_um": 2.0}

PIX4D = """P1060498 H_8.07_6.0525
1006 -1.90643 1.83493
1020 2.00132 -0.797681

P1060499 H_8.07_6.0525

1006 -2.42102 1.87814
1020 2.15263 -0.33399
"""
"""The example in Pix4D's documentation of its BINGO file."""


LIST = "P1 CAMERA\n1006 -1.5 1.5\n1020 3.0 -0.75\n-99\n"
GEOIN = "C a remark\nCAPA CAMERA 1 8.07 0 0\nCONT 1006 1.0 2.0 3.0 0.1\nCHCK 1020 4 5 6\n"


def write(folder, geoin=GEOIN):
    (folder / "image.dat").write_text(LIST)
    (folder / "geoin.dat").write_text(geoin)
    return folder


def test_millimetres_from_the_middle_become_pixels(tmp_path):
    brought = photo_lists.read_bingo(write(tmp_path), size=(4000, 3000), pixel_um=1.5)
    points = brought.tables["calibration/image_points.csv"]
    assert_allclose([points["col_px"], points["row_px"]], [[999.5, 3999.5], [499.5, 1999.5]])
    assert brought.settings["cameras"] == {
        "CAMERA": {"width_px": 4000, "height_px": 3000, "pixel_um": 1.5}
    }


def test_control_points_are_read_and_said_to_be_untried(tmp_path):
    brought = photo_lists.read_bingo(write(tmp_path), size=(4000, 3000), pixel_um=1.5)
    assert brought.tables["control_points.csv"] == {
        "point": ["1006", "1020"],
        "east_m": [1.0, 4.0],
        "north_m": [2.0, 5.0],
        "height_m": [3.0, 6.0],
        "role": ["control", "check"],
    }
    assert photo_lists.UNTRIED in brought.assumed
    assert brought.left_out == ("1 other lines of geoin.dat: 1 'CAPA'",)
    assert set(brought.sha256) == {"image.dat", "geoin.dat"}


@pytest.mark.parametrize(
    "text",
    [PIX4D, PIX4D.replace("\n\nP", "\n-99\nP") + "-99\n", PIX4D.replace("\n", "\r\n")],
)
def test_blocks_end_by_a_mark_or_by_the_next_header(tmp_path, text):
    (tmp_path / "image.dat").write_text(text)
    found = photo_lists.bingo(tmp_path, size=(4000, 3000), pixel_um=1.5)
    images, measured = found.images, found.measured
    pairs = zip(measured.image_idx, measured.point_idx, strict=True)
    assert [(images.names[i], measured.points[k]) for i, k in pairs] == [
        ("P1060498", "1006"),
        ("P1060498", "1020"),
        ("P1060499", "1006"),
        ("P1060499", "1020"),
    ]
    assert_allclose(measured.colrow[0], [1999.5 - 1906.43 / 1.5, 1499.5 - 1834.93 / 1.5])
    assert images.cameras == ("H_8.07_6.0525",) * 2


def test_a_header_without_a_camera_has_the_usual_one(tmp_path):
    (tmp_path / "image.dat").write_text("7\n1 0.5 0.5 3\n-99\n")
    assert photo_lists.bingo(tmp_path, **BLOCK).images.cameras == ("CAM",)


def test_micrometres_and_millimetres_are_declared(tmp_path):
    (tmp_path / "a.im").write_text("101 153000\n1 -2000.0 1000.0\n-99\n")
    (tmp_path / "b.im").write_text("101 153000\n1 -2.0 1.0\n-99\n")
    (tmp_path / "a.con").write_text("")
    for name, unit in (("a.im", "um"), ("b.im", "mm")):
        brought = photo_lists.read_patb(tmp_path / name, unit=unit, **BLOCK)
        points = brought.tables["calibration/image_points.csv"]
        assert_allclose([points["col_px"][0], points["row_px"][0]], [999.5, 999.5])
        assert list(brought.settings["cameras"]) == ["CAM"]
        assert any("untried" in one for one in brought.assumed)
    assert photo_lists.read_patb(tmp_path / "a.im", unit="um", **BLOCK).left_out == (
        "a.con: not read",
    )


@pytest.mark.parametrize("ending", photo_lists.NOT_READ)
def test_other_files_of_patb_are_refused(tmp_path, ending):
    path = tmp_path / f"a{ending}"
    path.write_text("1 2 3\n")
    with pytest.raises(FlightError, match=f"file: {ending} of PAT-B is not read"):
        photo_lists.read_patb(path, unit="mm", **BLOCK)
