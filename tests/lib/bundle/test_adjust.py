"""The bundle as a whole: recovery, covariances, invariance, and what takes part."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from numpy.testing import assert_allclose

from acx4lib.block import NO_POINTS, ImagePoints, Images, SurveyedPoints
from acx4lib.bundle.adjust import (
    adjust,
    designed,
    free_orientation,
    mounted_orientation,
)
from acx4lib.bundle.start import start_points
from acx4lib.bundle.unknowns import holding, layout
from acx4lib.errors import AdjustmentError
from acx4lib.geometry.collinearity import project
from acx4lib.geometry.frames import Pose, rotation_from_opk, transform
from acx4lib.geometry.geodesy import MappingFrame
from acx4lib.least_squares.adjustment import cross_covariance
from acx4lib.model import Model
from support import blocks
from support.helpers import dense_covariance, dense_jacobian, rotation_angle, weighted_residuals
from support.strategies import opk, vectors

FREE = ("f", "xp", "yp", "k1", "p1", "p2")
SECOND = replace(
    blocks.CAMERA,
    name="SIDE",
    interior=replace(blocks.CAMERA.interior, f=48.0, k1=-3e-6),
    T_b_c=Pose(R=rotation_from_opk(np.radians([12.0, -5.0, 90.0])), r=np.array([0.1, 0.3, 0.2])),
)


def mounted_network(block):
    return mounted_orientation(block, Model(free=FREE))


def free_network(block):
    return free_orientation(block, Model(free=FREE))


# --- recovery --------------------------------------------------------------------------------


def assert_recovered(found, true):
    """Values to 1e-9 of a millimetre, a metre or a radian; distortion to 1e-9 mm at 25 mm."""
    reach = np.array([1, 1, 1, 25**3, 25**5, 25**7, 25**2, 25**2, 25, 25])
    difference = found.interior.to_array() - true.interior.to_array()
    assert_allclose(difference * reach, 0.0, atol=1e-9)


@pytest.mark.parametrize("cameras", [(blocks.CAMERA,), (blocks.CAMERA, SECOND)])
def test_one_adjustment_recovers_interior_and_mounting_of_exact_data(cameras):
    block = blocks.standard(cameras=cameras)
    fit = adjust(mounted_network(blocks.approximate(block)))
    for found, true in zip(fit.cameras, block.cameras, strict=True):
        assert_recovered(found, true)
        assert_allclose(found.T_b_c.r, true.T_b_c.r, atol=1e-9)
        assert rotation_angle(found.T_b_c.R, true.T_b_c.R) < 1e-12
    assert_allclose(fit.state.T_m_b.r, block.trajectory.T_m_b.r, atol=1e-9)
    truth = np.concatenate([blocks.crosses(), blocks.terrain(2, seed=4), blocks.terrain(40)])
    used = fit.network.free_points
    assert_allclose(fit.state.x_m[used], truth[used], atol=1e-8)
    assert fit.oriented.all()


def test_a_design_has_the_precision_of_the_adjustment_and_a_variance_of_one(exact_block):
    network = mounted_network(exact_block)
    planned, fit = designed(network).solution, adjust(network).solution
    assert (planned.sigma0_sq, planned.redundancy) == (1.0, fit.redundancy)
    assert fit.sigma0_sq < 1e-9
    assert_allclose(planned.cov, fit.cov, rtol=1e-6, atol=1e-9 * np.abs(fit.cov).max())
    alone = replace(network, observed=network.observed, image_points=network.image_points[:3])
    with pytest.raises(AdjustmentError, match="observations cannot determine"):
        designed(replace(alone, control=network.control[np.arange(0)]))


def test_a_free_bundle_recovers_interior_and_poses_of_exact_data(exact_block):
    fit = adjust(free_network(blocks.approximate(exact_block)))
    (camera,) = exact_block.cameras
    assert_recovered(fit.cameras[0], camera)
    poses = exact_block.T_m_b_images @ Pose(R=camera.T_b_c.R[None], r=camera.T_b_c.r[None])
    assert_allclose(fit.T_m_c.r, poses.r, atol=1e-7)  # f and heights are correlated by 0.99
    assert rotation_angle(fit.T_m_c.R, poses.R).max() < 1e-10


@pytest.mark.parametrize("error_deg", [1.0, 3.0])
def test_start_values_may_be_degrees_off(exact_block, error_deg):
    """The note on solvers saw undamped steps diverge from 5 degrees."""
    rough = blocks.approximate(exact_block, df=5.0, boresight_deg=error_deg)
    assert_recovered(adjust(mounted_network(rough)).cameras[0], exact_block.cameras[0])


def test_what_is_not_free_stays_as_declared(exact_block):
    (camera,) = exact_block.cameras
    fit = adjust(
        mounted_orientation(exact_block, Model(free=("k1",), fix=("lever_arm", "boresight")))
    )
    found = fit.cameras[0]
    assert found.interior == replace(camera.interior, k1=found.interior.k1)
    assert_allclose(found.T_b_c.r, camera.T_b_c.r, atol=0)
    assert_allclose(found.T_b_c.R, camera.T_b_c.R, atol=1e-15)


# --- covariance ------------------------------------------------------------------------------


@pytest.fixture(params=["mounted", "self_calibrated"])
def fit(request):
    return request.getfixturevalue(request.param)


def test_the_gradient_vanishes_at_the_solution(fit):
    J = dense_jacobian(fit.network, fit.state)
    step = (
        dense_covariance(fit.network, fit.state) @ J.T @ weighted_residuals(fit.network, fit.state)
    )
    sigma = np.sqrt(np.diag(dense_covariance(fit.network, fit.state)))
    assert np.max(np.abs(step) / sigma) < 1e-5  # it stops when 1e-6 sigma is left


def test_covariances_are_the_inverse_of_the_full_normal_matrix(fit):
    full = dense_covariance(fit.network, fit.state)
    n = fit.network.n_columns
    sigma = np.sqrt(np.diag(full))
    difference = np.abs(fit.solution.cov - full[:n, :n]) / np.outer(sigma[:n], sigma[:n])
    assert difference.max() < 1e-8  # of the sigmas
    for i, point in enumerate(np.flatnonzero(fit.network.free_points)):
        at = slice(n + 3 * i, n + 3 * i + 3)
        difference = np.abs(fit.solution.cov_points[point] - full[at, at])
        assert np.all(difference < 1e-8 * np.outer(sigma[at], sigma[at]))


def test_points_with_columns_have_the_covariance_of_the_full_inverse(fit):
    full = dense_covariance(fit.network, fit.state)
    n = fit.network.n_columns
    sigma = np.sqrt(np.diag(full))
    free = np.flatnonzero(fit.network.free_points)
    some = np.array([3, 0, len(free) - 1])
    cross = cross_covariance(fit.network, fit.state, fit.solution, free[some])
    for i, found in zip(some, cross, strict=True):
        at = slice(n + 3 * i, n + 3 * i + 3)
        scale = np.outer(sigma[at], sigma[:n])
        assert np.max(np.abs(found - full[at, :n]) / scale) < 1e-8


def test_redundancy_numbers_are_those_of_the_full_normal_matrix(fit):
    J = dense_jacobian(fit.network, fit.state)
    leverage = np.einsum("ij,jk,ik->i", J, dense_covariance(fit.network, fit.state), J)
    parts = [(g.redundancy[g.used], g.w[g.used]) for g in fit.solution.groups]
    redundancy, w = (np.concatenate(values) for values in zip(*parts, strict=True))
    assert_allclose(redundancy, 1 - leverage, atol=1e-8)
    assert redundancy.sum() == pytest.approx(fit.solution.redundancy, abs=1e-6)
    expected = weighted_residuals(fit.network, fit.state) / np.sqrt(1 - leverage)
    firm = redundancy > 1e-3  # below, the redundancy number itself has lost its digits
    assert_allclose(w[firm], expected[firm], rtol=1e-5, atol=1e-5)


def test_noise_of_the_stated_size_gives_unit_variance(mounted):
    """Within the 99.9 % interval for 864 degrees of freedom: sqrt(2 / 864) * 3.3 = 0.16."""
    assert mounted.solution.sigma0_sq == pytest.approx(1.0, abs=0.16)
    assert mounted.solution.chi_square_p > 0.001


# --- invariance ------------------------------------------------------------------------------


def turned(block, R, r):
    """The same block in a mapping frame that is turned and shifted: x' = R x + r."""
    trajectory = block.trajectory

    def points(surveyed):
        return replace(surveyed, x_m=surveyed.x_m @ R.T + r, R_g_m=surveyed.R_g_m @ R.T)

    T = Pose(R=R @ trajectory.T_m_b.R, r=trajectory.T_m_b.r @ R.T + r)
    return replace(
        block,
        control=points(block.control),
        check=points(block.check),
        trajectory=replace(trajectory, T_m_b=T, R_g_m=trajectory.R_g_m @ R.T),
    )


