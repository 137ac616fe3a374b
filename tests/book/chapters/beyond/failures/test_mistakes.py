"""Planted mistakes change what they are to change, by what they are to change it."""

import numpy as np
import pandas as pd
import pyproj
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.beyond.failures import mistakes
from acx4book.chapters.beyond.failures.mistakes import CONTROL, MISTAKES, TRAJECTORY


@pytest.fixture(scope="module")
def flight():
    return mistakes.flown(1)


def changed(flight, name):
    """Return the columns that a mistake changes, by table."""
    other = MISTAKES[name](flight)
    return {
        (path, column)
        for path, table in flight.tables.items()
        for column in table
        if not table[column].equals(other.tables[path][column])
    }


@pytest.mark.parametrize(
    ("name", "columns"),
    [
        ("no mistake", set()),
        ("wrong sign", {(TRAJECTORY, "pitch_deg")}),
        ("angles exchanged", {(TRAJECTORY, "roll_deg"), (TRAJECTORY, "pitch_deg")}),
        ("coordinates exchanged", {(CONTROL, "east_m"), (CONTROL, "north_m")}),
        ("convergence", {(TRAJECTORY, "heading_deg")}),
        ("geoid", {(CONTROL, "height_m")}),
        ("delay", {(TRAJECTORY, name) for name in ("lat_deg", "lon_deg", "height_m")}),
    ],
)
def test_a_mistake_changes_its_columns_only(flight, name, columns):
    assert changed(flight, name) == columns


def test_the_convergence_is_that_of_proj(flight):
    table, other = flight.tables[TRAJECTORY], MISTAKES["convergence"](flight).tables[TRAJECTORY]
    factors = pyproj.Proj(flight.plan.crs).get_factors(table["lon_deg"], table["lat_deg"])
    assert_allclose(table["heading_deg"] - other["heading_deg"], factors.meridian_convergence)


def test_a_delay_moves_positions_along_the_flight(flight):
    late = MISTAKES["delay"](flight).tables[TRAJECTORY]
    now = flight.tables[TRAJECTORY]
    geod = pyproj.Geod(ellps="GRS80")
    azimuth, _, metres = geod.inv(now["lon_deg"], now["lat_deg"], late["lon_deg"], late["lat_deg"])
    assert_allclose(metres, 70 * mistakes.DELAY_S, rtol=0.3)  # 70 m/s, less regular exposures
    off = (azimuth - now["heading_deg"] + 180) % 360 - 180
    assert np.all(np.abs(off) < 20)  # crab and wind


def test_one_direction_is_one_height_and_one_direction(flight):
    track = MISTAKES["one direction"](flight).tables[TRAJECTORY]
    assert np.ptp(track["height_m"]) < 60
    turns = np.exp(1j * np.radians(track["heading_deg"]))
    assert abs(turns.mean()) > 0.99


def test_gross_errors_are_told_by_the_truth(flight):
    spoiled = MISTAKES["gross errors"](flight)
    assert {one["kind"] for one in spoiled.truth["gross_errors"]} >= {"image_point", "gnss"}
    kept = pd.DataFrame(spoiled.tables[TRAJECTORY]["heading_deg"])
    assert (kept.ne(flight.tables[TRAJECTORY][["heading_deg"]])).sum().item() == 1
