"""What is said of a CRS far from where it is meant for."""

import numpy as np
import pandas as pd
import pytest

from acx4lib.flight import checks
from acx4lib.geometry.geodesy import GridSystem
from support.flights.simulated import fly
from support.flights.written import write_flight
from support.helpers import flight_problems


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
