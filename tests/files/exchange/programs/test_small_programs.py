"""Programs whose files are few."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.reference import data
from acx4files.exchange.programs import micmac, opensfm, photo_lists, pix4d
from acx4lib.errors import FlightError
from support.helpers import needs
from support.projects import pix4d as written_pix4d
from support.projects import scene

# --- MicMac's version 2 is named, and not read


def test_files_of_version_2_are_refused_by_name(tmp_path):
    (tmp_path / "MMVII-PhgrProj").mkdir()
    with pytest.raises(FlightError, match=r"MMVII-PhgrProj:1: file: is of version 2 \(MMVII\)"):
        micmac.read(tmp_path)


# --- pix4d -----------------------------------------------------------------------------------
#
# Pix4Dmapper's folder params: OpenCV's pixels are met, its matrices and angles are the proof.


POINTS_PIX4D = scene.scene().points_enh


@pytest.fixture
def folder(tmp_path):
    written_pix4d.write(tmp_path)
    return tmp_path


def test_points_are_where_opencv_sees_them(folder):
    found = pix4d.read_project(folder)
    lens, T = found.lenses["CAM"], found.images.T_w_c
    for k, (R, centre) in enumerate(zip(*written_pix4d.poses(), strict=True)):
        pixels = scene.seen(R.T, centre, POINTS_PIX4D) - 0.5
        x_c = (POINTS_PIX4D - T.r[k]) @ T.R[k]
        assert_allclose(lens.colrow(x_c[:, :2] / -x_c[:, 2:] * [1, -1]), pixels, atol=1e-6)


def test_the_trajectory_is_pix4ds_own_angles_and_positions(folder):
    brought = pix4d.read(folder)
    table = brought.tables["calibration/trajectory.csv"]
    R, centres = written_pix4d.poses()
    angles = np.array([table[f"{name}_deg"] for name in ("omega", "phi", "kappa")]).T
    assert_allclose(angles, [written_pix4d.opk(one) for one in R], atol=1e-8)
    assert_allclose(np.array([table["east_m"], table["height_m"]]).T, centres[:, [0, 2]], atol=1e-5)
    assert brought.settings["crs"] == scene.CRS
    assert brought.settings["cameras"]["CAM"]["pixel_um"] == 3.75
    assert any("mean nothing" in one for one in brought.assumed)


def test_matrices_and_angles_are_the_proof(folder):
    found = pix4d.read(folder).found
    assert any(one.startswith("4 matrices of *_pmatrix.txt are K [R | -R t], to ") for one in found)
    proof = next(one for one in found if one.startswith("places in all images, by Pix4D's own"))
    assert float(proof.split(" px rms")[0].split()[-1]) < 0.01  # what the refit leaves
    assert "(36 measurements)" in proof
    said = next(one for one in found if one.startswith("Omega, Phi, Kappa and positions"))
    off = said.split(" to ")[1].split()
    assert max(float(off[0]), float(off[3])) < 1e-5


# --- ODM's list of control points: its ways to write a CRS, missing heights, wrong lines -----


ROWS = """544256.7 5320919.9 5 3044 2622 a.jpg north
544256.7 5320919.9 5 100.5 200.25 b.jpg north
544157.7 5320899.2 NaN 4193 1552 b.jpg south
"""


def odm_read(folder, text, **options):
    path = folder / "gcp_list.txt"
    path.write_text(text)
    return opensfm.read_control(path, **options)


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
    assert opensfm.crs_of(text) == crs


@pytest.mark.parametrize(
    "crs",
    [
        "WGS84 UTM 10N",
        "epsg:32610",
        "+proj=utm +zone=10 +ellps=WGS84 +datum=WGS84 +units=m +no_defs",
    ],
)
def test_points_and_measurements(tmp_path, crs):
    brought = odm_read(tmp_path, f"# remark\n{crs}\n\n{ROWS}")
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
    brought = odm_read(tmp_path, "WGS84\n13.400740745 52.519134104 12.08 2335.0 1416.7 01.jpg\n")
    assert brought.settings["crs"] == "EPSG:32633"
    control = brought.tables["control_points.csv"]
    assert control["point"] == ["GCP1"]
    assert_allclose([control["east_m"][0], control["north_m"][0]], [391466.6, 5820000], atol=60)


@needs("formats/odm")
def test_a_real_list():
    brought = opensfm.read_control(data.path("formats/odm/gcp_list.txt"))
    assert brought.settings["crs"] == "EPSG:32617"
    assert "4 measurements of 4 points" in brought.found
    assert brought.tables["control_points.csv"]["height_m"][0] == 345.16893


# --- photo lists -----------------------------------------------------------------------------
#
# Lists of BINGO and PAT-B: pixels of Pix4D's documented example, blocks, units, control.


BLOCK = {"size": "4000x3000", "pixel_um": 2.0}

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
    brought = photo_lists.read_bingo(write(tmp_path), size="4000x3000", pixel_um=1.5)
    points = brought.tables["calibration/image_points.csv"]
    assert_allclose([points["col_px"], points["row_px"]], [[999.5, 3999.5], [499.5, 1999.5]])
    assert brought.settings["cameras"] == {
        "CAMERA": {"width_px": 4000, "height_px": 3000, "pixel_um": 1.5}
    }


def test_control_points_are_read_and_said_to_be_untried(tmp_path):
    brought = photo_lists.read_bingo(write(tmp_path), size="4000x3000", pixel_um=1.5)
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
    tables = photo_lists.read_bingo(tmp_path, size="4000x3000", pixel_um=1.5).tables
    points = tables["calibration/image_points.csv"]
    assert list(zip(points["image"], points["point"], strict=True)) == [
        ("P1060498", "1006"),
        ("P1060498", "1020"),
        ("P1060499", "1006"),
        ("P1060499", "1020"),
    ]
    first = [points["col_px"][0], points["row_px"][0]]
    assert_allclose(first, [1999.5 - 1906.43 / 1.5, 1499.5 - 1834.93 / 1.5], atol=1e-4)
    assert tables["calibration/images.csv"]["camera"] == ["H_8.07_6.0525"] * 2


def test_micrometres_and_millimetres_are_declared(tmp_path):
    (tmp_path / "a.im").write_text("101 153000\n1 -2000.0 1000.0\n-99\n")
    (tmp_path / "b.im").write_text("101 153000\n1 -2.0 1.0\n-99\n")
    for name, unit in (("a.im", "um"), ("b.im", "mm")):
        brought = photo_lists.read_patb(tmp_path / name, unit=unit, **BLOCK)
        points = brought.tables["calibration/image_points.csv"]
        assert_allclose([points["col_px"][0], points["row_px"][0]], [999.5, 999.5])
        assert list(brought.settings["cameras"]) == ["CAM"]
        assert any("untried" in one for one in brought.assumed)


@pytest.mark.parametrize("ending", photo_lists.NOT_READ)
def test_other_files_of_patb_are_refused(tmp_path, ending):
    path = tmp_path / f"a{ending}"
    path.write_text("1 2 3\n")
    with pytest.raises(FlightError, match=f"file: {ending} of PAT-B is not read"):
        photo_lists.read_patb(path, unit="mm", **BLOCK)
