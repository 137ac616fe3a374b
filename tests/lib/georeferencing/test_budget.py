"""The error budget against closed forms of the normal case, differences, and drawn errors."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4lib.bundle.unknowns import layout
from acx4lib.calibration.estimates import Calibration, given
from acx4lib.flight.block import Block, ImagePoints, Images, Trajectory
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.parameters import MOUNT
from acx4lib.georeferencing import budget, direct
from acx4lib.georeferencing.budget import CALIBRATION, SOURCES
from acx4lib.least_squares.covariance import GaussMarkov
from support import blocks
from support.helpers import numeric_jacobian

N = len(SOURCES)


def of(variance, source):
    return variance[..., SOURCES.index(source)]


# --- the normal case: two vertical images, the point below the middle of the base -----------------

F, H, B = 50.0, 1000.0, 400.0
SIGMA_PX, PIXEL_MM = 0.5, 0.01
SCALE = H / F
"""Metres on the ground in a millimetre of the image."""

NORMAL = Camera(
    name="CAM", width_px=4000, height_px=4000, pixel_mm=PIXEL_MM, interior=Interior(f=F)
)


def normal_case(*, position=(0.0, 0.0, 0.0), attitude=(0.0, 0.0, 0.0)):
    none = np.zeros(0, dtype=int)
    return Block(
        cameras=(NORMAL,),
        images=Images(names=("left", "right")),
        points=(),
        image_points=ImagePoints(
            image_idx=none, point_idx=none, colrow=np.zeros((0, 2)), sigma_px=np.zeros(0)
        ),
        trajectory=Trajectory(
            exposures=("left", "right"),
            T_m_b=Pose(
                R=np.tile(np.eye(3), (2, 1, 1)), r=np.array([[-B / 2, 0.0, H], [B / 2, 0.0, H]])
            ),
            sigma_position=np.tile(position, (2, 1)),
            sigma_attitude=np.tile(attitude, (2, 1)),
        ),
    )


def at_middle(block, calibration=None, **options):
    """The variance of the point below the middle of the base, shape (3, n_sources)."""
    known = given(block.cameras) if calibration is None else calibration
    g = direct.georeference(block, known)
    found = budget.predict(block, g, np.zeros((1, 3)), sigma_px=SIGMA_PX, **options)
    return found.variance[0]


def mounted(free, free_mount, cov):
    """A calibration of the normal case's camera with this covariance."""
    return Calibration(
        cameras=(NORMAL,),
        layout=layout(1, 0, free=free, free_mount=free_mount),
        cov=np.atleast_2d(cov).astype(float),
        sigma0_sq=1.0,
        open_columns=np.zeros(len(free) + len(free_mount), dtype=bool),
    )


def test_image_points_of_the_normal_case():
    """sigma_X = sigma_Y = (H / f) s / sqrt 2, sigma_Z = (H / B) (H / f) s sqrt 2."""
    on_ground = SCALE * SIGMA_PX * PIXEL_MM
    expected = np.array([on_ground**2 / 2, on_ground**2 / 2, 2 * (H / B * on_ground) ** 2])
    found = at_middle(normal_case())
    assert_allclose(of(found, "image points"), expected, rtol=1e-9)
    assert_allclose(found.sum(axis=-1), expected, rtol=1e-9)


def test_survey_is_added_along_its_axes():
    found = at_middle(normal_case(), sigma_survey_m=np.array([0.01, 0.02, 0.03]))
    assert_allclose(of(found, "survey"), [1e-4, 4e-4, 9e-4], rtol=1e-12)


def test_positions_of_the_normal_case():
    """East errors change the base, and with it the height; a lifted end moves its inclined ray."""
    e, n, u = 0.05, 0.07, 0.11
    inclined = u * B / 2 / H
    expected = [(e**2 + inclined**2) / 2, n**2 / 2, u**2 / 2 + 2 * (H / B * e) ** 2]
    assert_allclose(of(at_middle(normal_case(position=(e, n, u))), "GNSS"), expected, rtol=1e-9)


def test_attitudes_of_the_normal_case():
    """Roll moves the ray across, pitch along the base by H (1 + (B / 2H)^2), heading by B / 2."""
    s = np.radians([0.005, 0.006, 0.01])
    found = at_middle(normal_case(attitude=tuple(s)))
    along = H * (1 + (B / 2 / H) ** 2) * s[1]
    assert_allclose(of(found, "roll"), [0, (H * s[0]) ** 2 / 2, 0], atol=1e-15)
    assert_allclose(of(found, "pitch"), [along**2 / 2, 0, 2 * (H / B * along) ** 2], atol=1e-13)
    assert_allclose(of(found, "heading"), [0, (B / 2 * s[2]) ** 2 / 2, 0], atol=1e-15)


