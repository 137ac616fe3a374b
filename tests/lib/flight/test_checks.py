"""Checks of a flight: its settings, its tables, and what is set up of them."""

import csv
import datetime as dt
import io
import tomllib
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from acx4lib import flight
from acx4lib.flight import checks
from acx4lib.flight.setup import camera_of, camera_table, camera_toml
from acx4lib.flight.tables import read_header, read_rows
from acx4lib.geometry.geodesy import GridSystem
from acx4lib.geometry.parameters import Prior
from support import blocks
from support.flights import written
from support.flights.simulated import fly
from support.flights.written import write_flight
from support.helpers import flight_problems

# --- what is said of a CRS far from where it is meant for ------------------------------------


def area_notes(design, crs):
    """Return what is said of a CRS for a flight of the simulator."""
    read = fly(design, seed=1).flight
    grid = GridSystem(crs=crs)
    return list(checks.area_notes(grid, read.blocks))


def test_a_crs_of_another_country_is_a_note_with_both_places():
    said = area_notes("acx4-ideal", "EPSG:2193")
    assert said[0] == (
        "calibration: the exposures are at 25.4 S 49.3 W, but EPSG:2193 (NZGD2000 / New Zealand "
        "Transverse Mercator 2000) is meant for 47.3 S 166.4 E to 34.1 S 178.6 E, New Zealand - "
        "North Island, South Island, Stewart Island - onshore: is it the right CRS?"
    )
    assert len(said) == 2


@pytest.mark.parametrize(
    "crs",
    [
        "EPSG:31982",  # its own
        "EPSG:31983",  # the next zone to the east begins 1.3 degrees from here
        "EPSG:3857",  # the world
        "+proj=utm +zone=22 +south +ellps=GRS80 +units=m",  # says no area
    ],
)
def test_a_crs_that_fits_or_says_nothing_is_no_note(crs):
    assert not area_notes("acx4-ideal", crs)


@pytest.mark.parametrize(("crs", "fits"), [("EPSG:3832", False), ("EPSG:3851", False)])
def test_an_area_may_cross_the_date_line(crs, fits):
    """From 98.7 east by the date line to 68 west; Brazil's 49.3 west is in neither."""
    assert bool(area_notes("acx4-ideal", crs)) is not fits
    assert area_notes("single-head", crs)  # nor is Bohemia


@pytest.mark.parametrize(
    ("west", "east", "lon", "inside"),
    [
        (160, -171, 175, True),
        (160, -171, -175, True),
        (160, -171, 150, False),
        (160, -171, 0, False),
    ],
)
def test_places_beside_the_date_line(west, east, lon, inside):
    assert checks.holds((west, -50.0, east, -30.0), lon, -40.0) is inside


def test_degrees_in_the_place_of_metres_are_known():
    at = np.array([13.39, 13.41]), np.array([49.79, 49.81])
    assert checks.of_degrees(GridSystem(crs="EPSG:32633"), *at)
    assert not checks.of_degrees(GridSystem(crs="EPSG:32633"), 1e5 + at[0], 1e5 + at[1])
    assert not checks.of_degrees(GridSystem(crs="EPSG:3857"), *at)  # means Africa's coast, too
    assert not checks.of_degrees(GridSystem(crs="+proj=utm +zone=33 +units=m"), *at)


def test_a_trajectory_in_degrees_is_a_problem_of_its_first_row(tmp_path):
    folder = write_flight(tmp_path / "flight")
    path = folder / "calibration/trajectory.csv"
    table = pd.read_csv(path)
    table["east_m"], table["north_m"] = -49.31 + 0.001 * table.index, -25.41
    table.to_csv(path, index=False)
    found = flight_problems(folder)
    assert any(
        "trajectory.csv:2: east_m: -49.31, -25.41 (longitude, latitude in degrees?); must be "
        "metres where EPSG:31982 is meant for" in line
        for line in found
    )


# --- the table [certificate]: stated values are read, faults are lines with their cure -------


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


# --- rows as Python's module csv reads them, whether commas alone cut a text or not ----------


CELLS = st.text(alphabet=" 1ü\x0b\x85\u2028", max_size=3)
END = st.sampled_from(["\n", "\r\n", "\r"])


@given(rows=st.lists(st.tuples(CELLS, CELLS, CELLS), max_size=30), end=END, quoted=st.booleans())
def test_rows_are_those_of_the_module_csv(rows, end, quoted):
    header = '"a",b,c' if quoted else "a,b,c"
    text = end.join([header, *map(",".join, rows)])
    found, problems = read_rows(text, "t.csv", width=3, wanted={"a": 0, "c": 2}, names=["a"])
    _, *expected = csv.reader(io.StringIO(text, newline=""))
    while expected and not any(map(str.strip, expected[-1])):
        expected.pop()
    assert not problems
    assert list(zip(found.columns["a"], found.columns["c"], strict=True)) == [
        (first, last) for first, _, last in expected
    ]
    assert list(found.lines) == list(range(2, 2 + len(expected)))


@pytest.mark.parametrize("quote", ["", '"'])
def test_a_long_cell_is_named_with_its_line_and_long_tables_are_read_in_parts(quote):
    longest = csv.field_size_limit()
    rows = [f"{k},{'x' * 1000}" for k in range(longest // 500)]
    text = "\n".join([f"{quote}a{quote},b", *rows])
    found, problems = read_rows(text, "t.csv", width=2, wanted={"a": 0})
    assert not problems
    assert found.columns["a"] == [str(k) for k in range(len(rows))]
    _, (problem,) = read_rows(f"{text}\n{'y' * (longest + 1)},", "t.csv", width=2, wanted={"a": 0})
    assert (problem.line, problem.found) == (len(rows) + 2, "a cell is too long")


def test_a_quoted_header_may_have_more_than_one_line():
    assert read_header('"a\nb",c\n1,2\n', "t.csv") == (["a\nb", "c"], ())
    assert read_header("a,b\n1,2\n", "t.csv") == (["a", "b"], ())


# --- cameras as flight.toml has them, there and back -----------------------------------------


SIGMA = (0.01, 0.02, 0.03, 1e-4, 2e-4, 3e-4)
KNOWN = replace(blocks.SECOND, prior=Prior(declared=(True,) * 6, sigma=SIGMA))
QUOTED = replace(blocks.CAMERA, name='Phase "One" / 150')


@pytest.mark.parametrize("camera", [blocks.CAMERA, KNOWN, QUOTED], ids=lambda camera: camera.name)
def test_a_camera_comes_back_from_its_lines_in_flight_toml(camera):
    written = tomllib.loads(camera_toml(camera))["cameras"]
    assert written == {camera.name: camera_table(camera)}
    back = camera_of(camera.name, written[camera.name])
    assert (back.width_px, back.height_px) == (camera.width_px, camera.height_px)
    assert_allclose(back.pixel_mm, camera.pixel_mm, rtol=1e-15)
    assert back.interior == camera.interior
    assert_allclose(back.T_b_c.R, camera.T_b_c.R, atol=1e-15)
    assert_allclose(back.T_b_c.r, camera.T_b_c.r, atol=0)
    assert_allclose(back.prior.sigma, camera.prior.sigma, rtol=1e-14)
    assert np.all(back.prior.declared)
