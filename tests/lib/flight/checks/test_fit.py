"""Control that does not fit the rest of a flight, and what would make it fit."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pandas as pd
import pyproj
import pytest

from acx4lib import flight
from support.flights.spoilt import CONTROL, POINTS, TOML, TRAJECTORY, change, replace
from support.flights.written import write_flight
from support.helpers import flight_problems as problems


def to_other_zone(table: pd.DataFrame) -> pd.DataFrame:
    other = pyproj.Transformer.from_crs("EPSG:31982", "EPSG:31981", always_xy=True)
    east, north = other.transform(table["east_m"], table["north_m"])
    return table.assign(east_m=east, north_m=north)


def swapped(a: str, b: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.rename(columns={a: b, b: a})


def in_radians(*columns: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.assign(**{c: np.radians(table[c]) for c in columns})


def z_down(table: pd.DataFrame) -> pd.DataFrame:
    opk = table[["omega_deg", "phi_deg", "kappa_deg"]].to_numpy() * [1, -1, -1] + [180, 0, 0]
    return table.assign(omega_deg=opk[:, 0], phi_deg=opk[:, 1], kappa_deg=opk[:, 2])


MISFITS = [
    ("grid", CONTROL, swapped("east_m", "north_m"), "east_m", "east_m and north_m were swapped"),
    (
        "geographic",
        CONTROL,
        swapped("east_m", "north_m"),
        "east_m",
        "east_m and north_m were swapped",
    ),
    ("grid", TRAJECTORY, swapped("east_m", "north_m"), "east_m", "east_m and north_m were swapped"),
    ("grid", CONTROL, to_other_zone, "east_m", "east_m and north_m were of UTM zone 21S"),
    ("grid", TRAJECTORY, to_other_zone, "east_m", "east_m and north_m were of UTM zone 21S"),
    (
        "geographic",
        TRAJECTORY,
        swapped("lat_deg", "lon_deg"),
        "lat_deg",
        "latitude and longitude were swapped",
    ),
    (
        "geographic",
        TRAJECTORY,
        in_radians("lat_deg", "lon_deg"),
        "lat_deg",
        "latitude and longitude were in radians",
    ),
    (
        "geographic",
        TRAJECTORY,
        in_radians("roll_deg", "pitch_deg", "heading_deg"),
        "heading_deg",
        "roll_deg, pitch_deg, heading_deg were in radians",
    ),
    (  # one strip still fits, since its kappa is nearly zero
        "grid",
        TRAJECTORY,
        in_radians("omega_deg", "phi_deg", "kappa_deg"),
        "kappa_deg",
        "omega_deg, phi_deg, kappa_deg were in radians",
    ),
    (
        "grid",
        TRAJECTORY,
        lambda t: t.assign(kappa_deg=90.0 - t["kappa_deg"]),
        "kappa_deg",
        "kappa_deg were a heading from north",
    ),
    (
        "geographic",
        TRAJECTORY,
        lambda t: t.assign(heading_deg=90.0 - t["heading_deg"]),
        "heading_deg",
        "heading_deg were an angle from east",
    ),
    (
        "grid",
        TRAJECTORY,
        z_down,
        "kappa_deg",
        "omega_deg, phi_deg, kappa_deg were of a body with z down",
    ),
    (
        "grid",
        POINTS,
        lambda t: t.assign(row_px=2999.0 - t["row_px"]),
        "row_px",
        "row_px were counted from the bottom",
    ),
]


@pytest.mark.parametrize(("form", "file", "mistake", "column", "says"), MISFITS)
def test_control_that_does_not_fit_is_explained(tmp_path, form, file, mistake, column, says):
    write_flight(tmp_path, form=form)
    change(tmp_path, file, mistake)
    (line,) = problems(tmp_path)
    assert line.startswith(f"{file}:1: {column}: control points lie ")
    assert f"with the trajectory of {TRAJECTORY} and the points of {CONTROL}" in line
    assert f"it looks as if {says} in {file} (then " in line
    assert line.endswith("; must be below 1250 px, a quarter of the image diagonal")


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ((0, 0, 0), "turned by 90 degrees about z"),
        ((0, 0, -90), "turned by 180 degrees about z"),
        ((0, 0, 180), "turned by -90 degrees about z"),
        ((180, 0, -90), "with z forward"),
    ],
)
def test_a_wrong_mounting_is_named_with_the_angles_that_fit(tmp_path, given, says):
    write_flight(tmp_path)
    for name, angle in zip(("omega", "phi", "kappa"), given, strict=True):
        text = (tmp_path / TOML).read_text()
        (tmp_path / TOML).write_text(
            re.sub(rf"mount_{name}_deg = .*", f"mount_{name}_deg = {angle}", text)
        )
    (line,) = problems(tmp_path)
    assert line.startswith(f"{TOML}:13: cameras.CAM.mount_kappa_deg: control points lie ")
    angles = "mount_omega_deg, mount_phi_deg, mount_kappa_deg of CAM 0, 0, 90 would fit"
    assert f"it looks as if the camera axes were {says}: {angles}" in line


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("mount_omega_deg = 15", "mount_omega_deg = -15", "of other signs"),
        ("mount_kappa_deg = -90", "mount_kappa_deg = 90", "turned by 180 degrees about z"),
    ],
)
def test_one_wrong_head_is_named_alone(tmp_path, old, new, says):
    replace(write_flight(tmp_path, blocks=("heads",)), TOML, old, new)
    (line,) = problems(tmp_path)
    assert "cameras.RIGHT.mount_kappa_deg: control points in images of RIGHT lie " in line
    angles = "mount_omega_deg, mount_phi_deg, mount_kappa_deg of RIGHT 15, 0, -90 would fit"
    assert f"the camera axes were {says}: {angles}" in line


def test_a_misfit_without_explanation_says_how_far_apart_everything_is(tmp_path):
    change(write_flight(tmp_path), CONTROL, lambda t: t.assign(east_m=t["east_m"] + 3000.0))
    (line,) = problems(tmp_path)
    assert line.startswith(f"{CONTROL}:1: east_m: control points lie ")
    assert (
        "no usual mistake explains it; the control points' middle lies 3000 m east, 38 m north and "
        "-1001 m up of the exposures'; must be"
    ) in line
    change(tmp_path, CONTROL, lambda t: t.assign(north_m=t["north_m"] - 1e6))
    (line,) = problems(tmp_path)
    assert "of the exposures' (is EPSG:31982 the right CRS?); must be" in line


def test_a_few_gross_errors_are_left_to_the_adjustment(tmp_path):
    """Two of nine control points 500 m off: no error here, whatever the adjustment says."""
    write_flight(tmp_path)
    change(
        tmp_path,
        CONTROL,
        lambda t: t.assign(east_m=t["east_m"] + np.array([500.0] * 2 + [0.0] * 7)),
    )
    assert len(flight.read(tmp_path).calibration.control) == 9
