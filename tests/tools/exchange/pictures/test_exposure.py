"""When, where and how a picture was taken."""

import datetime as dt

import pytest

from acx4lib.errors import FlightError
from acx4tools.exchange.pictures import exposure
from acx4tools.exchange.pictures.tags import read
from support.pictures import tagged


def tags_of(tmp_path, properties=None, *, name="IMG_0001_1.tif", **exif):
    return read(tagged.write(tmp_path / name, properties, exif=tagged.metadata(**exif)))


@pytest.mark.parametrize(("lat", "lon"), [(47.696732, -3.193452), (-25.4483, 151.25)])
def test_positions_have_the_signs_of_their_letters(tmp_path, lat, lon):
    found = exposure.place_of(tags_of(tmp_path, lat=lat, lon=lon, height=-3.25))
    assert found == pytest.approx((lat, lon, -3.25), abs=1e-8)


def test_a_picture_without_gps_has_no_position(tmp_path):
    assert exposure.place_of(tags_of(tmp_path, lat=None)) is None


def test_a_place_beyond_the_poles_is_refused(tmp_path):
    with pytest.raises(FlightError, match=r"GPSLatitude.*must be on Earth"):
        exposure.place_of(tags_of(tmp_path, lat=91.0))


def test_times_have_parts_of_a_second(tmp_path):
    expected = dt.datetime(2024, 5, 1, 10, 20, 30, 250_000)
    assert exposure.time_of(tags_of(tmp_path)) == expected


def test_what_is_no_time_is_refused(tmp_path):
    with pytest.raises(FlightError, match="DateTimeOriginal: '2024-05-01'; must be a time"):
        exposure.time_of(tags_of(tmp_path, time="2024-05-01"))


def test_a_gimbal_that_looks_down_is_level(tmp_path):
    angles = dict(zip(exposure.GIMBAL, ("+0.50", "-89.90", "-132.00"), strict=True))
    held = exposure.attitude_of(tags_of(tmp_path, angles))
    assert (held.roll, held.pitch, held.heading) == pytest.approx((0.5, 0.1, 228.0))


def test_the_light_sensors_angles_are_radians_and_count_last(tmp_path):
    light = dict(zip(exposure.LIGHT, (0.05, 0.0, 1.0), strict=True))
    held = exposure.attitude_of(tags_of(tmp_path, light))
    assert held.heading == pytest.approx(57.29578)
    camera = dict(zip(exposure.CAMERA, (1.0, 2.0, 300.0), strict=True))
    held = exposure.attitude_of(tags_of(tmp_path, light | camera))
    assert (held.roll, held.pitch, held.heading) == (1.0, 2.0, 300.0)
    assert exposure.attitude_of(tags_of(tmp_path)) is None


def test_sigma_of_positions_are_taken_where_they_are(tmp_path):
    rtk = dict(zip(exposure.RTK, (0.01, 0.02, 0.03), strict=True))
    assert exposure.sigma_of(tags_of(tmp_path, rtk)) == (0.01, 0.02, 0.03)
    said = dict(zip(exposure.ACCURACY, (0.4, 0.8), strict=True))
    assert exposure.sigma_of(tags_of(tmp_path, said)) == (0.4, 0.4, 0.8)
    assert exposure.sigma_of(tags_of(tmp_path)) is None


def test_heads_of_one_exposure_have_one_key(tmp_path):
    named = [tags_of(tmp_path, name=f"IMG_0001_{k}.tif") for k in (1, 10)]
    assert len({exposure.key(one) for one in named}) == 1
    assert {exposure.name_of(one) for one in named} == {"IMG_0001"}
    other = tags_of(tmp_path, {exposure.CAPTURE[0]: "x"}, name="IMG_0001_3.tif")
    assert exposure.key(other) == "x"


def test_the_course_follows_the_track():
    north = [(47.0, 3.0, 0.0), (47.1, 3.0, 0.0), (47.2, 3.0, 0.0)]
    assert exposure.course(north) == pytest.approx([0, 0, 0])
    assert exposure.course([(0.0, 3.0, 0.0), (0.0, 3.1, 0.0)]) == pytest.approx([90, 90])
    assert exposure.course(north[:1]) == [0.0]
