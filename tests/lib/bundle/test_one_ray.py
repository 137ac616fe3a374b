"""One ray of an adjustment closes its equation: by hand, its residual is the library's."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle.one_ray import one_ray
from acx4lib.geometry.camera import distort


@pytest.mark.parametrize("i", [0, 7])
def test_the_residual_of_a_ray_is_what_equation_14_leaves(mounted, i):
    ray = one_ray(mounted, i)
    camera, body = ray.camera, ray.T_m_b
    r_c = camera.T_b_c.R.T @ (body.R.T @ (ray.x_m - body.r) - camera.T_b_c.r)
    ideal = -camera.interior.f * r_c[:2] / r_c[2]
    seen = distort(camera.interior, ideal[None])[0]
    by_hand = (seen - ray.xy_mm) / camera.pixel_mm * np.array([1, -1])
    assert_allclose(by_hand, ray.residual_px, atol=1e-6)


def test_the_poses_of_a_ray_hang_together(mounted):
    ray = one_ray(mounted, 3)
    again = ray.T_m_b @ ray.camera.T_b_c
    assert_allclose(again.r, ray.T_m_c.r, atol=1e-6)
    assert "point " in repr(ray)


def test_a_ray_that_is_not_there_is_an_error(mounted):
    n = len(mounted.network.image_points)
    with pytest.raises(ValueError, match=f"i: expected less than {n}"):
        one_ray(mounted, n)
