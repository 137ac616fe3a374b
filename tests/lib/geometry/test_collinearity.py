"""Collinearity: eqs (1)-(5) and (14) written out, OpenCV's projection, Jacobians."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose

from acx4lib.geometry import collinearity
from acx4lib.geometry.camera import Camera, Interior, distortion, xy_from_colrow
from acx4lib.geometry.collinearity import Measurement, refraction_lift, refraction_taken_up
from acx4lib.geometry.frames import Pose, exp, rotation_from_opk, transform
from support.helpers import numeric_jacobian
from support.strategies import interiors, opk, poses, vectors, visible_points

CAMERA = Camera(
    name="CAM",
    width_px=9000,
    height_px=6700,
    pixel_mm=0.006,
    interior=Interior(f=74.0, xp=0.05, yp=-0.08, k1=2.3e-6, p1=3e-6, p2=-7e-6),
)
PIXELS = 1e-8  # px of 1e4: positions of 1e4 m are rounded to 1e-12 m, seen from 300 m


def repeated(T, n):
    """One pose for each of n points."""
    return Pose(R=np.tile(T.R.reshape(3, 3), (n, 1, 1)), r=np.tile(T.r.reshape(3), (n, 1)))


def from_camera(T, x_c):
    """Points given in camera axes, in the mapping frame."""
    return transform(T.R, x_c) + T.r


# --- the paper's equations, written out ------------------------------------------------------


@given(interior=interiors(), angles=opk(), r0=vectors(3000.0), x_c=visible_points(3))
def test_projected_points_fulfil_eqs_1_to_5(interior, angles, r0, x_c):
    camera = replace(CAMERA, interior=interior)
    m = rotation_from_opk(angles).T  # eq. (6): object to image
    x_m = x_c @ m + r0
    T = Pose(R=m.T, r=r0)
    colrow = collinearity.project(camera, repeated(T, 3), x_m)
    for xy, point in zip(xy_from_colrow(camera, colrow), x_m, strict=True):
        D = [sum(m[i, j] * (point[j] - r0[j]) for j in range(3)) for i in range(3)]  # (3)-(5)
        dx, dy = distortion(interior, xy)
        x = (1 + interior.b1) * xy[0] + interior.b2 * xy[1]
        assert x - interior.xp == pytest.approx(-interior.f * D[0] / D[2] + dx, abs=1e-9)  # mm
        assert xy[1] - interior.yp == pytest.approx(-interior.f * D[1] / D[2] + dy, abs=1e-9)


@given(T_m_b=poses(), T_b_c=poses(), x_c=visible_points(1))
def test_a_mounted_cameras_rays_fulfil_eq_14(T_m_b, T_b_c, x_c):
    x_m = from_camera(T_m_b @ T_b_c, x_c)
    colrow = collinearity.project(CAMERA, T_m_b @ T_b_c, x_m)
    x, y = xy_from_colrow(CAMERA, colrow)[0] - [CAMERA.interior.xp, CAMERA.interior.yp]
    dx, dy = distortion(CAMERA.interior, xy_from_colrow(CAMERA, colrow))[0]
    r_i = np.array([x - dx, y - dy, -CAMERA.interior.f])
    scale = np.linalg.norm(x_c) / np.linalg.norm(r_i)
    # r_i^m = r_b^m + R_b^m r_c^b + lambda R_b^m R_c^b r_i^c
    found = T_m_b.r[0] + T_m_b.R[0] @ T_b_c.r[0] + scale * T_m_b.R[0] @ T_b_c.R[0] @ r_i
    assert_allclose(found, x_m[0], atol=1e-8)  # m, of 1e4


@given(T=poses(), x_c=visible_points())
def test_projection_is_opencvs_for_a_pinhole_camera(T, x_c):
    camera = replace(CAMERA, interior=Interior(f=74.0, xp=0.05, yp=-0.08))
    x_m = from_camera(T, x_c)
    turned = np.diag([1.0, -1.0, -1.0]) @ T.R[0].T  # OpenCV looks along +z, y down
    f_px = 74.0 / 0.006
    K = [
        [f_px, 0.0, 4499.5 + 0.05 / 0.006],
        [0.0, f_px, 3349.5 + 0.08 / 0.006],  # y up is row down
        [0.0, 0.0, 1.0],
    ]
    # the rotation as a matrix: the rotation vector of a near half turn costs some digits
    expected, _ = cv2.projectPoints(x_m, turned, -turned @ T.r[0], np.array(K), None)
    found = collinearity.project(camera, repeated(T, len(x_m)), x_m)
    assert_allclose(found, expected[:, 0], atol=1e-6)


def test_a_point_to_the_right_and_ahead_of_a_nadir_camera_lies_right_and_up():
    level = Pose(R=np.eye(3)[None], r=np.array([[0.0, 0.0, 1000.0]]))
    col, row = collinearity.project(CAMERA, level, np.array([[100.0, 50.0, 0.0]]))[0]
    assert col > 4499.5
    assert row < 3349.5


@given(T=poses(), x_c=visible_points())
def test_rays_lead_back_to_their_points(T, x_c):
    n = len(x_c)
    x_m = from_camera(T, x_c)
    colrow = collinearity.project(CAMERA, repeated(T, n), x_m)
    rays = collinearity.rays(CAMERA, repeated(T, n), colrow)
    expected = (x_m - T.r) / np.linalg.norm(x_m - T.r, axis=1, keepdims=True)
    assert_allclose(rays, expected, atol=1e-11)  # positions of 1e4 m, rounded, seen from 300 m


# --- residuals -------------------------------------------------------------------------------


def seen(T, colrow, cameras=(CAMERA,), **options):
    n = len(colrow)
    return Measurement(
        cameras=cameras,
        camera_idx=np.arange(n) % len(cameras),
        T_m_c=repeated(T, n),
        colrow=colrow,
        **options,
    )


@given(T=poses(), x_c=visible_points())
def test_residuals_of_projected_points_vanish(T, x_c):
    x_m = from_camera(T, x_c)
    colrow = collinearity.project(CAMERA, repeated(T, len(x_m)), x_m)
    assert_allclose(collinearity.image_residuals(seen(T, colrow), x_m), 0.0, atol=PIXELS)


def test_residuals_are_estimated_less_observed_pixels():
    camera = replace(CAMERA, interior=Interior(f=74.0))
    T = Pose(R=np.eye(3)[None], r=np.array([[0.0, 0.0, 1000.0]]))
    x_m = np.array([[100.0, 50.0, 0.0]])
    measured_off = collinearity.project(camera, T, x_m) + np.array([2.0, -3.0])
    v = collinearity.image_residuals(seen(T, measured_off, (camera,)), x_m)
    assert_allclose(v, [[-2.0, 3.0]], atol=PIXELS)


@given(interior=interiors(), T=poses(), x_c=visible_points(2))
def test_residuals_lead_from_the_measured_to_the_projected_point(interior, T, x_c):
    """One step of Newton's method from two pixels off: the next would be 3 k1 x v^2, 1e-5 px."""
    camera = replace(CAMERA, interior=interior)
    x_m = from_camera(T, x_c)
    projected = collinearity.project(camera, repeated(T, 2), x_m)
    v = collinearity.image_residuals(seen(T, projected + np.array([1.6, -1.2]), (camera,)), x_m)
    assert_allclose(v, np.tile([-1.6, 1.2], (2, 1)), atol=1e-4)


