"""A flight of pictures alone, from their metadata to a stack of bands."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from acx4files.exchange import flight_folder, metadata
from acx4files.exchange.metadata import read
from acx4files.exchange.pictures import read_folder
from acx4files.flight import reader
from acx4files.measuring.measure import read_unmeasured
from acx4lib.errors import FlightError
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
    flight_folder.write(read_folder(pictures), tmp_path / "flight")
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
    brought = read_folder(tmp_path / "a")
    assert brought.left_out == (
        "1 picture of another kind than 320 x 240 px, 1 x 16 bit: IMG_0001_1.jpg",
    )
    assert "RigRelatives" in read_folder(pictures).assumed[-1]
    assert read_folder(pictures).settings["crs"] == "EPSG:32630"
    assert read_folder(pictures, crs="EPSG:2154").settings["crs"] == "EPSG:2154"


def test_one_camera_makes_a_calibration_block_with_its_track(tmp_path):
    for k in range(3):
        exif = tagged.metadata(lat=-25.0 - 0.001 * k, lon=151.0, time=f"2024:05:01 10:20:3{k}")
        tagged.write(
            tmp_path / f"DJI_000{k}.JPG", {"drone-dji:CalibratedFocalLength": 300}, exif=exif
        )
    brought = read_folder(tmp_path)
    assert brought.settings["crs"] == "EPSG:32756"
    assert "synthetic" not in brought.settings
    track = brought.tables["calibration/trajectory.csv"]
    assert track["heading_deg"] == pytest.approx([180.0] * 3)
    assert np.diff(track["time_s"]) == pytest.approx([1, 1])


def test_two_pictures_of_one_head_at_one_exposure_are_refused(tmp_path):
    for k in (1, 2):
        tagged.write(tmp_path / f"IMG_0001_{k}.tif", tagged.micasense(0))
    with pytest.raises(FlightError, match=r"RigCameraIndex.*of the same exposure"):
        read_folder(tmp_path)


@pytest.mark.parametrize("name", ["DJI_0001.JPG", "IMG_0001_1.tif"])
def test_a_picture_that_is_cut_off_is_refused(tmp_path, name):
    path = tagged.write(tmp_path / name, tagged.micasense(0))
    assert read_folder(tmp_path).found
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(FlightError, match="is cut off: its pixels have no end"):
        read_folder(tmp_path)


def test_the_height_above_take_off_tells_the_ground(tmp_path):
    """55 m of EXIF less 30 m."""
    said = {"drone-dji:CalibratedFocalLength": 300, "drone-dji:RelativeAltitude": "+30.00"}
    tagged.write(tmp_path / "DJI_0001.JPG", said)
    found = next(one for one in read_folder(tmp_path).found if one.startswith("ground at take-off"))
    assert found.startswith("ground at take-off at 25.0 m")
    assert found.endswith("acx4 measure takes it by --ground 25")


def test_a_lens_that_no_camera_is_like_is_refused_unless_it_is_allowed(tmp_path):
    """Decentring as large as this is no camera's: it leaves more than 2 px."""
    odd = tagged.micasense(0) | {metadata.DISTORTION: [-0.4, 0.3, 0.1, 0.03, 0.03]}
    tagged.write(tmp_path / "a" / "IMG_0001_1.tif", odd)
    with pytest.raises(
        FlightError, match=r"lens: .*differs by .* px at most.*must be at most 2 px"
    ):
        read_folder(tmp_path / "a")
    (said,) = read_folder(tmp_path / "a", allow=20.0).warnings
    assert said.startswith("the lens of 1 Band0 differs from that of its metadata by ")


# --- When, where and how a picture was taken


def tags_of(tmp_path, properties=None, *, name="IMG_0001_1.tif", **exif):
    return read(tagged.write(tmp_path / name, properties, exif=tagged.metadata(**exif)))


