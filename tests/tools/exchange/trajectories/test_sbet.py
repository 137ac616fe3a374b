"""SBET and SMRMSG: PDAL's samples, and records that no trajectory has."""

import numpy as np
import pytest

from acx4book.reference import data
from acx4lib.errors import FlightError
from acx4tools.exchange.safe import opened
from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.trajectories import sbet
from support.reference_files import needs

T = np.arange(0, 2, 0.5)


@needs("applanix_pdal")
def test_the_numbers_of_pdal_and_the_direction_of_motion():
    track = sbet.read_track(opened.read(data.path("applanix_pdal/2-points.sbet")))
    rows = np.arange(2)
    lon, lat, height = track.lonlath(rows)[0]
    assert np.degrees([lat, lon]) == pytest.approx([32.54521659, -116.9781799], abs=1e-7)
    assert height == pytest.approx(107.71529533, abs=1e-8)
    degrees = np.degrees(track.rph(rows))
    assert degrees[0, :2] == pytest.approx([-1.61196356, -1.39223324], abs=1e-8)
    assert degrees[:, 2] == pytest.approx([175.82684609, 175.84735154], abs=1e-8)
    assert track.velocity(rows).mean(axis=0)[:2] == pytest.approx([-2.34108, 0.28158], abs=1e-4)
    with pytest.raises(FlightError, match="has 271 bytes; must be a multiple of 136"):
        sbet.read_track(opened.read(data.path("applanix_pdal/badfile.sbet")))


SMRMSG = data.folder() / "applanix_pdal/smrmsg_first200.smrmsg"


@pytest.mark.skipif(not SMRMSG.is_file(), reason="a part of PDAL's file, not fetched")
def test_deviations_are_those_of_the_text_beside_them():
    found = sbet.read_deviations(opened.read(SMRMSG))
    text = np.loadtxt(SMRMSG.with_suffix(".txt"), delimiter=",", skiprows=1)
    assert found.time == pytest.approx(text[:, 0])
    assert found.sigma[:, :3] == pytest.approx(text[:, [2, 1, 3]], abs=1e-6)
    assert found.sigma[:, 3:] == pytest.approx(text[:, 7:] / 60, abs=1e-6)


def test_velocities_and_headings_do_not_depend_on_the_wander_angle(made):
    rows = np.arange(len(T))
    _, velocity, rph = made.motion(T)
    for wander in (0.0, 0.3, -2.0):
        track = sbet.read_track(Opened(file="a", data=made.sbet(T, wander=wander)))
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
    records = np.frombuffer(made.sbet(T)).reshape(-1, 17).copy()
    records[1, field] = value
    with pytest.raises(FlightError) as raised:
        sbet.read_track(Opened(file="a.sbet", data=records.tobytes()))
    assert str(raised.value) == f"a.sbet:1: {says}"


def test_deviations_that_are_not_positive_are_named(made):
    records = np.frombuffer(made.smrmsg(T)).reshape(-1, 10).copy()
    records[2, 7] = 0.0
    with pytest.raises(FlightError, match=r"roll: record 3 of 4 has \(0.0\); must be a positive"):
        sbet.read_deviations(Opened(file="a", data=records.tobytes()))