def test_at_the_measured_point_residuals_are_projected_minus_corrected_points():
    """As in DBAT: five pixels off along the radius, corrected by k1 r^3 at the measured point."""
    camera = replace(CAMERA, interior=Interior(f=74.0, k1=1e-6))
    ahead = Pose(R=np.eye(3)[None], r=np.zeros((1, 3)))
    measured = np.array([[4499.5 + 4000.0, 3349.5]])  # 24 mm to the right
    x_m = np.array([[24.0 - 1e-6 * 24.0**3 + 0.03, 0.0, -74.0]])
    v = collinearity.image_residuals(
        seen(ahead, measured, (camera,), distortion_at="measured"), x_m
    )
    assert_allclose(v, [[5.0, 0.0]], atol=1e-9)
    v = collinearity.image_residuals(seen(ahead, measured, (camera,)), x_m)
    stretched = 0.03 / (1 - 3e-6 * 24.0**2)
    assert_allclose(v, [[stretched / 0.006, 0.0]], atol=1e-3)  # first order, 3 k1 x v^2


def test_distortion_is_evaluated_at_points_that_are_known():
    with pytest.raises(ValueError, match="distortion_at: expected one of adjusted, measured"):
        seen(Pose(R=np.eye(3)[None], r=np.zeros((1, 3))), np.zeros((1, 2)), distortion_at="ideal")


def test_every_measurement_is_corrected_with_its_own_camera(rng):
    other = replace(CAMERA, name="B", pixel_mm=0.005, interior=Interior(f=50.0, k1=-1e-5))
    T = Pose(R=np.eye(3)[None], r=np.array([[0.0, 0.0, 1000.0]]))
    x_m = np.column_stack([rng.uniform(-200, 200, (6, 2)), np.zeros(6)])
    colrow = np.empty((6, 2))
    colrow[0::2] = collinearity.project(CAMERA, repeated(T, 3), x_m[0::2])
    colrow[1::2] = collinearity.project(other, repeated(T, 3), x_m[1::2])
    measurement = seen(T, colrow, (CAMERA, other))
    assert_allclose(collinearity.image_residuals(measurement, x_m), 0.0, atol=PIXELS)
    v, *_ = collinearity.image_derivatives(measurement, x_m)
    assert_allclose(v, 0.0, atol=PIXELS)


