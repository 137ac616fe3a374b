"""Table 1 projected into Table 2's frame: footprints, coverage, and the inverse pair.

The numbers were worked out from Table 1 by a computation of its own before there was a library.
"""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from numpy.testing import assert_allclose

from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.errors import AdjustmentError
from acx4lib.geometry.camera import (
    Camera,
    Interior,
    colrow_from_xy,
    correct,
    distortion,
    inside,
    xy_from_colrow,
)
from acx4lib.geometry.collinearity import pinhole
from acx4lib.geometry.frames import Pose, opk_from_rotation, rotation_from_opk
from acx4lib.synthetic_image import frame
from acx4lib.synthetic_image.frame import (
    TYPICAL_BASES_M,
    coverage,
    flight_parallax,
    footprint,
    head_from_synthetic,
    parallax,
    reduced_camera,
    reduced_heads,
    synthetic_from_head,
    synthetic_from_head_jacobian,
)
from acx4lib.synthetic_image.head_map import (
    TOLERANCE,
    fitting_step,
    head_map,
    levelled,
    window_map,
)
from support import blocks
from support.helpers import numeric_jacobian
from support.pictures import taken
from support.strategies import image_points, numbers

SYNTHETIC = taken.printed_synthetic()
ORIENTATION = taken.printed_heads()


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


def test_heads_that_look_one_way_coincide_and_lose_no_more_than_their_own_border():
    assert not coverage(ORIENTATION, SYNTHETIC).coincides
    heads = tuple(replace(SYNTHETIC, name=name) for name in "AB")
    turned = np.array([[0.0, 0.0, 0.0], [0.0, 1e-4, 0.0]])  # a pixel and a third
    parallel = RelativeOrientation(
        heads=heads,
        xyz_mm=np.tile([0.0, 0.0, 74.0], (2, 1)),
        opk=turned,
        cov_joint=np.zeros((32, 32)),
        n_exposures=1,
    )
    found = coverage(parallel, SYNTHETIC)
    assert found.coincides
    assert found.share.tolist() == [0.0, 0.0, 1.0]  # a border of one pixel is no mesh of 60


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
        cov_joint=np.zeros((16, 16)),
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


# --- Base and relief: closed forms, and two real projections of one ground point


PARALLAX_SYNTHETIC = Camera(
    name="SYN", width_px=12000, height_px=16200, pixel_mm=0.0056, interior=Interior(f=74.0)
)
RELIEF_M = np.array([10.0, 30.0, 100.0, 200.0])


@pytest.mark.parametrize(
    ("base_m", "height_m", "shift_px", "change_px"),
    [
        (0.10, 1000.0, 1.32, (0.01, 0.04, 0.15, 0.33)),
        (0.15, 1000.0, 1.98, (0.02, 0.06, 0.22, 0.50)),
        (0.30, 1000.0, 3.96, (0.04, 0.12, 0.44, 0.99)),
        (0.15, 1300.0, 1.52, (0.01, 0.04, 0.13, 0.28)),
        (0.30, 1300.0, 3.05, (0.02, 0.07, 0.25, 0.55)),
    ],
)
def test_shifts_of_usual_bases_and_heights(base_m, height_m, shift_px, change_px):
    """Worked out for Table 2, f / p = 13214 px, before there was a library; two decimals."""
    found = parallax(PARALLAX_SYNTHETIC, np.array([base_m]), np.array([height_m]), RELIEF_M)
    assert_allclose(found.shift_px, [shift_px], atol=0.0051)
    assert_allclose(found.change_px, [change_px], atol=0.0051)


@given(
    base=numbers(0.5, smallest=0.01),
    height=numbers(4000.0, smallest=300.0),
    relief=numbers(250.0),
)
def test_two_lenses_see_a_ground_point_as_far_apart(base, height, relief):
    found = parallax(PARALLAX_SYNTHETIC, np.array([base]), np.array([height]), np.array([relief]))

    def apart(z):
        seen = [
            pinhole(PARALLAX_SYNTHETIC.interior.f, np.array([[120.0 - r, 80.0, z - height]]))
            for r in (0.0, base)
        ]
        first, second = (colrow_from_xy(PARALLAX_SYNTHETIC, xy)[0] for xy in seen)
        return np.hypot(*(second - first))

    assert_allclose(found.shift_px, apart(0.0), rtol=1e-7)  # of a small difference
    assert_allclose(found.change_px[0, 0], apart(relief) - apart(0.0), atol=1e-8)


