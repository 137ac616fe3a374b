"""The ground of a plan: layouts of points, and hills."""

import numpy as np
import pytest

from acx4lib.planning import ground, text
from acx4lib.planning.plan import Area, Points
from acx4sim import earth
from support.flights.planned import values


def places(layout, number, **other):
    return ground.places(Points(layout=layout, number=number, area_m=(400.0, 200.0), **other))


def test_a_grid_has_rows_along_and_columns_across():
    at = places("grid", (3, 2))
    assert sorted(set(at[:, 0])) == [-200.0, 0.0, 200.0]
    assert sorted(set(at[:, 1])) == [-100.0, 100.0]
    assert len(at) == 6
    np.testing.assert_array_equal(places("grid", (1, 1)), [[0.0, 0.0]])


def test_corners_come_by_diagonals_before_the_middle():
    at = places("corners", (5,))
    np.testing.assert_array_equal(np.abs(at[:4]), [[200.0, 100.0]] * 4)
    np.testing.assert_array_equal(at[0] + at[1], [0.0, 0.0])
    np.testing.assert_array_equal(at[4], [0.0, 0.0])


def test_a_border_is_a_border():
    at = places("border", (10,))
    on_border = (np.abs(at[:, 0]) == 200.0) | (np.abs(at[:, 1]) == 100.0)
    assert on_border.all()
    assert len(np.unique(at, axis=0)) == 10


def test_play_moves_points_by_no_more_than_it_says():
    moved = places("grid", (3, 2), play_m=7.0) - places("grid", (3, 2))
    assert 0 < np.abs(moved).max() <= 7.0


def test_points_that_fill_an_area_do_so_evenly():
    at = ground.evenly(1000)
    counts, _, _ = np.histogram2d(at[:, 0], at[:, 1], bins=5, range=[[0, 1], [0, 1]])
    # forty in each of 25 parts; by chance they would differ by six
    assert np.abs(counts - 40).max() <= 4


def test_forward_is_along_the_course_and_left_is_left_of_it():
    area = Area(east_m=100.0, north_m=200.0, course_deg=90.0)
    at = ground.on_map(area, np.array([[10.0, 0.0], [0.0, 10.0]]))
    np.testing.assert_allclose(at, [[110.0, 200.0], [100.0, 210.0]], atol=1e-9)


@pytest.mark.parametrize("relief_m", [0.0, 12.0, 29.4])
def test_the_hills_are_those_of_the_simulator(relief_m):
    plan = text.from_values(values(field={"relief_m": relief_m}))
    local = np.random.default_rng(3).uniform(-2000, 2000, (200, 2))
    x_g = ground.on_ground(plan, plan.blocks["calibration"].area, local)
    llh = earth.Grid(crs="EPSG:32633").geodetic_from_grid(x_g)
    theirs = earth.terrain_height(llh, 430.0, relief=relief_m / ground.RELIEF_M)
    np.testing.assert_allclose(x_g[:, 2], theirs, atol=1e-6)


def test_the_relief_is_the_root_mean_square_of_the_hills():
    plan = text.from_values(values(field={"relief_m": 40.0}))
    lon, lat = np.radians(
        np.random.default_rng(1).uniform((13.0, 49.0), (15.0, 51.0), (20000, 2))
    ).T
    above = ground.heights(lon, lat, plan) - 430.0
    assert np.sqrt(np.mean(above**2)) == pytest.approx(40.0, rel=0.02)
