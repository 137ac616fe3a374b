"""Two-step and single-step: eqs (12) and (13), Table 3's shift, and propagated covariances."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

import acx4sim
from acx4book.paper import printed as paper
from acx4lib.bundle import variance_components
from acx4lib.bundle.adjust import adjust, free_orientation, mounted_orientation
from acx4lib.bundle.rejections import Rejection
from acx4lib.calibration import mounting
from acx4lib.calibration.estimates import parameters
from acx4lib.calibration.mounting import mounting_jacobians, mountings_per_image
from acx4lib.errors import AdjustmentError
from acx4lib.geometry.camera import Interior
from acx4lib.geometry.frames import Pose, exp, log, rotation_from_opk
from acx4lib.geometry.parameters import MOUNT
from acx4lib.model import Model
from support import blocks
from support.flights import simulated as flown
from support.helpers import numeric_jacobian, repeats, rotation_angle

FREE = ("f", "xp", "yp", "k1", "p1", "p2")
SIDE = replace(
    blocks.CAMERA,
    name="SIDE",
    T_b_c=Pose(R=rotation_from_opk(np.radians([12.0, -5.0, 90.0])), r=np.array([0.1, 0.3, 0.2])),
)


def without_lever(camera=blocks.CAMERA):
    return replace(camera, T_b_c=Pose(R=camera.T_b_c.R, r=np.zeros(3)))


def assert_mounted(found, true, *, lever_m=1e-9, angle=1e-12):
    assert_allclose(found.T_b_c.r, true.T_b_c.r, atol=lever_m)
    assert rotation_angle(found.T_b_c.R, true.T_b_c.R) < angle


# --- recovery --------------------------------------------------------------------------------


@pytest.mark.parametrize("off_deg", [0.5, 20.0])  # approximate values to begin with, or to recover
def test_two_step_methods_begin_with_the_single_step_and_end_where_they_would_alone(
    noisy_block, off_deg
):
    block = blocks.approximate(noisy_block, boresight_deg=off_deg)
    together = mounting.calibrate(block, Model(free=FREE))
    for name, method in (
        ("two_step", mounting.two_step),
        ("two_step_gnss", mounting.two_step_gnss),
    ):
        found, alone = together[name], method(block, Model(free=FREE))
        assert found.bundle.solution.iterations <= 4 - (name == "two_step")
        assert found.bundle.network.left_out == alone.bundle.network.left_out
        assert_allclose(found.calibration.cov, alone.calibration.cov, rtol=1e-4, atol=1e-18)
        for one, other in zip(
            parameters(found.calibration), parameters(alone.calibration), strict=True
        ):
            assert one.value == pytest.approx(other.value, abs=1e-4 * other.sigma), one.name


def test_single_step_recovers_the_mounting_of_exact_data(exact_block):
    found = mounting.single_step(blocks.approximate(exact_block), Model(free=FREE))
    assert found.method == "single_step"
    assert_mounted(found.calibration.cameras[0], exact_block.cameras[0])


@pytest.mark.parametrize("cameras", [(blocks.CAMERA,), (blocks.CAMERA, SIDE)])
def test_two_step_recovers_the_mounting_of_exact_data(cameras):
    block = blocks.standard(cameras=cameras)
    found = mounting.two_step(blocks.approximate(block), Model(free=FREE))
    for camera, true in zip(found.calibration.cameras, cameras, strict=True):
        # perspective centres come back to 1e-7 m only: f and heights are correlated by 0.99
        assert_mounted(camera, true, lever_m=1e-7, angle=1e-10)
        assert camera.interior.f == pytest.approx(true.interior.f, abs=1e-8)


def test_two_step_gnss_recovers_the_boresight_where_there_is_no_lever_arm():
    block = blocks.standard(cameras=(without_lever(),))
    found = mounting.two_step_gnss(blocks.approximate(block), Model(free=FREE))
    assert_mounted(found.calibration.cameras[0], without_lever(), angle=1e-10)


def test_every_image_shows_the_mounting_of_eqs_12_and_13(exact_block):
    found = mounting.two_step(blocks.approximate(exact_block), Model(free=FREE))
    T_m_b, T_m_c = exact_block.trajectory.T_m_b, found.bundle.T_m_c
    for i in range(len(T_m_c)):
        R_b_m = T_m_b.R[i].T  # R_m^b(t) of the paper: from m to b
        assert_allclose(found.per_image.r[i], R_b_m @ (T_m_c.r[i] - T_m_b.r[i]), atol=1e-9)  # (12)
        assert_allclose(found.per_image.R[i], R_b_m @ T_m_c.R[i], atol=1e-14)  # (13)


# --- the paper's discovery -------------------------------------------------------------------


def test_a_lever_arm_held_at_zero_goes_into_the_interior_orientation_as_in_table_3():
    """Two-step less single-step: f, xp, yp take up the lever arm times f over the height.

    The paper prints its lever arm in the camera's axes, z away from the ground.
    """
    single = paper.interior(3, "single_step")
    lever = np.array([paper.value(3, f"lever_{axis}_m", "single_step") for axis in "xyz"])
    camera = replace(
        blocks.CAMERA,
        width_px=12000,
        height_px=16200,
        pixel_mm=0.0056,
        interior=single,
        T_b_c=Pose(R=np.eye(3), r=lever),
    )
    strips = [(1400.0, y, way) for y in (-250.0, 250.0) for way in (0.0, 180.0)]
    block = blocks.simulate(
        blocks.fly(strips, tilt_deg=0.5),
        cameras=(camera,),
        ties=blocks.terrain(60, half_m=500.0, relief_m=20.0),
        control=blocks.crosses(spacing_m=450.0),
    )
    # GNSS far better than control, as only the paper's sigma of f can have arisen
    sigma = np.full((len(block.trajectory), 3), 1e-3)
    block = replace(block, trajectory=replace(block.trajectory, sigma_position=sigma))
    start = replace(block, cameras=(without_lever(camera),))
    shift = {}
    for name, method in (("gnss", mounting.two_step_gnss), ("one", mounting.single_step)):
        found = method(start, Model(free=("f", "xp", "yp"))).calibration.cameras[0].interior
        shift[name] = np.array([found.f, found.xp, found.yp])
    printed = [
        paper.value(3, name, "two_step") - paper.value(3, name, "single_step")
        for name in ("f_mm", "xp_mm", "yp_mm")
    ]
    assert_allclose(printed, [0.0107, -0.0118, 0.0228], atol=1e-9)
    # the paper's block has two heights and its own control: a tenth of the effect
    assert_allclose(shift["gnss"] - shift["one"], printed, rtol=0.12)


# --- what is estimated, and what enters ------------------------------------------------------


@pytest.mark.parametrize(
    ("fix", "names"),
    [
        ((), MOUNT),
        (("lever_arm",), MOUNT[3:]),
        (("boresight",), MOUNT[:3]),
        (("lever_arm", "boresight"), ()),
    ],
)
def test_a_part_of_the_mounting_can_be_held(exact_block, fix, names):
    true = exact_block.cameras[0].T_b_c
    held = blocks.approximate(
        exact_block,
        boresight_deg=0.0 if "boresight" in fix else 0.5,
        lever_m=true.r if "lever_arm" in fix else None,
    )
    for method in (mounting.single_step, mounting.two_step):
        found = method(held, Model(free=FREE, fix=fix)).calibration
        assert_mounted(found.cameras[0], exact_block.cameras[0], lever_m=1e-7, angle=1e-10)
        assert found.n_columns == len(FREE) + len(names)


def rejecting(block, rejected):
    """Return the single step as if it had rejected other observations."""
    single = mounting.single_step(block, Model(free=FREE))
    return replace(single, bundle=replace(single.bundle, rejected=rejected))


@pytest.mark.parametrize("kind", ["gnss", "attitude"])
def test_an_exposure_that_was_rejected_enters_no_mean(exact_block, kind):
    by = np.zeros((len(exact_block.trajectory), 3))
    by[3] = {"gnss": 5.0, "attitude": 0.01}[kind]
    spoilt = blocks.changed(blocks.approximate(exact_block), kind, by)
    rejected = (Rejection(kind=kind, row=3, component=-1, statistic=99.0),)
    found = mounting.two_step(spoilt, Model(free=FREE), after=rejecting(spoilt, rejected))
    assert np.flatnonzero(~found.averaged).tolist() == [3]
    assert_mounted(found.calibration.cameras[0], exact_block.cameras[0], lever_m=1e-7, angle=1e-9)
    assert found.bundle.rejected == rejected


def test_single_step_says_what_it_rejected_and_the_others_take_it_over(noisy_block):
    by = np.zeros((len(noisy_block.image_points), 2))
    by[100, 1] = 8.0
    spoilt = blocks.approximate(blocks.changed(noisy_block, "image_point", by))
    found = mounting.calibrate(spoilt, Model(free=FREE))
    assert list(found.methods) == ["two_step", "two_step_gnss", "single_step"]
    assert found.failures == {}
    for method in found.methods:
        assert [(r.kind, r.row) for r in found[method].bundle.rejected] == [("image_point", 100)]
        assert 100 not in found[method].bundle.network.rows


def test_a_method_that_fails_is_named_and_the_others_stand(exact_block):
    few = replace(exact_block, control=exact_block.control[np.arange(2)])
    found = mounting.calibrate(blocks.approximate(few, df=0.0), Model(free=("xp", "yp")))
    assert list(found.methods) == ["two_step_gnss", "single_step"]
    assert list(found.failures) == ["two_step"]
    assert "2 control points in images do not orient the block" in found.failures["two_step"]


# --- Jacobians and covariances ---------------------------------------------------------------


def estimates(calibration, true):
    """Free interior parameters, lever arm and small rotation, in the order of the columns."""
    (camera,) = calibration.cameras
    columns = calibration.layout
    values = np.concatenate(
        [
            camera.interior.to_array(),
            camera.T_b_c.r,
            log(true.T_b_c.R.T @ camera.T_b_c.R),
        ]
    )
    return values[np.concatenate([columns.interior[0], columns.mount[0]]) >= 0]


@pytest.mark.parametrize(
    "method", [mounting.single_step, mounting.two_step, repeats(mounting.two_step_gnss)]
)
def test_covariances_carry_every_observation_to_the_parameters(method):
    """Each observation is moved by a share of its sigma and everything computed anew.

    Exact data, so that weights and curvature play no part to first order; no distortion, since
    sigma_px is taken for that of the corrected point. In two_step the scatter of the images alone
    would claim several times too little.
    """
    camera = without_lever() if method is mounting.two_step_gnss else blocks.CAMERA
    camera = replace(camera, interior=Interior(f=50.0, xp=0.06, yp=-0.04))
    block = blocks.simulate(
        blocks.fly([(1000.0, 0.0, 0.0), (1300.0, 0.0, 180.0)], per_strip=2),
        cameras=(camera,),
        control=blocks.crosses(),
        ties=blocks.terrain(2),
    )
    free = ("xp", "yp", "k1")

    def estimate(changed):
        return estimates(method(changed, Model(free=free)).calibration, camera)

    calibration = method(block, Model(free=free)).calibration
    numeric = blocks.numeric_covariance(block, estimate)
    sigma = np.sqrt(np.diag(numeric))
    # steps of a thousandth of a sigma: curvature leaves less than 1e-5 of it
    assert_allclose(
        calibration.cov / np.outer(sigma, sigma), numeric / np.outer(sigma, sigma), atol=1e-4
    )


@pytest.mark.slow
@pytest.mark.parametrize("method", [mounting.single_step, mounting.two_step])
def test_errors_over_many_flights_are_as_large_as_their_joint_covariance_says(exact_block, method):
    """The sum of squared normalised errors of 60 noisy blocks is chi-square distributed."""
    free = ("xp", "yp", "k1")
    (true,) = exact_block.cameras
    truth = np.array([true.interior.xp, true.interior.yp, true.interior.k1, *true.T_b_c.r, 0, 0, 0])
    total, dof = 0.0, 0
    for seed in range(60):
        noisy = blocks.noisy(exact_block, np.random.default_rng(1000 + seed))
        # the distortion that is not estimated is known
        held = replace(blocks.approximate(noisy, df=0.0).cameras[0], interior=true.interior)
        found = method(replace(noisy, cameras=(held,)), Model(free=free)).calibration
        error = estimates(found, true) - truth
        total += error @ np.linalg.solve(found.cov, error)
        dof += len(error)
    low, high = stats.chi2.ppf([0.005, 0.995], dof)
    assert low < total < high


# --- Derivatives of the mountings of single images


def test_mounting_jacobians(exact_block):
    """The Jacobians agree with eqs (12) and (13); say nothing of these themselves."""
    fit = adjust(free_orientation(exact_block, Model(free=("xp",))))
    T_b_c = mountings_per_image(fit)
    by_camera, by_trajectory = mounting_jacobians(fit, T_b_c)
    net = fit.network

    def change(T):
        about = log(np.swapaxes(T_b_c.R, 1, 2) @ T.R)
        return np.concatenate([T.r - T_b_c.r, about], axis=1)

    def with_camera(step):
        """Move every camera pose by the same step; its columns are position and own axes."""
        dx = np.zeros(net.n_columns)
        dx[net.layout.pose] = step
        state = net.moved(fit.state, dx, np.zeros((net.n_points, 3)))
        return change(mountings_per_image(replace(fit, state=state)))

    def with_body(step):
        trajectory = exact_block.trajectory
        T = trajectory.T_m_b
        T = Pose(R=T.R @ exp(step[3:]), r=T.r + step[:3])
        block = replace(exact_block, trajectory=replace(trajectory, T_m_b=T))
        return change(mountings_per_image(replace(fit, network=replace(net, block=block))))

    # positions of 2e3 m: rounding of 1e-12 m over a step of 1e-5 rad is 1e-7 m per rad
    steps = np.array([1e-2] * 3 + [1e-5] * 3)
    assert_allclose(by_camera, numeric_jacobian(with_camera, np.zeros(6), step=steps), atol=1e-6)
    assert_allclose(by_trajectory, numeric_jacobian(with_body, np.zeros(6), step=steps), atol=1e-6)


# --- weights of the observations -------------------------------------------------------------


WEIGHTS_FREE = ("f", "xp", "yp", "k1")


def adjusted(block):
    return adjust(mounted_orientation(block, Model(free=WEIGHTS_FREE)))


@pytest.fixture(scope="module")
def block():
    return blocks.balanced()


@pytest.fixture(scope="module")
def factors(block):
    return mounting.estimated_factors(block, adjusted)


def test_with_estimated_sigma_every_group_fits_its_residuals(block, factors):
    found = variance_components.components(
        adjusted(mounting.scaled(block, factors)), applied=factors
    )
    moved = [c for c in found if c.applied != 1]
    assert len(moved) >= 3
    for c in moved:
        assert c.factor == pytest.approx(c.applied, rel=2e-3)


def test_a_group_with_too_little_redundancy_keeps_its_sigma(block):
    two = replace(block, control=block.control[:2])
    bare = mounting.estimated_factors(two, adjusted)
    assert bare["control height"] == 1.0
    assert bare["control plan"] == 1.0
    assert bare["image points"] != 1.0


def test_scaling_multiplies_the_sigma_of_its_groups_only(block):
    scaled = mounting.scaled(block, {"GNSS": 2.0, "roll, pitch": 3.0, "control height": 5.0})
    was, now = block.trajectory, scaled.trajectory
    assert_allclose(now.sigma_position, 2 * was.sigma_position)
    assert_allclose(now.sigma_attitude, was.sigma_attitude * [3, 3, 1])
    assert_allclose(scaled.control.sigma_m, block.control.sigma_m * [1, 1, 5])
    assert_allclose(scaled.image_points.sigma_px, block.image_points.sigma_px)


def test_factors_that_do_not_settle_are_an_error_that_names_them(block, monkeypatch):
    monkeypatch.setattr(mounting, "MAX_ITERATIONS", 1)
    with pytest.raises(AdjustmentError, match=r'still change by .* %; use weights = "given"'):
        mounting.estimated_factors(mounting.scaled(block, {"heading": 0.4}), adjusted)


def test_a_flights_gnss_that_is_2_5_times_worse_than_stated_is_found_so():
    """Through the flight's files; the bound is 3.3 of the factor's own standard deviations."""
    options = {"blocks": ("calibration",), "tie_points": {"calibration": 100}}
    true = acx4sim.DESIGNS["single-head"](
        seed=2, options=acx4sim.Options(**options, gnss_noise=2.5)
    )
    told = acx4sim.DESIGNS["single-head"](seed=2, options=acx4sim.Options(**options))
    toml = told.toml + 'weights = "estimated"\n'
    flight = flown.read_back(replace(true, toml=toml)).flight
    assert flight.weights == "estimated"
    block, factors = mounting.weighted(flight.calibration, flight.model, weights=flight.weights)
    found = variance_components.components(
        adjust(mounted_orientation(block, Model(free=flight.estimate_mounting))), applied=factors
    )
    gnss = next(c for c in found if c.group == "GNSS")
    assert abs(gnss.applied - 2.5) < 3.3 * gnss.sigma
    assert gnss.sigma < 0.5
