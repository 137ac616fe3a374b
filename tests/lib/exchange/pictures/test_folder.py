"""A flight of pictures alone, from their metadata to a stack of bands."""

import numpy as np
import pytest
import tifffile
from scipy.spatial.transform import Rotation

from acx4lib.errors import FlightError
from acx4lib.exchange import flight_folder
from acx4lib.exchange.pictures.folder import bring
from acx4lib.flight import reader
from acx4lib.production.exposure import RenderOptions
from acx4lib.production.flight_images import render_flight
from acx4lib.stages import synthetic
from acx4lib.synthetic_image.frame import head_pose
from support.pictures import tagged

TRUE = ((0, 0, 0), (0.2, -0.3, 0.5), (-0.4, 0.1, -0.2), (0.1, 0.5, 0.3), (-0.2, -0.2, 0.4))
BANDS = tuple((np.cos(a), np.sin(a)) for a in np.radians([0, 26, 52, 78, 104]))
"""Neighbours see nearly the same; the last is rather bright where the first is dark."""

STATED = tuple((a + 0.15, b - 0.1, c + 0.05) for a, b, c in TRUE[1:])


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    """Five heads at one exposure, in two folders, whose stated angles are off."""
    folder = tmp_path_factory.mktemp("pictures")
    stated = ((0, 0, 0), *STATED)
    for k, grey in enumerate(tagged.pictures_of(TRUE, BANDS)):
        said = tagged.micasense(k, relatives=stated[k], band="abcde"[k])
        place = folder / ("Red" if k < 3 else "Blue") / f"IMG_0007_{k + 1}.tif"
        tagged.write(place, said, pixels=grey)
    return folder


def test_heads_without_a_measured_point_are_turned_by_their_pictures_and_stacked(
    pictures, tmp_path
):
    """The truth within what the pictures give; the stated angles are off by 0.15 deg."""
    flight_folder.write(bring(pictures), tmp_path / "flight")
    flight = reader.read(tmp_path / "flight")
    assert flight.head_names == ("1 a", "2 b", "3 c", "4 d", "5 e")
    stage = synthetic.run(flight, tmp_path / "results")
    flip = np.diag([1, -1, -1])
    for k, angles in enumerate(TRUE):
        R = flip @ head_pose(stage.refinement.orientation, k).R @ flip
        true = Rotation.from_euler("XYZ", angles, degrees=True).as_matrix()
        turned = Rotation.from_matrix(R.T @ true).as_rotvec(degrees=True)
        # 0.15 px: what a band sees of the other landscape is no noise that averages out
        assert np.abs(turned[:2]).max() < 0.024
        assert abs(turned[2]) < 0.05
    options = RenderOptions(blend="stack", equalise="none", compression="deflate")
    made = render_flight(flight, tmp_path / "results", tmp_path / "images", options=options)
    assert not made.problems
    stack = tifffile.imread(tmp_path / "images" / "IMG_0007.tif")
    assert stack.shape == (240, 320, 5)
    inner = stack[20:-20, 20:-20].reshape(-1, 5).astype(float)
    likeness = np.corrcoef(inner.T)
    assert np.abs(likeness - np.array(BANDS) @ np.transpose(BANDS)).max() < 0.12


def test_a_flight_names_what_it_assumed_found_and_left_out(pictures, tmp_path):
    tagged.write(tmp_path / "a" / "IMG_0001_1.jpg", tagged.micasense(0))
    for k in (1, 2):
        tagged.write(tmp_path / "a" / f"IMG_0001_{k}.tif", tagged.micasense(k - 1))
    brought = bring(tmp_path / "a")
    assert brought.left_out == (
        "1 pictures that have not 320 x 240 px, 1 x 16 bit: IMG_0001_1.jpg",
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
    assert bring(tmp_path).left_out == ("1 exposures without a position: DJI_0002",)


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
