"""A trajectory at the times of events, from files to the tables of a flight."""

import re

import numpy as np
import pytest

from acx4book.reference import data
from acx4files.exchange import safe
from acx4files.exchange.safe import Opened
from acx4files.exchange.trajectories import sbet
from acx4lib.errors import FlightError
from acx4lib.geometry import frames
from support.helpers import needs

START = 604_795.0
T = np.arange(0, 10, 0.01)


@pytest.fixture
def files(tmp_path, made):
    """An SBET and an SMRMSG through the end of a week, without records from 6.0 to 6.5 s."""
    there = (T <= 6.0) | (T >= 6.5)
    (tmp_path / "a.sbet").write_bytes(made.sbet(T[there], start=START))
    (tmp_path / "a.smrmsg").write_bytes(made.smrmsg(np.arange(0.5, 10), start=START))
    return tmp_path


def read(folder, events, *, deviations=False, **options):
    (folder / "events.txt").write_text(events)
    spread = folder / "a.smrmsg" if deviations else None
    given = {"time": "gps-sow", **options}
    return sbet.read(folder / "a.sbet", events=folder / "events.txt", smrmsg=spread, **given)


def error(folder, events, **options):
    with pytest.raises(FlightError) as raised:
        read(folder, events, **options)
    return str(raised.value)


def test_rows_are_the_motion_in_closed_form(files, made):
    events = "image,time\nA,604796.1234\nB,3.25\n"
    brought = read(files, events, deviations=True, camera="CAM")
    table = brought.tables["calibration/trajectory.csv"]
    lonlath, _, rph = made.motion(np.array([1.1234, 8.25]))
    assert table["exposure"] == ["A", "B"]
    assert table["lat_deg"] == pytest.approx(np.degrees(lonlath[:, 1]), abs=1e-10)
    assert table["lon_deg"] == pytest.approx(np.degrees(lonlath[:, 0]), abs=1e-10)
    assert table["height_m"] == pytest.approx(lonlath[:, 2], abs=1e-5)
    assert table["heading_deg"] == pytest.approx(np.degrees(rph[:, 2]) % 360, abs=1e-5)
    assert table["time_s"].tolist() == [604796.1234, 604803.25]
    assert table["sigma_roll_deg"] == pytest.approx([0.05 * 1.0692666, 0.05 * 1.861111], abs=1e-6)
    assert brought.settings == {"heights": "ellipsoidal"}
    assert brought.tables["calibration/images.csv"]["camera"] == ["CAM", "CAM"]
    assert any("differ by 0.0" in line for line in brought.found)


def test_heights_of_the_flight_may_be_others(files, made):
    brought = read(files, "image,time\nA,604796\n", crs="EPSG:32611", heights=-30.0)
    expected = made.motion(np.array([1.0]))[0][0, 2] + 30
    assert brought.tables["calibration/trajectory.csv"]["height_m"] == pytest.approx([expected])
    assert brought.settings == {"crs": "EPSG:32611", "heights": -30.0}


def test_clocks_are_never_mixed_silently(files):
    utc = "image,time\nA,604778.0\n"
    said = error(files, utc, time="utc-sow")
    assert "events.txt:1: times: are UTC, those of the trajectory GPS time; needs --leap-" in said
    brought = read(files, utc, time="utc-sow", leap_seconds=18)
    assert brought.tables["calibration/trajectory.csv"]["time_s"].tolist() == [604796.0]
    assert "18 s ahead of UTC" in brought.assumed[0]


def test_gaps_and_events_outside_are_named_by_line(files):
    said = error(files, "image,time\nA,604796\nB,604794\nC,1.2\nD,400000\n").split("\n")
    places = "must lie between 604795.000 and 604804.990 s, of a.sbet"
    assert said[0].endswith(f"events.txt:3: time: is 604794.000 s; {places}")
    assert "events.txt:4: time: lies in a gap of 0.500 s; must be at most 0.1 s" in said[1]
    assert "events.txt:5: time: is 400000.000 s" in said[2]


@pytest.mark.parametrize("rate", [1, 10, 200])
def test_steps_of_the_trajectorys_own_rate_are_no_gaps(tmp_path, made, rate):
    t = np.round(np.arange(0, 20, 1 / rate), 6)
    (tmp_path / "a.sbet").write_bytes(made.sbet(t, start=381000.005))
    rows = "".join(f"E{k},{381000.5 + 0.97 * k:.3f}\n" for k in range(15))
    read(tmp_path, f"image,time\n{rows}")


