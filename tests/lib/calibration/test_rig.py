"""All heads in one adjustment: recovery, what the relative orientation derived from it is worth,
points that heads share at one exposure only, and what is held where it is not determined."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4files.results.sentences import not_determined
from acx4lib.block import ImagePoints
from acx4lib.bundle import adjust
from acx4lib.calibration import heads as calibration_heads
from acx4lib.calibration import rig
from acx4lib.calibration.estimates import from_bundle
from acx4lib.errors import AdjustmentError
from acx4lib.geometry.camera import mountings
from acx4lib.geometry.frames import Pose, log, rotation_from_opk
from acx4lib.model import Model
from support import blocks
from support.flights import simulated as flights
from support.flights.in_heads import FREE, SEEDS, SYNTHETIC, flown, heads, simulated
from support.helpers import numeric_jacobian, rotation_angle


@pytest.fixture(scope="module")
def exact():
    return simulated(3)


@pytest.fixture(scope="module")
def noisy(exact):
    return blocks.noisy(exact, np.random.default_rng(5))


@pytest.fixture(scope="module")
def together(noisy):
    return rig.calibrate(blocks.approximate(noisy), Model(free=FREE))


# --- recovery --------------------------------------------------------------------------------


def test_exact_heads_come_back(exact):
    found = rig.calibrate(blocks.approximate(exact), Model(free=FREE))
    assert found.method == "rig"
    for estimated, true in zip(found.calibration.cameras, heads(3), strict=True):
        # mm; the last step of the adjustment leaves a millionth of the standard deviations
        assert_allclose(estimated.interior.to_array(), true.interior.to_array(), atol=1e-7)
        assert_allclose(estimated.T_b_c.r, true.T_b_c.r, atol=1e-6)
        assert rotation_angle(estimated.T_b_c.R, true.T_b_c.R) < 1e-8


def test_exact_data_give_the_relative_orientation_of_the_heads_one_by_one(exact):
    """Two ways through different unknowns; only the definition is common to both."""
    found = rig.relative_orientation(rig.calibrate(exact, Model(free=FREE)), SYNTHETIC)
    one_by_one = calibration_heads.calibrate_heads(
        exact, ["CAM1", "CAM2", "CAM3"], Model(free=FREE)
    )
    alone = calibration_heads.relative_orientation(one_by_one, SYNTHETIC)
    assert_allclose(found.opk, alone.opk, atol=1e-8)  # rad
    assert_allclose(found.xyz_mm, alone.xyz_mm, atol=1e-6)  # mm
    assert found.n_exposures == alone.n_exposures == 12


def test_turning_the_body_axes_turns_the_mountings_and_nothing_else(noisy):
    """A rig does not know which way its IMU was built in; equal sigmas about all axes."""
    turn = Pose(R=rotation_from_opk(np.array([0.3, -0.2, 1.1])), r=np.zeros(3))
    trajectory = noisy.trajectory
    even = np.full_like(trajectory.sigma_attitude, 1e-4)
    one = replace(noisy, trajectory=replace(trajectory, sigma_attitude=even))
    other = replace(
        one,
        trajectory=replace(one.trajectory, T_m_b=trajectory.T_m_b @ turn),
        cameras=tuple(replace(c, T_b_c=turn.inverse @ c.T_b_c) for c in one.cameras),
    )
    synthetic = replace(SYNTHETIC, T_b_c=turn.inverse @ SYNTHETIC.T_b_c)
    a, b = (rig.calibrate(block, Model(free=FREE)) for block in (one, other))
    turned = turn.inverse @ mountings(a.calibration.cameras)
    # the adjustments stop within 1e-4 sigma of their minimum: a micrometre, a microradian / 100
    assert_allclose(mountings(b.calibration.cameras).r, turned.r, atol=2e-6)
    assert rotation_angle(mountings(b.calibration.cameras).R, turned.R).max() < 2e-8
    first, second = (
        rig.relative_orientation(found, s) for found, s in ((a, SYNTHETIC), (b, synthetic))
    )
    assert_allclose(second.xyz_mm, first.xyz_mm, atol=1e-6)
    assert_allclose(second.sigma, first.sigma, rtol=1e-4)


# --- covariance ------------------------------------------------------------------------------


def values(found):
    outer = np.column_stack([found.xyz_mm, found.opk]).ravel()
    return np.concatenate([outer, *(camera.interior.to_array() for camera in found.heads)])


def test_the_covariance_is_carried_over_from_the_mountings(together):
    """J cov J^T with the derivatives of the whole, numerically, from the bundle's own step."""
    fit, cov = together.bundle, together.calibration.cov
    points = np.zeros((fit.network.n_points, 3))

    def at(step):
        dx = np.zeros(fit.network.n_columns)
        dx[: len(cov)] = step
        moved = replace(fit, state=fit.network.moved(fit.state, dx, points))
        calibration = from_bundle(moved)
        return values(
            rig.relative_orientation(
                replace(together, bundle=moved, calibration=calibration), SYNTHETIC
            )
        )

    J = numeric_jacobian(at, np.zeros(len(cov)), step=0.01 * np.sqrt(np.diag(cov)))
    found = rig.relative_orientation(together, SYNTHETIC)
    expected = together.calibration.sigma0_sq * J @ cov @ J.T
    scale = np.sqrt(np.diag(expected)) + 1e-300
    # the height over ground, taken as known, changes with the first lever arm: 0.3 m in 1000 m
    assert_allclose(
        found.cov_joint / scale[:, None] / scale,
        expected / scale[:, None] / scale,
        atol=3e-3,
    )


