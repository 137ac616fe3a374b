"""The procedural landscape: one and the same wherever and however finely one looks."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import norm

from acx4sim import scenery
from acx4sim.drawing import GroundWindow, cell_m, draw, fractal, rectangles, shapes, white
from acx4sim.scenery import Country, Landscape

MIDDLE = (671_000.0, 7_189_500.0)
COUNTRY = Country(seed=1, middle=MIDDLE)


def window_at(east_m, north_m, level, size):
    """Return a window around a place given from the middle."""
    cell = cell_m(level)
    col, row = int((MIDDLE[0] + east_m) / cell), int((MIDDLE[1] + north_m) / cell)
    return GroundWindow(level=level, row=row - size // 2, col=col - size // 2, rows=size, cols=size)


def part(window, row, col, rows, cols):
    return GroundWindow(
        level=window.level, row=window.row + row, col=window.col + col, rows=rows, cols=cols
    )


@pytest.fixture(scope="module")
def plain():
    return Landscape(country=COUNTRY)


VILLAGE, LAKE, RIVER = (-470.0, 250.0), (1213.0, -871.0), (-330.0, 360.0)


@pytest.mark.parametrize("place", [VILLAGE, LAKE, (150.0, -80.0)])
def test_a_part_of_a_window_is_the_same_by_itself(plain, place):
    """Odd beginnings; float32 sums differ by a DN.

    OpenCV draws an edge that leaves the window a little differently, within its own cells.
    """
    window = window_at(*place, 2, 300)
    whole = plain.paint(window)[37:180, 61:290].astype(int)
    alone = plain.paint(part(window, 37, 61, 143, 229)).astype(int)
    assert np.mean(np.abs(whole - alone) <= 2) > 0.99


def test_the_same_seed_gives_the_same_ground_and_another_does_not(plain):
    window = window_at(*VILLAGE, 2, 200)
    first = plain.paint(window)
    scenery._cell.cache_clear()
    assert_array_equal(Landscape(country=COUNTRY).paint(window), first)
    other = Landscape(country=Country(seed=2, middle=MIDDLE)).paint(window)
    assert np.mean(other == first) < 0.05  # by chance


def test_coarse_cells_are_the_means_of_fine_ones(plain):
    """In the large, by blocks of 128 m; woods lose clumps of leaves, which makes 15 %."""
    fine = plain.paint(window_at(0, 0, 3, 1024)).astype(float)
    coarse = plain.paint(window_at(0, 0, 5, 256)).astype(float)
    blocks = fine.reshape(4, 256, 4, 256, 3).mean(axis=(1, 3))
    assert_allclose(coarse.reshape(4, 64, 4, 64, 3).mean(axis=(1, 3)), blocks, rtol=0.2)


@pytest.mark.parametrize("place", [VILLAGE, (150.0, -80.0), (20.0, -380.0)])
def test_edges_stand_where_they_are_in_cells_of_every_size(plain, place):
    """How far parts of 32 x 32 cells have moved against cells of half the size."""
    for level in (0, 1):
        window = window_at(*place, level, 1024)
        window = replace(window, row=window.row // 2 * 2, col=window.col // 2 * 2)
        fine = plain.paint(window)[..., 1].reshape(512, 2, 512, 2).mean(axis=(1, 3))
        coarse = plain.paint(
            GroundWindow(
                level=level + 1, row=window.row // 2, col=window.col // 2, rows=512, cols=512
            )
        )[..., 1]
        moved = np.linalg.norm(shifts(fine, coarse.astype(float)), axis=1)
        assert len(moved) > 50
        assert np.sqrt(np.mean(moved**2)) < 0.1
        assert np.quantile(moved, 0.95) < 0.2


def shifts(one, other, size=32):
    """Return how far parts of an image moved, by least squares; only where there is structure."""
    down, along = np.gradient((one + other) / 2)
    found = []
    for row in range(0, len(one) - size + 1, size):
        for col in range(0, len(one) - size + 1, size):
            at = np.s_[row : row + size, col : col + size]
            A = np.column_stack([-along[at].ravel(), -down[at].ravel(), np.ones(size**2)])
            if np.linalg.eigvalsh(A.T[:2] @ A[:, :2])[0] > 2e8:
                found.append(np.linalg.lstsq(A, (other - one)[at].ravel(), rcond=None)[0][:2])
    return np.array(found)


@pytest.mark.parametrize("size_m", [0.5, 2.0, 8.0])
@pytest.mark.parametrize("angle_deg", [0.0, 20.0, 45.0])
def test_a_polygon_covers_its_area_in_cells_of_every_size(size_m, angle_deg):
    middle, angle = np.array([[4.03, 3.98]]), np.radians([angle_deg])
    drawn = shapes(rectangles(middle, 1.5 * size_m, size_m, angle), (200, 200, 200, 200))
    for level in range(-2, 4):
        if size_m < 3 * cell_m(level):
            continue
        n = int(32 / cell_m(level))
        window = GroundWindow(level=level, row=-n // 4, col=-n // 4, rows=n, cols=n)
        canvas = np.zeros((n, n, 4), np.uint8)
        draw(canvas, window, drawn)
        east, north = window.en()
        share = canvas[..., 0] / 200
        found = np.array([share.sum(axis=0) @ east, share.sum(axis=1) @ north]) / share.sum()
        edge_m = (np.sqrt(share.sum() / 1.5) * cell_m(level) - size_m) / 2
        assert abs(edge_m) < 0.12 * cell_m(level)
        assert np.all(np.abs(found - middle[0]) < 0.2 * cell_m(level))


def test_levels_are_those_of_a_camera_of_16_bit(plain):
    dn = plain.paint(window_at(0, 0, 5, 500)).astype(float)
    assert 8_000 < dn.mean() < 18_000
    assert np.mean(dn >= 60_000) < 1e-3
    assert dn.max() < 65_535
    assert np.all(dn.mean(axis=(0, 1)) > 6_000)


def test_there_is_texture_in_every_meadow_but_none_on_the_water(plain):
    """What two neighbouring pixels differ by, relative to the ground; shot noise is 0.4 %."""
    for level in (0, 2):
        lake = plain.paint(window_at(*LAKE, level, 200)).astype(float)
        assert np.diff(lake, axis=1).std() / lake.mean() < 0.004
        land = plain.paint(window_at(20.0, -380.0, level, 200)).astype(float)
        assert np.diff(land, axis=1).std() / land.mean() > 0.02


def test_country_has_water_woods_and_villages():
    """Shares of 6 x 6 km, roughly those that the design is after."""
    side = np.arange(-3000, 3000, 20.0)
    en = np.stack(np.meshgrid(side, side), axis=-1) + MIDDLE
    assert 0.02 < np.mean(COUNTRY.water_m(en) > 0) < 0.15
    assert 0.05 < np.mean(COUNTRY.woods(en) > 0) < 0.30
    assert 0.005 < np.mean(COUNTRY.village_m(en) > 0) < 0.10
    assert COUNTRY.lake_m(np.add(MIDDLE, LAKE)) > 300
    assert COUNTRY.village_m(np.add(MIDDLE, VILLAGE)) > 200


def test_marks_are_discs_of_60_cm_on_dark_squares():
    """Area and middle of the white, from cells that the edge covers in part."""
    mark = np.add(MIDDLE, (20.013, -380.027))
    ground = Landscape(country=COUNTRY, marks=mark[None])
    window = window_at(20.0, -380.0, -1, 64)
    dn = ground.paint(window).astype(float).mean(axis=2)
    share = (dn - 3200) / (46_000 - 3200)
    share[np.hypot(*(np.indices(share.shape) - 32)) > 20] = 0
    cell = window.cell_m
    assert_allclose(share.sum() * cell**2, np.pi * 0.3**2, rtol=0.01)
    east, north = window.en()
    middle = [(share.sum(axis=0) * east).sum(), (share.sum(axis=1) * north).sum()] / share.sum()
    assert_allclose(middle, mark, atol=1e-3)  # 8 x 8 places in a cell of 3 cm
    assert_allclose(dn[32 - 24 : 32 + 24, 32 - 24], 3200, atol=1)


def test_white_noise_is_independent_and_of_unit_variance():
    """Means over 250 000 values, at five sigma."""
    window = GroundWindow(level=0, row=-123, col=10_000_000, rows=500, cols=500)
    noise = white(window, 5)
    bound = -norm.ppf(2.9e-7) / 500
    assert abs(noise.mean()) < bound
    assert abs((noise**2).mean() - 1) < bound
    for other in (np.roll(noise, 1, axis=0), np.roll(noise, 1, axis=1), white(window, 6)):
        assert abs((noise * other).mean()) < bound


def test_fractal_noise_does_not_depend_on_where_a_window_begins():
    """float32 of numbers about one."""
    window = GroundWindow(level=0, row=-77, col=1013, rows=120, cols=90)
    amplitudes = dict.fromkeys(range(8), 0.3)
    whole = fractal(window, amplitudes, 1)
    assert_allclose(
        fractal(part(window, 13, 24, 50, 31), amplitudes, 1), whole[13:63, 24:55], atol=1e-5
    )
