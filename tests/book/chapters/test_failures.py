"""Some flights with mistakes, examined once."""

import numpy as np
import pandas as pd
import pyproj
import pytest
from matplotlib.colors import to_rgba
from numpy.testing import assert_allclose

from acx4book.chapters import failures
from acx4book.chapters.failures import (
    CONTROL,
    TRAJECTORY,
    changed,
    examine,
    flown,
    late,
    standardised,
)
from acx4book.typesetting import style
from support.figures import drawn, panels


@pytest.fixture(scope="session")
def found():
    flight = flown(1)
    control = flight.tables[CONTROL]
    exchanged = {"east_m": control["north_m"], "north_m": control["east_m"]}
    flights = {
        "no mistake": flight,
        "coordinates exchanged": changed(flight, {CONTROL: exchanged}),
        "delay": changed(flight, {TRAJECTORY: late(flight, by_s=0.1)}),
    }
    return {name: examine(one) for name, one in flights.items()}


# --- What plants mistakes changes what it is to change, by what it is to change it


@pytest.fixture(scope="module")
def flight():
    return failures.flown(1)


def test_only_the_named_columns_are_changed(flight):
    heights = flight.tables[CONTROL]["height_m"] - 45.0
    other = failures.changed(flight, {CONTROL: {"height_m": heights}})
    different = {
        (path, column)
        for path, table in flight.tables.items()
        for column in table
        if not table[column].equals(other.tables[path][column])
    }
    assert different == {(CONTROL, "height_m")}
    assert failures.changed(flight, {}).tables.keys() == flight.tables.keys()


def test_the_convergence_is_that_of_proj(flight):
    table = flight.tables[TRAJECTORY]
    factors = pyproj.Proj(flight.plan.crs).get_factors(table["lon_deg"], table["lat_deg"])
    assert_allclose(failures.convergence_deg(flight), factors.meridian_convergence)


def test_a_delay_moves_positions_along_the_flight(flight):
    late = failures.late(flight, by_s=0.1)
    now = flight.tables[TRAJECTORY]
    geod = pyproj.Geod(ellps="GRS80")
    azimuth, _, metres = geod.inv(now["lon_deg"], now["lat_deg"], late["lon_deg"], late["lat_deg"])
    assert_allclose(metres, 70 * 0.1, rtol=0.3)  # 70 m/s, less regular exposures
    off = (azimuth - now["heading_deg"] + 180) % 360 - 180
    assert np.all(np.abs(off) < 20)  # crab and wind


def test_one_direction_is_one_height_and_one_direction(flight):
    track = failures.only(flight, ("1", "3")).tables[TRAJECTORY]
    assert np.ptp(track["height_m"]) < 60
    turns = np.exp(1j * np.radians(track["heading_deg"]))
    assert abs(turns.mean()) > 0.99


def test_gross_errors_are_told_by_the_truth(flight):
    spoiled = failures.flown(1, gross_errors=True)
    assert {one["kind"] for one in spoiled.truth["gross_errors"]} >= {"image_point", "gnss"}
    kept = pd.DataFrame(spoiled.tables[TRAJECTORY]["heading_deg"])
    assert (kept.ne(flight.tables[TRAJECTORY][["heading_deg"]])).sum().item() == 1


# --- Panels of one scale, a mark for what stands out, a sentence for what was refused


def test_bars_are_the_residuals_and_red_where_they_stand_out(found):
    fig = drawn(failures.fingerprints(found))
    by_title = {ax.get_title(loc="left"): ax for ax in panels(fig)}
    for name in ("no mistake", "delay"):
        bars = by_title[name].patches
        ends = [bar.get_x() + bar.get_width() for bar in bars]
        rms = standardised(found[name])
        np.testing.assert_allclose(ends, rms)
        red = [bar.get_facecolor() == to_rgba(style.BRICK) for bar in bars]
        assert red == list(rms > failures.SEEN)
    assert len({ax.get_xlim() for ax in by_title.values()}) == 1


def test_maps_have_one_scale_and_say_what_was_refused(found):
    fig = drawn(failures.maps(found))
    by_title = {ax.get_title(loc="left"): ax for ax in panels(fig)}
    assert len({by_title[name].get_xlim() for name in found}) == 1
    texts = [text.get_text() for text in by_title["coordinates exchanged"].texts]
    assert texts == [failures.REFUSED]
    longest = [text.get_text() for text in by_title["no mistake"].texts]
    assert longest[0].startswith("longest arrow ")
    assert longest[0].endswith(" cm")
