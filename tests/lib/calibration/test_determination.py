"""What an adjustment determines least is found and called by the names of results."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import linalg, stats

from acx4files.results import sentences
from acx4lib.bundle.adjust import adjust, free_orientation, mounted_orientation
from acx4lib.bundle.rejections import noncentrality
from acx4lib.calibration import determination, mounting
from acx4lib.calibration.determination import (
    SHARE,
    STRONG,
    absorption,
    by_lever_arms,
    detectable,
    effective_heights,
    strong_correlations,
    weakest_combination,
)
from acx4lib.calibration.estimates import from_bundle, parameters, reported_covariance
from acx4lib.design import flying_heights
from acx4lib.geometry.frames import Pose, log, rotation_from_opk
from acx4lib.least_squares.covariance import GaussMarkov
from acx4lib.model import Model
from support import blocks
from support.flights.simulated import fly


@pytest.fixture(scope="module")
def on_control():
    """A bundle over nearly flat ground, on control points alone, that estimates f."""
    flat = blocks.crosses() * [1, 1, 0] + [0, 0, blocks.GROUND_M]
    block = blocks.simulate(
        blocks.fly(), ties=blocks.terrain(40, relief_m=5.0), control=flat, cameras=(blocks.CAMERA,)
    )
    return adjust(free_orientation(block, Model(free=("f", "xp", "yp"))))


def test_f_goes_with_the_height_of_all_positions(on_control):
    """Over flat ground only the ratio of the two is known: half of the combination is each."""
    parts = weakest_combination(on_control)
    assert {part.unknown for part in parts[:2]} == {"CAM/f_mm", "height of all positions"}
    assert [part.share for part in parts[:2]] == pytest.approx([0.5, 0.5], abs=0.05)


def test_images_with_one_point_are_named_where_double_precision_ends(exact_block):
    points = exact_block.image_points
    rest = np.setdiff1d(np.arange(len(points)), np.flatnonzero(points.image_idx == 3)[1:])
    block = replace(exact_block, image_points=points[rest])
    fit = adjust(free_orientation(block, Model(free=("xp", "yp"))))
    name = block.images.names[3]
    assert sentences.beyond_precision(fit).endswith(
        "is more than double precision can carry: the observations do not determine the position "
        f"and attitude of {name} (measured points: 1)"
    )


def test_shares_are_of_the_eigenvector_of_the_smallest_eigenvalue(mounted):
    """The inverse of the covariance is the normal matrix that was reduced by the points."""
    N = np.linalg.inv(mounted.solution.cov)
    scale = 1 / np.sqrt(np.diag(N))
    _, vectors = linalg.eigh(N * scale[:, None] * scale)
    squares = vectors[:, 0] ** 2
    pose = mounted.network.layout.pose
    names = mounted.network.column_names()
    own = {n: squares[i] for i, n in enumerate(names) if i < pose.min()}
    parts = {part.unknown: part.share for part in weakest_combination(mounted)}
    for name in ("CAM/f", "CAM/lever_z", "CAM/yp", "CAM/lever_y"):
        reported = name + ("_m" if "lever" in name else "_mm")
        assert parts.get(reported, 0.0) == pytest.approx(
            own[name] if own[name] >= SHARE else 0.0, abs=1e-3
        )
    positions = sum(parts.get(f"height of {which}positions", 0.0) for which in ("", "all "))
    of_heights = np.sum(squares[pose[:, 2]])
    assert positions == pytest.approx(of_heights if of_heights >= SHARE else 0.0, abs=1e-3)


def test_among_several_open_directions_none_is_the_weakest():
    """Without control a self-calibration floats in seven directions."""
    fit = adjust(free_orientation(blocks.standard(control=None), Model(free=("xp", "yp"))))
    assert fit.solution.defect == 7
    assert weakest_combination(fit) == ()


def test_strong_correlations_are_those_of_the_reported_covariance():
    """One flying height: f and the lever arm's z are one."""
    strips = ((1000.0, -150.0, 0.0), (1000.0, 150.0, 180.0))
    block = blocks.simulate(
        blocks.fly(strips, per_strip=4),
        ties=blocks.terrain(40, relief_m=5.0),
        control=blocks.crosses() * [1, 1, 0] + [0, 0, blocks.GROUND_M],
    )
    found = from_bundle(adjust(mounted_orientation(block, Model(free=("f", "xp", "yp")))))
    pairs = strong_correlations(found)
    assert (pairs[0].row, pairs[0].column) == ("CAM/f_mm", "CAM/lever_z_m")
    cov = reported_covariance(found)
    related = cov / np.sqrt(np.outer(np.diag(cov), np.diag(cov)))
    names = [f"CAM/{p.name}" for p in parameters(found)]
    strong = np.argwhere(np.triu(np.abs(related) > STRONG, 1))
    assert {(names[i], names[j]) for i, j in strong} == {(p.row, p.column) for p in pairs}
    for pair in pairs:
        i, j = names.index(pair.row), names.index(pair.column)
        assert pair.correlation == pytest.approx(related[i, j])
    sizes = [abs(pair.correlation) for pair in pairs]
    assert sizes == sorted(sizes, reverse=True)


# --- Correlations of interior and exterior orientation


