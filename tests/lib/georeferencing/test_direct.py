"""Eq. (14) applied: poses, intersections, and covariances against everything they depend on."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle.observations import SharedErrors
from acx4lib.calibration.estimates import Calibration, given
from acx4lib.geometry import frames
from acx4lib.geometry.camera import Interior
from acx4lib.geometry.collinearity import refraction_lift
from acx4lib.geometry.frames import Pose, log, rotation_from_opk
from acx4lib.georeferencing import direct, error_sources, forgotten
from acx4lib.georeferencing.direct import Rays, georeference, ground_points, intersect_rays
from acx4lib.georeferencing.error_sources import ErrorSources
from acx4lib.georeferencing.validation import validate
from acx4lib.least_squares.covariance import GaussMarkov
from acx4lib.model import Model
from support import blocks
from support.blocks import COLUMN_STEPS, SECOND, moved_calibration, moved_trajectory
from support.blocks import SEEN as POINTS
from support.helpers import numeric_jacobian, repeats


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
    in_air = georeference(block, calibration, Model(refraction="standard"))
    found = intersect_rays(block, in_air, rays)
    assert_allclose(found.x_m, POINTS, atol=1e-8)
    raised = intersect_rays(block, georeference(block, calibration), rays).x_m - POINTS
    assert np.all((raised[:, 2] > 0.01) & (raised[:, 2] < 0.1))  # centimetres, upwards


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


# --- Pixels on the ground: where they were projected from, and every source of their errors


SIGMA_PX, SIGMA_HEIGHT = 0.4, 0.3


def each_alone(block):
    """All measurements, each as a pixel of its own, and the points of which they are."""
    points = block.image_points
    n = len(points)
    sigma = np.full(n, SIGMA_PX)
    rays = Rays(
        image_idx=points.image_idx, group=np.arange(n), colrow=points.colrow, sigma_px=sigma
    )
    return rays, blocks.SEEN[points.point_idx]


@pytest.fixture(scope="module")
def pixels(rig):
    return each_alone(rig)


def heights(block, x_m):
    return block.frame.to_grid(x_m)[:, 2]


def located(block, calibration, rays, height, model=Model()):
    return ground_points(
        block,
        georeference(block, calibration, model),
        rays,
        height_m=height,
        sigma_height_m=np.full(len(height), SIGMA_HEIGHT),
    )


def test_a_pixel_lies_where_the_point_was_that_it_shows(rig, calibration, pixels):
    rays, x_m = pixels
    found = located(rig, calibration, rays, heights(rig, x_m))
    assert_allclose(found.x_m, x_m, atol=1e-6)
    assert_allclose(found.enh, rig.frame.to_grid(x_m), atol=1e-6)


def test_a_nadir_pixel_has_the_errors_of_the_textbook(pixels):
    """Straight down, from Z above ground: Z sigma / f on the ground, and height errs by itself."""
    block = blocks.simulate(blocks.fly(tilt_deg=0.0), ties=blocks.terrain(1))
    level = Pose(R=np.eye(3), r=np.zeros(3))
    camera = replace(blocks.CAMERA, interior=Interior(f=50.0), T_b_c=level)
    trajectory = replace(
        block.trajectory, sigma_position=np.zeros((12, 3)), sigma_attitude=np.zeros((12, 3))
    )
    exact = replace(block, cameras=(camera,), trajectory=trajectory)
    middle = np.array([[1999.5, 1499.5]])
    rays = Rays(image_idx=np.array([0]), group=np.array([0]), colrow=middle, sigma_px=np.ones(1))
    found = located(exact, given([camera]), rays, np.array([900.0]))
    above = block.frame.to_grid(block.trajectory.T_m_b.r[:1])[0, 2] - 900.0
    expected = above * camera.pixel_mm / camera.interior.f
    sigma = np.sqrt(np.diag(found.cov[0]))
    assert_allclose(sigma, [expected, expected, SIGMA_HEIGHT], rtol=1e-3)  # 1/3000 rad off nadir


def test_refraction_lowers_the_ray_as_the_atmosphere_does(calibration):
    cameras = (blocks.CAMERA, blocks.SECOND)
    block = blocks.simulate(blocks.fly(), cameras=cameras, ties=blocks.SEEN, refraction="standard")
    rays, x_m = each_alone(block)
    in_air = Model(refraction="standard")
    found = located(block, calibration, rays, heights(block, x_m), in_air)
    assert_allclose(found.x_m, x_m, atol=1e-6)
    straight = located(block, calibration, rays, heights(block, x_m))
    r = georeference(block, calibration).T_m_c.r[rays.image_idx]
    aside = np.linalg.norm((x_m - r)[:, :2], axis=1)
    expected = refraction_lift(r, x_m) * aside / (r - x_m)[:, 2]
    off = np.linalg.norm((straight.x_m - x_m)[:, :2], axis=1)
    assert_allclose(off, expected, rtol=1e-3, atol=1e-6)


def test_errors_are_those_of_pixel_height_trajectory_and_calibration(rig, calibration, pixels):
    rays, x_m = pixels
    h = heights(rig, x_m)
    found = located(rig, calibration, rays, h)

    def by_pixel(x):
        return located(rig, calibration, replace(rays, colrow=rays.colrow + x), h).x_m

    def by_height(x):
        return located(rig, calibration, rays, h + x).x_m

    def by_body(x):
        return located(moved_trajectory(rig, x), calibration, rays, h).x_m

    def by_columns(x):
        return located(rig, moved_calibration(calibration, x), rays, h).x_m

    # along the grid's axes, in metres on the ground: a map's are longer by its scale
    R_g_m = rig.frame.grid_axes(x_m)
    J_pixel = numeric_jacobian(by_pixel, np.zeros(2), step=1e-2)
    J_height = numeric_jacobian(by_height, np.zeros(1), step=1e-2)
    body_steps = np.tile([1e-2] * 3 + [1e-6] * 3, len(rig.trajectory))
    J_body = numeric_jacobian(by_body, np.zeros(len(body_steps)), step=body_steps)
    J_columns = numeric_jacobian(by_columns, np.zeros(20), step=COLUMN_STEPS)
    expected = J_pixel @ np.swapaxes(J_pixel, 1, 2) * SIGMA_PX**2
    expected += J_height @ np.swapaxes(J_height, 1, 2) * SIGMA_HEIGHT**2
    expected += J_columns @ calibration.cov @ np.swapaxes(J_columns, 1, 2)
    for e, cov in enumerate(rig.trajectory.cov):
        own = J_body[:, :, 6 * e : 6 * e + 6]
        expected += own @ cov @ np.swapaxes(own, 1, 2)
    expected = R_g_m @ expected @ np.swapaxes(R_g_m, 1, 2)
    for part, whole in zip(found.cov, expected, strict=True):
        scale = np.sqrt(np.diag(whole))
        # steps of 1e-6 rad move points by 1e-3 m, and points are found to 1e-9
        assert_allclose(part / np.outer(scale, scale), whole / np.outer(scale, scale), atol=1e-4)


@pytest.mark.parametrize("draws", [500, repeats(2000)])
def test_scatter_of_everything_at_once_is_the_stated_covariance(rig, calibration, pixels, draws):
    """Draws of all errors: sampling leaves 1 / sqrt(2 n) of a sigma, 3 % with 500."""
    rays, x_m = pixels
    h = heights(rig, x_m)
    rng = np.random.default_rng(11)
    stated = located(rig, calibration, rays, h)
    half_body = [np.linalg.cholesky(cov) for cov in rig.trajectory.cov]
    half_columns = np.linalg.cholesky(calibration.cov)
    drawn = []
    for _ in range(draws):
        body = np.concatenate([half @ rng.standard_normal(6) for half in half_body])
        columns = half_columns @ rng.standard_normal(20)
        noise = SIGMA_PX * rng.standard_normal(rays.colrow.shape)
        h_off = SIGMA_HEIGHT * rng.standard_normal(len(h))
        moved = replace(rays, colrow=rays.colrow + noise)
        block, cameras = moved_trajectory(rig, body), moved_calibration(calibration, columns)
        drawn.append(located(block, cameras, moved, h + h_off).enh)
    off = np.stack(drawn) - rig.frame.to_grid(x_m)
    chi_square = np.einsum("sni,nij,snj->sn", off, np.linalg.inv(stated.cov), off)
    # 3 degrees of freedom each; the mean over n draws has a deviation of sqrt(6 / n)
    assert_allclose(chi_square.mean(axis=0), 3.0, atol=5 * np.sqrt(6 / draws))
    sigma = np.sqrt(np.diagonal(stated.cov, axis1=1, axis2=2))
    assert_allclose(off.std(axis=0) / sigma, 1.0, atol=5 / np.sqrt(2 * draws))


def test_a_ray_that_does_not_come_down_to_the_height_meets_nothing(rig, calibration, pixels):
    rays, x_m = pixels
    h = heights(rig, x_m)
    h[0] = 5000.0  # above the aircraft
    found = located(rig, calibration, rays, h)
    assert np.isnan([*found.x_m[0], *found.enh[0], *found.cov[0].ravel()]).all()
    assert np.isfinite([found.x_m[1:], found.enh[1:]]).all()


# --- sources of errors that points share -----------------------------------------------------


@pytest.fixture(params=["white", "slow"])
def sources(request, rng):
    """Six points on four exposures, each on two or three of them, and five parameters."""
    point = np.repeat(np.arange(6), [2, 3, 2, 3, 2, 3])
    exposure = np.concatenate([np.sort(rng.permutation(4)[:k]) for k in (2, 3, 2, 3, 2, 3)])
    root = rng.normal(size=(6, 3, 3)) * 0.02 + 0.05 * np.eye(3)
    mix = np.linalg.qr(rng.normal(size=(5, 5)))[0] * rng.uniform(0.5, 1.5, 5)
    sigma = np.array([3e-3, 2e-2, 1e-7, 1e-12, 1e-4])
    sigma_body = np.array([0.05] * 3 + [1e-4] * 3)
    return ErrorSources(
        image=root @ np.swapaxes(root, 1, 2),
        survey=np.tile(np.diag([1e-4, 1e-4, 4e-4]), (6, 1, 1)),
        point=point,
        exposure=exposure,
        by_body=rng.normal(size=(15, 3, 6)) * [1, 1, 1, 1000, 1000, 1000],
        by_parameters=rng.normal(size=(6, 3, 5)) * 0.1 / sigma,
        cov_body=np.tile(np.diag(sigma_body**2), (4, 1, 1)),
        cov_parameters=sigma[:, None] * (mix @ mix.T) * sigma,
        shared=SHARED if request.param == "slow" else None,
    )


APART = np.abs(np.subtract.outer(np.arange(4), np.arange(4)))
SHARED = SharedErrors(
    roots=np.tile(0.9 * np.diag([0.05] * 3 + [1e-4] * 3), (4, 1, 1)),
    together=np.stack([np.exp(-APART / 5.0), np.exp(-APART / 2.0)]) * (APART > 0),
)


def dense(sources):
    """The joint covariance, assembled block by block."""
    n = len(sources)
    C = np.zeros((3 * n, 3 * n))
    J = sources.by_parameters
    for i in range(n):
        for j in range(n):
            block = J[i] @ sources.cov_parameters @ J[j].T + (i == j) * sources.own[i]
            for a in np.flatnonzero(sources.point == i):
                for b in np.flatnonzero(sources.point == j):
                    e, f = sources.exposure[[a, b]]
                    between = sources.cov_body[e] if e == f else np.zeros((6, 6))
                    if sources.shared is not None and e != f:
                        (between,) = sources.shared.between(e[None], f[None])
                    block += sources.by_body[a] @ between @ sources.by_body[b].T
            C[3 * i : 3 * i + 3, 3 * j : 3 * j + 3] = block
    return C


def test_sources_add_up_to_the_dense_covariance(sources, rng):
    C, d = dense(sources), rng.normal(size=(6, 3))
    size = np.sqrt(np.diag(C))
    for i in range(6):
        assert_allclose(sources.cov[i], C[3 * i : 3 * i + 3, 3 * i : 3 * i + 3], rtol=1e-9)
    chi_square = error_sources.chi_square(sources, d)
    assert chi_square == pytest.approx(d.ravel() @ np.linalg.solve(C, d.ravel()), rel=1e-8)
    average = np.tile(np.eye(3) / 6, 6)
    of_mean = average @ C @ average.T
    assert_allclose(error_sources.mean_covariance(sources), of_mean, rtol=1e-9, atol=1e-12)
    scale = np.outer(size, size)
    assert_allclose(error_sources.joint_covariance(sources) / scale, C / scale, atol=1e-9)
    for axis, among in enumerate(error_sources.axis_covariances(sources)):
        own = scale[axis::3, axis::3]
        assert_allclose(among / own, C[axis::3, axis::3] / own, atol=1e-9)
    R = rotation_from_opk(rng.uniform(-3, 3, (6, 3)))  # along other axes
    there = error_sources.chi_square(error_sources.turned(sources, R), frames.transform(R, d))
    assert there == pytest.approx(chi_square, rel=1e-8)


def sharing_one_shift(n, *, own_m, shared_m):
    """Points of which each has its own error, and all have one shift in common."""
    return ErrorSources(
        image=np.tile(own_m**2 * np.eye(3), (n, 1, 1)),
        survey=np.zeros((n, 3, 3)),
        point=np.zeros(0, dtype=int),
        exposure=np.zeros(0, dtype=int),
        by_body=np.zeros((0, 3, 6)),
        by_parameters=np.tile(np.eye(3), (n, 1, 1)),
        cov_body=np.zeros((0, 6, 6)),
        cov_parameters=shared_m**2 * np.eye(3),
    )


def test_a_shift_that_all_points_share_does_not_average_out():
    """Variance of the mean: s^2 / n + S^2, not (s^2 + S^2) / n."""
    cov = error_sources.mean_covariance(sharing_one_shift(25, own_m=0.05, shared_m=0.10))
    assert_allclose(cov, (0.05**2 / 25 + 0.10**2) * np.eye(3), rtol=1e-12)


def test_chi_square_of_a_shared_shift_has_a_closed_form(rng):
    """Mean and scatter part: n m^2 / (s^2 + n S^2) + sum (d - m)^2 / s^2, each axis."""
    d, n, own, shared = rng.normal(size=(25, 3)), 25, 0.05, 0.10
    mean = d.mean(axis=0)
    expected = np.sum(n * mean**2 / (own**2 + n * shared**2))
    expected += np.sum((d - mean) ** 2) / own**2
    sources = sharing_one_shift(n, own_m=own, shared_m=shared)
    assert error_sources.chi_square(sources, d) == pytest.approx(expected, rel=1e-12)


def test_given_cameras_and_no_points(sources, rng):
    none = replace(sources, by_parameters=np.zeros((6, 3, 0)), cov_parameters=np.zeros((0, 0)))
    d, C = rng.normal(size=(6, 3)), dense(none)
    expected = d.ravel() @ np.linalg.solve(C, d.ravel())
    assert error_sources.chi_square(none, d) == pytest.approx(expected, rel=1e-9)
    nothing = sharing_one_shift(0, own_m=0.05, shared_m=0.10)
    assert error_sources.chi_square(nothing, np.zeros((0, 3))) == 0.0
    assert np.isnan(error_sources.mean_covariance(nothing)).all()


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