def assert_same_adjustment(a, b):
    """Parameters, covariances and tests agree to what rounding and the last step leave."""
    sigma = np.sqrt(np.diag(a.solution.cov))
    n = int(np.sum(a.network.layout.interior >= 0) + np.sum(a.network.layout.mount >= 0))
    values = [
        np.concatenate(
            [
                *(i.to_array()[c >= 0] for i, c in zip(fit.state.interiors, columns, strict=True)),
                fit.state.T_b_c.r.ravel(),
            ]
        )
        for fit, columns in ((a, a.network.layout.interior), (b, b.network.layout.interior))
    ]
    assert np.all(np.abs(values[0] - values[1]) < 1e-5 * np.max(np.abs(values[0])))
    boresight = a.network.layout.mount[:, 3:]
    # a hundred kilometres from its origin a frame leaves residuals 1e-9 px of rounding
    least = sigma[boresight].min() if np.all(boresight >= 0) else 1e-5
    assert rotation_angle(a.state.T_b_c.R, b.state.T_b_c.R).max() < 1e-4 * least
    assert_allclose(
        b.solution.cov[:n, :n] / np.outer(sigma[:n], sigma[:n]),
        a.solution.cov[:n, :n] / np.outer(sigma[:n], sigma[:n]),
        atol=1e-6,
    )
    assert b.solution.cost == pytest.approx(a.solution.cost, rel=1e-9)


