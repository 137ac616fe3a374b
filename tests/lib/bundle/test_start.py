"""Start values: when they are bad, and that positions and control are enough to recover them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.spatial.transform import Rotation

from acx4lib.block import Trajectory
from acx4lib.bundle.adjust import adjust, free_orientation, mounted_orientation
from acx4lib.bundle.start import (
    far_off,
    in_front,
    recovered,
    resected,
    reweighted,
    robust_phase,
    sizes,
    spread,
    start_points,
    suspects,
)
from acx4lib.errors import AdjustmentError
from acx4lib.geometry.frames import Pose, rotation_from_opk, turn
from acx4lib.model import Model
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
    network = mounted_orientation(exact_block, Model(free=FREE))
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
    network = free_orientation(with_attitudes(exact_block, anyhow), Model(free=FREE))
    assert rotation_angle(recovered(network).T_m_b.R, true_poses(exact_block).R).max() < 1e-3


@pytest.mark.parametrize("vague", [np.inf, np.radians(3.0)])
def test_only_attitudes_that_are_not_well_observed_are_turned(exact_block, vague):
    trajectory = exact_block.trajectory
    R, sigma = trajectory.T_m_b.R.copy(), trajectory.sigma_attitude.copy()
    R[[2, 5]] = R[[2, 5]] @ turn(1, np.radians(1.0))
    sigma[5] = vague
    block = replace(
        exact_block,
        trajectory=replace(trajectory, T_m_b=Pose(R=R, r=trajectory.T_m_b.r), sigma_attitude=sigma),
    )
    found = recovered(mounted_orientation(block, Model(free=FREE))).T_m_b.R
    assert_allclose(np.delete(found, 5, axis=0), np.delete(R, 5, axis=0), atol=0)
    assert rotation_angle(found[5], trajectory.T_m_b.R[5]) < np.radians(0.1)


def test_an_image_without_control_is_turned_like_the_others_and_onto_its_tie_points(exact_block):
    is_control = exact_block.image_points.point_idx < 9
    keep = ~(is_control & (exact_block.image_points.image_idx == 4))
    block = replace(exact_block, image_points=exact_block.image_points[keep])
    (camera,) = block.cameras
    wrong = with_mounting(block, camera.T_b_c.R @ turn(2, np.pi / 2))
    network = free_orientation(wrong, Model(free=FREE))
    assert rotation_angle(recovered(network).T_m_b.R[4], true_poses(block).R[4]) < 1e-3


def test_a_wrong_control_point_hardly_turns_a_camera(exact_block):
    """200 m at 1000 m are 11 degrees; least squares over nine would turn by about one."""
    block = blocks.changed(exact_block, "control_point", [[0.0, 200.0, 0.0]] + [[0.0] * 3] * 8)
    (camera,) = block.cameras
    wrong = with_mounting(block, camera.T_b_c.R @ turn(2, np.pi / 2))
    state = recovered(mounted_orientation(wrong, Model(free=FREE)))
    assert rotation_angle(state.T_b_c.R[0], camera.T_b_c.R) < np.radians(0.1)


def test_one_ray_leaves_the_turn_about_itself_as_it_was(exact_block):
    """Image 4 has one measurement; 90 degrees about nearly that axis stay."""
    points = exact_block.image_points
    own = np.flatnonzero(points.image_idx == 4)
    block = replace(exact_block, image_points=points[np.setdiff1d(np.arange(len(points)), own[1:])])
    network = free_orientation(block, Model(free=FREE))
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


# --- The robust phase goes where most observations agree, and loses nothing where all do


ROBUST_FREE = ("f", "xp", "yp", "k1", "p1", "p2")


def network_of(block):
    return mounted_orientation(blocks.approximate(block), Model(free=ROBUST_FREE))


def interior(state):
    return np.array([getattr(state.interiors[0], name) for name in ROBUST_FREE])


def contaminated(block, rng, *, share):
    """Return the block with a share of its measurements wrong by 10 to 200 px, and which."""
    n = len(block.image_points)
    wrong = rng.permutation(n) < share * n
    size = np.exp(rng.uniform(np.log(10.0), np.log(200.0), n)) * wrong
    angle = rng.uniform(0, 2 * np.pi, n)
    by = size[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return blocks.changed(block, "image_point", by), wrong


def test_without_gross_errors_it_ends_at_the_least_squares_solution(noisy_block, mounted):
    network = network_of(noisy_block)
    state = robust_phase(network, network.start)
    sigma = np.sqrt(np.diag(mounted.solution.cov))[: len(ROBUST_FREE)]
    # weights between 1/4 and 1 for residuals up to the width of 4: a little less efficient
    assert np.all(np.abs(interior(state) - interior(mounted.state)) < 0.5 * sigma)


@pytest.mark.parametrize("share", [0.02, 0.1, 0.2])
def test_gross_errors_do_not_pull_it_along(noisy_block, mounted, rng, share):
    spoilt, wrong = contaminated(noisy_block, rng, share=share)
    network = network_of(spoilt)
    state = robust_phase(network, network.start)
    sigma = np.sqrt(np.diag(mounted.solution.cov))[: len(ROBUST_FREE)]
    assert np.all(np.abs(interior(state) - interior(mounted.state)) < 2 * sigma)
    u = sizes(*network.residuals(state)[0])[:, 0]
    assert np.mean(u[wrong[network.rows]] > 5) > 0.98  # few rays may agree with a wrong one
    assert np.mean(u[~wrong[network.rows]] > 5) < 0.01


def test_least_squares_is_pulled_along(noisy_block, mounted, rng):
    """So that the test above says something."""
    spoilt, _ = contaminated(noisy_block, rng, share=0.1)
    sigma = np.sqrt(np.diag(mounted.solution.cov))[: len(ROBUST_FREE)]
    pulled = interior(adjust(network_of(spoilt)).state) - interior(mounted.state)
    assert np.max(np.abs(pulled) / sigma) > 10


def test_redundancy_numbers_show_an_observation_that_draws_the_others_to_itself(noisy_block):
    """Control is so precise here that its error of 150 sigma shows in its rays instead."""
    by = np.zeros((9, 3))
    by[5, 2] = 3.0  # m
    network = network_of(blocks.changed(noisy_block, "control_point", by))
    first = adjust(network)
    redundancy = [group.redundancy for group in first.solution.groups]
    assert redundancy[1][5, 2] < 0.02
    unaware = robust_phase(network, first.state)
    assert abs(network.residuals(unaware)[1][0][5, 2]) < 0.02
    aware = robust_phase(network, first.state, redundancy)
    assert network.residuals(aware)[1][0][5, 2] == pytest.approx(-3.0, abs=0.3)


def test_sigmas_are_multiplied_where_asked(noisy_block):
    network = network_of(noisy_block)
    before = [sigma for _, sigma in network.residuals(network.start)]
    factors = [np.ones((len(before[0]), 1)), *(np.ones_like(sigma) for sigma in before[1:])]
    factors[0][7] = 2.0
    factors[1][3, 1] = 3.0
    factors[2][4] = 5.0
    factors[3][6, 2] = 7.0
    changed = reweighted(network, factors)
    after = [sigma for _, sigma in changed.residuals(network.start)]
    for sigma, factor, old in zip(after, factors, before, strict=True):
        assert_allclose(sigma, factor * old, rtol=1e-15)
    # rays keep their order, which takes long to find, and get the weights of the other sigma
    anew = replace(changed).packed
    assert_array_equal(changed.packed.rays.weight, anew.rays.weight)
    assert changed.packed.rays.xy is network.packed.rays.xy


def test_an_image_point_counts_by_its_length_and_others_by_component():
    assert_allclose(sizes(np.array([[3.0, -4.0]]), np.full((1, 2), 0.5)), [[10.0]])
    assert_allclose(sizes(np.array([[3.0, -4.0, 1.0]]), np.full((1, 3), 0.5)), [[6.0, 8.0, 2.0]])


def test_spread_is_one_at_least_and_ignores_what_takes_no_part(rng):
    v = 3 * rng.normal(size=(5000, 2))
    sigma = np.ones((5000, 2))
    assert spread(v, sigma) == pytest.approx(3.0, rel=0.05)
    assert spread(v / 100, sigma) == 1.0
    half = np.where(np.arange(5000)[:, None] < 2500, sigma, np.inf)
    assert spread(v, half) == pytest.approx(3.0, rel=0.05)
    assert spread(v[:0], sigma[:0]) == 1.0


# --- Start values that are bad, and whose measurements say so


def test_ordinary_start_values_are_taken_as_they_are(exact_block):
    """Half a degree and 0.3 mm: no phase comes before the adjustment."""
    rough = blocks.approximate(exact_block)
    network = mounted_orientation(rough, Model(free=FREE))
    assert not far_off(network, network.start).any()
    assert_allclose(network.start.T_b_c.R[0], rough.cameras[0].T_b_c.R, atol=0)


def test_a_single_image_that_looks_elsewhere_is_far_off(exact_block):
    network = free_orientation(exact_block, Model(free=FREE))
    R = network.start.T_m_b.R.copy()
    R[3] = R[3] @ turn(0, np.radians(6.0))
    state = replace(network.start, T_m_b=Pose(R=R, r=network.start.T_m_b.r))
    assert np.flatnonzero(far_off(network, state)).tolist() == [3]
    assert np.flatnonzero(far_off(network, state, limit=np.radians(6.5))).tolist() == []
    assert "in 1 of 12 images (3_CAM by 6 degrees)" in suspects(network, state)


def test_good_start_values_raise_no_suspicion(exact_block):
    network = mounted_orientation(exact_block, Model(free=FREE))
    assert suspects(network, network.start) == ""


def test_a_point_behind_a_camera_is_not_in_front(exact_block):
    network = mounted_orientation(exact_block, Model(free=FREE))
    assert in_front(network, network.start)
    x_m = network.start.x_m.copy()
    x_m[network.image_points.point_idx[0], 2] = 5000.0  # m, above all flying heights
    assert not in_front(network, replace(network.start, x_m=x_m))


def test_without_measurements_nothing_is_far_off(exact_block):
    empty = replace(exact_block, image_points=exact_block.image_points[np.zeros(0, dtype=int)])
    network = free_orientation(empty, Model(free=FREE))
    assert not far_off(network, network.start).any()
    assert suspects(network, network.start) == ""


# --- Poses by resection: those with which an exact block was made


SECOND = replace(
    blocks.CAMERA,
    name="SIDE",
    T_b_c=Pose(R=rotation_from_opk(np.radians([18.0, 0.0, 90.0])), r=np.array([0.1, 0.3, 0.0])),
)


def without_poses(block):
    n = len(block.trajectory)
    nowhere = Pose(R=np.tile(np.eye(3), (n, 1, 1)), r=np.zeros((n, 3)))
    return replace(
        block, trajectory=Trajectory(exposures=block.trajectory.exposures, T_m_b=nowhere)
    )


@pytest.mark.parametrize("cameras", [(blocks.CAMERA,), (blocks.CAMERA, SECOND)])
def test_body_poses_come_back_from_exact_measurements(cameras):
    exact = blocks.standard(cameras=cameras, control=blocks.terrain(30))
    found = resected(without_poses(exact)).trajectory
    assert_allclose(found.T_m_b.r, exact.trajectory.T_m_b.r, atol=1e-5)  # m; SQPnP stops there
    assert_allclose(found.T_m_b.R, exact.trajectory.T_m_b.R, atol=1e-8)
    assert np.isinf([found.sigma_position, found.sigma_attitude]).all()


def test_an_exposure_without_three_control_points_is_named():
    exact = blocks.standard()
    few = replace(exact, control=exact.control[:2])
    with pytest.raises(AdjustmentError, match=r"^exposure '0' has no image with 3 control points"):
        resected(few)


def test_an_exposure_without_images_is_named():
    exact = blocks.standard()
    more = replace(
        exact, images=replace(exact.images, exposure_idx=np.zeros(len(exact.images), dtype=int))
    )
    with pytest.raises(AdjustmentError, match=r"^exposure '1' has no image"):
        resected(more)