def test_a_head_without_a_common_exposure_is_an_error(together):
    fit = together.bundle
    seen = fit.network.image_points
    own = fit.network.block.images.camera_idx[seen.image_idx] != 2
    blind = replace(fit, network=replace(fit.network, image_points=seen[own]))
    with pytest.raises(AdjustmentError, match="share no exposure"):
        rig.relative_orientation(replace(together, bundle=blind), SYNTHETIC)


# --- what is held ----------------------------------------------------------------------------

ONE_HEIGHT = tuple((1000.0, aside, turn) for _, aside, turn in blocks.BOTH_WAYS)


def test_focal_lengths_are_held_where_they_leave_something_open():
    block = blocks.noisy(simulated(strips=ONE_HEIGHT), np.random.default_rng(3))
    flat = replace(block, trajectory=replace(
        block.trajectory, sigma_position=np.tile([0.02, 0.02, 3.0], (12, 1))))  # fmt: skip
    found = rig.calibrate(flat, Model(free=FREE)).calibration
    assert np.all(found.layout.interior[:, 0] < 0)
    assert not_determined(found) == []
    assert [camera.interior.f for camera in found.cameras] == [50.0, 50.1]


# --- points that heads share -----------------------------------------------------------------


def exposures_by_point(block):
    seen = {}
    for image, point in zip(
        block.image_points.image_idx, block.image_points.point_idx, strict=True
    ):
        seen.setdefault(int(point), []).append(int(block.images.exposure_idx[image]))
    return seen


def split(block, *, shared, whole=()):
    """Give every tie point a new name at every exposure; keep those that heads share there.

    Without `shared` there are no tie points at all, but those that stay `whole`.
    """
    points = block.image_points
    control = np.isin(points.point_idx, [*block.control.point_idx, *whole])
    exposure = block.images.exposure_idx[points.image_idx]
    n = len(block.points)
    renamed = np.where(control, points.point_idx, points.point_idx + n * (1 + exposure))
    keep = control | (np.bincount(renamed)[renamed] >= 2) if shared else control
    rows = np.flatnonzero(keep)
    more = [f"{name}@{e}" for e in range(len(block.trajectory)) for name in block.points]
    return replace(
        block,
        points=(*block.points, *more),
        image_points=ImagePoints(
            image_idx=points.image_idx[rows],
            point_idx=renamed[rows],
            colrow=points.colrow[rows],
            sigma_px=points.sigma_px[rows],
        ),
    )


def test_points_of_one_exposure_are_found(exact):
    block = split(exact, shared=True)
    expected = [
        point
        for point, exposures in sorted(exposures_by_point(block).items())
        if len(set(exposures)) == 1 and len(exposures) > 1 and point not in block.control.point_idx
    ]
    assert list(rig.one_exposure_points(block)) == expected
    assert len(expected) > 50
    assert len(rig.one_exposure_points(exact)) == 0
    counts = np.unique(
        [(p, e, es.count(e)) for p, es in exposures_by_point(exact).items() for e in set(es)],
        axis=0,
    )[:, 2]
    assert list(rig.heads_at_once(exact)) == list(np.bincount(counts))


def test_observed_heights_are_those_of_the_nearest_points(exact):
    """Points of known ground, on rays of known heads: x, y within their relief times the tilt."""
    fit = adjust.adjust(adjust.mounted_orientation(exact, Model()))
    lonely = split(exact, shared=True)
    added = rig.observe_heights(lonely, fit, rig.one_exposure_points(lonely))
    new = added.control[len(exact.control) :]
    known = np.concatenate([blocks.crosses(), blocks.terrain(30)])
    used = np.isin(np.arange(len(known)), fit.network.image_points.point_idx)
    apart = np.linalg.norm(known[used, None, :2] - known[None, used, :2], axis=2)
    nearest = np.argsort(apart, axis=1)[:, 1]
    z = known[used, 2]
    assert_allclose(new.sigma_m[:, 2], np.sqrt(np.mean((z - z[nearest]) ** 2)), rtol=1e-6)
    assert np.all(np.isinf(new.sigma_m[:, :2]))
    assert np.all(np.min(np.abs(new.x_m[:, 2, None] - z), axis=1) < 1e-6)
    true = known[new.point_idx % len(known)]
    off = np.linalg.norm(new.x_m[:, :2] - true[:, :2], axis=1)
    slope = np.tan(np.radians(45.0))  # no ray of these heads is flatter
    assert np.all(off <= slope * np.abs(new.x_m[:, 2] - true[:, 2]) + 1e-6)


