"""Cameras to and from OpenCV, held against OpenCV's own projection and undistortion."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.geometry.camera import Camera, Interior, correct, xy_from_colrow
from acx4lib.geometry.collinearity import project
from acx4lib.geometry.frames import Pose
from acx4tools.exchange.opencv import from_opencv, to_opencv

HEAD = Camera(  # Table 1 and section 3.1 of the paper, CAM1
    name="CAM1",
    width_px=8984,
    height_px=6732,
    pixel_mm=0.006,
    interior=Interior(
        f=74.1, xp=0.12, yp=-0.08, k1=2.27e-6, k2=-1.1e-10, p1=3.3e-6, p2=-7.2e-6, b1=2e-4
    ),
)
LEVEL = Pose(R=np.eye(3)[None], r=np.zeros((1, 3)))


def ahead(camera):
    """Points all over the image, 100 m from the camera, in its axes."""
    half = 0.49 * camera.pixel_mm * np.array([camera.width_px, camera.height_px])
    x, y = (a.ravel() for a in np.meshgrid(*(np.linspace(-h, h, 9) for h in half)))
    return 100 * np.column_stack([x, y, np.full(81, -camera.interior.f)]) / camera.interior.f


def seen_by_opencv(camera, x_c):
    points, zero = x_c * [1, -1, -1], np.zeros(3)
    return cv2.projectPoints(points, zero, zero, camera.matrix, camera.distortion)[0][:, 0]


def test_opencv_projects_points_to_where_the_library_does():
    """As closely as it says, and no closer: the misfit is that of the two polynomials."""
    x_c, found = ahead(HEAD), to_opencv(HEAD)
    apart = np.linalg.norm(seen_by_opencv(found, x_c) - project(HEAD, LEVEL, x_c), axis=1)
    assert (
        apart.max() <= 1.001 * found.left.largest_px
    )  # the corners are not among the nodes' image
    assert apart.max() > 0.3 * found.left.largest_px
    assert found.left.largest_px < 0.03  # of some 20 px of distortion


def test_a_camera_without_distortion_is_the_same_to_opencv():
    plain = replace(HEAD, interior=Interior(f=74.1, xp=0.12, yp=-0.08, b1=2e-4))
    found = to_opencv(plain)
    assert_allclose(found.distortion, 0.0, atol=1e-12)
    assert_allclose(
        seen_by_opencv(found, ahead(plain)), project(plain, LEVEL, ahead(plain)), atol=1e-8
    )


def test_a_camera_comes_back_from_opencv():
    found = to_opencv(HEAD)
    back, left = from_opencv(
        found.matrix, found.distortion, name="CAM1", width_px=8984, height_px=6732, pixel_mm=0.006
    )
    x_c = ahead(HEAD)
    apart = np.linalg.norm(project(back, LEVEL, x_c) - project(HEAD, LEVEL, x_c), axis=1)
    assert apart.max() < 2 * (left.largest_px + found.left.largest_px)
    assert_allclose(
        back.interior.to_array()[:3], HEAD.interior.to_array()[:3], rtol=1e-12, atol=1e-12
    )
    assert_allclose(back.interior.b1, HEAD.interior.b1, atol=1e-12)


@pytest.mark.parametrize("n", [4, 5, 8])
def test_ideal_points_are_opencvs_own_undistortion(n):
    """A consumer's camera with strong distortion; eight coefficients are the rational model."""
    matrix = np.array([[3000.0, 0.0, 2010.0], [0.0, 3003.0, 1490.0], [0.0, 0.0, 1.0]])
    distortion = np.array([-0.11, 0.08, 3e-4, -2e-4, -0.02, 0.01, 0.02, 0.001])[:n]
    camera, left = from_opencv(
        matrix, distortion, name="C", width_px=4000, height_px=3000, pixel_mm=0.002
    )
    colrow = np.array([[0.0, 0.0], [3999.0, 10.0], [2000.0, 2999.0], [777.0, 888.0]])
    ideal = correct(camera.interior, xy_from_colrow(camera, colrow)) / camera.interior.f * [1, -1]
    x_c, zero = np.column_stack([ideal, np.ones(len(ideal))]), np.zeros(3)
    seen = cv2.projectPoints(x_c, zero, zero, matrix, distortion)[0][:, 0]
    assert np.hypot(*(seen - colrow).T).max() <= 1.01 * left.largest_px
    assert left.largest_px < 1.0  # of some 100 px of distortion


def test_what_is_no_camera_of_opencv_is_told():
    matrix, size = np.diag([3000.0, 3000.0, 1.0]), {"width_px": 10, "height_px": 10}
    with pytest.raises(
        ValueError, match=r"len\(distortion\): expected one of 4, 5, 8, 12, 14, got 3"
    ):
        from_opencv(matrix, np.zeros(3), name="C", pixel_mm=0.002, **size)
    matrix[0, 1] = 0.5
    with pytest.raises(ValueError, match=r"matrix: expected no skew, got 0\.5"):
        from_opencv(matrix, np.zeros(5), name="C", pixel_mm=0.002, **size)
