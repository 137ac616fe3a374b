"""The table [certificate]: stated values are read, faults are lines with their cure."""

import datetime as dt

import pytest

from acx4lib import flight
from support.flights import written
from support.helpers import flight_problems

STATED = """
[certificate]
number = "2026-031"
operator = "Aero <b>Sul</b> & $x$"
antenna_lever_m = [0.12, -0.03, 1]
valid_until = 2028-11-22

[certificate.cameras.CAM]
maker = "Maker"
lens_serial = "77"
"""


def stating(folder, text):
    path = written.write_flight(folder / "flight")
    toml = path / "flight.toml"
    toml.write_text(toml.read_text(encoding="utf-8") + text, encoding="utf-8")
    return path


def test_what_is_stated_is_read_and_the_rest_is_empty(tmp_path):
    found = flight.read(stating(tmp_path, STATED)).certificate
    assert (found.number, found.operator, found.laboratory) == (
        "2026-031",
        "Aero <b>Sul</b> & $x$",
        "",
    )
    assert found.antenna_lever_m == (0.12, -0.03, 1.0)
    assert found.valid_until == dt.date(2028, 11, 22)
    assert (found.cameras["CAM"].maker, found.cameras["CAM"].serial) == ("Maker", "")


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[certificate]\nserial = 'x'\n", "certificate.serial: unknown key"),
        (
            "[certificate]\nimu_serial = 4711\n",
            "certificate.imu_serial: 4711; must be text in quotes",
        ),
        ("[certificate]\nnumber = ''\n", "certificate.number: ''; must be text in quotes"),
        ("[certificate]\noperator = '=1+1'\n", "would be computed as a formula"),
        ('[certificate]\noperator = "a\\u202Eb"\n', "holds the character U+202E"),
        ("[certificate]\nvalid_until = '2028-11-22'\n", "must be a date without quotes"),
        ("[certificate]\nvalid_until = 2028-11-22T10:00:00\n", "must be a date without quotes"),
        (
            "[certificate]\nantenna_lever_m = 1.2\n",
            "must be a list of three numbers: x, y, z, in m",
        ),
        ("[certificate]\nantenna_lever_m = [0, 1, true]\n", "must be a list of three numbers"),
        ("[certificate]\nantenna_lever_m = [0, 1, 1284]\n", "[0, 1, 1284]; must lie between"),
        (
            "[certificate.cameras.CAMM]\nserial = '1'\n",
            "no camera of this name (did you mean 'CAM'?)",
        ),
        ("[certificate.cameras]\nCAM = 3\n", "certificate.cameras.CAM: 3; must be a table"),
        ("[certificate.cameras.CAM]\nlens_serial = 3\n", "lens_serial: 3; must be text in quotes"),
        ("[certificate.cameras.CAM]\nlense = 'x'\n", "unknown key (did you mean 'lens'?)"),
    ],
)
def test_a_fault_is_one_line_that_says_what_it_must_be(tmp_path, text, says):
    (line,) = flight_problems(stating(tmp_path, text))
    assert says in line
