"""Readings of trajectories against scipy's rotations and closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from acx4lib.flight.checks.readings import height_readings, of_cameras, pixel_readings, readings
from acx4lib.flight.text.table import Table
from acx4lib.geometry.frames import rotation_from_opk, rotation_from_rph
from acx4lib.geometry.geodesy import GridSystem

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
    return Table(file="trajectory.csv", lines=np.arange(2, 5), numbers=numbers)


def angles(table, form):
    kappa = ("omega_deg", "phi_deg", "kappa_deg")
    return table.stack(*(kappa if form == "grid" else ("roll_deg", "pitch_deg", "heading_deg")))


def named(form):
    return {reading.name: reading for reading in readings(trajectory(form), GRID)}


@pytest.mark.parametrize("form", ["grid", "geodetic"])
def test_no_two_readings_have_one_name_or_one_meaning(form):
    found = list(readings(trajectory(form), GRID))
    assert len({reading.name for reading in found}) == len(found) >= 30
    numbers = [tuple(np.round(angles(r.table, form), 9).ravel()) for r in found]
    heights = [tuple(r.table.numbers["height_m"]) for r in found]
    assert len({*zip(numbers, heights, strict=True)}) == len(found)


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
    turned = np.radians(angles(named(form)[name].table, form))
    R = rotation_from_opk(turned) if form == "grid" else rotation_from_rph(turned)
    expected = Rotation.from_euler(order, ANGLES[:, columns], degrees=True).as_matrix()
    assert_allclose(R, expected, atol=1e-12)


@pytest.mark.parametrize("form", ["grid", "geodetic"])
def test_the_transposed_rotation_is_the_inverse(form):
    (reading,) = (r for name, r in named(form).items() if "transposed" in name)
    turned, given = np.radians(angles(reading.table, form)), np.radians(ANGLES)
    rotation = rotation_from_opk if form == "grid" else rotation_from_rph
    assert_allclose(rotation(turned) @ rotation(given), np.tile(np.eye(3), (3, 1, 1)), atol=1e-12)


def test_a_heading_from_grid_north_differs_by_the_convergence():
    """To first order, the convergence is the difference of longitude times sin(latitude)."""
    turned = angles(named("geodetic")["heading from grid north"].table, "geodetic")
    lat, lon = np.array([49.0, 50.0, 51.0]), np.array([12.0, 15.0, 17.0])
    expected = (lon - 15.0) * np.sin(np.radians(lat))
    assert_allclose(turned[:, 2] - ANGLES[:, 2], expected, atol=2e-3)  # third order: 0.0012


def test_units_and_rows_are_what_they_say():
    found = named("grid")
    assert_allclose(angles(found["omega, phi, kappa in gon"].table, "grid"), ANGLES * 0.9)
    assert_allclose(
        angles(found["omega, phi in radians"].table, "grid")[:, :2], np.degrees(ANGLES[:, :2])
    )
    after = found["positions, angles of the next row"].table
    assert_allclose(angles(after, "grid"), ANGLES[[1, 2, 2]])
    assert_allclose(after.numbers["east_m"], [4.1e5, 3e5, 3e5])
    assert_allclose(found["height in feet"].table.numbers["height_m"], [304.8, 457.2, 301.752])


def test_angles_of_a_camera_give_the_body_by_its_boresight():
    R_b_c = Rotation.from_euler("XYZ", [0.5, -1.6, 90.0], degrees=True)
    (reading,) = of_cameras(trajectory("grid"), R_b_c.as_matrix())
    body = Rotation.from_euler("XYZ", angles(reading.table, "grid"), degrees=True)
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
