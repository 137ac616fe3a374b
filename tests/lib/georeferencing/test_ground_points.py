"""Pixels on the ground: where they were projected from, and every source of their errors."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.calibration.estimates import given
from acx4lib.geometry.camera import Interior
from acx4lib.geometry.collinearity import project, refraction_lift
from acx4lib.geometry.frames import Pose
from acx4lib.georeferencing.direct import Rays, georeference
from acx4lib.georeferencing.ground_points import ground_points
from support import blocks
from support.blocks import COLUMN_STEPS, moved_calibration, moved_trajectory
from support.helpers import numeric_jacobian, repeats

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


def located(block, calibration, rays, height, **options):
    return ground_points(
        block,
        georeference(block, calibration),
        rays,
        height_m=height,
        sigma_height_m=np.full(len(height), SIGMA_HEIGHT),
        **options,
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
    found = located(block, calibration, rays, heights(block, x_m), refraction="standard")
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


def test_a_point_projects_back_into_its_pixel(rig, calibration, pixels):
    rays, x_m = pixels
    g = georeference(rig, calibration)
    found = located(rig, calibration, rays, heights(rig, x_m) - 20.0)
    for k, camera in enumerate(g.cameras):
        own = rig.images.camera_idx[rays.image_idx] == k
        back = project(camera, g.T_m_c[rays.image_idx[own]], found.x_m[own])
        assert_allclose(back, rays.colrow[own], atol=1e-5)