@pytest.mark.parametrize(("lat", "lon"), [(47.696732, -3.193452), (-25.4483, 151.25)])
def test_positions_have_the_signs_of_their_letters(tmp_path, lat, lon):
    found = metadata.place_of(tags_of(tmp_path, lat=lat, lon=lon, height=-3.25))
    assert found == pytest.approx((lat, lon, -3.25), abs=1e-8)


def test_a_gimbal_that_looks_down_is_level(tmp_path):
    angles = dict(zip(metadata.GIMBAL, ("+0.50", "-89.90", "-132.00"), strict=True))
    held = metadata.attitude_of(tags_of(tmp_path, angles))
    assert (held.roll, held.pitch, held.heading) == pytest.approx((0.5, 0.1, 228.0))


def test_the_light_sensors_angles_are_radians_and_count_last(tmp_path):
    light = dict(zip(metadata.LIGHT, (0.05, 0.0, 1.0), strict=True))
    held = metadata.attitude_of(tags_of(tmp_path, light))
    assert held.heading == pytest.approx(57.29578)
    camera = dict(zip(metadata.CAMERA, (1.0, 2.0, 300.0), strict=True))
    held = metadata.attitude_of(tags_of(tmp_path, light | camera))
    assert (held.roll, held.pitch, held.heading) == (1.0, 2.0, 300.0)
    assert metadata.attitude_of(tags_of(tmp_path)) is None


# --- Heads, their reference, and what their three angles mean


def test_the_angles_turn_a_ray_of_the_head_into_the_reference():
    """Camera axes of the library have y up and z back, those of the angles y down and z ahead."""
    angles, ray = (3.0, -5.0, 8.0), np.array([0.2, -0.3, 1.0])
    down = np.diag([1, -1, -1])
    turned = Rotation.from_euler("XYZ", angles, degrees=True).apply(ray)
    assert down @ metadata.rotation(angles) @ down @ ray == pytest.approx(turned)


ONE_TURNED, UNTURNED, TWO_TURNED = (0.1, 0, 0), (0.0, 0, 0), (0, 0.2, 0)


@pytest.mark.parametrize(
    ("angles", "reference", "order", "says"),
    [
        ((ONE_TURNED, UNTURNED, TWO_TURNED), 1, "102", "reference, 1;"),
        ((ONE_TURNED, UNTURNED, TWO_TURNED), None, "102", "no file names: 1, whose own angles are"),
        ((ONE_TURNED, TWO_TURNED), None, "01", "no file names: 0, the first"),
    ],
)
def test_the_reference_leads_wherever_it_stands(angles, reference, order, says):
    heads = [
        metadata.Head(name=str(i), index=i, reference=reference, relatives_deg=a)
        for i, a in enumerate(angles)
    ]
    assert "".join(head.name for head in metadata.in_order(heads)) == order
    assert says in metadata.sentence(heads)


# --- Vignetting and dark level by the metadata


def test_the_polynomial_begins_with_the_radius(tmp_path):
    said = {metadata.VIGNETTING_CENTRE: [100, 50], metadata.VIGNETTING_POLYNOMIAL: [1e-3, -2e-5]}
    tags = read(tagged.write(tmp_path / "a.tif", said))
    found = metadata.vignetting(tags, np.array([[100, 50], [103, 54]]))
    assert found == pytest.approx([1.0, 1 + 5e-3 - 25 * 2e-5])


# --- what other makers write


def test_a_clock_that_is_off_the_receiver_s_time_is_told(tmp_path):
    exif = tagged.metadata(time="2024:05:01 12:21:05")
    exif.get_ifd(tagged.GPS)[7] = (10.0, 20.0, 30.0)  # two hours are a zone, 35 s are none
    tagged.write(tmp_path / "IMG_0001.JPG", {"drone-dji:CalibratedFocalLength": 300}, exif=exif)
    (said,) = (one for one in read_folder(tmp_path).found if "clock" in one)
    assert said.startswith("the clock of EXIF is +35 s off the receiver's time")