def test_a_boresight_turns_both_rays_alike():
    """Roll and pitch shift the point and cannot change its height; heading lifts nothing."""
    s = np.radians([0.002, 0.003, 0.004])
    found = at_middle(normal_case(), mounted((), MOUNT, np.diag([0, 0, 0, *s**2])))
    along = H * (1 + (B / 2 / H) ** 2) * s[1]
    assert_allclose(of(found, "boresight"), [along**2, (H * s[0]) ** 2, 0], atol=1e-15)


def test_focal_length_and_vertical_lever_arm_compensate_at_one_height_only():
    """dZ = -(H / f) df + dz: with df = (f / H) dz together the height is right, each alone not."""
    z = 0.10
    f = z / SCALE
    cov = np.zeros((7, 7))
    cov[np.ix_([0, 3], [0, 3])] = np.outer([f, z], [f, z])
    found = at_middle(normal_case(), mounted(("f",), MOUNT, cov))
    height = found[2]
    assert of(height, "interior orientation") == pytest.approx(z**2)
    assert of(height, "lever arm") == pytest.approx(z**2)
    assert of(height, "lever arm with interior orientation") == pytest.approx(-2 * z**2)
    assert sum(of(height, name) for name in CALIBRATION) == pytest.approx(0, abs=1e-12)


def test_principal_point_moves_the_point_along_the_base():
    found = at_middle(normal_case(), mounted(("xp",), (), [[0.003**2]]))
    assert_allclose(of(found, "interior orientation"), [(SCALE * 0.003) ** 2, 0, 0], atol=1e-15)


# --- any case --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def measured(rig):
    points = rig.image_points
    order = np.argsort(points.point_idx, kind="stable")
    return direct.Rays(
        image_idx=points.image_idx[order],
        group=points.point_idx[order],
        colrow=points.colrow[order],
        sigma_px=np.linspace(0.3, 0.8, len(order)),
    )


@pytest.fixture(scope="module")
def found(rig, calibration, measured):
    g = direct.georeference(rig, calibration)
    sources = direct.intersect_rays(rig, g, measured).sources
    return sources, budget.of(sources, g.layout)


def test_parts_sum_to_the_variance(found):
    sources, split = found
    total = np.diagonal(sources.cov, axis1=1, axis2=2)
    assert_allclose(split.variance.sum(axis=-1), total, rtol=1e-12)
    assert_allclose(split.sigma, np.sqrt(total), rtol=1e-12)
    for share in (budget.shares(split.variance), budget.shares(split.mean)):
        assert_allclose(sum(share.values()), 1.0, rtol=1e-12)


def test_parts_sum_to_the_variance_where_exposures_share_errors(rig, calibration, measured):
    timed = blocks.in_strips(rig, 3)
    process = GaussMarkov(share=0.95, time_constant_s=60.0)
    own = replace(timed.trajectory, slow_positions=process, slow_attitudes=process)
    g = direct.georeference(replace(timed, trajectory=own), calibration)
    sources = direct.intersect_rays(timed, g, measured).sources
    split, total = budget.of(sources, g.layout), np.diagonal(sources.cov, axis1=1, axis2=2)
    assert_allclose(split.variance.sum(axis=-1), total, rtol=1e-12)
    white = budget.of(replace(sources, shared=None), g.layout)
    plan = [of(one.variance, "GNSS")[:, :2] for one in (split, white)]
    assert np.all(plan[0] > 1.2 * plan[1])  # what moves all rays alike moves the point with them
    assert_allclose(of(split.variance, "boresight"), of(white.variance, "boresight"))


