"""The metadata of single pictures."""

from pathlib import Path

import cv2
import numpy as np
import pyproj
import pytest
from numpy.testing import assert_allclose

from acx4files.exchange import metadata
from acx4files.exchange.metadata import properties, read
from acx4files.exchange.pictures import read_folder
from acx4lib.errors import FlightError
from acx4lib.geometry.camera import correct, xy_from_colrow
from support.pictures import tagged

# --- EXIF and XMP of TIFF and JPEG, written by another program -------------------------------


@pytest.mark.parametrize("name", ["a.tif", "a.TIFF", "a.jpg", "a.JPEG"])
def test_a_tiff_and_a_jpeg_say_the_same(tmp_path, name):
    found = read(tagged.write(tmp_path / name, {"Camera:BandName": "NIR"}))
    assert (found.width_px, found.height_px) == tagged.SIZE
    assert found.text("Camera:BandName", "Model") == "NIR"
    assert found.text("drone-dji:BandName", "Model") == "RedEdge-T"
    assert found.number("FocalPlaneXResolution") == pytest.approx(1 / tagged.PIXEL_MM)
    assert (found.samples, found.bits) == ((1, 16) if "t" in name.lower() else (3, 8))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "is empty"),
        (b"GIF89a", "cannot be read; must be a TIFF"),
        (b"\xff\xd8\xff\xe1\x00", "cannot be read"),
        (b"II*\x00\xff\xff\xff\x7f", "must be a TIFF or a JPEG that is whole"),
    ],
)
def test_other_and_cut_files_are_refused_in_one_line(tmp_path, content, said):
    path = tmp_path / "a.tif"
    path.write_bytes(content)
    with pytest.raises(FlightError, match=said) as refused:
        read(path)
    assert str(refused.value).count("\n") == 0
    assert str(path) in str(refused.value)


# --- XMP packets as vendors write them, and as nobody should


PATH = Path("a.tif")


def test_elements_lists_and_attributes_are_read_by_the_vendors_prefix():
    as_elements = properties(
        tagged.packet({"Camera:BandName": "Red edge", "Camera:VignettingCenter": [1.5, 2]}), PATH
    )
    assert as_elements == {
        "Camera:BandName": ("Red edge",),
        "Camera:VignettingCenter": ("1.5", "2"),
    }
    as_attributes = properties(
        tagged.packet({"drone-dji:GimbalYawDegree": "+3.0"}, attributes=True), PATH
    )
    assert as_attributes == {"drone-dji:GimbalYawDegree": ("+3.0",)}


@pytest.mark.parametrize(
    ("packet", "said"),
    [
        (b"<x:xmpmeta", "must be valid XML"),
        (b"<!DOCTYPE x [<!ENTITY a 'b'>]><x>&a;</x>", "DOCTYPE"),
        (b"\xff\xfe\xfa", "XML|UTF"),
    ],
)
def test_what_is_no_plain_xml_is_refused(packet, said):
    with pytest.raises(FlightError, match=said):
        properties(packet, PATH)


# --- marks -----------------------------------------------------------------------------------
#
# Timestamp.MRK of a drone: the antenna's positions, moved to the camera and joined by number.


LAT, LON, HEIGHT = 47.5, -3.2, 150.0
LINE = (
    "{n}\t400373.488877\t[2264]\t{N},N\t{E},E\t{V},V\t{lat:.9f},Lat\t{lon:.9f},Lon\t{h},Ellh\t"
    "0.028, 0.031, 0.055\t{q},Q\n"
)


def line(n, *, north=-40, east=25, down=186, flag=50, lat=LAT):
    return LINE.format(n=n, N=north, E=east, V=down, lat=lat, lon=LON, h=HEIGHT, q=flag)


def folder(path, *, flags=(50, 50, 50), **exif):
    for k in range(3):
        tagged.write(
            path / f"DJI_20240501_{k + 7:04d}_V.JPG",
            {"drone-dji:CalibratedFocalLength": 300},
            exif=tagged.metadata(lat=LAT, lon=LON, height=100.0, **exif),
        )
    lines = [line(k + 7, flag=flag, lat=LAT + 1e-4 * k) for k, flag in enumerate(flags)]
    (path / "DJI_20240501_Timestamp.MRK").write_text("".join(reversed(lines)))
    return path


