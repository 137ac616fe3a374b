"""Timestamp.MRK of a drone: the antenna's positions, moved to the camera and joined by number."""

import numpy as np
import pyproj
import pytest
from numpy.testing import assert_allclose

from acx4lib.errors import FlightError
from acx4tools.exchange.pictures import marks
from acx4tools.exchange.pictures.folder import bring
from support.pictures import tagged

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
    """PROJ's geodesic between both is as long, and points as the offset does."""
    found, sums = marks.marks_of(folder(tmp_path))
    assert set(found) == {7, 8, 9}
    assert list(sums) == ["DJI_20240501_Timestamp.MRK"]
    camera = found[7]
    azimuth, _, length = pyproj.Geod(ellps="WGS84").inv(LON, LAT, camera.lon_deg, camera.lat_deg)
    assert_allclose(length, np.hypot(0.040, 0.025), rtol=1e-5)
    assert_allclose(azimuth, np.degrees(np.arctan2(25, -40)), atol=0.01)
    assert_allclose(camera.height_m, HEIGHT - 0.186)
    assert camera.sigma_m == (0.031, 0.028, 0.055)  # east, north, height


def test_marks_are_joined_to_the_pictures_by_number(tmp_path):
    brought = bring(folder(tmp_path, time="2024:05:01 10:20:30"))
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
    (said,) = (w for w in bring(folder(tmp_path, flags=(50, 16, 34))).warnings if "MRK" in w)
    assert said.endswith("1 with flag 16 (single), 1 with flag 34 (float)")


def test_a_picture_without_a_mark_keeps_its_own_position_and_is_named(tmp_path):
    path = folder(tmp_path)
    (path / "DJI_20240501_Timestamp.MRK").write_text(line(7) + line(8))
    brought = bring(path)
    track = brought.tables["calibration/trajectory.csv"]
    assert sorted(track["height_m"]) == pytest.approx([100.0, HEIGHT - 0.186, HEIGHT - 0.186])
    assert any("1 exposure without a mark" in one for one in brought.assumed)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (line(7) + line(7), "number: line 2: 7 again"),
        ("7 nothing\n", "line 1: '7 nothing'; must be number, time, N, E, V"),
        (line(7, lat=95.0), "line 1: "),
    ],
)
def test_a_line_that_is_none_is_refused(tmp_path, text, says):
    path = folder(tmp_path)
    (path / "DJI_20240501_Timestamp.MRK").write_text(text)
    with pytest.raises(FlightError) as error:
        bring(path)
    assert says in error.value.problems[0]