# --- at and behind the camera ----------------------------------------------------------------


def test_the_horizon_and_what_is_behind_the_camera_are_not_seen():
    x_c = np.array([[100.0, 0.0, 0.0], [0.0, 0.0, 0.0], [10.0, 0.0, 500.0], [10.0, 0.0, -500.0]])
    T = repeated(Pose(R=np.eye(3), r=np.zeros(3)), 4)
    for found in (collinearity.pinhole(74.0, x_c), collinearity.project(CAMERA, T, x_c)):
        assert np.isnan(found[:3]).all()
        assert np.isfinite(found[3]).all()


def test_a_point_just_under_the_horizon_is_far_out_or_not_seen():
    x_c = np.array([[100.0, 0.0, -1e-3], [1e4, 1e4, -1e-6]])
    colrow = collinearity.project(CAMERA, repeated(Pose(R=np.eye(3), r=np.zeros(3)), 2), x_c)
    assert np.all(np.isnan(colrow) | (np.abs(colrow) > 1e5))


def test_no_points_give_no_points():
    none = np.zeros((0, 3))
    T = Pose(R=np.zeros((0, 3, 3)), r=none)
    assert collinearity.project(CAMERA, T, none).shape == (0, 2)
    empty = Measurement(
        cameras=(CAMERA,), camera_idx=np.zeros(0, dtype=int), T_m_c=T, colrow=np.zeros((0, 2))
    )
    shapes = [a.shape for a in collinearity.image_derivatives(empty, none)]
    assert shapes == [(0, 2), (0, 2, 10), (0, 2, 6), (0, 2, 3)]


# --- Jacobians, each step and the whole ------------------------------------------------------


def moved(T, step):
    """A pose varied as the library varies it: position in m, rotation about its own axes."""
    return Pose(R=T.R @ exp(step[3:]), r=T.r + step[:3])


@given(x_c=visible_points(1))
def test_pinhole_jacobian(x_c):
    """The Jacobian agrees with the value; says nothing of the value itself."""
    numeric = numeric_jacobian(lambda x: collinearity.pinhole(74.0, x[None])[0], x_c[0], step=1e-2)
    # steps of 1e-2 m at 300 m: truncation 1e-9, rounding 1e-12
    assert_allclose(collinearity.pinhole_jacobian(74.0, x_c)[0], numeric, atol=1e-9)


@given(T=poses(), x_c=visible_points(1))
def test_to_camera_jacobian(T, x_c):
    x_m = from_camera(T, x_c)
    by_pose, by_point = collinearity.to_camera_jacobian(T, x_c)
    numeric_pose = numeric_jacobian(
        lambda step: collinearity.to_camera(moved(T, step), x_m)[0],
        np.zeros(6),
        step=[1e-1] * 3 + [1e-5] * 3,
    )
    numeric_point = numeric_jacobian(
        lambda x: collinearity.to_camera(T, x[None])[0], x_m[0], step=1e-1
    )
    # m per radian of points 4 km away: truncation 4e3 * 1e-10, rounding 1e-12 / 1e-5
    assert_allclose(by_pose[0], numeric_pose, atol=2e-6)
    assert_allclose(by_point[0], numeric_point, atol=1e-10)


@given(T_m_b=poses(), T_b_c=poses())
def test_mounted_jacobian(T_m_b, T_b_c):
    T_b_c = Pose(R=T_b_c.R, r=T_b_c.r / 1000)  # a lever arm of metres

    def change(T_b, T_c):
        """The camera pose as six numbers against the unvaried one."""
        T, T0 = T_b @ T_c, T_m_b @ T_b_c
        turned = T0.R[0].T @ T.R[0]
        about = 0.5 * np.array(
            [turned[2, 1] - turned[1, 2], turned[0, 2] - turned[2, 0], turned[1, 0] - turned[0, 1]]
        )
        return np.concatenate([T.r[0] - T0.r[0], about])

    by_body, by_mount = collinearity.mounted_jacobian(T_m_b, T_b_c)
    steps = np.array([1e-1] * 3 + [1e-5] * 3)
    numeric_body = numeric_jacobian(
        lambda s: change(moved(T_m_b, s), T_b_c), np.zeros(6), step=steps
    )
    numeric_mount = numeric_jacobian(
        lambda s: change(T_m_b, moved(T_b_c, s)), np.zeros(6), step=steps
    )
    # positions of 1e4 m are rounded to 1e-12 m; over a step of 1e-5 that is 1e-7
    assert_allclose(by_body[0], numeric_body, atol=5e-7)
    assert_allclose(by_mount[0], numeric_mount, atol=5e-7)