def test_a_week_that_is_not_the_trajectorys_is_outside(files):
    events = "image,week,time\nA,2300,604796\nB,2301,3\n"
    found = read(files, events, time="gps-week-sow")
    assert found.tables["calibration/trajectory.csv"]["time_s"].tolist() == [604796, 604803]
    assert "is 1209603.000 s" in error(files, events.replace("2301", "2302"), time="gps-week-sow")


# --- SBET and SMRMSG: PDAL's samples, and records that no trajectory has


TIMES = np.arange(0, 2, 0.5)


@needs("applanix_pdal")
def test_the_numbers_of_pdal_and_the_direction_of_motion():
    track = sbet.read_track(safe.read(data.path("applanix_pdal/2-points.sbet")))
    rows = np.arange(2)
    lon, lat, height = track.lonlath(rows)[0]
    assert np.degrees([lat, lon]) == pytest.approx([32.54521659, -116.9781799], abs=1e-7)
    assert height == pytest.approx(107.71529533, abs=1e-8)
    degrees = np.degrees(track.rph(rows))
    assert degrees[0, :2] == pytest.approx([-1.61196356, -1.39223324], abs=1e-8)
    assert degrees[:, 2] == pytest.approx([175.82684609, 175.84735154], abs=1e-8)
    assert track.velocity(rows).mean(axis=0)[:2] == pytest.approx([-2.34108, 0.28158], abs=1e-4)
    with pytest.raises(FlightError, match="has 271 bytes; must be a multiple of 136"):
        sbet.read_track(safe.read(data.path("applanix_pdal/badfile.sbet")))


SMRMSG = data.folder() / "applanix_pdal/smrmsg_first200.smrmsg"


@pytest.mark.skipif(not SMRMSG.is_file(), reason="a part of PDAL's file, not fetched")
def test_deviations_are_those_of_the_text_beside_them():
    found = sbet.read_deviations(safe.read(SMRMSG))
    text = np.loadtxt(SMRMSG.with_suffix(".txt"), delimiter=",", skiprows=1)
    assert found.time == pytest.approx(text[:, 0])
    assert found.sigma[:, :3] == pytest.approx(text[:, [2, 1, 3]], abs=1e-6)
    assert found.sigma[:, 3:] == pytest.approx(text[:, 7:] / 60, abs=1e-6)


def test_velocities_and_headings_do_not_depend_on_the_wander_angle(made):
    rows = np.arange(len(TIMES))
    _, velocity, rph = made.motion(TIMES)
    for wander in (0.0, 0.3, -2.0):
        track = sbet.read_track(Opened(file="a", data=made.sbet(TIMES, wander=wander)))
        assert track.velocity(rows) == pytest.approx(velocity)
        assert np.cos(track.rph(rows) - rph) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("field", "value", "says"),
    [
        (1, np.nan, "lat: record 2 of 4 has (nan); must be -1.5708 to 1.5708"),
        (7, 57.3, "roll: record 2 of 4 has (57.3); must be -10 to 10"),
        (0, 0.0, "time: record 2 of 4 has (0.0); must be after that before"),
    ],
)
def test_records_that_no_trajectory_has_are_named(made, field, value, says):
    records = np.frombuffer(made.sbet(TIMES)).reshape(-1, 17).copy()
    records[1, field] = value
    with pytest.raises(FlightError) as raised:
        sbet.read_track(Opened(file="a.sbet", data=records.tobytes()))
    assert str(raised.value) == f"a.sbet:1: {says}"


# --- What lies between two records follows a motion in closed form


METRES = np.array([111_320.0, 111_320.0, 1.0])
EVENTS = np.linspace(0.3, 9.7, 40)
WHEN = "image,time\n" + "".join(f"E{k},{t!r}\n" for k, t in enumerate(EVENTS.tolist()))


def at_rate(folder, made, interval, *, westward=1):
    times = np.arange(0, 10 + interval / 2, interval)
    records = np.frombuffer(made.sbet(times)).reshape(-1, 17).copy()
    records[:, 5] *= westward
    (folder / "a.sbet").write_bytes(records.tobytes())
    return read(folder, WHEN)


def columns(brought, *names):
    table = brought.tables["calibration/trajectory.csv"]
    return np.stack([table[name] for name in names], axis=1)