def test_the_camera_is_beside_the_antenna_by_millimetres_north_east_and_down(tmp_path):
    """In the plane that touches the ellipsoid at the antenna."""
    track = read_folder(folder(tmp_path)).tables["calibration/trajectory.csv"]
    enu = pyproj.Transformer.from_pipeline(
        f"+proj=pipeline +step +proj=cart +ellps=WGS84 +step +proj=topocentric +ellps=WGS84 "
        f"+lon_0={LON} +lat_0={LAT} +h_0={HEIGHT}"
    )
    camera = [track[name][0] for name in ("lon_deg", "lat_deg", "height_m")]
    assert_allclose(enu.transform(*camera), [0.025, -0.040, -0.186], atol=2e-4)
    assert [track[f"sigma_{axis}_m"][0] for axis in ("east", "north", "height")] == [
        *(0.031, 0.028, 0.055)
    ]


def test_marks_are_joined_to_the_pictures_by_number(tmp_path):
    brought = read_folder(folder(tmp_path, time="2024:05:01 10:20:30"))
    track = brought.tables["calibration/trajectory.csv"]
    assert_allclose(np.diff(track["lat_deg"]), 1e-4, atol=1e-9)
    assert_allclose(track["height_m"], HEIGHT - 0.186, atol=1e-9)
    assert track["sigma_north_m"] == [0.028] * 3
    assert not any("Timestamp" in one for one in brought.warnings)
    (said,) = (one for one in brought.assumed if "Timestamp.MRK" in one)
    assert "joined by number and moved by 0.192 m (median)" in said
    assert "those of EXIF lie" in said
    assert "-49.814 m above" in said
    assert "DJI_20240501_Timestamp.MRK" in brought.sha256


def test_flags_that_are_no_fixed_solutions_are_warned_of(tmp_path):
    (said,) = (w for w in read_folder(folder(tmp_path, flags=(50, 16, 34))).warnings if "MRK" in w)
    assert "1 with flag 16, 1 with flag 34, 1 with flag 50; 50 is fixed" in said


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (line(7) + line(7), ":2: number: 7 again"),
        ("7 nothing\n", ":1: mark: '7 nothing'; must be number, time, N, E, V"),
        (line(7, lat=95.0), ":1: mark: "),
    ],
)
def test_a_line_that_is_none_is_refused(tmp_path, text, says):
    path = folder(tmp_path)
    (path / "DJI_20240501_Timestamp.MRK").write_text(text)
    with pytest.raises(FlightError) as error:
        read_folder(path)
    assert says in error.value.problems[0]


# --- the camera of a picture: units, principal point, distortion beside OpenCV's own ---------


DISTORTION = [-0.11, 0.2, -0.18, 0.0003, 0.0005]
FISHEYE = {
    "Camera:ModelType": "fisheye",
    metadata.POLYNOMIAL: "0,1,0,0",
    metadata.MATRIX: f"{364 * np.pi / 2},0,0,{364 * np.pi / 2}",
    metadata.POINT: "2.3925,1.7925",
}


def lens_of(tmp_path, properties, *, exif=None, name="a.tif", **known):
    return metadata.lens_of(
        read(tagged.write(tmp_path / name, properties, exif=exif)), "CAM", **known
    )


@pytest.mark.parametrize(
    ("focal", "unit"),
    [(5.46, "mm"), (364.0, None), (5.46, None), (364.0, "pixel"), ("546/100", "mm")],
)
def test_a_focal_length_is_told_in_mm_and_in_pixels(tmp_path, focal, unit):
    said = {metadata.UNITS: unit} if unit else {}
    found = lens_of(tmp_path, tagged.micasense(0, focal=focal, **said))
    assert found.camera.interior.f == pytest.approx(5.46)
    assert found.camera.pixel_mm == tagged.PIXEL_MM


@pytest.mark.parametrize(("focal", "unit"), [(364.0, "mm"), (5.46, "pixel"), (-5.0, "mm")])
def test_a_unit_that_contradicts_the_number_is_refused(tmp_path, focal, unit):
    with pytest.raises(FlightError, match=metadata.FOCAL):
        lens_of(tmp_path, tagged.micasense(0, focal=focal, **{metadata.UNITS: unit}))