def test_heights_that_are_not_above_the_ground_have_no_parallax():
    found = parallax(PARALLAX_SYNTHETIC, np.full(3, 0.2), np.array([150.0, 0.0, -20.0]), RELIEF_M)
    assert np.isnan(found.shift_px).tolist() == [False, True, True]
    assert np.isnan(found.change_px[0]).tolist() == [False, False, False, True]


# --- a flight --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def block():
    """Two heights, 1000 and 1300 m."""
    return blocks.standard()


def head(name, *r):
    return replace(PARALLAX_SYNTHETIC, name=name, T_b_c=Pose(R=np.eye(3), r=np.array(r)))


HEADS = (head("A", 0.0, 0.0, 0.0), head("B", 0.12, 0.0, 0.0), head("C", 0.12, 0.16, 0.0))


def test_a_flights_shifts_follow_from_its_lever_arms_and_heights(block):
    found = flight_parallax(block, HEADS, PARALLAX_SYNTHETIC)
    ground = block.control.x_m[:, 2]
    z = block.trajectory.T_m_b.r[:, 2]
    assert found.labels == ("A and B", "A and C", "B and C")
    assert_allclose(found.height_m, z - ground.mean())
    assert found.relief_m == pytest.approx(ground.max() - ground.mean())
    f_px = 74.0 / 0.0056
    assert_allclose(found.shift_px, f_px * np.outer([0.12, 0.20, 0.16], 1 / (z - ground.mean())))
    # the highest point is seen as far apart as from a flight so much lower
    seen = f_px * np.outer([0.12, 0.20, 0.16], 1 / (z - ground.max()))
    assert_allclose(found.shift_px + found.change_px, seen, rtol=1e-12)


def test_undeclared_lever_arms_are_replaced_by_typical_bases(block):
    found = flight_parallax(block, [HEADS[0], head("B", 0.0, 0.0, 0.0)], PARALLAX_SYNTHETIC)
    assert_allclose(found.base_m, TYPICAL_BASES_M)
    assert found.labels == ("0.1 m, typical", "0.3 m, typical")


def test_without_control_the_heights_are_not_known(block):
    none = replace(block, control=block.control[:0])
    with pytest.raises(AdjustmentError, match="no control points: flying heights"):
        flight_parallax(none, HEADS, PARALLAX_SYNTHETIC)


def test_the_table_has_the_lowest_and_the_highest_exposure(block):
    found = flight_parallax(block, HEADS, PARALLAX_SYNTHETIC)
    table = found.table()
    assert table.index.tolist() == ["A and B", "A and C", "B and C"]
    assert_allclose(table["Base (m)"], [0.12, 0.20, 0.16])
    assert_allclose(table.iloc[:, 1], found.shift_px.max(axis=1))
    assert_allclose(table.iloc[:, 2], found.shift_px.min(axis=1))
    assert_allclose(table.iloc[:, 3], found.change_px.max(axis=1))
    assert len(repr(found)) < 120


# --- positions of synthetic pixels in the heads ----------------------------------------------


SYN = taken.printed_synthetic()
HEAD_MAP_HEADS = taken.printed_heads()


def between_nodes(head, rows, cols):
    """Return the bilinear positions, in the head, of rows x columns of the grid's image."""
    i, t = cell(rows, head.step_px, head.nodes.shape[0])
    j, s = cell(cols, head.step_px, head.nodes.shape[1])
    t, s = t[:, None, None], s[None, :, None]
    upper = (1 - s) * head.nodes[np.ix_(i, j)] + s * head.nodes[np.ix_(i, j + 1)]
    lower = (1 - s) * head.nodes[np.ix_(i + 1, j)] + s * head.nodes[np.ix_(i + 1, j + 1)]
    return (1 - t) * upper + t * lower


