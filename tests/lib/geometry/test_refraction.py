"""Refraction against a ray that is traced through thin layers of air."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.geometry.refraction import refraction_lift


def traced_bend(camera_m, ground_m, theta):
    """Follow a ray through thin level layers of the standard atmosphere (n sin(theta) is kept).

    Returns the angle from the vertical at the camera less that of the straight line.
    """
    h = np.linspace(ground_m, camera_m, 20_001)
    n = 1 + 2.78e-4 * (1 - 0.0065 * h / 288.15) ** 4.2559  # visible light, density of the air
    sine = n[-1] * np.sin(theta) / n
    tangent = sine / np.sqrt(1 - sine**2)
    aside = np.sum((tangent[1:] + tangent[:-1]) / 2) * (h[1] - h[0])
    return theta - np.arctan2(aside, camera_m - ground_m)


@pytest.mark.parametrize(
    ("camera_m", "ground_m"), [(1900, 900), (2500, 900), (3500, 900), (6000, 0)]
)
def test_refraction_lifts_points_as_much_as_a_ray_through_the_standard_atmosphere(
    camera_m, ground_m
):
    theta = np.radians(30.0)
    depth = camera_m - ground_m
    lift = refraction_lift(
        np.array([[0.0, 0.0, camera_m]]), np.array([[depth * np.tan(theta), 0.0, ground_m]])
    )[0]
    seen_at = theta + traced_bend(camera_m, ground_m, theta)
    expected = depth - depth * np.tan(theta) / np.tan(seen_at)
    # first order in n - 1, of 3e-4, and in the bend's own change along the ray
    assert lift == pytest.approx(expected, rel=1e-3)


def test_refraction_is_least_at_the_nadir_and_grows_outwards():
    r = np.tile([0.0, 0.0, 2500.0], (3, 1))
    x = np.array([[0.0, 0.0, 900.0], [1600.0, 0.0, 900.0], [0.0, -1600.0, 900.0]])
    lift = refraction_lift(r, x)
    assert_allclose(lift[1:] / lift[0], 2.0)  # 1 / cos^2 at 45 degrees


def test_no_points_are_not_lifted():
    assert refraction_lift(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)
