"""Parameters and intersections."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from acx4files.flight.settings import camera_of
from acx4lib.geometry.collinearity import project
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.geometry.intersection import intersect, largest_angles, resect
from acx4lib.geometry.parameters import Prior
from support import blocks
from support.helpers import rotation_angle
from support.strategies import numbers, vectors

# --- start values: rays that meet, rays that do not, and resection ---------------------------


def rays_to(x, origins):
    directions = x - origins
    return directions / np.linalg.norm(directions, axis=1, keepdims=True)


@given(
    x=vectors(500.0),
    aside=st.lists(numbers(400.0), min_size=2, max_size=5),
)
def test_rays_to_a_point_meet_there(x, aside):
    n = len(aside) + 1
    origins = np.array([[0.0, 0.0, 1500.0], *([a, 300.0 + i, 1500.0] for i, a in enumerate(aside))])
    found = intersect(origins, rays_to(x, origins), np.zeros(n, dtype=int), 1)
    assert_allclose(found, x[None], atol=1e-8)  # m: 1e-12 of rays that meet at ten degrees


def test_skew_rays_meet_where_they_are_nearest():
    """Two rays a metre apart, at right angles: half way between."""
    origins = np.array([[-5.0, 0.0, 0.0], [0.0, -5.0, 1.0]])
    directions = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    assert_allclose(intersect(origins, directions, np.zeros(2, dtype=int), 1), [[0, 0, 0.5]])


def test_a_third_ray_counts_as_much_as_each_of_the_others():
    """Vertical rays do not say how high; a horizontal one does, and pulls a third aside."""
    origins = np.array([[0.0, 0.0, 9.0], [0.0, 0.0, 9.0], [5.0, 3.0, 2.0]])
    directions = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, -1.0], [-1.0, 0.0, 0.0]])
    found = intersect(origins, directions, np.zeros(3, dtype=int), 1)
    assert_allclose(found, [[0.0, 1.0, 2.0]], atol=1e-12)  # y: the mean of 0, 0 and 3


def test_a_weight_of_two_is_a_ray_twice_and_of_zero_is_none():
    origins = np.array([[0.0, 0.0, 9.0], [5.0, 0.0, 9.0], [5.0, 3.0, 2.0]])
    directions = rays_to(np.array([1.0, 2.0, 0.0]), np.add(origins, [[0.3], [0.0], [-0.2]]))
    first = np.zeros(4, dtype=int)
    twice = intersect(origins[[0, 1, 1, 2]], directions[[0, 1, 1, 2]], first, 1)
    found = intersect(origins, directions, first[:3], 1, weights=np.array([1.0, 2.0, 1.0]))
    assert_allclose(found, twice, atol=1e-12)
    found = intersect(origins, directions, first[:3], 1, weights=np.array([1.0, 0.0, 1.0]))
    assert_allclose(found, intersect(origins[::2], directions[::2], first[:2], 1), atol=1e-12)


def test_one_ray_parallel_rays_and_no_rays_meet_nowhere():
    origins = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [10.0, 0.0, 0.0]])
    directions = np.array([[0.0, 0.0, -1.0]] * 3)
    found = intersect(origins, directions, np.array([0, 1, 1]), 3)
    assert np.isnan(found).all()
    assert intersect(origins[:0], directions[:0], np.zeros(0, dtype=int), 0).shape == (0, 3)


def test_the_largest_angle_is_that_of_the_outermost_rays():
    angles = np.radians([-20.0, 3.0, 25.0, 0.0, 1e-4])
    directions = np.column_stack([np.sin(angles), np.zeros(5), -np.cos(angles)])
    found = largest_angles(directions, np.array([2, 2, 2, 0, 0]), 4)
    # the arc cosine would give 1e-4 degrees to two digits only
    assert_allclose(np.degrees(found), [1e-4, 0.0, 45.0, 0.0], rtol=1e-9)


def test_the_largest_angle_is_found_among_all_pairs(rng):
    n_rays = np.array([2, 3, 5, 8, 8, 13])
    point_idx = rng.permutation(np.repeat(np.arange(len(n_rays)), n_rays))
    directions = rng.normal(size=(len(point_idx), 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    found = largest_angles(directions, point_idx, len(n_rays))
    for point, angle in enumerate(found):
        d = directions[point_idx == point]
        assert np.cos(angle) == pytest.approx((d @ d.T).min(), abs=1e-12)


def test_opposite_rays_make_a_straight_angle():
    directions = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    assert largest_angles(directions, np.zeros(2, dtype=int), 1)[0] == pytest.approx(np.pi)


@pytest.mark.parametrize("relief_m", [0.0, 80.0])
@pytest.mark.parametrize("kappa_deg", [0.0, 90.0, -150.0])
def test_an_image_is_resected_on_flat_and_on_hilly_ground(relief_m, kappa_deg):
    angles = np.radians([2.0, -3.0, kappa_deg])
    T = Pose(R=rotation_from_opk(angles), r=np.array([20.0, -30.0, 1900.0]))
    x_m = blocks.terrain(12, half_m=250.0, relief_m=relief_m)
    poses = Pose(R=np.tile(T.R, (12, 1, 1)), r=np.tile(T.r, (12, 1)))
    found = resect(blocks.CAMERA, project(blocks.CAMERA, poses, x_m), x_m)
    assert_allclose(found.r, T.r, atol=1e-3)  # m; a start value
    assert rotation_angle(found.R, T.R) < 1e-6


@pytest.mark.parametrize("n", [0, 2])
def test_a_resection_needs_three_points(n):
    with pytest.raises(ValueError, match=f"three points or more, got {n}"):
        resect(blocks.CAMERA, np.zeros((n, 2)), np.zeros((n, 3)))


# --- what is known of a mounting: six values, and what is no such ----------------------------


TABLE = {"width_px": 4000, "height_px": 3000, "pixel_um": 5.0, "focal_mm": 50.0}


def test_nothing_is_known_by_default():
    prior = Prior()
    assert not prior.lever_declared.any()
    assert not prior.boresight_declared.any()
    assert np.isinf(prior.lever_sigma).all()


@pytest.mark.parametrize("wrong", [{"sigma": (1.0,) * 5}, {"declared": ()}])
def test_six_values_are_expected(wrong):
    with pytest.raises(ValueError, match="expected 6 values each"):
        Prior(**wrong)


def test_a_sigma_is_positive():
    with pytest.raises(ValueError, match="expected positive numbers"):
        Prior(sigma=(0.1, 0.0, 0.1, 1.0, 1.0, 1.0))


def test_declared_is_what_is_written_and_sigma_is_of_that():
    """One number is of all three; where no value is written, there is no sigma either."""
    said = {"lever_x_m": 0.0, "lever_z_m": -0.3, "lever_sigma_m": 0.02, "mount_kappa_deg": 90.0}
    prior = camera_of("CAM", {**TABLE, **said, "mount_sigma_deg": [0.5, 0.5, 0.2]}).prior
    assert prior.lever_declared.tolist() == [True, False, True]
    assert prior.lever_sigma.tolist() == [0.02, np.inf, 0.02]
    assert prior.boresight_declared.tolist() == [False, False, True]
    assert prior.boresight_sigma.tolist() == [np.inf, np.inf, np.radians(0.2)]


def test_a_ray_without_direction_meets_nothing():
    """NaN, and no finite point: the other two rays of its point do not outvote it."""
    x, of_one = np.array([10.0, 20.0, 0.0]), np.zeros(3, dtype=int)
    origins = np.array([[0.0, 0.0, 100.0], [50.0, 0.0, 100.0], [80.0, 0.0, 100.0]])
    towards = rays_to(x, origins)
    assert_allclose(intersect(origins, towards, of_one, 1), x[None], atol=1e-9)
    towards[1] = 0.0
    assert np.isnan(intersect(origins, towards, of_one, 1)).all()
