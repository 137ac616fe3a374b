import shutil

import pytest

from acx4lib.flight.reader import read
from support.pictures import measured


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    return measured.flown(tmp_path_factory.mktemp("small"), ("C1-04", "C2-04"), reduce=16)


def test_pictures_become_a_flight_that_is_read(acx4, flight, tmp_path):
    out = tmp_path / "measured"
    status, said, err = acx4("measure", flight, "--out", out, "--points", 150)
    assert (status, err) == (0, "")
    lines = said.splitlines()
    assert lines[0] == "calibration 1/16: done"
    assert lines[1].startswith("calibration: ")
    assert lines[-1] == str(out)
    assert len(read(out).calibration.image_points) > 100


def test_a_flight_is_not_measured_into_itself(acx4, flight):
    status, _, err = acx4("measure", flight, "--out", flight)
    assert status == 2
    assert err == f"{flight}: is the flight itself; choose another folder for the measured one\n"


def test_no_height_of_the_ground_is_needed_where_pictures_overlap(acx4, flight, tmp_path):
    own = shutil.copytree(flight, tmp_path / "own", copy_function=shutil.os.link)
    (own / "control_points.csv").unlink()
    shutil.rmtree(own / "validation")
    status, _, err = acx4("measure", own, "--out", tmp_path / "out")
    assert (status, err) == (0, "")
    assert not len(read(tmp_path / "out").calibration.control)
