"""A trajectory at the times of events, from files to the tables of a flight."""

import numpy as np
import pytest

from acx4lib.errors import FlightError
from acx4tools.exchange.trajectories import pospac
from acx4tools.exchange.trajectories.orientations import Meaning

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
    given = pospac.SbetOptions(**{"time": "gps-sow", **options})
    return pospac.read(folder / "a.sbet", folder / "events.txt", spread, given)


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
    meaning = Meaning(crs="EPSG:32611", heights=-30.0)
    brought = read(files, "image,time\nA,604796\n", meaning=meaning)
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
    late = "image,time\nA,604814.0\n"
    brought = read(files, late, trajectory_time="utc-sow", leap_seconds=18)
    assert brought.tables["calibration/trajectory.csv"]["time_s"].tolist() == [604796.0]


def test_gaps_and_events_outside_are_named_by_line(files):
    said = error(files, "image,time\nA,604796\nB,604794\nC,1.2\nD,400000\n").split("\n")
    places = "must lie between 604795.000 and 604804.990 s, of a.sbet"
    assert said[0].endswith(f"events.txt:3: time: is 604794.000 s; {places}")
    assert "events.txt:4: time: lies in a gap of 0.500 s; must be at most 0.1 s: --gap" in said[1]
    assert "events.txt:5: time: is 400000.000 s" in said[2]
    assert len(read(files, "image,time\nC,1.2\n", gap_s=0.6).tables) == 1


def test_a_week_that_is_not_the_trajectorys_is_outside(files):
    events = "image,week,time\nA,2300,604796\nB,2301,3\n"
    for week in (None, 2300):
        found = read(files, events, time="gps-week-sow", week=week)
        assert found.tables["calibration/trajectory.csv"]["time_s"].tolist() == [604796, 604803]
    assert "is 1209596.000 s" in error(files, events, time="gps-week-sow", week=2299)


def test_velocities_of_another_frame_are_not_used(files):
    records = np.frombuffer((files / "a.sbet").read_bytes()).reshape(-1, 17).copy()
    records[:, 5] *= -1
    (files / "a.sbet").write_bytes(records.tobytes())
    brought = read(files, "image,time\nA,604796\n")
    assert "positions are on straight lines" in " ".join(brought.left_out)
