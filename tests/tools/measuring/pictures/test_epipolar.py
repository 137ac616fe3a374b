import numpy as np

from acx4lib.geometry.frames import Pose, exp
from acx4tools.measuring.pictures.epipolar import agree, distances
from acx4tools.measuring.pictures.views import View, ground_of, pixels_of


def seen(views, surface, rng, n=200):
    size = [views[0].camera.width_px - 1, views[0].camera.height_px - 1]
    x_m = ground_of(views[0], surface, rng.uniform(0.1, 0.9, (n, 2)) * size)
    x_m[:, 2] += rng.uniform(-10, 10, n)  # relief that the surface does not know
    return pixels_of(views[0], x_m), pixels_of(views[1], x_m)


def turned(view, by):
    T = Pose(R=view.T_m_c.R @ exp(np.array([by])), r=view.T_m_c.r)
    return View(**{**view.__dict__, "T_m_c": T})


def test_points_of_one_plane_with_both_cameras_have_no_distance(views, surface, rng):
    a, b = seen(views, surface, rng)
    assert np.max(np.abs(distances(views[0], views[1], a, b))) < 1e-6


def test_a_shift_across_the_line_is_its_distance(views, surface, rng):
    a, b = seen(views, surface, rng)
    off = [distances(views[0], views[1], a, b + step)[:, 0] for step in ([2.0, 0], [0, 2.0])]
    both = np.hypot(*off)
    assert np.all((both > 1.2) & (both < 2.05))  # across lines that are not quite straight


def test_a_wrong_orientation_is_no_false_match(views, surface, rng):
    a, b = seen(views, surface, rng)
    wrong = turned(views[1], [0.003, -0.004, 0.005])
    assert np.max(np.abs(distances(views[0], wrong, a, b))) > 2
    assert agree(views[0], wrong, a, b, least_px=0.5).all()


def test_false_matches_are_found_beside_a_wrong_orientation(views, surface, rng):
    a, b = seen(views, surface, rng)
    false = rng.random(len(a)) < 0.2
    b = b + rng.normal(0, 0.05, b.shape)
    b[false] += rng.uniform(3, 12, (false.sum(), 2))
    near = agree(views[0], turned(views[1], [0.003, -0.004, 0.005]), a, b, least_px=0.5)
    assert np.all(near[~false])
    across = np.abs(distances(views[0], views[1], a, b)[:, 0])
    assert not np.any(near & (across > 2.0))


def test_a_few_matches_are_not_believed(views, surface, rng):
    a, b = seen(views, surface, rng, n=8)
    assert not agree(views[0], views[1], a, b, least_px=0.5).any()
