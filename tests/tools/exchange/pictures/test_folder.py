"""A flight of pictures alone, from their metadata to a stack of bands."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from acx4lib.errors import FlightError
from acx4lib.flight import reader
from acx4tools.exchange import flight_folder
from acx4tools.exchange.pictures.folder import bring
from support.pictures import tagged

ANGLES = ((0, 0, 0), (0.2, -0.3, 0.5))


@pytest.fixture
def pictures(tmp_path):
    """Two heads at one exposure."""
    for k, angles in enumerate(ANGLES):
        said = tagged.micasense(k, relatives=angles)
        tagged.write(tmp_path / "two" / f"IMG_0007_{k + 1}.tif", said)
    return tmp_path / "two"


def test_mounts_and_files_of_heads_are_those_of_the_metadata(pictures, tmp_path):
    flight_folder.write(bring(pictures), tmp_path / "flight")
    flight = reader.read(tmp_path / "flight")
    assert flight.head_names == ("1 Band0", "2 Band1")
    first, second = (flight.cameras[name].T_b_c.R for name in flight.head_names)
    flip = np.diag([1, -1, -1])
    turned = Rotation.from_euler("XYZ", ANGLES[1], degrees=True).as_matrix()
    assert first.T @ second == pytest.approx(flip @ turned @ flip, abs=1e-12)
    assert all(path.is_file() for path in flight.image_files["heads"])
    assert not len(flight.heads.image_points)


def test_a_flight_names_what_it_assumed_found_and_left_out(pictures, tmp_path):
    tagged.write(tmp_path / "a" / "IMG_0001_1.jpg", tagged.micasense(0))
    for k in (1, 2):
        tagged.write(tmp_path / "a" / f"IMG_0001_{k}.tif", tagged.micasense(k - 1))
    brought = bring(tmp_path / "a")
    assert brought.left_out == (
        "1 picture of another kind than 320 x 240 px, 1 x 16 bit: IMG_0001_1.jpg",
    )
    assert "RigRelatives" in bring(pictures).assumed[-1]
    assert bring(pictures).settings["crs"] == "EPSG:32630"
    assert bring(pictures, crs="EPSG:2154").settings["crs"] == "EPSG:2154"


def test_one_camera_makes_a_calibration_block_with_its_track(tmp_path):
    for k in range(3):
        exif = tagged.metadata(lat=-25.0 - 0.001 * k, lon=151.0, time=f"2024:05:01 10:20:3{k}")
        tagged.write(
            tmp_path / f"DJI_000{k}.JPG", {"drone-dji:CalibratedFocalLength": 300}, exif=exif
        )
    brought = bring(tmp_path)
    assert brought.settings["crs"] == "EPSG:32756"
    assert "synthetic" not in brought.settings
    track = brought.tables["calibration/trajectory.csv"]
    assert track["heading_deg"] == pytest.approx([180.0] * 3)
    assert np.diff(track["time_s"]) == pytest.approx([1, 1])


def test_exposures_without_a_position_are_counted(tmp_path):
    tagged.write(tmp_path / "DJI_0001.JPG", {"drone-dji:CalibratedFocalLength": 300})
    exif = tagged.metadata(lat=None)
    tagged.write(tmp_path / "DJI_0002.JPG", {"drone-dji:CalibratedFocalLength": 300}, exif=exif)
    assert bring(tmp_path).left_out == ("1 exposure without a position: DJI_0002",)


def test_what_is_no_folder_of_pictures_is_refused(tmp_path):
    with pytest.raises(FlightError, match="is no folder"):
        bring(tmp_path / "nowhere")
    with pytest.raises(FlightError, match="holds 0 pictures"):
        bring(tmp_path)
    tagged.write(tmp_path / "a.tif", tagged.micasense(0), exif=tagged.metadata(lat=None))
    with pytest.raises(FlightError, match=r"GPSLatitude.*missing"):
        bring(tmp_path)


def test_two_pictures_of_one_head_at_one_exposure_are_refused(tmp_path):
    for k in (1, 2):
        tagged.write(tmp_path / f"IMG_0001_{k}.tif", tagged.micasense(0))
    with pytest.raises(FlightError, match=r"RigCameraIndex.*of the same exposure"):
        bring(tmp_path)


def test_a_receiver_without_a_fix_gives_no_position(tmp_path):
    focal = {"drone-dji:CalibratedFocalLength": 300}
    for k, place in enumerate(((0.0, 0.0), (-25.0, 151.0))):
        exif = tagged.metadata(lat=place[0], lon=place[1], time=f"2024:05:01 10:20:3{k}")
        tagged.write(tmp_path / f"DJI_000{k}.JPG", focal, exif=exif)
    brought = bring(tmp_path)
    assert brought.left_out == ("1 exposure without a position: DJI_0000",)
    assert brought.settings["crs"] == "EPSG:32756"


def test_a_jpeg_that_is_cut_in_half_is_refused(tmp_path):
    path = tmp_path / "DJI_0001.JPG"
    noise = np.random.default_rng(1).integers(0, 255, tagged.SIZE[::-1]).astype(np.uint8)
    tagged.write(path, {"drone-dji:CalibratedFocalLength": 300}, pixels=noise)
    assert bring(tmp_path).found
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    with pytest.raises(FlightError, match="is cut off: its pixels have no end"):
        bring(tmp_path)
