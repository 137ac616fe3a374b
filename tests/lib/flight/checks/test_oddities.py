"""What is said of a CRS far from where it is meant for."""

import pytest

from acx4lib.flight.checks import oddities
from acx4lib.geometry.geodesy import GridSystem
from support.flights.simulated import fly


def area_notes(design, crs):
    """Return what is said of a CRS for a flight of the simulator."""
    read = fly(design, seed=1).flight
    grid = GridSystem(crs=crs)
    return list(oddities.area_notes(grid, read.blocks))


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
    assert oddities.holds((west, -50.0, east, -30.0), lon, -40.0) is inside