def test_a_cropped_picture_is_warned_of(tmp_path):
    exif = tagged.metadata()
    own = exif.get_ifd(tagged.EXIF)
    own[40962], own[40963] = 4000, 3000
    tagged.write(tmp_path / "IMG_0001.JPG", {"drone-dji:CalibratedFocalLength": 300}, exif=exif)
    (said,) = read_folder(tmp_path).warnings
    assert said.startswith("1 picture")
    assert "320 x 240 px, and 4000 x 3000 px by their EXIF: cropped or reduced" in said


# --- gimbal and aircraft that look in other directions


def test_an_aircraft_that_looks_elsewhere_than_its_gimbal_is_warned_of(tmp_path):
    for k in range(3):
        angles = dict(zip(metadata.GIMBAL, (0.0, -90.0, 205.0), strict=True))
        said = {"drone-dji:CalibratedFocalLength": 300, "drone-dji:FlightYawDegree": 28.0}
        exif = tagged.metadata(lat=47.5 + 1e-4 * k, time=f"2024:05:01 10:20:3{k}")
        tagged.write(tmp_path / f"DJI_000{k}.JPG", said | angles, exif=exif)
    brought = read_folder(tmp_path)
    assert brought.warnings == (
        "at 3 of 3 exposures the yaw of the gimbal and that of the aircraft differ by 177° "
        "(median): the gimbal's is taken; look where the tops of pictures point",
    )
    assert brought.tables["calibration/trajectory.csv"]["heading_deg"] == [205.0] * 3


def test_a_gimbal_that_is_turned_over_looks_down_with_its_top_behind(tmp_path):
    """Its angles and those without a half turn are of one attitude."""
    angles = dict(zip(metadata.GIMBAL, ("+180.00", "-89.90", "-132.00"), strict=True))
    held = metadata.attitude_of(tags_of(tmp_path, angles))
    level = [Rotation.from_euler("Y", 90, degrees=True), Rotation.identity()]
    turns = ((-132, -89.9, 180), (held.heading, held.pitch, held.roll))
    given, found = (
        Rotation.from_euler("ZYX", one, degrees=True) * by
        for one, by in zip(turns, level, strict=True)
    )
    assert (given.inv() * found).magnitude() < 1e-9
    assert held.heading == pytest.approx(48.0)


# --- exposures that are held out


def flown(path, *, heads=2, n=4):
    for k in range(n):
        exif = tagged.metadata(lat=47.5 + 1e-4 * k, time=f"2024:05:01 10:20:3{k}")
        for head in range(heads):
            said = tagged.micasense(head, relatives=ANGLES[head])
            said["MicaSense:CaptureId"] = f"capture-{k}"
            tagged.write(path / f"IMG_000{k}_{head + 1}.tif", said, exif=exif)
    return path


def test_every_second_exposure_of_heads_is_held_out(tmp_path):
    brought = read_folder(flown(tmp_path / "p"), hold_out=2)
    flight_folder.write(brought, tmp_path / "flight")
    flight = read_unmeasured(tmp_path / "flight").flight
    assert {name: block.trajectory.exposures for name, block in flight.blocks.items()} == {
        "heads": ("IMG_0000", "IMG_0002"),
        "calibration": ("IMG_0000", "IMG_0002"),
        "validation": ("IMG_0001", "IMG_0003"),
    }
    assert flight.transferred == ("calibration", "validation")
    assert all(path.is_file() for files in flight.image_files.values() for path in files)
    assert flight.fix == ("lever_arm",)
    assert flight.estimate_mounting == ()
    assert any("one in 2 in the order of time" in one for one in brought.assumed)
    alone = read_folder(flown(tmp_path / "one", n=1))
    assert {name.partition("/")[0] for name in alone.pictures} == {"heads"}
    assert "stages" not in alone.settings
