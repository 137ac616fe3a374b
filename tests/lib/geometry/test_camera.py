"""The camera: the paper's printed distortions, OpenCV's polynomials, inverse pairs, Jacobians."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose

from acx4book.paper import printed
from acx4lib.geometry import camera
from acx4lib.geometry.camera import INTERIOR, Camera, Interior
from support.helpers import numeric_jacobian
from support.strategies import image_points, interiors

HEAD = Camera(name="CAM1", width_px=8984, height_px=6732, pixel_mm=0.006, interior=Interior(f=74))
HEAD_CORNER = 0.003 * np.array([[8984.0, 6732.0]])  # mm, outer edge of the outer pixels
SYNTHETIC_CORNER = np.array([[33.60, 45.36]])  # mm, Table 2


def radial(interior):
    """The radial terms alone, about the middle of the image."""
    return Interior(f=interior.f, k1=interior.k1, k2=interior.k2, k3=interior.k3)


# --- printed numbers -------------------------------------------------------------------------


def test_border_distortion_is_the_papers_15_pixels():
    dxy_px = camera.distortion(Interior(f=74.0, k1=2.27e-6), HEAD_CORNER) / 0.006
    assert_allclose(np.hypot(*dxy_px.T), 15.0, atol=1.0)  # "approximately 15 pixels"


@pytest.mark.parametrize(
    ("head", "px"), [("CAM1", 14.45), ("CAM2", 13.18), ("CAM3", 12.48), ("CAM4", 13.69)]
)
def test_radial_distortion_at_the_heads_corners(head, px):
    """Worked out by hand: k1 r^3 at r = 33.68 mm."""
    dxy_px = camera.distortion(radial(printed.interior(1, head)), HEAD_CORNER) / 0.006
    assert_allclose(np.hypot(*dxy_px.T), px, atol=0.006)  # two decimals


def test_decentring_moves_the_heads_corners_between_9_and_18_pixels():
    corners = HEAD_CORNER * [[1, 1], [-1, 1], [-1, -1], [1, -1]]
    moved = [
        camera.distortion(printed.interior(1, head), corners) / 0.006 for head in printed.HEADS
    ]
    size = np.linalg.norm(moved, axis=-1)
    assert_allclose([size.min(), size.max()], [8.8, 18.3], atol=0.05)  # one decimal


def test_table_3_gives_5_pixels_of_radial_distortion_at_the_corner():
    """Worked out by hand: k1 r^3 + k2 r^5 + k3 r^7 at r = 56.45 and 45.4 mm."""
    two_step = radial(printed.interior(3, "two_step"))
    corner = camera.distortion(two_step, SYNTHETIC_CORNER) / 0.0056
    border = camera.distortion(two_step, np.array([[0.0, 45.4]])) / 0.0056
    assert_allclose(np.hypot(*corner.T), 5.05, atol=0.006)  # two decimals
    assert_allclose(border, [[0.0, 2.33]], atol=0.006)


@given(interior=interiors(), xy=image_points())
def test_distortion_is_eqs_7_to_11_as_printed(interior, xy):
    i = interior
    for (x, y), found in zip(xy, camera.distortion(i, xy), strict=True):
        dx, dy = x * (1 + i.b1) + i.b2 * y - i.xp, y - i.yp
        r = np.sqrt(dx**2 + dy**2)  # eq. (11)
        radial = i.k1 * r**2 + i.k2 * r**4 + i.k3 * r**6
        expected = [
            radial * dx + i.p1 * (r**2 + 2 * dx**2) + 2 * i.p2 * dx * dy,  # eqs (7), (9)
            radial * dy + i.p2 * (r**2 + 2 * dy**2) + 2 * i.p1 * dx * dy,  # eqs (8), (10)
        ]
        assert_allclose(found, expected, atol=1e-14)  # mm, of at most one


def test_the_middle_of_the_top_left_pixel_is_pixel_zero():
    xy = camera.xy_from_colrow(HEAD, np.array([[0.0, 0.0], [8983.0, 6731.0], [4491.5, 3365.5]]))
    corner = [8983 / 2 * 0.006, 6731 / 2 * 0.006]
    assert_allclose(xy, [[-corner[0], corner[1]], [corner[0], -corner[1]], [0, 0]], atol=1e-13)


# --- OpenCV ----------------------------------------------------------------------------------


def opencv_coefficients(i):
    """The coefficients with which OpenCV's distortion does what `correct` does.

    OpenCV distorts x by x (1 + K1 r^2 + ...) + 2 P1 x y + P2 (r^2 + 2 x^2), in units of f.
    """
    return -np.array([i.k1 * i.f**2, i.k2 * i.f**4, i.p2 * i.f, i.p1 * i.f, i.k3 * i.f**6])


@given(interior=interiors(), xy=image_points())
def test_correct_is_opencvs_polynomial_with_the_other_sign(interior, xy):
    x = xy[:, 0] * (1 + interior.b1) + interior.b2 * xy[:, 1]
    bar = np.column_stack([x, xy[:, 1]]) - [interior.xp, interior.yp]
    rays = np.column_stack([bar / interior.f, np.ones(len(bar))])
    expected, _ = cv2.projectPoints(
        rays, np.zeros(3), np.zeros(3), np.eye(3), opencv_coefficients(interior)
    )
    assert_allclose(
        camera.correct(interior, xy), interior.f * expected[:, 0], rtol=1e-12, atol=1e-12
    )


def test_distort_is_opencvs_iterative_undistortion():
    interior = Interior(f=74.0, xp=0.05, yp=-0.08, k1=2.27e-6, k2=-1e-10, p1=3.3e-6, p2=-7.2e-6)
    ideal = np.array([[20.0, -15.0], [-26.0, 20.0], [0.0, 0.0]])
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-14)
    bar = cv2.undistortPoints(
        ideal[:, None] / 74.0, np.eye(3), opencv_coefficients(interior), None, None, None, criteria
    )
    expected = 74.0 * bar[:, 0] + [0.05, -0.08]
    assert_allclose(camera.distort(interior, ideal), expected, atol=1e-9)  # OpenCV's last step, mm


# --- inverse pairs ---------------------------------------------------------------------------


@given(interior=interiors(), xy=image_points())
def test_distort_is_the_inverse_of_correct(interior, xy):
    ideal = camera.correct(interior, xy)
    assert_allclose(camera.distort(interior, ideal), xy, atol=1e-11)  # mm; stops at 1e-13 of ideal


@given(interior=interiors(), xy=image_points())
def test_correct_is_the_inverse_of_distort(interior, xy):
    found = camera.distort(interior, 0.8 * xy)
    assert_allclose(camera.correct(interior, found), 0.8 * xy, atol=1e-12)  # stops at 1e-13


@given(colrow=image_points())
def test_pixels_come_back_from_millimetres(colrow):
    back = camera.colrow_from_xy(HEAD, camera.xy_from_colrow(HEAD, 100 * colrow))
    assert_allclose(back, 100 * colrow, atol=1e-11)  # px, of 1e4


@given(interior=interiors())
def test_an_interior_orientation_comes_back_from_its_array(interior):
    assert Interior.from_array(interior.to_array()) == interior
    assert [getattr(interior, name) for name in INTERIOR] == interior.to_array().tolist()


# --- Jacobian --------------------------------------------------------------------------------


@given(interior=interiors(), xy=image_points(3))
def test_correct_jacobian(interior, xy):
    steps = np.array([1e-3, 1e-3, 1e-3, 1e-9, 1e-12, 1e-15, 1e-7, 1e-7, 1e-5, 1e-5])
    numeric = numeric_jacobian(
        lambda values: camera.correct(Interior.from_array(values), xy),
        interior.to_array(),
        step=steps,
    )
    # the steps move points by 1e-4 mm or more, at a rounding of 1e-14 mm; cubic terms are below
    atol = 1e-12 / steps
    found = camera.correct_jacobian(interior, xy)
    assert np.all(np.abs(found - numeric) <= atol + 1e-7 * np.abs(numeric))


# --- limits ----------------------------------------------------------------------------------


@given(interior=interiors(), xy=image_points())
def test_correct_by_point_is_its_derivative(interior, xy):
    numeric = [
        numeric_jacobian(lambda at: camera.correct(interior, at), one, step=1e-4) for one in xy
    ]
    assert_allclose(camera.correct_by_point(interior, xy), numeric, atol=1e-8)


@pytest.mark.parametrize("f", [0.0, -74.0, np.nan, np.inf])
def test_a_focal_length_must_be_positive(f):
    with pytest.raises(ValueError, match=f"^f.*got (f=)?{f}"):
        Interior(f=f)


def test_the_sensor_ends_at_the_outer_edges_of_its_pixels():
    colrow = np.array([[-0.5, -0.5], [8983.5, 6731.5], [-0.51, 0], [0, 6731.51], [100, 100]])
    assert camera.inside(HEAD, colrow).tolist() == [True, True, False, False, True]


def test_the_distance_from_the_border_is_to_the_nearest_outer_edge():
    small = Camera(name="CAM", width_px=100, height_px=40, pixel_mm=0.01, interior=Interior(f=50))
    colrow = np.array([[-0.5, 20.0], [3.0, 20.0], [50.0, 38.5], [50.0, 41.0], [np.nan, 3.0]])
    assert_allclose(camera.border_distance(small, colrow), [0.0, 3.5, 1.0, -1.5, np.nan])
    assert camera.inside(small, colrow).tolist() == [True, True, True, False, False]


def test_the_diagonal_of_a_head():
    assert pytest.approx(11226.4, abs=0.05) == HEAD.diagonal_px  # sqrt(8984^2 + 6732^2)


def test_no_points_give_no_points():
    none = np.zeros((0, 2))
    interior = Interior(f=50.0, k1=1e-6)
    assert camera.distort(interior, none).shape == (0, 2)
    assert camera.correct(interior, none).shape == (0, 2)
    assert camera.correct_jacobian(interior, none).shape == (0, 2, 10)
    assert camera.xy_from_colrow(HEAD, none).shape == (0, 2)


@pytest.mark.parametrize("radius", [40.0, 60.0, 100.0, 1e4, 1e9])
def test_beyond_its_turning_point_a_lens_model_shows_nothing(radius):
    """x - k1 x^3 with k1 = 1e-4 turns at 57.7 mm, where it has reached 38.5 mm."""
    ideal = radius * np.array([[1.0, 0.0], [0.0, -1.0], [0.6, 0.8]])
    assert np.isnan(camera.distort(Interior(f=50.0, k1=1e-4), ideal)).all()


def test_just_inside_its_turning_point_a_lens_model_still_shows_points():
    found = camera.distort(Interior(f=50.0, k1=1e-4), np.array([[38.4, 0.0]]))
    assert 50 < found[0, 0] < 57.7