def between_heads(found):
    """The rotation from the second head to the first, of exact heads the identity, radians."""
    one, two = found.calibration.cameras[:2]
    true = heads()
    return log((true[0].T_b_c.R.T @ true[1].T_b_c.R).T @ one.T_b_c.R.T @ two.T_b_c.R)


def sigma_between_heads(found):
    """Its standard deviation about the second head's axes, a priori."""
    mount = found.calibration.layout.mount
    one, two = found.calibration.cameras[:2]
    J = np.zeros((3, found.calibration.n_columns))
    J[:, mount[1, 3:]] = np.eye(3)
    J[:, mount[0, 3:]] = -(two.T_b_c.R.T @ one.T_b_c.R)
    return J @ found.calibration.cov @ J.T


def test_points_of_one_exposure_tell_how_the_heads_are_turned_to_each_other():
    block = simulated(ties=60)
    with_points, without = (
        rig.calibrate(split(block, shared=shared), Model()) for shared in (True, False)
    )
    before, after = (np.sqrt(np.diag(sigma_between_heads(f))) for f in (without, with_points))
    assert np.all(after < 0.7 * before)
    assert with_points.bundle.network.left_out == {}
    # whatever the ground does between its points, exact heads come back within their sigma
    assert np.all(np.abs(between_heads(with_points)) < after)


def no_control(rng):
    """Every second point at one exposure only, no control, rough positions, attitudes far off."""
    block = blocks.noisy(simulated(ties=300), rng)
    n = len(block.points)
    ties = np.setdiff1d(np.arange(n), block.control.point_idx)
    block = split(block, shared=True, whole=ties[::2])
    points = block.image_points
    kept = ~np.isin(points.point_idx, block.control.point_idx)
    exact, exposures = block.trajectory.T_m_b, len(block.trajectory)
    off = np.radians(rng.normal(0, [3, 3, 6], (exposures, 3)))
    off[0] = np.radians([5, -5, 10])
    return replace(
        block,
        image_points=points[kept],
        control=block.control[:0],
        trajectory=replace(
            block.trajectory,
            T_m_b=Pose(
                R=exact.R @ rotation_from_opk(off), r=exact.r + rng.normal(0, 2, (exposures, 3))
            ),
            sigma_position=np.full((exposures, 3), 2.0),
            sigma_attitude=np.tile(np.radians([3.0, 3.0, 6.0]), (exposures, 1)),
        ),
    )


def test_heads_without_control_under_attitudes_ten_degrees_off_tell_how_they_are_turned():
    block = no_control(np.random.default_rng(1))
    lonely = rig.one_exposure_points(block)
    assert len(lonely) > 50
    found = rig.calibrate(block, Model(free=("k1",), fix=("lever_arm",)))
    used = np.unique(found.bundle.network.image_points.point_idx)
    assert not np.isin(lonely, used).any()  # their heights would count as observed
    assert 0.8 < found.bundle.solution.sigma0_sq < 1.25
    error = between_heads(found)
    assert error @ np.linalg.solve(sigma_between_heads(found), error) < 16.3  # 99.9 % of 3


def test_a_lever_arm_that_fix_names_is_held_where_something_stays_open():
    block = no_control(np.random.default_rng(2))
    free = rig.calibrate(block, Model(free=("k1",))).calibration
    assert any("lever_z" in line for line in not_determined(free))
    held = rig.calibrate(block, Model(free=("k1",), fix=("lever_arm",))).calibration
    assert not_determined(held) == []
    assert_allclose(mountings(held.cameras).r, mountings(block.cameras).r)


@pytest.mark.slow
def test_what_points_of_one_exposure_tell_is_as_good_as_it_says():
    """Noise and relief drawn anew every time; 60 degrees of freedom at 99 %."""
    found = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        exact = blocks.simulate(
            blocks.fly(),
            cameras=heads(),
            control=blocks.crosses(),
            ties=blocks.terrain(60, seed=seed),
        )
        one = rig.calibrate(split(blocks.noisy(exact, rng), shared=True), Model())
        error = between_heads(one)
        found.append((error @ np.linalg.solve(sigma_between_heads(one), error), 3))
    flights.assert_errors_fit(found)


# --- simulated flights -----------------------------------------------------------------------


def true_values(truth, estimates):
    return np.array([truth["cameras"][c][p] for c, p in map(str.split, estimates.names)])


@pytest.mark.slow
def test_rigs_of_simulated_flights_are_as_good_as_they_say():
    """All 48 parameters jointly, by a simulator that shares nothing with the estimator."""
    found = []
    for seed in SEEDS:
        one = flown(seed)
        estimates = flights.of_calibration(
            rig.calibrate(one.flight.heads, Model(free=one.flight.estimate_heads)).calibration
        )
        assert len(estimates.values) == 48
        errors = estimates.values - true_values(one.truth, estimates)
        flights.assert_within_4_sigma(errors, estimates)
        found.append(flights.chi_square(errors, estimates.cov))
    flights.assert_errors_fit(found)
