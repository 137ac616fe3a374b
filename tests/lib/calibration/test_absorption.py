"""What an interior orientation takes up of a lever arm, on exact flights and with noise."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from acx4lib.calibration import mounting
from acx4lib.calibration.absorption import absorption, by_lever_arms, effective_heights
from acx4lib.flight.design import flying_heights
from acx4lib.geometry.frames import Pose, log, rotation_from_opk
from acx4lib.least_squares.gauss_markov import GaussMarkov
from support import blocks
from support.flights.simulated import fly
from support.helpers import repeats

FREE = ("f", "xp", "yp", "k1", "k2", "k3", "p1", "p2")
LEVER_M = 0.01
SIDE = replace(
    blocks.CAMERA,
    name="SIDE",
    T_b_c=Pose(R=rotation_from_opk(np.radians([12.0, -5.0, 90.0])), r=np.array([0.1, 0.3, 0.2])),
)


@pytest.fixture(scope="module")
def exact():
    """The study's block 2 without noise, cameras at their true values."""
    block = fly("acx4-ideal", seed=1, blocks=("calibration",), exact=True).flight.calibration
    return replace(block, cameras=mounting.single_step(block, free=FREE).calibration.cameras)


def held_off(block, axis, *, lever_m=LEVER_M, free=FREE):
    """Return two_step_gnss with a lever arm held too short along an axis of the camera."""
    camera = block.cameras[0]
    r = camera.T_b_c.r - lever_m * camera.T_b_c.R[:, axis]
    start = replace(camera, T_b_c=Pose(R=camera.T_b_c.R, r=r))
    return mounting.two_step_gnss(replace(block, cameras=(start,)), free=free)


def weighted(block, *, gnss=1.0, control=1.0):
    """Return the block with its standard deviations of positions and control multiplied."""
    sigma = gnss * block.trajectory.sigma_position
    return replace(
        block,
        trajectory=replace(block.trajectory, sigma_position=sigma),
        control=replace(block.control, sigma_m=control * block.control.sigma_m),
    )


def taken_up(block, axis):
    """Return what f, xp, yp and the boresight change by per metre along an axis of the camera."""
    found = held_off(block, axis).calibration.cameras[0]
    true = block.cameras[0]
    interior = [getattr(found.interior, k) - getattr(true.interior, k) for k in ("f", "xp", "yp")]
    return np.array([*interior, *log(true.T_b_c.R.T @ found.T_b_c.R)]) / LEVER_M


@pytest.mark.parametrize("share", [0.0, 0.9])
@pytest.mark.parametrize("axis", range(3))
def test_by_lever_arms_is_what_an_adjustment_with_a_wrong_lever_arm_does(exact, axis, share):
    """With independent errors of the positions, and with those that change slowly."""
    process = GaussMarkov(share=share, time_constant_s=600.0)
    block = replace(exact, trajectory=replace(exact.trajectory, slow_positions=process))
    two = held_off(block, axis).bundle
    by_lever = by_lever_arms(two.network, two.solution.inverse) @ exact.cameras[0].T_b_c.R
    # linear: of a lever arm of 1 cm the second order is 1e-5
    assert_allclose(by_lever[:, axis], taken_up(block, axis)[:3], rtol=1e-3, atol=2e-5)


def test_exact_data_differ_by_what_the_lever_arm_says(exact):
    """Table 3's lever arm, the other method none: 0.0105, -0.0121, 0.0230 mm."""
    camera = exact.cameras[0]
    start = replace(camera, T_b_c=Pose(R=camera.T_b_c.R, r=np.zeros(3)))
    found = absorption(mounting.calibrate(replace(exact, cameras=(start,)), free=FREE))
    assert_allclose(found.lever_m, (0.223, -0.399, -0.201), atol=1e-4)
    assert_allclose(found.by_lever @ found.lever_m, found.shift_mm, atol=5e-6)
    assert_allclose(found.lever_seen_m, found.lever_m, atol=1e-4)


# --- closed forms ----------------------------------------------------------------------------


def test_where_positions_give_way_f_takes_up_z_at_the_height_of_the_squares(exact):
    """Positions miss f's share by l - H df / f; its squares are least at H of sum H2 / sum H."""
    given_way = weighted(exact, gnss=10.0)
    H = flying_heights(exact)[exact.images.exposure_idx]
    two = held_off(given_way, 2)
    heights = effective_heights(
        two.calibration, by_lever_arms(two.bundle.network, two.bundle.solution.inverse)
    )[0]
    assert heights[2] == pytest.approx(np.sum(H**2) / np.sum(H), rel=0.005)