def cell(position, step_px, n):
    """Return the node before each position, and the fraction of the way to the next node."""
    before = np.clip(position // step_px, 0, n - 2).astype(np.intp)
    return before, position / step_px - before


def errors(orientation, k, synthetic, head, rows, cols):
    """Return the errors at rows x columns that the head sees, px."""
    colrow = np.stack(np.meshgrid(cols, rows), axis=-1).astype(float)
    xy = xy_from_colrow(synthetic, colrow).reshape(-1, 2)
    exact = head_from_synthetic(orientation, k, xy).reshape(colrow.shape)
    seen = inside(orientation.heads[k], exact)
    return np.linalg.norm(between_nodes(head, rows, cols) - exact, axis=-1)[seen]


@pytest.mark.parametrize("k", range(4))
def test_positions_of_table_1s_heads_are_right_to_a_four_hundredth_of_a_pixel(k):
    head = head_map(HEAD_MAP_HEADS, k, SYN)
    rows = np.r_[0 : SYN.height_px : 71, SYN.height_px - 1]  # 71 meets every place in a cell
    cols = np.r_[0 : SYN.width_px : 53, SYN.width_px - 1]
    misfit = errors(HEAD_MAP_HEADS, k, SYN, head, rows, cols)
    assert len(misfit) > 10_000
    assert misfit.max() < 0.0025  # NaN where a cell that is seen had no nodes


def test_errors_go_with_the_step_squared():
    rows, cols = np.arange(0, 16200, 71), np.arange(0, 12000, 53)
    worst = [
        errors(
            HEAD_MAP_HEADS, 0, SYN, head_map(HEAD_MAP_HEADS, 0, SYN, step_px=step), rows, cols
        ).max()
        for step in (16, 32)
    ]
    assert_allclose(worst[1] / worst[0], 4.0, rtol=0.05)  # the interpolation's remainder


@pytest.mark.parametrize(("k", "step"), [(1, 8), (2, 4), (4, 4), (8, 2)])
def test_small_images_need_closer_nodes(k, step):
    heads, synthetic = reduced_heads(HEAD_MAP_HEADS, k), reduced_camera(SYN, k)
    assert fitting_step(heads, synthetic) == step
    rows, cols = np.arange(0, synthetic.height_px, 17), np.arange(0, synthetic.width_px, 13)
    head = head_map(heads, 0, synthetic, step_px=step)
    assert errors(heads, 0, synthetic, head, rows, cols).max() < TOLERANCE


def test_nodes_are_exact_and_far_ones_are_left_out():
    head = head_map(HEAD_MAP_HEADS, 0, SYN)
    i, j = np.nonzero(np.isfinite(head.nodes[..., 0]))
    xy = xy_from_colrow(SYN, 16.0 * np.column_stack([j, i]))
    exact = head_from_synthetic(HEAD_MAP_HEADS, 0, xy)
    assert_allclose(head.nodes[i, j], exact, rtol=0, atol=1e-6)  # px
    share = len(i) / head.nodes[..., 0].size  # the head covers a third of the frame
    assert 0.3 < share < 0.6


def test_a_lens_that_no_spline_follows_is_computed_node_by_node():
    wild = HEAD_MAP_HEADS.heads[0].with_interior(
        replace(HEAD_MAP_HEADS.heads[0].interior, k2=2e-7, k3=-1.2e-10)
    )
    heads = replace(HEAD_MAP_HEADS, heads=(wild, *HEAD_MAP_HEADS.heads[1:]))
    head = head_map(heads, 0, SYN, step_px=32)
    i, j = np.nonzero(np.isfinite(head.nodes[..., 0]))
    xy = xy_from_colrow(SYN, 32.0 * np.column_stack([j, i]))
    assert_allclose(head.nodes[i, j], head_from_synthetic(heads, 0, xy), rtol=0, atol=1e-5)


@pytest.mark.parametrize("k", range(4))
def test_a_levelled_map_is_right_on_average(k):
    """Of a quadratic 2/3 of the largest error are left, and 0.42 of its root mean square."""
    exact = head_map(HEAD_MAP_HEADS, k, SYN)
    level = levelled(exact)
    rows, cols = (np.arange(3, n, 37) for n in (SYN.height_px, SYN.width_px))
    before, after = (errors(HEAD_MAP_HEADS, k, SYN, head, rows, cols) for head in (exact, level))
    assert after.max() < 0.8 * before.max()
    assert np.sqrt(np.mean(after**2)) < 0.45 * np.sqrt(np.mean(before**2))


def test_a_window_is_seen_as_it_is_in_the_whole_image():
    whole, part = (
        head_map(HEAD_MAP_HEADS, 0, SYN),
        window_map(HEAD_MAP_HEADS, 0, SYN, (10000, 10300, 2000, 2100)),
    )
    rows, cols = np.arange(0, 300, 7), np.arange(0, 100, 3)
    assert_allclose(
        between_nodes(part, rows, cols),
        between_nodes(whole, 10000 + rows, 2000 + cols),
        atol=0.005,  # px, both may be off by 0.0025
    )


def test_the_last_nodes_lie_behind_the_last_pixels():
    synthetic = reduced_camera(SYN, 100)
    head = head_map(reduced_heads(HEAD_MAP_HEADS, 100), 0, synthetic, step_px=8)
    n_rows, n_cols = head.nodes.shape[:2]
    assert synthetic.height_px <= 8 * (n_rows - 1) < synthetic.height_px + 8
    assert synthetic.width_px <= 8 * (n_cols - 1) < synthetic.width_px + 8
