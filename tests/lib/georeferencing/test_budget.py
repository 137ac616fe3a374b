"""The error budget against closed forms of the normal case, differences, and drawn errors."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4lib.block import Block, ImagePoints, Images, Trajectory
from acx4lib.bundle.unknowns import layout
from acx4lib.calibration.estimates import Calibration, given
from acx4lib.geometry.camera import Camera, Interior
from acx4lib.geometry.frames import Pose, rotation_from_opk
from acx4lib.geometry.parameters import MOUNT
from acx4lib.georeferencing import budget, direct
from acx4lib.georeferencing.budget import CALIBRATION, SOURCES, MappingFlight
from acx4lib.least_squares.covariance import GaussMarkov
from support import blocks
from support.helpers import numeric_jacobian


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


# --- a regular mapping flight ----------------------------------------------------------------


CAMERA = Camera(name="CAM", width_px=3000, height_px=4000, pixel_mm=0.01, interior=Interior(f=50.0))
FLIGHT = MappingFlight(
    height_m=1000.0,
    sigma_position_m=(0.02, 0.02, 0.03),
    sigma_attitude=(1e-4, 1e-4, 2e-4),
    sigma_px=0.5,
)


def turned(degrees):
    R = rotation_from_opk(np.radians([0.0, 0.0, degrees]))
    return replace(CAMERA, T_b_c=Pose(R=R, r=np.zeros(3)))


@pytest.mark.parametrize(
    ("degrees", "length", "width"), [(0, 600, 800), (90, 800, 600), (180, 600, 800)]
)
def test_base_and_distance_of_strips_follow_from_the_overlaps(degrees, length, width):
    """The footprint is 3000 px x 0.01 mm x H / f = 600 m by 800 m; it turns with the camera."""
    base, apart = budget.spacing(turned(degrees), FLIGHT)
    assert base == pytest.approx(0.4 * length)
    assert apart == pytest.approx(0.7 * width)


def test_overlaps_of_60_and_30_percent_show_a_point_in_two_to_six_images():
    """Along: two or three; across: one or two."""
    block = budget.fly(CAMERA, FLIGHT)
    x, y = np.meshgrid(np.linspace(-119, 119, 30), np.linspace(-279, 279, 30))
    ground = np.column_stack([x.ravel(), y.ravel(), np.zeros(900)])
    g = direct.georeference(block, given(block.cameras))
    _, point_idx, _ = budget.shown(block, g, ground)
    among = np.bincount(point_idx, minlength=900)
    assert sorted(set(among.tolist())) == [2, 3, 4, 6]
    # mean number of images: (1 / 0.4) (1 / 0.7), up to the grid's steps
    assert among.mean() == pytest.approx(1 / 0.4 / 0.7, rel=0.05)


def test_errors_grow_with_the_height_but_those_of_positions_do_not():
    """With the overlaps, every angle of a ray stays: image and attitude ~ H, positions not."""
    low, high = (
        budget.over_ground(given([CAMERA]), replace(FLIGHT, height_m=h)).mean
        for h in (1000.0, 3000.0)
    )
    for name, factor in {
        "image points": 9.0,
        "GNSS": 1.0,
        "roll": 9.0,
        "pitch": 9.0,
        "heading": 9.0,
    }.items():
        i = SOURCES.index(name)
        assert_allclose(high[:, i], factor * low[:, i], rtol=1e-6)


def test_the_format_is_symmetric_for_a_symmetric_flight():
    """A camera without lever arm and boresight, strips there and back: left is as good as right."""
    format_ = budget.over_format(given([CAMERA]), FLIGHT, n=15)
    sigma = format_.sigma
    assert sigma.shape == (15, 11, 3)
    assert_allclose(format_.colrow[-1, -1], [2999, 3999])
    assert_allclose(sigma, sigma[::-1], rtol=1e-6)
    assert_allclose(sigma, sigma[:, ::-1], rtol=1e-6)


def test_height_is_worst_where_two_neighbours_alone_see_the_point():
    """Two images 240 m apart: (H / B) (H / f) s sqrt 2 in the middle of their common strip."""
    quiet = replace(FLIGHT, sigma_position_m=(0.0,) * 3, sigma_attitude=(0.0,) * 3)
    block = budget.fly(CAMERA, quiet)
    g = direct.georeference(block, given(block.cameras))
    found = budget.predict(block, g, np.array([[120.0, 0.0, 0.0]]), sigma_px=0.5)
    assert found.sigma[0, 2] == pytest.approx(1000 / 240 * 20 * 0.005 * np.sqrt(2), rel=1e-9)


def test_a_camera_that_does_not_look_down_is_refused():
    oblique = replace(
        CAMERA, T_b_c=Pose(R=rotation_from_opk(np.radians([80.0, 0.0, 0.0])), r=np.zeros(3))
    )
    assert budget.looks_down(CAMERA)
    assert not budget.looks_down(oblique)
    with pytest.raises(ValueError, match="looks down"):
        budget.over_ground(given([oblique]), FLIGHT)
