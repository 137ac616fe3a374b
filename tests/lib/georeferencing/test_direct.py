"""Eq. (14) applied: poses, intersections, and covariances against everything they depend on."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.calibration.estimates import Calibration, given
from acx4lib.geometry.frames import log
from acx4lib.georeferencing import direct, forgotten
from acx4lib.georeferencing.direct import Rays, georeference, intersect_rays
from acx4lib.georeferencing.validation import validate
from acx4lib.least_squares.gauss_markov import GaussMarkov
from support import blocks
from support.blocks import COLUMN_STEPS, SECOND, moved_calibration, moved_trajectory
from support.blocks import SEEN as POINTS
from support.helpers import numeric_jacobian


@pytest.fixture(scope="module")
def all_rays(rig):
    points = rig.image_points
    order = np.argsort(points.point_idx, kind="stable")
    return Rays(
        image_idx=points.image_idx[order],
        group=points.point_idx[order],
        colrow=points.colrow[order],
        sigma_px=np.linspace(0.3, 0.8, len(order)),
    )


# --- poses -----------------------------------------------------------------------------------


def test_camera_poses_are_those_of_eq_14(rig, calibration):
    g = georeference(rig, calibration)
    for i, (e, k) in enumerate(zip(rig.images.exposure_idx, rig.images.camera_idx, strict=True)):
        body, mount = rig.trajectory.T_m_b[e], rig.cameras[k].T_b_c
        assert_allclose(g.T_m_c.r[i], body.r + body.R @ mount.r, atol=1e-11)
        assert_allclose(g.T_m_c.R[i], body.R @ mount.R, atol=1e-15)


def test_cameras_are_found_by_name_in_any_order(rig, calibration):
    swapped = Calibration(
        cameras=calibration.cameras[::-1],
        layout=replace(
            calibration.layout,
            interior=calibration.layout.interior[::-1],
            mount=calibration.layout.mount[::-1],
        ),
        cov=calibration.cov,
        sigma0_sq=1.0,
        open_columns=calibration.open_columns,
    )
    a, b = georeference(rig, calibration), georeference(rig, swapped)
    assert_allclose(b.T_m_c.r, a.T_m_c.r, atol=0)
    assert_allclose(b.by_parameters, a.by_parameters, atol=0)
    assert b.layout.interior.tolist() == a.layout.interior.tolist()


def test_a_camera_without_calibration_is_named(rig, calibration):
    lacking = replace(calibration, cameras=calibration.cameras[:1])
    with pytest.raises(ValueError, match="no camera SIDE"):
        georeference(rig, lacking)


def pose_change(T, T0):
    return np.concatenate([T.r - T0.r, log(np.swapaxes(T0.R, 1, 2) @ T.R)], axis=1)


def test_poses_depend_on_trajectory_and_calibration_as_stated(rig, calibration):
    g = georeference(rig, calibration)
    body_steps = np.tile([1e-2] * 3 + [1e-6] * 3, len(rig.trajectory))
    by_body = numeric_jacobian(
        lambda x: pose_change(georeference(moved_trajectory(rig, x), calibration).T_m_c, g.T_m_c),
        np.zeros(len(body_steps)),
        step=body_steps,
    )
    by_columns = numeric_jacobian(
        lambda x: pose_change(georeference(rig, moved_calibration(calibration, x)).T_m_c, g.T_m_c),
        np.zeros(20),
        step=COLUMN_STEPS,
    )
    # rounding: 1e-12 m over steps of 1e-6 rad
    assert_allclose(g.by_parameters, by_columns, atol=5e-6)
    for i, e in enumerate(rig.images.exposure_idx):
        assert_allclose(g.by_body[i], by_body[i][:, 6 * e : 6 * e + 6], atol=5e-6)
    cov = direct.pose_covariances(rig, g)
    i, e = 5, rig.images.exposure_idx[5]
    own = by_body[i][:, 6 * e : 6 * e + 6]
    expected = own @ rig.trajectory.cov[e] @ own.T
    expected += by_columns[i] @ calibration.cov @ by_columns[i].T
    scale = np.sqrt(np.diag(expected))
    assert_allclose(cov[i] / np.outer(scale, scale), expected / np.outer(scale, scale), atol=1e-4)


# --- intersections ---------------------------------------------------------------------------


def test_exact_rays_meet_in_their_points(rig, calibration, all_rays):
    found = intersect_rays(rig, georeference(rig, calibration), all_rays)
    assert_allclose(found.x_m, POINTS, atol=1e-8)
    assert_allclose(found.v, 0.0, atol=1e-7)


def test_refracted_rays_meet_where_refraction_is_allowed_for(calibration):
    block = blocks.simulate(
        blocks.fly(), cameras=(blocks.CAMERA, SECOND), ties=POINTS, refraction="standard"
    )
    points = block.image_points
    order = np.argsort(points.point_idx, kind="stable")
    rays = Rays(
        image_idx=points.image_idx[order],
        group=points.point_idx[order],
        colrow=points.colrow[order],
        sigma_px=np.ones(len(order)),
    )
    g = georeference(block, calibration)
    found = intersect_rays(block, g, rays, refraction="standard")
    assert_allclose(found.x_m, POINTS, atol=1e-8)
    raised = intersect_rays(block, g, rays).x_m - POINTS
    assert np.all((raised[:, 2] > 0.01) & (raised[:, 2] < 0.1))  # centimetres, upwards


def test_residuals_are_weighted_with_sigma_px(rig, calibration, all_rays):
    """At the solution the weighted residuals are orthogonal to every direction of the point."""
    shaken = replace(
        all_rays,
        colrow=all_rays.colrow + np.random.default_rng(1).normal(size=(len(all_rays.group), 2)),
    )
    found = intersect_rays(rig, georeference(rig, calibration), shaken)
    for group in range(3):
        own = shaken.group == group
        P = 1 / shaken.sigma_px[own] ** 2
        gradient = np.einsum("nki,nk,n->i", found.by_point[own], found.v[own], P)
        size = np.einsum("nki,nk,n->i", np.abs(found.by_point[own]), np.abs(found.v[own]), P)
        assert np.all(np.abs(gradient) < 1e-6 * size)


def test_covariances_of_points_carry_everything_they_depend_on(rig, calibration, all_rays):
    g = georeference(rig, calibration)
    found = intersect_rays(rig, g, all_rays)

    def by_image(x):
        rays = replace(all_rays, colrow=all_rays.colrow + x.reshape(-1, 2))
        return intersect_rays(rig, g, rays).x_m

    def by_body(x):
        block = moved_trajectory(rig, x)
        return intersect_rays(block, georeference(block, calibration), all_rays).x_m

    def by_columns(x):
        return intersect_rays(
            rig, georeference(rig, moved_calibration(calibration, x)), all_rays
        ).x_m

    n = 2 * len(all_rays.group)
    J_image = numeric_jacobian(by_image, np.zeros(n), step=1e-2)
    body_steps = np.tile([1e-2] * 3 + [1e-6] * 3, len(rig.trajectory))
    J_body = numeric_jacobian(by_body, np.zeros(len(body_steps)), step=body_steps)
    J_columns = numeric_jacobian(by_columns, np.zeros(20), step=COLUMN_STEPS)
    # the corrected point stands for the measured one: distortion changes lengths by 0.4 %
    largest = np.abs(J_columns).max(axis=(0, 1))
    assert np.all(np.abs(found.sources.by_parameters - J_columns) < 1e-5 * largest)
    cov_columns = J_columns @ calibration.cov @ np.swapaxes(J_columns, 1, 2)
    cov_body = sum(
        J_body[:, :, 6 * e : 6 * e + 6] @ cov @ np.swapaxes(J_body[:, :, 6 * e : 6 * e + 6], 1, 2)
        for e, cov in enumerate(rig.trajectory.cov)
    )
    variance = np.repeat(all_rays.sigma_px**2, 2)
    cov_image = (J_image * variance) @ np.swapaxes(J_image, 1, 2)
    expected = cov_image + cov_body + cov_columns
    for part, whole in zip(found.cov, expected, strict=True):
        scale = np.sqrt(np.diag(whole))
        assert_allclose(part / np.outer(scale, scale), whole / np.outer(scale, scale), atol=5e-3)
    without = intersect_rays(rig, georeference(rig, given(rig.cameras)), all_rays)
    rest = found.cov - without.cov
    assert_allclose(rest, cov_columns, rtol=1e-4, atol=1e-9)


def test_scatter_of_noisy_intersections_is_the_stated_covariance(rig, calibration):
    """Two rays of one point, 4000 times: sampling leaves 1 / sqrt(2 * 4000) = 1.1 % of a sigma."""
    points = rig.image_points
    rows = np.flatnonzero(points.point_idx == 0)[[0, -1]]
    rng = np.random.default_rng(3)
    n = 4000
    noise = rng.normal(0, 0.5, (n, 2, 2))
    rays = Rays(
        image_idx=np.tile(points.image_idx[rows], n),
        group=np.repeat(np.arange(n), 2),
        colrow=(points.colrow[rows] + noise).reshape(-1, 2),
        sigma_px=np.full(2 * n, 0.5),
    )
    none = replace(
        rig,
        trajectory=replace(
            rig.trajectory,
            sigma_position=np.zeros((6, 3)),
            sigma_attitude=np.zeros((6, 3)),
        ),
    )
    found = intersect_rays(none, georeference(none, given(rig.cameras)), rays)
    scatter = np.cov(found.x_m.T)
    assert_allclose(np.sqrt(np.diag(scatter)), np.sqrt(np.diag(found.cov.mean(axis=0))), rtol=0.04)
    assert np.linalg.norm(found.x_m.mean(axis=0) - POINTS[0]) < 0.02


def test_misclosures_of_single_rays_have_the_trajectorys_part(rig, calibration, all_rays):
    g = georeference(rig, calibration)
    found = intersect_rays(rig, g, all_rays)
    # hold the points and move the trajectory of one exposure by each of its sigmas in turn
    i = 4
    e = rig.images.exposure_idx[all_rays.image_idx[i]]
    seen = direct.measured(rig, g, all_rays)
    x_m = POINTS[all_rays.group]
    v0 = direct.image_derivatives(seen, x_m)[0][i]
    cov = np.eye(2) * all_rays.sigma_px[i] ** 2
    sigma = np.concatenate([rig.trajectory.sigma_position[e], rig.trajectory.sigma_attitude[e]])
    R_m_g = rig.trajectory.R_g_m[e].T
    for axis in range(6):
        by = np.zeros((len(rig.trajectory), 6))
        by[e, axis] = sigma[axis] / 10
        by[e, :3] = R_m_g @ by[e, :3]
        moved = georeference(moved_trajectory(rig, by.ravel()), calibration)
        v = direct.image_derivatives(direct.measured(rig, moved, all_rays), x_m)[0][i]
        effect = 10 * (v - v0)
        cov += np.outer(effect, effect)
    assert_allclose(found.cov_v[i], cov, rtol=1e-3)


def test_two_rays_of_one_exposure_share_its_error(rig, calibration):
    """Both cameras of one body: its attitude error turns both rays alike, and hardly parts them."""
    points = rig.image_points
    exposure = rig.images.exposure_idx[points.image_idx]
    pair = next(
        rows
        for e in range(6)
        for p in range(3)
        if len(rows := np.flatnonzero((exposure == e) & (points.point_idx == p))) == 2
    )
    rays = Rays(
        image_idx=points.image_idx[pair],
        group=np.zeros(2, dtype=int),
        colrow=points.colrow[pair],
        sigma_px=np.full(2, 1e-9),
    )
    found = intersect_rays(rig, georeference(rig, given(rig.cameras)), rays)
    direction = POINTS[points.point_idx[pair[0]]] - rig.trajectory.T_m_b.r[exposure[pair[0]]]
    direction /= np.linalg.norm(direction)
    along = np.sqrt(direction @ found.cov[0] @ direction)
    # the body's own position error alone, 2 to 3 cm; the base of 0.8 m is measured without error
    assert along < 0.04


# --- rays that do not meet -------------------------------------------------------------------


def one_group(colrow, images):
    return Rays(
        image_idx=np.array(images),
        group=np.zeros(len(images), dtype=int),
        colrow=np.array(colrow),
        sigma_px=np.full(len(images), 0.5),
    )


def test_a_single_ray_and_parting_rays_meet_nowhere(rig, calibration):
    g = georeference(rig, calibration)
    single = intersect_rays(rig, g, one_group([[2000.0, 1500.0]], [0]))
    assert np.isnan(single.x_m).all()
    parting = intersect_rays(rig, g, one_group([[3900.0, 1500.0], [100.0, 1500.0]], [4, 0]))
    assert np.isnan(parting.x_m).all()


def test_no_rays_give_no_points(rig, calibration):
    none = Rays(
        image_idx=np.zeros(0, dtype=int),
        group=np.zeros(0, dtype=int),
        colrow=np.zeros((0, 2)),
        sigma_px=np.zeros(0),
    )
    found = intersect_rays(rig, georeference(rig, calibration), none)
    assert found.x_m.shape == (0, 3)
    assert found.cov.shape == (0, 3, 3)


def test_a_bad_group_does_not_harm_the_others(rig, calibration, all_rays):
    rays = Rays(
        image_idx=np.append(all_rays.image_idx, 0),
        group=np.append(all_rays.group, 3),
        colrow=np.concatenate([all_rays.colrow, [[2000.0, 1500.0]]]),
        sigma_px=np.append(all_rays.sigma_px, 0.5),
    )
    found = intersect_rays(rig, georeference(rig, calibration), rays)
    assert_allclose(found.x_m[:3], POINTS, atol=1e-8)
    assert np.isnan(found.x_m[3]).all()


@pytest.mark.parametrize("share", [0.0, 0.9], ids=["independent", "slow"])
def test_a_point_by_hand_has_the_covariance_of_its_rays(rig, calibration, share):
    """G C G^T, where C has pixels, poses that exposures share, and the calibration."""
    slow = GaussMarkov(share=share, time_constant_s=20.0)
    timed = blocks.in_strips(rig, 3)
    trajectory = replace(timed.trajectory, slow_positions=slow, slow_attitudes=slow)
    block = replace(timed, trajectory=trajectory)
    g = georeference(block, calibration)
    points = block.image_points
    rows = np.flatnonzero(points.point_idx == 0)
    rays = Rays(
        image_idx=points.image_idx[rows],
        group=np.zeros(len(rows), dtype=np.intp),
        colrow=points.colrow[rows],
        sigma_px=np.linspace(0.3, 0.8, len(rows)),
    )
    found = intersect_rays(block, g, rays)
    B, P = found.by_point.reshape(-1, 3), np.diag(1 / np.repeat(rays.sigma_px, 2) ** 2)
    G = -np.linalg.inv(B.T @ P @ B) @ B.T @ P
    by_hand = G @ direct.ray_covariance(block, g, rays) @ G.T
    assert_allclose(by_hand, found.cov[0], rtol=1e-8, atol=1e-12)
    assert (g.shared is None) == (share == 0.0)


# --- A validation with a forgotten step, against what the geometry of the ideal flight says


def rms(block, calibration):
    found = validate(block, calibration, method="given")
    return float(np.sqrt(np.mean(np.sum(found.points.d**2, axis=1))))


@pytest.mark.parametrize("name", ["lever_arm", "boresight", "distortion", "principal_point"])
def test_a_step_that_a_calibration_lacks_is_seen_at_exact_check_points(block, cameras, name):
    without = getattr(forgotten, name)(cameras)
    assert rms(block, cameras) < 1e-6
    assert rms(block, without) > 1e-3


def test_a_forgotten_convergence_turns_by_it(block, cameras):
    wrong = forgotten.convergence(block)
    lonlat = block.frame.to_geographic(block.trajectory.T_m_b.r)[:, :2]
    gamma = np.abs(block.frame.grid.convergence(lonlat))
    turned = np.swapaxes(block.trajectory.T_m_b.R, 1, 2) @ wrong.trajectory.T_m_b.R
    angle = np.arccos(np.clip((np.trace(turned, axis1=1, axis2=2) - 1) / 2, -1, 1))
    assert_allclose(angle, gamma, rtol=1e-6)
    assert rms(wrong, cameras) > 1e-3


def test_the_other_steps_stay(cameras):
    (camera,) = cameras.cameras
    (without,) = forgotten.lever_arm(cameras).cameras
    assert_allclose(without.T_b_c.r, 0.0)
    assert_allclose(without.T_b_c.R, camera.T_b_c.R)
    assert without.interior == camera.interior
    (straight,) = forgotten.boresight(cameras).cameras
    assert_allclose(np.abs(straight.T_b_c.R).sum(axis=0), 1.0)  # quarter turns
    (plain,) = forgotten.distortion(cameras).cameras
    assert plain.interior == replace(camera.interior, k1=0.0, k2=0.0, k3=0.0, p1=0.0, p2=0.0)