def misfit_m(folder, made, interval, **how):
    truth = made.motion(EVENTS)[0]
    truth[:, :2] = np.degrees(truth[:, :2])
    found = columns(at_rate(folder, made, interval, **how), "lon_deg", "lat_deg", "height_m")
    return float(np.abs((found - truth) * METRES).max())


def test_positions_with_velocities_have_errors_of_the_fourth_power_of_the_interval(tmp_path, made):
    # h^4 / 384 of the fourth derivative; that of the height is 3 (2 pi / 8)^4 = 1.14 m/s^4
    coarse, fine = misfit_m(tmp_path, made, 0.5), misfit_m(tmp_path, made, 0.25)
    assert 0.3 * 1.9e-4 < coarse < 8 * 1.9e-4
    assert coarse / fine == pytest.approx(16, rel=0.4)  # heights have five decimals
    assert misfit_m(tmp_path, made, 0.005) < 6e-6
    assert misfit_m(tmp_path, made, 0.5, westward=-1) > 0.03  # on straight lines


def test_attitudes_turn_as_rotations_through_north(tmp_path, made):
    found = columns(at_rate(tmp_path, made, 0.005), "roll_deg", "pitch_deg", "heading_deg")
    rph, truth = np.radians(found), made.motion(EVENTS)[2]
    R, R_true = (frames.rotation_from_rph(one) for one in (rph, truth))
    assert np.abs(frames.log(np.swapaxes(R, 1, 2) @ R_true)).max() < 1e-7
    assert rph[:, 2].min() < 0.1  # the heading passes 360 degrees
    assert rph[:, 2].max() > 6.2


def test_records_across_the_antimeridian(tmp_path, made):
    records = np.frombuffer(made.sbet(np.array([0.0, 1.0]))).reshape(-1, 17).copy()
    records[:, 2] = [np.pi - 1e-6, -np.pi + 1e-6]
    (tmp_path / "a.sbet").write_bytes(records.tobytes())
    lon = columns(read(tmp_path, "image,time\nA,0.25\nB,0.75\n"), "lon_deg")[:, 0]
    assert np.abs(lon) == pytest.approx(180.0, abs=1e-4)
    assert np.sign(lon).tolist() == [1, -1]


def test_velocities_that_do_not_fit_are_seen(tmp_path, made):
    said = " ".join(at_rate(tmp_path, made, 0.005).found)
    off, speed = map(float, re.search(r"differ by (\S+) m/s .* at (\S+) m/s", said).groups())
    assert off < 0.3
    assert speed == pytest.approx(56.0, abs=3.0)
    other = at_rate(tmp_path, made, 0.005, westward=-1)
    said = " ".join((*other.found, *other.left_out))
    assert "positions are on straight lines" in said
    assert float(re.search(r"differ by (\S+) m/s", said)[1]) > 30


# --- Time bases of events


@pytest.mark.parametrize(
    ("base", "event", "start", "expected"),
    [
        ("gps-week-sow", "image,week,time\nA,2300,100.5\n", 100, 100.5),
        ("gps-sow", "image,time\nA,100.5\n", 100, 100.5),
        # GPS week 2300 began on Sunday, 4 February 2024; a Monday follows
        ("iso-8601", "image,time\nA,2024-02-05T00:00:01.25Z\n", 86_400, 86_401.25),
        ("iso-8601", "image,time\nA,2024-02-05T02:00:01+02:00\n", 86_400, 86_401.0),
    ],
)
def test_every_base(tmp_path, made, base, event, start, expected):
    (tmp_path / "a.sbet").write_bytes(made.sbet(T, start=start))
    brought = read(tmp_path, event, time=base, leap_seconds=0)
    assert columns(brought, "time_s").tolist() == [[expected]]


@pytest.mark.parametrize(
    ("base", "event", "says"),
    [
        ("gps-sow", "image,time\nA,700000\n", ":2: time: '700000'; must be seconds of the week"),
        ("gps-week-sow", "image,time,week\nA,1,1.5\n", "must be the GPS week"),
        (
            "iso-8601",
            "image,time\nA,2024-02-05T00:00:01\n",
            "must be a date with its time and zone",
        ),
        ("iso-8601", "image,time\nA,5.2.2024\n", "must be a date with its time"),
    ],
)
def test_other_cells_are_refused(files, base, event, says):
    assert says in error(files, event, time=base)