def test_rays_are_those_of_opencv_with_the_vendors_coefficients(tmp_path):
    """Its order there is k1 k2 p1 p2 k3, in the metadata k1 k2 k3 p1 p2."""
    shifted = {metadata.POINT: "2.43,1.80", metadata.DISTORTION: DISTORTION}
    found = lens_of(tmp_path, tagged.micasense(0, **shifted))
    colrow = np.stack(np.meshgrid(np.linspace(0, 319, 9), np.linspace(0, 239, 7)), -1).reshape(
        -1, 2
    )
    matrix = np.array([[364, 0, 2.43 / 0.015], [0, 364, 1.80 / 0.015], [0, 0, 1]])
    k1, k2, k3, p1, p2 = DISTORTION
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-13)
    distortion = np.array([k1, k2, p1, p2, k3])
    rays = cv2.undistortPoints(colrow, matrix, distortion, None, None, None, criteria)[:, 0]
    ours = correct(found.camera.interior, xy_from_colrow(found.camera, colrow))
    apart = ours / found.camera.interior.f - rays * [1, -1]
    assert 364 * np.abs(apart).max() <= found.fitted.largest_px + 1e-6 < 0.1


def test_djis_calibration_counts_its_centre_from_the_middle(tmp_path):
    exact = {metadata.DEWARP: "2018-03-13;364,360,2.5,-1.5,0,0,0,0,0"}
    camera = lens_of(tmp_path, exact, name="a.jpg").camera
    assert camera.interior.f == pytest.approx(360 * tagged.PIXEL_MM)
    assert camera.interior.b1 == pytest.approx(360 / 364 - 1)
    assert camera.interior.xp == pytest.approx(2.5 * 360 / 364 * tagged.PIXEL_MM)
    assert camera.interior.yp == pytest.approx(1.5 * tagged.PIXEL_MM)


def test_an_image_that_dji_has_undistorted_has_no_distortion(tmp_path):
    numbers = "364,364,0,0,-0.2,0.1,0,0,0"
    kept = lens_of(tmp_path, {metadata.DEWARP: numbers, "drone-dji:DewarpFlag": "0"}, name="a.jpg")
    gone = lens_of(tmp_path, {metadata.DEWARP: numbers, "drone-dji:DewarpFlag": "1"}, name="b.jpg")
    assert kept.camera.interior.k1 != 0 == gone.camera.interior.k1


def test_multispectral_pictures_of_dji_have_both_name_spaces(tmp_path):
    """Their calibration is DEWARP; FOCAL, in mm, has no distortion, and no pixel size with it."""
    both = {metadata.FOCAL: 4.34, metadata.POINT: "2.4,1.8", metadata.DESIGNED: "362"}
    found = lens_of(tmp_path, {**both, metadata.DEWARP: "2023-01-01;364,364,0,0,-0.2,0.1,0,0,0"})
    assert metadata.DEWARP in found.said
    assert found.camera.interior.k1 != 0
    bare = lens_of(tmp_path, both, exif=tagged.metadata(pixel_mm=None), name="b.tif")
    assert metadata.DESIGNED in bare.said


def test_the_focal_length_of_35_mm_film_is_over_the_width(tmp_path):
    exif = tagged.metadata(pixel_mm=None)
    exif.get_ifd(tagged.EXIF)[41989] = 24
    camera = lens_of(tmp_path, None, exif=exif, name="a.jpg").camera
    assert camera.interior.f / camera.pixel_mm == pytest.approx(24 / 36 * 320)


@pytest.mark.parametrize(
    ("properties", "said"),
    [
        ({"Camera:ModelType": "brown"}, "must be perspective or fisheye"),
        ({"Camera:ModelType": "fisheye"}, "FisheyePolynomial: missing"),
        (FISHEYE | {metadata.POLYNOMIAL: "5,1,0,0"}, "must be 0, a positive number, and others"),
        (FISHEYE | {metadata.POLYNOMIAL: "0,0.1,0,0"}, "got none at col"),
        ({metadata.DISTORTION: [1, 2]}, "must be 5"),
        ({metadata.POINT: "1.0"}, "must be 2"),
    ],
)
def test_a_lens_that_is_none_is_refused_with_its_element(tmp_path, properties, said):
    with pytest.raises(FlightError, match=said):
        lens_of(tmp_path, tagged.micasense(0) | properties)


def test_a_picture_says_that_its_lens_is_a_fisheye(tmp_path):
    found = metadata.lens_of(read(tagged.write(tmp_path / "a.tif", FISHEYE)), "F")
    assert found.camera.interior.f == pytest.approx(364 * tagged.PIXEL_MM)
    assert found.fitted.largest_px < 0.2
