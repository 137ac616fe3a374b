"""Start values: when they are bad, and that positions and control are enough to recover them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from acx4lib.bundle import uses
from acx4lib.bundle.start.start_values import recovered, start_points
from acx4lib.geometry.frames import Pose, turn
from support import blocks
from support.helpers import rotation_angle

FREE = ("f", "xp", "yp", "k1")


def true_poses(block):
    (camera,) = block.cameras
    return block.T_m_b_images @ Pose(R=camera.T_b_c.R[None], r=camera.T_b_c.r[None])


def with_mounting(block, R_b_c):
    (camera,) = block.cameras
    mounted = replace(camera, T_b_c=Pose(R=R_b_c, r=camera.T_b_c.r))
    return replace(block, cameras=(mounted,))


def with_attitudes(block, R_m_b):
    T_m_b = Pose(R=R_m_b, r=block.trajectory.T_m_b.r)
    return replace(block, trajectory=replace(block.trajectory, T_m_b=T_m_b))


# --- recovered ---------------------------------------------------------------------------------


@pytest.mark.parametrize("seed", range(5))
def test_any_mounting_is_recovered_and_the_observed_attitudes_stay(exact_block, seed):
    (camera,) = exact_block.cameras
    anyhow = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
    network = uses.mounted_orientation(exact_block, free=FREE)
    T_b_c = Pose(R=anyhow[None], r=camera.T_b_c.r[None])
    state = recovered(replace(network, start=replace(network.start, T_b_c=T_b_c)))
    assert rotation_angle(state.T_b_c.R[0], camera.T_b_c.R) < 1e-6  # exact data
    assert_allclose(state.T_m_b.R, exact_block.trajectory.T_m_b.R, atol=0)
    used = network.free_points
    assert_allclose(state.x_m[used], network.start.x_m[used], atol=0.01)


@pytest.mark.parametrize("seed", range(5))
def test_any_attitudes_are_recovered_where_none_is_observed(exact_block, seed):
    """Nine control points are seen by all images, wholly or in part."""
    anyhow = Rotation.random(12, rng=np.random.default_rng(seed)).as_matrix()
    network = uses.free_orientation(with_attitudes(exact_block, anyhow), free=FREE)
    assert rotation_angle(recovered(network).T_m_b.R, true_poses(exact_block).R).max() < 1e-3


def test_only_attitudes_that_are_not_observed_are_turned(exact_block):
    trajectory = exact_block.trajectory
    R, sigma = trajectory.T_m_b.R.copy(), trajectory.sigma_attitude.copy()
    R[[2, 5]] = R[[2, 5]] @ turn(1, np.radians(1.0))
    sigma[5] = np.inf
    block = replace(
        exact_block,
        trajectory=replace(trajectory, T_m_b=Pose(R=R, r=trajectory.T_m_b.r), sigma_attitude=sigma),
    )
    found = recovered(uses.mounted_orientation(block, free=FREE)).T_m_b.R
    assert_allclose(np.delete(found, 5, axis=0), np.delete(R, 5, axis=0), atol=0)
    assert rotation_angle(found[5], trajectory.T_m_b.R[5]) < np.radians(0.1)


def test_an_image_without_control_is_turned_like_the_others_and_onto_its_tie_points(exact_block):
    is_control = exact_block.image_points.point_idx < 9
    keep = ~(is_control & (exact_block.image_points.image_idx == 4))
    block = replace(exact_block, image_points=exact_block.image_points[keep])
    (camera,) = block.cameras
    wrong = with_mounting(block, camera.T_b_c.R @ turn(2, np.pi / 2))
    network = uses.free_orientation(wrong, free=FREE)
    assert rotation_angle(recovered(network).T_m_b.R[4], true_poses(block).R[4]) < 1e-3


def test_a_wrong_control_point_hardly_turns_a_camera(exact_block):
    """200 m at 1000 m are 11 degrees; least squares over nine would turn by about one."""
    block = blocks.changed(exact_block, "control_point", [[0.0, 200.0, 0.0]] + [[0.0] * 3] * 8)
    (camera,) = block.cameras
    wrong = with_mounting(block, camera.T_b_c.R @ turn(2, np.pi / 2))
    state = recovered(uses.mounted_orientation(wrong, free=FREE))
    assert rotation_angle(state.T_b_c.R[0], camera.T_b_c.R) < np.radians(0.1)


def test_one_ray_leaves_the_turn_about_itself_as_it_was(exact_block):
    """Image 4 has one measurement; 90 degrees about nearly that axis stay."""
    points = exact_block.image_points
    own = np.flatnonzero(points.image_idx == 4)
    block = replace(exact_block, image_points=points[np.setdiff1d(np.arange(len(points)), own[1:])])
    network = uses.free_orientation(block, free=FREE)
    # about the vertical, which the ray of a control point leaves by up to 25 degrees
    R = network.observed.T_m_b.R.copy()
    R[4] = turn(2, np.radians(1.0)) @ R[4]
    observed = replace(network.observed, T_m_b=Pose(R=R, r=network.observed.T_m_b.r))
    found = recovered(replace(network, observed=observed)).T_m_b.R[4]
    turned = rotation_angle(found, true_poses(exact_block).R[4])
    assert np.radians(0.5) < turned < np.radians(1.01)


# --- points ------------------------------------------------------------------------------------


def test_rays_that_part_start_amid_their_ends(exact_block):
    """Swap the rays of one point to either side: they meet above the cameras."""
    points = exact_block.image_points
    last = len(exact_block.points) - 1
    image = points.image_idx[points.point_idx == last][:2]
    T = true_poses(exact_block)
    left = image[np.argmin(T.r[image, 0])]
    colrow, keep = points.colrow.copy(), points.point_idx != last
    rows = [np.flatnonzero((points.point_idx == last) & (points.image_idx == i))[0] for i in image]
    for row, i in zip(rows, image, strict=True):
        x_c = np.array([-400.0 if i == left else 400.0, 0.0, -1000.0])
        away = T.R[i].T @ x_c  # level axes
        colrow[row] = [1999.5 - 5000 * away[0] / away[2], 1499.5 + 5000 * away[1] / away[2]]
        keep[row] = True
    block = replace(exact_block, image_points=replace(points, colrow=colrow)[keep])
    x_m, _ = start_points(block, T, np.arange(keep.sum()))
    assert_allclose(x_m[last, :2], T.r[image, :2].mean(axis=0), atol=60)  # m; symmetric
    assert 0 < x_m[last, 2] < T.r[image, 2].min()
