"""Control that does not fit the rest of a flight, and what would make it fit."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pandas as pd
import pyproj
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from acx4files import flight
from acx4files.conventions import height_readings, of_trajectory, pixel_readings
from acx4lib.geometry.frames import rotation_from_opk, rotation_from_rph
from acx4lib.geometry.geodesy import GridSystem
from support.flights.written import CONTROL, POINTS, TOML, TRAJECTORY, change, replace, write_flight
from support.helpers import flight_problems as problems


def to_other_zone(table: pd.DataFrame) -> pd.DataFrame:
    other = pyproj.Transformer.from_crs("EPSG:31982", "EPSG:31981", always_xy=True)
    east, north = other.transform(table["east_m"], table["north_m"])
    return table.assign(east_m=east, north_m=north)


def swapped(a: str, b: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.rename(columns={a: b, b: a})


def in_radians(*columns: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.assign(**{c: np.radians(table[c]) for c in columns})


def negative(*columns: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.assign(**{c: -table[c] for c in columns})


def z_down(table: pd.DataFrame) -> pd.DataFrame:
    opk = table[["omega_deg", "phi_deg", "kappa_deg"]].to_numpy() * [1, -1, -1] + [180, 0, 0]
    return table.assign(omega_deg=opk[:, 0], phi_deg=opk[:, 1], kappa_deg=opk[:, 2])


EN, LL = ("east_m", "north_m"), ("lat_deg", "lon_deg")
RPH, OPK = ("roll_deg", "pitch_deg", "heading_deg"), ("omega_deg", "phi_deg", "kappa_deg")


def from_90(column: str) -> Callable[[pd.DataFrame], pd.DataFrame]:
    return lambda table: table.assign(**{column: 90.0 - table[column]})


def from_the_bottom(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(row_px=2999.0 - table["row_px"])


MISFITS = [
    ("grid", CONTROL, swapped(*EN), "east_m", "east_m and north_m were swapped"),
    ("geographic", CONTROL, swapped(*EN), "east_m", "east_m and north_m were swapped"),
    ("grid", TRAJECTORY, swapped(*EN), "east_m", "east_m and north_m were swapped"),
    ("grid", CONTROL, to_other_zone, "east_m", "east_m and north_m were of UTM zone 21S"),
    ("grid", TRAJECTORY, to_other_zone, "east_m", "east_m and north_m were of UTM zone 21S"),
    ("geographic", TRAJECTORY, swapped(*LL), "lat_deg", "lat_deg, lon_deg were swapped"),
    ("geographic", TRAJECTORY, in_radians(*LL), "lat_deg", "lat_deg, lon_deg were in radians"),
    *(
        ("geographic", TRAJECTORY, negative(*n), n[0], f"{', '.join(n)} were of opposite sign")
        for n in (LL[1:], LL[:1], LL)
    ),
    ("geographic", TRAJECTORY, in_radians(*RPH), RPH[2], f"{', '.join(RPH)} were in radians"),
    # one strip still fits, since its kappa is nearly zero
    ("grid", TRAJECTORY, in_radians(*OPK), OPK[2], f"{', '.join(OPK)} were in radians"),
    ("grid", TRAJECTORY, from_90(OPK[2]), OPK[2], "kappa_deg were a heading from north"),
    ("geographic", TRAJECTORY, from_90(RPH[2]), RPH[2], "heading_deg were an angle from east"),
    ("grid", TRAJECTORY, z_down, OPK[2], f"{', '.join(OPK)} were of a body with z down"),
    ("grid", POINTS, from_the_bottom, "row_px", "row_px were counted from the bottom"),
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
    ("given", "by"),
    [
        ((0, 0, 0), " by 90 degrees about z"),
        ((0, 0, -90), " by 180 degrees about z"),
        ((0, 0, 180), " by -90 degrees about z"),
        ((180, 0, -90), " by 180 degrees about x"),
        ((20, 0, 40), ""),
    ],
)
def test_a_wrong_mounting_is_named_with_the_angles_that_fit(tmp_path, given, by):
    write_flight(tmp_path)
    for name, angle in zip(("omega", "phi", "kappa"), given, strict=True):
        text = (tmp_path / TOML).read_text()
        (tmp_path / TOML).write_text(
            re.sub(rf"mount_{name}_deg = .*", f"mount_{name}_deg = {angle}", text)
        )
    (line,) = problems(tmp_path)
    assert line.startswith(f"{TOML}:13: cameras.CAM.mount_kappa_deg: control points lie ")
    angles = "mount_omega_deg, mount_phi_deg, mount_kappa_deg of CAM 0, 0, 90 would fit"
    assert f"it looks as if the camera axes were turned{by}: {angles}" in line


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("mount_omega_deg = 15", "mount_omega_deg = -15"),
        ("mount_kappa_deg = -90", "mount_kappa_deg = 90"),
    ],
)
def test_one_wrong_head_is_named_alone(tmp_path, old, new):
    replace(write_flight(tmp_path, blocks=("heads",)), TOML, old, new)
    (line,) = problems(tmp_path)
    assert "cameras.RIGHT.mount_kappa_deg: control points in images of RIGHT lie " in line
    angles = "mount_omega_deg, mount_phi_deg, mount_kappa_deg of RIGHT 15, 0, -90 would fit"
    assert re.search(f"the camera axes were turned by -?[0-9]+ degrees about [xyz]: {angles}", line)


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


# --- Readings of trajectories against scipy's rotations and closed forms


GRID = GridSystem(crs="EPSG:32633")
ANGLES = np.array([[1.2, -0.7, 250.0], [-2.0, 1.5, 20.0], [0.3, 3.0, -100.0]])


def trajectory(form):
    names = ("omega_deg", "phi_deg", "kappa_deg")
    places = {"east_m": np.array([4e5, 4.1e5, 3e5]), "north_m": np.array([5.5e6, 5.4e6, 5.6e6])}
    if form == "geodetic":
        names = ("roll_deg", "pitch_deg", "heading_deg")
        places = {"lat_deg": np.array([49.0, 50.0, 51.0]), "lon_deg": np.array([12.0, 15.0, 17.0])}
    numbers = {**places, "height_m": np.array([1000.0, 1500.0, 990.0])}
    numbers |= dict(zip(names, ANGLES.T, strict=True))
    return numbers


def angles(table, form):
    kappa = ("omega_deg", "phi_deg", "kappa_deg")
    names = kappa if form == "grid" else ("roll_deg", "pitch_deg", "heading_deg")
    return np.stack([table[name] for name in names], axis=-1)


def named(form):
    return {reading.name: reading for reading in of_trajectory(trajectory(form), GRID)}


@pytest.mark.parametrize("form", ["grid", "geodetic"])
def test_no_two_readings_have_one_name_or_one_meaning(form):
    found = list(of_trajectory(trajectory(form), GRID))
    assert len({reading.name for reading in found}) == len(found) >= 30
    numbers = [{**trajectory(form), **reading.changed} for reading in found]
    rounded = [np.round(angles(own, form), 9).ravel() for own in numbers]
    heights = [own["height_m"] for own in numbers]
    assert len({(*a, *h) for a, h in zip(rounded, heights, strict=True)}) == len(found)


@pytest.mark.parametrize(
    ("form", "name", "order", "columns"),
    [
        ("grid", "omega, phi, kappa in the order phi, omega, kappa", "YXZ", [1, 0, 2]),
        ("grid", "omega, phi, kappa in the order kappa, phi, omega", "ZYX", [2, 1, 0]),
        ("geodetic", "roll, pitch, heading in the order pitch before roll", "ZXY", [2, 0, 1]),
        ("geodetic", "roll, pitch, heading in the order roll, pitch, heading", "XYZ", [0, 1, 2]),
    ],
)
def test_other_orders_are_scipys_intrinsic_rotations(form, name, order, columns):
    turned = np.radians(angles(named(form)[name].changed, form))
    R = rotation_from_opk(turned) if form == "grid" else rotation_from_rph(turned)
    expected = Rotation.from_euler(order, ANGLES[:, columns], degrees=True).as_matrix()
    assert_allclose(R, expected, atol=1e-12)


@pytest.mark.parametrize("form", ["grid", "geodetic"])
def test_the_transposed_rotation_is_the_inverse(form):
    (reading,) = (r for name, r in named(form).items() if "transposed" in name)
    turned, given = np.radians(angles(reading.changed, form)), np.radians(ANGLES)
    rotation = rotation_from_opk if form == "grid" else rotation_from_rph
    assert_allclose(rotation(turned) @ rotation(given), np.tile(np.eye(3), (3, 1, 1)), atol=1e-12)


def test_a_heading_from_grid_north_differs_by_the_convergence():
    """To first order, the convergence is the difference of longitude times sin(latitude)."""
    turned = angles(named("geodetic")["heading from grid north"].changed, "geodetic")
    lat, lon = np.array([49.0, 50.0, 51.0]), np.array([12.0, 15.0, 17.0])
    expected = (lon - 15.0) * np.sin(np.radians(lat))
    assert_allclose(turned[:, 2] - ANGLES[:, 2], expected, atol=2e-3)  # third order: 0.0012


def test_units_and_rows_are_what_they_say():
    found = named("grid")
    assert_allclose(angles(found["omega, phi, kappa in gon"].changed, "grid"), ANGLES * 0.9)
    assert_allclose(
        angles(found["omega, phi in radians"].changed, "grid")[:, :2], np.degrees(ANGLES[:, :2])
    )
    after = found["positions, angles of the next row"].changed
    assert_allclose(angles(after, "grid"), ANGLES[[1, 2, 2]])
    assert_allclose(after["east_m"], [4.1e5, 3e5, 3e5])
    assert_allclose(found["height in feet"].changed["height_m"], [304.8, 457.2, 301.752])


def test_angles_of_a_camera_give_the_body_by_its_boresight():
    R_b_c = Rotation.from_euler("XYZ", [0.5, -1.6, 90.0], degrees=True)
    *_, reading = (
        r
        for r in of_trajectory(trajectory("grid"), GRID, R_b_c.as_matrix())
        if r.meaning == "of the camera, not of the body"
    )
    body = Rotation.from_euler("XYZ", angles(reading.changed, "grid"), degrees=True)
    camera = Rotation.from_euler("XYZ", ANGLES, degrees=True)
    assert_allclose((body * R_b_c).as_matrix(), camera.as_matrix(), atol=1e-12)


def test_heights_have_a_geoid_only_where_the_flight_has_one():
    height, lonlat = np.array([100.0]), np.array([[15.0, 50.0]])
    assert [meaning for meaning, _ in height_readings(height, lonlat, GRID)] == ["in feet"]


def test_pixels_in_other_axes_meet_at_the_middle():
    """The middle of an image is the middle in each reading of it."""
    size, pixel_mm = np.array([[4000, 3000]]), np.array([[0.005]])
    middles = [[1999.5, 1499.5]] * 2 + [[1499.5, 1999.5], [0.0, 0.0], [10.0, 7.5]]
    names = []
    for given, right in zip(middles, [[1999.5, 1499.5]] * 5, strict=True):
        k = len(names)
        columns, meaning, colrow = list(pixel_readings(np.array([given]), size, pixel_mm))[k]
        names.append((columns, meaning))
        assert_allclose(colrow, [right], atol=1e-9)
    assert len(set(names)) == 5