@given(angles=opk(), r=vectors(1e5))
@settings(max_examples=4)
def test_a_turned_and_shifted_mapping_frame_changes_nothing(noisy_block, angles, r):
    start = blocks.approximate(noisy_block)
    a = adjust(mounted_network(start))
    b = adjust(mounted_network(turned(start, rotation_from_opk(angles), r)))
    assert_same_adjustment(a, b)
    for here, there in zip(a.solution.groups, b.solution.groups, strict=True):
        # sigma is 0.5 px; residuals along the grid axes and about the body's do not turn
        assert_allclose(there.v / there.sigma, here.v / here.sigma, atol=1e-5)
        assert_allclose(there.w, here.w, atol=1e-5)


def test_another_origin_of_the_mapping_frame_changes_nothing(noisy_block):
    """The same through ECEF: the grid axes and the curvature of the Earth go along."""
    start = blocks.approximate(noisy_block)
    here = start.frame
    there = MappingFrame(grid=here.grid, origin=here.origin + np.array([0.3, -0.2]))

    def points(surveyed):
        x_m = there.from_geographic(here.to_geographic(surveyed.x_m))
        return replace(surveyed, x_m=x_m, R_g_m=there.grid_axes(x_m))

    trajectory = start.trajectory
    T = there.pose_from_grid(*here.pose_to_grid(trajectory.T_m_b))
    moved = replace(
        start,
        frame=there,
        control=points(start.control),
        check=points(start.check),
        trajectory=replace(trajectory, T_m_b=T, R_g_m=there.grid_axes(T.r)),
    )
    a, b = adjust(mounted_network(start)), adjust(mounted_network(moved))
    assert_same_adjustment(a, b)
    # the position comes back from PROJ within 1e-7 m, a few millionths of its sigma
    assert_allclose(b.solution.group("gnss").w, a.solution.group("gnss").w, atol=1e-4)


def permuted(block, rng):
    """The same block with images, points, measurements and control in another order."""
    images, points = rng.permutation(len(block.images)), rng.permutation(len(block.points))
    rows, control = rng.permutation(len(block.image_points)), rng.permutation(len(block.control))
    image_of, point_of = np.argsort(images), np.argsort(points)
    old = block.images
    return replace(
        block,
        images=Images(
            names=tuple(old.names[i] for i in images),
            camera_idx=old.camera_idx[images],
            exposure_idx=old.exposure_idx[images],
            strips=tuple(old.strips[i] for i in images),
        ),
        points=tuple(block.points[i] for i in points),
        image_points=ImagePoints(
            image_idx=image_of[block.image_points.image_idx][rows],
            point_idx=point_of[block.image_points.point_idx][rows],
            colrow=block.image_points.colrow[rows],
            sigma_px=block.image_points.sigma_px[rows],
        ),
        control=replace(
            block.control[control], point_idx=point_of[block.control.point_idx[control]]
        ),
        check=replace(block.check, point_idx=point_of[block.check.point_idx]),
    )