def test_each_source_is_what_its_errors_alone_give(found, rig, calibration, measured):
    """By numerical derivatives of the points by every pose and every parameter."""
    split = found[1].variance

    def points(block=rig, known=calibration):
        return direct.intersect_rays(block, direct.georeference(block, known), measured).x_m

    n = len(rig.trajectory)
    by_body = numeric_jacobian(
        lambda x: points(blocks.moved_trajectory(rig, x)),
        np.zeros(6 * n),
        step=np.tile([1e-2] * 3 + [1e-6] * 3, n),
    ).reshape(-1, 3, n, 6)
    for name, columns in budget.TRAJECTORY.items():
        J = by_body[..., columns]
        cov = rig.trajectory.cov[:, columns][:, :, columns]
        expected = np.einsum("nkep,epq,nkeq->nk", J, cov, J)
        assert_allclose(of(split, name), expected, rtol=2e-3, atol=1e-9)
    J = numeric_jacobian(
        lambda x: points(known=blocks.moved_calibration(calibration, x)),
        np.zeros(20),
        step=blocks.COLUMN_STEPS,
    )
    interior = np.isin(np.arange(20) % 10, range(4))
    lever = np.isin(np.arange(20) % 10, range(4, 7))
    boresight = ~(interior | lever)
    groups = {"boresight": boresight, "lever arm": lever, "interior orientation": interior}
    for (a, in_a), (b, in_b) in [(x, y) for x in groups.items() for y in groups.items()]:
        name = a if a == b else f"{a} with {b}"
        if name in SOURCES:
            factor = 1 if a == b else 2
            expected = factor * np.einsum("nip,pq,niq->ni", J * in_a, calibration.cov, J * in_b)
            assert_allclose(of(split, name), expected, rtol=2e-3, atol=1e-8)


def test_drawn_errors_scatter_as_predicted(found, rig, calibration, measured):
    """Monte Carlo: all errors drawn at once; 99.9 % bounds of every coordinate's variance."""
    sigma, draws, rng = found[1].sigma, 120, np.random.default_rng(11)
    exact = blocks.SEEN
    n = len(rig.trajectory)
    body = np.linalg.cholesky(rig.trajectory.cov)
    half = np.linalg.cholesky(calibration.cov)
    z = []
    for _ in range(draws):
        noise = np.einsum("nij,nj->ni", body, rng.normal(size=(n, 6))).ravel()
        block = blocks.moved_trajectory(rig, noise)
        known = blocks.moved_calibration(calibration, half @ rng.normal(size=20))
        at = measured.colrow + rng.normal(size=measured.colrow.shape) * measured.sigma_px[:, None]
        x_m = direct.intersect_rays(
            block, direct.georeference(block, known), replace(measured, colrow=at)
        ).x_m
        z.append((x_m - exact) / sigma)
    low, high = stats.chi2.ppf([0.0005, 0.9995], draws) / draws
    among = np.mean(np.square(z), axis=0)
    assert np.all((low < among) & (among < high)), among


def test_a_point_of_one_image_has_no_budget(rig, calibration):
    g = direct.georeference(rig, calibration)
    far = np.array([[0.0, 0.0, 900.0], [1e5, 0.0, 900.0]])
    found = budget.predict(rig, g, far, sigma_px=0.5)
    assert np.isfinite(found.sigma[0]).all()
    assert np.isnan(found.sigma[1]).all()
    assert np.isfinite(found.rms).all()
    nothing = budget.predict(rig, g, far[1:], sigma_px=0.5)
    assert np.isnan(nothing.rms).all()


def test_prediction_is_that_of_the_measured_points(rig, calibration):
    """Points that all the images measure have the variances of their intersections."""
    g = direct.georeference(rig, calibration)
    points = rig.image_points
    order = np.argsort(points.point_idx, kind="stable")
    rays = direct.Rays(
        image_idx=points.image_idx[order],
        group=points.point_idx[order],
        colrow=points.colrow[order],
        sigma_px=points.sigma_px[order],
    )
    cov = direct.intersect_rays(rig, g, rays).cov
    axes = rig.frame.grid_axes(blocks.SEEN)
    expected = np.diagonal(axes @ cov @ np.swapaxes(axes, 1, 2), axis1=1, axis2=2)
    found = budget.predict(rig, g, blocks.SEEN, sigma_px=0.5)
    assert_allclose(found.sigma**2, expected, rtol=1e-9)


def test_refraction_changes_where_images_show_points_and_hardly_the_budget(rig, calibration):
    g = direct.georeference(rig, calibration)
    _, _, straight = budget.shown(rig, g, blocks.SEEN)
    _, _, bent = budget.shown(rig, g, blocks.SEEN, refraction="standard")
    moved = np.hypot(*(bent - straight).T)
    assert 0.01 < moved.max() < 0.1  # px of 10 um: some microradians at 50 mm
    found, other = (
        budget.predict(rig, g, blocks.SEEN, sigma_px=0.5, refraction=refraction).sigma
        for refraction in ("none", "standard")
    )
    assert_allclose(other, found, rtol=1e-3)