@pytest.mark.parametrize(("axis", "parameter", "turn", "sign"), [(0, 1, 4, -1), (1, 2, 3, 1)])
def test_where_positions_hold_principal_point_and_boresight_take_up_the_mean(
    exact, axis, parameter, turn, sign
):
    """Each image is off by f l / H; what all have in common is the mean, shared by the two."""
    held = weighted(exact, gnss=0.1)
    f = exact.cameras[0].interior.f
    H = flying_heights(exact)[exact.images.exposure_idx]
    found = taken_up(held, axis)
    # a turn about y moves the image by -f along x, one about x by f along y
    together = -(found[parameter] - sign * f * found[turn])
    assert together == pytest.approx(f * np.mean(1 / H), rel=0.02)
    assert abs(f * found[turn]) > 0.05 * abs(found[parameter])


def test_x_and_y_are_alike_where_decentring_is_estimated_and_not_where_it_is_held(exact):
    """Decentring looks like the second order of a tilt, which the longer side shows better."""

    def apart(free):
        two = held_off(exact, 0, free=free)
        by_lever = by_lever_arms(two.bundle.network, two.bundle.solution.inverse)
        x, y, _ = effective_heights(two.calibration, by_lever)[0]
        return y - x

    assert abs(apart(FREE)) < 15
    assert apart(("f", "xp", "yp")) > 60


# --- the covariance of the difference --------------------------------------------------------


@pytest.mark.parametrize("cameras", [(blocks.CAMERA,), (blocks.CAMERA, SIDE)])
def test_differences_are_as_large_as_their_covariance_says(cameras):
    """Over flights with noise: chi-square, in 999 of 1000 cases."""
    exact, free = blocks.standard(cameras=cameras), ("f", "xp", "yp", "k1", "p1", "p2")
    start = [replace(c, T_b_c=Pose(R=c.T_b_c.R, r=c.T_b_c.r - [0.1, -0.2, 0.1])) for c in cameras]
    squares = []
    for seed in range(30):
        block = replace(blocks.noisy(exact, np.random.default_rng(seed)), cameras=tuple(start))
        found = absorption(mounting.calibrate(block, free=free))
        off = found.lever_seen_m - found.lever_m
        squares.append(off @ np.linalg.solve(found.cov_lever_m, off))
    n = 30 * 3 * len(cameras)
    low, high = stats.chi2.ppf((0.0005, 0.9995), n)
    assert low < sum(squares) < high


@pytest.mark.slow
@pytest.mark.parametrize("flights", [4, repeats(12)])
def test_methods_that_share_their_data_differ_by_far_less_than_their_sigmas(flights):
    """On the study's block by a third of a millimetre of lever arm, in all flights as predicted."""
    squares = []
    for seed in range(1, flights + 1):
        flight = fly("acx4-ideal", seed=seed, blocks=("calibration",)).flight
        found = mounting.calibrate(flight.calibration, free=FREE)
        compared, single = absorption(found), found["single_step"].calibration
        sigma = np.sqrt(np.diag(compared.cov_lever_m))
        alone = np.sqrt(np.diag(single.cov)[single.layout.mount[0, :3]])
        assert np.all(sigma < 0.05 * alone)
        off = compared.lever_seen_m - compared.lever_m
        squares.append(off @ np.linalg.solve(compared.cov_lever_m, off))
    low, high = stats.chi2.ppf((0.0005, 0.9995), 3 * len(squares))
    assert low < sum(squares) < high


# --- nothing to compare ----------------------------------------------------------------------


def test_methods_that_cannot_be_compared_are_not():
    block = blocks.approximate(blocks.standard())
    both = mounting.calibrate(block, free=("f", "xp", "yp"))
    alone = mounting.Mountings(methods={"single_step": both["single_step"]}, failures={})
    assert absorption(both) is not None
    assert absorption(alone) is None
    assert absorption(mounting.calibrate(block, free=("xp", "yp"))) is None
    assert absorption(mounting.calibrate(block, free=("f", "xp", "yp"), gnss=("shift",))) is None
