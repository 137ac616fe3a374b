"""What plants mistakes changes what it is to change, by what it is to change it."""

import numpy as np
import pandas as pd
import pyproj
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.beyond.failures import mistakes
from acx4book.chapters.beyond.failures.mistakes import CONTROL, TRAJECTORY


@pytest.fixture(scope="module")
def flight():
    return mistakes.flown(1)


def test_only_the_named_columns_are_changed(flight):
    heights = flight.tables[CONTROL]["height_m"] - 45.0
    other = mistakes.changed(flight, {CONTROL: {"height_m": heights}})
    different = {
        (path, column)
        for path, table in flight.tables.items()
        for column in table
        if not table[column].equals(other.tables[path][column])
    }
    assert different == {(CONTROL, "height_m")}
    assert mistakes.changed(flight, {}).tables.keys() == flight.tables.keys()


def test_the_convergence_is_that_of_proj(flight):
    table = flight.tables[TRAJECTORY]
    factors = pyproj.Proj(flight.plan.crs).get_factors(table["lon_deg"], table["lat_deg"])
    assert_allclose(mistakes.convergence_deg(flight), factors.meridian_convergence)


def test_a_delay_moves_positions_along_the_flight(flight):
    late = mistakes.late(flight, by_s=0.1)
    now = flight.tables[TRAJECTORY]
    geod = pyproj.Geod(ellps="GRS80")
    azimuth, _, metres = geod.inv(now["lon_deg"], now["lat_deg"], late["lon_deg"], late["lat_deg"])
    assert_allclose(metres, 70 * 0.1, rtol=0.3)  # 70 m/s, less regular exposures
    off = (azimuth - now["heading_deg"] + 180) % 360 - 180
    assert np.all(np.abs(off) < 20)  # crab and wind


def test_one_direction_is_one_height_and_one_direction(flight):
    track = mistakes.only(flight, ("1", "3")).tables[TRAJECTORY]
    assert np.ptp(track["height_m"]) < 60
    turns = np.exp(1j * np.radians(track["heading_deg"]))
    assert abs(turns.mean()) > 0.99


def test_gross_errors_are_told_by_the_truth(flight):
    spoiled = mistakes.flown(1, gross_errors=True)
    assert {one["kind"] for one in spoiled.truth["gross_errors"]} >= {"image_point", "gnss"}
    kept = pd.DataFrame(spoiled.tables[TRAJECTORY]["heading_deg"])
    assert (kept.ne(flight.tables[TRAJECTORY][["heading_deg"]])).sum().item() == 1