@pytest.mark.parametrize("set_up", [free_network, mounted_network])
def test_the_order_of_images_and_points_changes_nothing(noisy_block, rng, set_up):
    start = blocks.approximate(noisy_block)
    other = permuted(start, rng)
    a, b = adjust(set_up(start)), adjust(set_up(other))
    assert_same_adjustment(a, b)
    places = dict(zip(start.points, a.state.x_m, strict=True))
    for name, x, free in zip(other.points, b.state.x_m, b.network.free_points, strict=True):
        if free:
            assert_allclose(x, places[name], atol=1e-6)  # m, of sigmas of centimetres


# --- what takes part, and start values -------------------------------------------------------


def with_points(block, image_idx, colrow, x_names):
    """Add measurements of new points, one per given name."""
    n, k = len(block.points), len(colrow)
    points = block.image_points
    return replace(
        block,
        points=(*block.points, *x_names),
        image_points=ImagePoints(
            image_idx=np.concatenate([points.image_idx, image_idx]),
            point_idx=np.concatenate([points.point_idx, n + np.arange(k) // (k // len(x_names))]),
            colrow=np.concatenate([points.colrow, colrow]),
            sigma_px=np.concatenate([points.sigma_px, np.full(k, 0.5)]),
        ),
    )


def test_a_tie_point_measured_once_is_left_out_and_said(exact_block):
    block = with_points(exact_block, [0], np.array([[2000.0, 1500.0]]), ["once"])
    net = mounted_network(block)
    assert net.left_out == {"measured once": 1}
    assert len(net.image_points) == len(exact_block.image_points)
    assert not net.free_points[-1]


def test_a_control_point_measured_once_takes_part(exact_block):
    points = exact_block.image_points
    first = np.flatnonzero(points.point_idx == 0)
    keep = np.setdiff1d(np.arange(len(points)), first[1:])
    net = mounted_network(replace(exact_block, image_points=points[keep]))
    assert net.left_out == {}
    assert np.sum(net.image_points.point_idx == 0) == 1


def test_rays_that_hardly_meet_are_left_out_and_said(exact_block):
    """Two images 20 m apart see a point at 1.1 degrees; control they may see so."""
    T = exact_block.trajectory.T_m_b
    R, r = T.R.copy(), T.r.copy()
    R[1], r[1] = R[0], r[0] + [20.0, 0.0, 0.0]
    block = blocks.simulate(Pose(R=R, r=r), ties=blocks.terrain(40), control=blocks.crosses())
    (camera,) = block.cameras
    ground = np.tile([r[0, 0], r[0, 1], blocks.GROUND_M], (2, 1))
    T_m_c = Pose(R=R[:2], r=r[:2]) @ Pose(R=camera.T_b_c.R[None], r=camera.T_b_c.r[None])
    flat = with_points(block, [0, 1], project(camera, T_m_c, ground), ["flat"])
    net = mounted_network(flat)
    assert net.left_out == {"whose rays meet at less than 2 degrees": 1}
    assert not net.free_points[-1]
    assert len(net.image_points) == len(block.image_points)
    kept = mounted_network(replace(flat, smallest_angle=np.radians(1.0)))
    assert kept.left_out == {}
    assert kept.free_points[-1]


def test_start_values_of_points_are_where_their_rays_meet(exact_block):
    net = mounted_network(exact_block)
    truth = np.concatenate([blocks.crosses(), blocks.terrain(2, seed=4), blocks.terrain(40)])
    used = net.free_points
    assert_allclose(net.start.x_m[used], truth[used], atol=1e-6)


def test_rays_that_part_start_on_a_ray_before_the_camera(exact_block):
    """The image to the west looks west and the one to the east looks east."""
    colrow = np.array([[100.0, 1500.0], [3900.0, 1500.0]])
    block = with_points(exact_block, [0, 2], colrow, ["parting"])
    T_m_c = block.T_m_b_images @ Pose(R=blocks.CAMERA.T_b_c.R, r=blocks.CAMERA.T_b_c.r)
    assert T_m_c.r[0, 0] < T_m_c.r[2, 0]
    x_m, angle = start_points(block, T_m_c, np.arange(len(block.image_points)))
    assert np.isfinite(x_m).all()
    assert 400 < x_m[-1, 2] < 1400  # about the ground, at 900 m; the rays meet above 2000 m
    assert angle[-1] > np.radians(20)


def test_an_image_without_measurements_is_not_oriented(exact_block):
    points = exact_block.image_points
    block = replace(exact_block, image_points=points[points.image_idx != 4])
    fit = adjust(free_orientation(block, Model(free=("k1",))))
    assert np.flatnonzero(~fit.oriented).tolist() == [4]
    assert fit.cameras[0].interior.k1 == pytest.approx(2e-6, abs=1e-12)
    # an observed pose is oriented all the same
    assert adjust(mounted_orientation(block, Model(free=("k1",)))).oriented.all()


def test_a_block_without_control_floats(exact_block):
    """Six of its freedoms and the scale are open: positions and attitudes of all images."""
    block = replace(exact_block, control=exact_block.control[np.zeros(9, dtype=bool)])
    fit = adjust(free_orientation(block, Model()))
    assert not fit.oriented.any()
    assert fit.solution.undetermined.all()
    assert fit.solution.condition > 1e11


def test_without_any_measurement_there_is_nothing_to_adjust(exact_block):
    points = exact_block.image_points[np.zeros(0, dtype=int)]
    empty = replace(exact_block, image_points=points)
    with pytest.raises(AdjustmentError, match="cannot determine"):
        adjust(free_orientation(empty, Model(free=("f",))))


def test_surveyed_points_that_no_image_shows_play_no_part(exact_block):
    far = SurveyedPoints(
        point_idx=np.array([len(exact_block.points)]),
        x_m=np.array([[1e5, 1e5, 900.0]]),
        R_g_m=np.eye(3)[None],
        sigma_m=np.full((1, 3), 0.01),
    )
    control = exact_block.control
    both = replace(
        exact_block,
        points=(*exact_block.points, "far"),
        control=SurveyedPoints(
            **{
                name: np.concatenate([getattr(control, name), getattr(far, name)])
                for name in ("point_idx", "x_m", "R_g_m", "sigma_m")
            }
        ),
    )
    net = mounted_network(both)
    assert len(net.control) == 9
    assert not net.free_points[-1]
    assert transform(net.control.R_g_m, net.control.x_m).shape == (9, 3)


def test_a_block_without_a_trajectory_begins_with_resections():
    block = blocks.noisy(blocks.standard(check=None), np.random.default_rng(3))
    alone = replace(block, trajectory=None)
    assert alone.trajectory.exposures == block.images.names
    fit, same = (adjust(free_orientation(one, Model(free=("f",)))) for one in (alone, block))
    assert_allclose(fit.cameras[0].interior.f, same.cameras[0].interior.f, atol=1e-8)
    with pytest.raises(AdjustmentError, match="has no image with"):
        free_orientation(replace(alone, control=NO_POINTS), Model(free=("f",)))


def test_no_point_is_left_out_at_an_angle_of_zero():
    block = blocks.standard(check=None)
    counts = [
        free_orientation(replace(block, smallest_angle=angle), Model(free=("f",))).left_out
        for angle in (0.0, np.radians(60.0))
    ]
    assert counts[0] == {}
    assert "whose rays meet at less than 60 degrees" in counts[1]


# --- the columns of the unknowns, and what is left of them when some are held ----------------


def test_held_columns_leave_no_gap():
    columns = layout(2, 3, free=("f", "k1"), free_mount=("lever_x",), free_shift=("east",))
    assert columns.n_columns == 2 * 3 + 1 + 18
    left = holding(columns, columns.interior[1, [0, 3]])
    assert left.n_columns == columns.n_columns - 2
    assert left.interior[0, [0, 3]].tolist() == [0, 1]
    assert np.all(left.interior[1] == -1)
    assert left.mount[:, 0].tolist() == [2, 3]
    assert np.all(left.mount[:, 1:] == -1)
    assert left.shift.tolist() == [4, -1, -1]
    assert left.pose.ravel().tolist() == list(range(5, 23))
    assert left.drift.shape == (0, 3)