def test_correlations_are_those_of_the_covariance(fits):
    """East, north, height turned back to the mapping frame's axes must give the raw ones."""
    fit = fits["CAM2"]
    found = determination.interior_exterior(fit)
    assert found.interior == ("xp_mm", "yp_mm", "k1", "p1", "p2")
    assert found.values.shape == (31, 5, 6)
    assert np.abs(found.values).max() <= 1.0
    network = fit.network
    pose, interior = network.layout.pose[4], network.layout.interior[0]
    cov = fit.solution.cov
    # the share of an interior parameter's variance that the pose explains has no axes
    for j, column in enumerate(interior[interior >= 0]):
        raw = cov[column, pose] @ np.linalg.solve(cov[np.ix_(pose, pose)], cov[pose, column])
        assert np.all(found.values[4, j] ** 2 <= raw / cov[column, column] + 1e-12)
    sigma_z = np.sqrt(cov[pose[2], pose[2]] * cov[interior[1], interior[1]])
    # 2 km from its origin the mapping frame's z is the grid's height up to 0.02 degrees
    assert found.values[4, 0, 2] == pytest.approx(cov[interior[1], pose[2]] / sigma_z, abs=0.01)


# --- Detectable errors by group, and what those that escape do


FREE = ("f", "xp", "yp")


@pytest.fixture(scope="module")
def bundle():
    return adjust(mounted_orientation(blocks.standard(), Model(free=FREE)))


def test_the_redundancy_numbers_add_up_and_the_errors_follow_from_them(bundle):
    found = detectable(bundle)
    total = sum(one.redundancy.sum() for one in found)
    assert total == pytest.approx(bundle.solution.redundancy)
    gnss = bundle.network.observed.sigma_position
    for one in (one for one in found if one.kind == "gnss"):
        expected = noncentrality() * gnss[:, one.component] / np.sqrt(one.redundancy)
        np.testing.assert_allclose(one.bias, expected)


def test_an_error_that_just_escapes_moves_the_parameter_by_what_is_said(bundle):
    one = next(one for one in detectable(bundle) if (one.kind, one.component) == ("gnss", 2))
    assert one.on.split("/")[1] in (*FREE, "lever_x", "lever_y", "lever_z", *BORESIGHT)
    # no effect on a parameter is above delta_0 sqrt((1 - r) / r), that on the worst function
    r = one.redundancy.min()
    assert 0 < one.effect <= noncentrality() * np.sqrt((1 - r) / r)


BORESIGHT = ("boresight_x", "boresight_y", "boresight_z")


# --- What an interior orientation takes up of a lever arm, on exact flights and with noise


ABSORPTION_FREE = ("f", "xp", "yp", "k1", "k2", "k3", "p1", "p2")
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
    return replace(
        block, cameras=mounting.single_step(block, Model(free=ABSORPTION_FREE)).calibration.cameras
    )


def held_off(block, axis, *, lever_m=LEVER_M, free=ABSORPTION_FREE):
    """Return two_step_gnss with a lever arm held too short along an axis of the camera."""
    camera = block.cameras[0]
    r = camera.T_b_c.r - lever_m * camera.T_b_c.R[:, axis]
    start = replace(camera, T_b_c=Pose(R=camera.T_b_c.R, r=r))
    return mounting.two_step_gnss(replace(block, cameras=(start,)), Model(free=free))


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
    found = absorption(
        mounting.calibrate(replace(exact, cameras=(start,)), Model(free=ABSORPTION_FREE))
    )
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


# --- the covariance of the difference --------------------------------------------------------


@pytest.mark.parametrize("cameras", [(blocks.CAMERA,), (blocks.CAMERA, SIDE)])
def test_differences_are_as_large_as_their_covariance_says(cameras):
    """Over flights with noise: chi-square, in 999 of 1000 cases."""
    exact, free = blocks.standard(cameras=cameras), ("f", "xp", "yp", "k1", "p1", "p2")
    start = [replace(c, T_b_c=Pose(R=c.T_b_c.R, r=c.T_b_c.r - [0.1, -0.2, 0.1])) for c in cameras]
    squares = []
    for seed in range(30):
        block = replace(blocks.noisy(exact, np.random.default_rng(seed)), cameras=tuple(start))
        found = absorption(mounting.calibrate(block, Model(free=free)))
        off = found.lever_seen_m - found.lever_m
        squares.append(off @ np.linalg.solve(found.cov_lever_m, off))
    n = 30 * 3 * len(cameras)
    low, high = stats.chi2.ppf((0.0005, 0.9995), n)
    assert low < sum(squares) < high


# --- nothing to compare ----------------------------------------------------------------------


def test_methods_that_cannot_be_compared_are_not():
    block = blocks.approximate(blocks.standard())
    both = mounting.calibrate(block, Model(free=("f", "xp", "yp")))
    alone = mounting.Mountings(methods={"single_step": both["single_step"]}, failures={})
    assert absorption(both) is not None
    assert absorption(alone) is None
    assert absorption(mounting.calibrate(block, Model(free=("xp", "yp")))) is None
    assert (
        absorption(mounting.calibrate(block, Model(free=("f", "xp", "yp"), gnss=("shift",))))
        is None
    )
