"""Table 1 projected into Table 2's frame: footprints, coverage, and the inverse pair.

The numbers were worked out from Table 1 by a computation of its own before there was a library.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose

from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.geometry.camera import colrow_from_xy, correct, distortion, inside, xy_from_colrow
from acx4lib.geometry.frames import opk_from_rotation, rotation_from_opk
from acx4lib.synthetic_image import frame
from acx4lib.synthetic_image.frame import (
    coverage,
    footprint,
    head_from_synthetic,
    synthetic_from_head,
    synthetic_from_head_jacobian,
)
from support.helpers import numeric_jacobian
from support.pictures import printed_camera
from support.strategies import image_points

SYNTHETIC = printed_camera.synthetic()
ORIENTATION = printed_camera.heads()


# --- numbers from Table 1 --------------------------------------------------------------------


@pytest.mark.parametrize(
    ("k", "corners"),
    [
        (0, [(-43.95, -56.18), (-38.71, 7.84), (1.56, 6.69), (4.85, -48.85)]),
        (1, [(6.15, 48.79), (2.29, -6.93), (-37.98, -7.62), (-42.45, 56.25)]),
        (2, [(38.71, 55.04), (33.96, -7.39), (-5.53, -6.60), (-9.01, 49.41)]),
        (3, [(-9.55, -49.16), (-5.78, 6.72), (33.51, 7.35), (38.07, -54.84)]),
    ],
)
def test_footprint_corners_of_table_1(k, corners):
    """Upper left, upper right, lower right, lower left of the head, outer pixel edges."""
    found = footprint(ORIENTATION, k)
    assert_allclose(found[:4], corners, atol=0.0051)  # two decimals
    assert_allclose(found[4], found[0], atol=0)


def test_table_1_covers_the_whole_frame():
    found = coverage(ORIENTATION, SYNTHETIC)
    # per cent of the frame, one decimal; nodes every 60 px count it to 0.1
    assert_allclose(100 * found.share, [0.0, 69.2, 28.7, 0.4, 1.7], atol=0.15)
    assert found.share[0] == 0.0
    assert found.seen.shape == (4, *found.xy.shape[:2])


def test_table_1_read_the_other_way_round_leaves_half_of_the_frame_uncovered():
    transposed = np.stack([opk_from_rotation(rotation_from_opk(opk).T) for opk in ORIENTATION.opk])
    found = coverage(replace(ORIENTATION, opk=transposed), SYNTHETIC)
    assert_allclose(100 * found.share, [47, 3, 35, 4, 10], atol=1.0)  # whole per cent


def test_each_head_sees_its_quarter():
    """Heads 1 to 4: left bottom, left top, right top, right bottom."""
    quarter = [(-15.0, -20.0), (-15.0, 20.0), (15.0, 20.0), (15.0, -20.0)]
    for k, point in enumerate(quarter):
        seen = [
            bool(inside(head, head_from_synthetic(ORIENTATION, j, np.array([point])))[0])
            for j, head in enumerate(ORIENTATION.heads)
        ]
        assert seen == [j == k for j in range(4)]


@pytest.mark.parametrize(("k", "largest"), [(0, 0.14), (1, 0.07), (2, 0.08), (3, 0.10)])
def test_distortion_belongs_to_the_measured_point(k, largest):
    """Evaluated at the ideal point, as computer vision does it, it is off by so many pixels."""
    head = ORIENTATION.heads[k]
    xy = coverage(ORIENTATION, SYNTHETIC).xy.reshape(-1, 2)
    colrow = head_from_synthetic(ORIENTATION, k, xy)
    measured = xy_from_colrow(head, colrow[inside(head, colrow)])
    # what an explicit object-to-image formula would take for the measured point
    principal = np.array([head.interior.xp, head.interior.yp])
    ideal = correct(head.interior, measured) + principal
    other = ideal + distortion(head.interior, ideal)
    off = np.linalg.norm(other - measured, axis=1).max() / head.pixel_mm
    # found on a part of the frame; here its very corners are in
    assert off == pytest.approx(largest, abs=0.02)


# --- eqs (1)-(11) ----------------------------------------------------------------------------


def test_a_synthetic_point_is_seen_by_eqs_1_to_6():
    """The plane Z = 0 in mm is the object; a head is a camera over it."""
    point = np.array([-12.0, 31.0, 0.0])
    k = 1
    head = ORIENTATION.heads[k]
    omega, phi, kappa = ORIENTATION.opk[k]
    m = rotation_from_opk(np.array([omega, phi, kappa])).T
    D = m @ (point - ORIENTATION.xyz_mm[k])
    xy = xy_from_colrow(head, head_from_synthetic(ORIENTATION, k, point[None, :2]))
    left = xy[0] - [head.interior.xp, head.interior.yp] - distortion(head.interior, xy)[0]
    assert_allclose(left, -head.interior.f * D[:2] / D[2], atol=1e-10)  # mm


@pytest.mark.parametrize("k", range(4))
@given(xy=image_points())
def test_heads_and_synthetic_image_are_an_inverse_pair(k, xy):
    colrow = 100 * xy + [4491.5, 3365.5]  # up to 3100 px from the middle
    back = head_from_synthetic(ORIENTATION, k, synthetic_from_head(ORIENTATION, k, colrow))
    assert_allclose(back, colrow, atol=1e-8)  # px


def test_a_head_that_looks_straight_down_sees_the_frame_as_it_is():
    plain = RelativeOrientation(
        heads=(replace(SYNTHETIC, name="HEAD"),),
        xyz_mm=np.array([[0.0, 0.0, 74.0]]),
        opk=np.zeros((1, 3)),
        cov_joint=np.zeros((15, 15)),
        n_exposures=1,
    )
    colrow = np.array([[0.0, 0.0], [11999.0, 16199.0], [7000.0, 100.0]])
    xy = xy_from_colrow(SYNTHETIC, colrow)
    assert_allclose(synthetic_from_head(plain, 0, colrow), xy, atol=1e-12)
    assert_allclose(footprint(plain, 0)[0], [-33.60, 45.36], atol=1e-9)  # Table 2
    assert coverage(plain, SYNTHETIC).share.tolist() == [0.0, 1.0]


def test_a_footprint_can_have_more_points():
    corners, outline = footprint(ORIENTATION, 0), footprint(ORIENTATION, 0, per_side=8)
    assert outline.shape == (33, 2)
    assert_allclose(outline[::8], corners, atol=1e-12)


def test_points_that_a_head_cannot_see_are_nowhere():
    turned = replace(ORIENTATION, opk=ORIENTATION.opk + np.array([np.pi / 2, 0.0, 0.0]))
    far = np.array([[0.0, 1e5], [0.0, -1e5]])
    assert np.isnan(head_from_synthetic(turned, 0, far)).any()
    assert head_from_synthetic(ORIENTATION, 0, np.zeros((0, 2))).shape == (0, 2)


def test_a_heads_pose_is_counted_in_millimetres_over_the_plane():
    T = frame.head_pose(ORIENTATION, 1)
    assert_allclose(T.r, [0.042, 0.052, 74.272], atol=0)
    assert_allclose(np.degrees(T.opk), [14.782598, 12.163894, -93.408507], atol=1e-10)


# --- the way back ----------------------------------------------------------------------------


@given(xy=image_points(1))
@pytest.mark.parametrize("k", range(4))
def test_the_jacobian_of_the_way_back_is_that_of_differences(k, xy):
    (colrow,) = colrow_from_xy(ORIENTATION.heads[k], xy)
    numeric = numeric_jacobian(
        lambda at: synthetic_from_head(ORIENTATION, k, at[None])[0], colrow, step=1.0
    )
    found = synthetic_from_head_jacobian(ORIENTATION, k, colrow[None])[0]
    assert_allclose(found, numeric, rtol=1e-6, atol=1e-9)


def test_a_ray_that_looks_up_meets_no_synthetic_image():
    upward = replace(ORIENTATION, opk=ORIENTATION.opk + np.array([np.pi, 0.0, 0.0]))
    assert np.isnan(synthetic_from_head(upward, 0, np.array([[4000.0, 3000.0]]))).all()
