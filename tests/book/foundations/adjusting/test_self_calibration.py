"""Against differences of the library's projection, closed forms, and the system not reduced."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.foundations import example
from acx4book.foundations.adjusting import self_calibration as own
from acx4lib.geometry import collinearity
from acx4lib.geometry.camera import Interior, colrow_from_xy
from acx4lib.geometry.frames import Pose, exp, rotation_from_opk
from support.helpers import numeric_jacobian

FOUR_WAYS = [own.view(opk) for opk in ((20, 0, 0), (-20, 0, 0), (0, 20, 0), (0, -20, 0))]


def test_columns_are_derivatives():
    opk = (12.0, -5.0, 30.0)
    view, camera = own.view(opk, relief_m=40.0), example.camera()
    R = rotation_from_opk(np.radians(opk))
    ray = np.column_stack([view.xy, np.full(35, -example.F_MM)]) @ R.T
    x_m = ray * ((40.0 * np.cos(np.arange(35) * 2.4) - 480.0) / ray[:, 2])[:, None]

    def projected(values):
        f, xp, yp = values[:3]
        changed = replace(camera, interior=Interior(f=50.0 + f, xp=xp, yp=yp))
        T = Pose(R=(R @ exp(values[6:]))[None], r=values[None, 3:6])
        return ((collinearity.project(changed, T, x_m)) * [0.01, -0.01]).ravel()

    assert_allclose(collinearity.project(camera, Pose(R=R[None], r=np.zeros((1, 3))), x_m),
                    colrow_from_xy(camera, view.xy), atol=1e-9)  # fmt: skip
    numeric = numeric_jacobian(projected, np.zeros(9), step=1e-5)
    assert_allclose(np.hstack([view.by_camera, view.by_pose]), numeric, atol=1e-5)


def test_over_flat_ground_a_vertical_image_says_nothing_of_its_camera():
    flat = own.view((0.0, 0.0, 60.0))
    assert_allclose(flat.left[:, 0], 0.0, atol=1e-9)
    assert np.isinf(own.sigma_camera([flat] * 4)).all()


def test_the_focal_length_is_then_as_good_as_the_observed_height():
    # f / h is known, so sigma_f = f sigma_Z / h where the noise of the images is small beside it
    sigma = own.sigma_camera([own.view((0.0, 0.0, 0.0))], sigma_position=(0.03, 0.03, 5.0))
    assert_allclose(sigma[0], 50.0 * 5.0 / 480.0, rtol=1e-2)


def test_tilts_must_have_more_than_one_direction_in_the_image():
    assert np.isinf(own.sigma_camera([own.view((0.0, 20.0, 0.0))] * 4)).all()
    crossing = [own.view((20.0, 0.0, kappa)) for kappa in (0.0, 90.0, 180.0, 270.0)]
    assert_allclose(own.sigma_camera(crossing), own.sigma_camera(FOUR_WAYS), rtol=1e-6)


@pytest.mark.parametrize("sigma_position", [None, (0.03, 0.03, 0.05)])
def test_sigma_is_that_of_the_whole_system(sigma_position):
    A = np.zeros((4 * 70, 3 + 24))
    for i, view in enumerate(FOUR_WAYS):
        rows = slice(70 * i, 70 * i + 70)
        A[rows, :3], A[rows, 3 + 6 * i : 9 + 6 * i] = view.by_camera, view.by_pose
    N = A.T @ A / example.SIGMA_IMAGE_MM**2
    for i in range(4 if sigma_position else 0):
        at = 3 + 6 * i + np.arange(3)
        N[at, at] += 1 / np.square(sigma_position)
    expected = np.sqrt(np.linalg.inv(N).diagonal()[:3])
    assert_allclose(own.sigma_camera(FOUR_WAYS, sigma_position=sigma_position), expected, rtol=1e-6)
