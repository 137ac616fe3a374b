import numpy as np

from acx4tools.measuring.pictures import ground


def test_a_plane_has_its_height_everywhere():
    assert ground.level(430.0).heights(np.array([[0.0, 0.0], [1e4, -1e4]])).tolist() == [430.0] * 2


def test_a_slope_is_followed_and_ends_level(rng):
    x_m = rng.uniform(0, 1000, (3000, 3))
    x_m[:, 2] = 100 + 0.05 * x_m[:, 0] - 0.02 * x_m[:, 1]
    surface = ground.through(x_m)
    inner = rng.uniform(150, 850, (200, 2))
    expected = 100 + 0.05 * inner[:, 0] - 0.02 * inner[:, 1]
    assert np.max(np.abs(surface.heights(inner) - expected)) < 2.5  # a cell has 21 m
    edge = surface.heights(np.array([[3000.0, 500.0], [5000.0, 500.0]]))
    assert edge[0] == edge[1]


def test_a_few_points_far_off_their_neighbours_hardly_count(rng):
    x_m = rng.uniform(0, 100, (20000, 3))
    x_m[:, 2] = 5.0
    x_m[::40, 2] = 80.0
    off = np.abs(ground.through(x_m).heights(x_m[:, :2]) - 5.0)
    assert np.mean(off > 1e-3) < 0.05  # two of them in one cell


def test_holes_are_filled_from_around(rng):
    x_m = rng.uniform(0, 100, (4000, 3))
    x_m[:, 2] = 7.0
    x_m = x_m[np.hypot(*(x_m[:, :2] - 50).T) > 30]
    assert np.max(np.abs(ground.through(x_m).heights(np.array([[50.0, 50.0]])) - 7.0)) < 1e-6


def test_one_point_is_a_plane():
    assert ground.through(np.array([[1.0, 2.0, 3.0]])).heights(np.zeros((1, 2)))[0] == 3.0