@pytest.mark.parametrize("distortion_at", collinearity.DISTORTION_AT)
@given(interior=interiors(), T=poses(), x_c=visible_points(2))
def test_image_derivatives(distortion_at, interior, T, x_c):
    """The whole chain, in pixels, by everything that it depends on."""
    camera = replace(CAMERA, interior=interior)
    x_m = from_camera(T, x_c)
    colrow = collinearity.project(camera, repeated(T, 2), x_m) + np.array([0.6, -0.4])

    def residuals(values=None, step=None, by=None):
        changed = camera if values is None else camera.with_interior(Interior.from_array(values))
        pose = T if step is None else moved(T, step)
        points = x_m if by is None else x_m + by
        given = seen(pose, colrow, (changed,), distortion_at=distortion_at)
        return collinearity.image_residuals(given, points)

    v, by_interior, by_pose, by_point = collinearity.image_derivatives(
        seen(T, colrow, (camera,), distortion_at=distortion_at), x_m
    )
    assert_allclose(v, residuals(), atol=PIXELS)
    steps = np.array([1e-2, 1e-2, 1e-2, 1e-9, 1e-12, 1e-15, 1e-7, 1e-7, 1e-4, 1e-4])
    numeric = numeric_jacobian(lambda x: residuals(values=x), interior.to_array(), step=steps)
    # after its last step Newton's method is not begun anew for a neighbour: v times the curvature
    share = 1e-4 if distortion_at == "adjusted" else 0.0
    close(by_interior, numeric, PIXELS / steps + share * largest(numeric))
    steps = np.array([1e-2] * 3 + [1e-5] * 3)
    numeric = numeric_jacobian(lambda x: residuals(step=x), np.zeros(6), step=steps)
    close(by_pose, numeric, PIXELS / steps + share * largest(numeric))
    numeric = numeric_jacobian(lambda x: residuals(by=x), np.zeros(3), step=1e-2)
    close(by_point, numeric, 1e-6 + share * largest(numeric))


def test_residuals_of_a_strong_short_lens_agree_with_their_derivatives():
    """A fisheye of 4 mm in Brown's terms; an adjustment stops where the two contradict."""
    lens = Interior(f=4.0, k1=-0.024, k2=-6.3e-4, k3=-4.6e-5)
    camera = replace(CAMERA, width_px=1280, height_px=960, pixel_mm=0.00375, interior=lens)
    T = repeated(Pose(R=np.eye(3), r=np.zeros(3)), 1)
    x_m = np.array([[45.0, 30.0, -100.0]])
    colrow = collinearity.project(camera, T, x_m) + np.array([1.0, -0.7])

    def residuals(by):
        return collinearity.image_residuals(seen(T[0], colrow, (camera,)), x_m + by)[0]

    *_, by_point = collinearity.image_derivatives(seen(T[0], colrow, (camera,)), x_m)
    numeric = numeric_jacobian(residuals, np.zeros(3), step=1e-3)
    assert_allclose(by_point[0], numeric, rtol=2e-6, atol=1e-8)


def largest(by):
    """The largest derivative in every column."""
    return np.abs(by).max(axis=(0, 1))


def close(found, numeric, rounding):
    """Equal to seven digits of the largest derivative in the column, or within the rounding."""
    largest = np.abs(numeric).max(axis=(0, 1))
    assert np.all(np.abs(found - numeric) <= 1e-7 * largest + rounding)


# --- Refraction against a ray that is traced through thin layers of air


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


def test_at_two_heights_refraction_is_taken_up_by_f_and_lever_arm_as_a_lens_formula():
    """Nadir lifts are c H^2 for small H: f' = f (1 + c (H1 + H2)), and the arm grows c H1 H2."""
    ground, H = 0.0, np.array([50.0, 80.0])
    r = np.stack([0 * H, 0 * H, H], axis=1)
    c = (refraction_lift(r, 0 * r) / H**2).mean()
    f_mm, z_m = refraction_taken_up(74.0, 5.0, H, ground, lever_arm=True)
    assert f_mm == pytest.approx(74.0 * c * H.sum(), rel=0.02)
    assert z_m == pytest.approx(c * H.prod(), rel=0.02)
    alone, none = refraction_taken_up(74.0, 5.0, H[:1], ground, lever_arm=False)
    assert alone == pytest.approx(74.0 * c * H[0], rel=0.02)
    assert none == 0


def test_no_points_are_not_lifted():
    assert refraction_lift(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)
