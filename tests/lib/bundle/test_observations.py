"""What positions and attitudes are off in common: a shift, drifts along strips, a delay."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from acx4lib.bundle import adjust
from acx4lib.bundle.observations import (
    DECLARED,
    Strips,
    declared,
    position_errors,
    shared_errors,
    slow_errors,
    strips_of,
    velocities,
)
from acx4lib.bundle.unknowns import layout
from acx4lib.errors import AdjustmentError
from acx4lib.geometry.frames import Pose, exp, transform
from acx4lib.geometry.parameters import MOUNT, Prior
from acx4lib.least_squares.covariance import GaussMarkov
from acx4lib.model import Model
from support import blocks
from support.helpers import numeric_jacobian


@pytest.fixture(scope="module")
def block():
    """Twelve exposures in three strips of four, 3 s apart, with 60 s to turn."""
    found = blocks.in_strips(blocks.standard(), 4)
    time = np.arange(12) * 3.0 + np.repeat([0.0, 60.0, 120.0], 4)
    return replace(found, trajectory=replace(found.trajectory, time_s=time))


def test_positions_are_off_by_the_shift_and_what_the_drift_has_added_up():
    net = adjust.mounted_orientation(blocks.standard(), Model())
    strips = Strips(names=("A", "B"), idx=np.array([0, 1, -1]), elapsed=np.array([2.0, -3.0, 0.0]))
    drift = np.array([[0.1, 0.0, 0.0], [0.0, 0.2, 0.01]])
    found = position_errors(
        replace(net.observed, strips=strips),
        replace(net.start, shift=np.array([1.0, 2.0, 3.0]), drift=drift),
    )
    assert_allclose(found, [[1.2, 2.0, 3.0], [1.0, 1.4, 2.97], [1.0, 2.0, 3.0]], atol=1e-15)


def test_observed_positions_are_the_true_ones_and_their_errors(block):
    """At the truth, positions shifted and drifting along the grid's axes leave no residual."""
    net = adjust.mounted_orientation(block, Model(gnss=("shift", "drift")))
    shift, drift = np.array([0.3, -0.2, 0.1]), 0.01 * np.arange(9).reshape(3, 3)
    by = position_errors(net.observed, replace(net.start, shift=shift, drift=drift))
    off = adjust.mounted_orientation(
        blocks.changed(block, "gnss", by), Model(gnss=("shift", "drift"))
    )
    truth = replace(off.start, T_m_b=net.start.T_m_b, shift=shift, drift=drift)
    v, _ = off.residuals(truth)[2]
    assert_allclose(v, 0.0, atol=1e-9)  # m, of coordinates of 1e3


# --- delays ----------------------------------------------------------------------------------


ERRORS = ("delay", "deviation")


@pytest.fixture(scope="module")
def straight():
    """Four straight strips of three exposures, about 4 s apart."""
    return blocks.in_strips(blocks.standard(), 3)


def test_what_is_recorded_late_is_the_position_of_a_later_time(straight):
    """At the truth, positions of 20 ms later leave no residual."""
    net = adjust.mounted_orientation(straight, Model(gnss=("delay",)))
    T, R_m_g = net.start.T_m_b, np.swapaxes(straight.trajectory.R_g_m, -1, -2)
    late = Pose(R=T.R, r=T.r + transform(R_m_g, 0.02 * net.observed.velocity))
    truth = replace(net.start, delay=np.array([0.02]))
    observed = replace(net.observed, T_m_b=late)
    for v, _ in replace(net, observed=observed).residuals(truth)[2:4]:
        assert_allclose(v, 0.0, atol=1e-9)


@pytest.mark.parametrize("errors", [ERRORS[:1], ERRORS, ERRORS[1:]])
def test_derivatives_by_errors_of_the_trajectory_and_poses_agree_with_differences(
    straight, rng, errors
):
    net = adjust.mounted_orientation(straight, Model(fix=("lever_arm", "boresight"), gnss=errors))
    turned = exp(rng.normal(0, 0.02, (12, 3)))
    T = Pose(R=net.start.T_m_b.R @ turned, r=net.start.T_m_b.r + rng.normal(0, 1, (12, 3)))
    state = replace(net.start, T_m_b=T, delay=np.array([0.3]))
    state = replace(state, deviation=np.array([0.1, -0.2]))

    def equations(step):
        moved = net.moved(state, step, np.zeros_like(state.x_m))
        return net.equations(moved)[2:4]

    step = np.zeros(net.n_columns)
    for k, e in enumerate(equations(step)):
        J = np.zeros((*e.v.shape, net.n_columns))
        np.put_along_axis(J, np.broadcast_to(e.columns[:, None], e.A.shape), e.A, axis=2)
        found = numeric_jacobian(lambda x, k=k: equations(x)[k].v.ravel(), step)
        assert_allclose(found, J.reshape(found.shape), atol=1e-6 * np.abs(J).max())


# --- errors that change slowly ---------------------------------------------------------------


def slow(block, share=0.9):
    process = GaussMarkov(share=share, time_constant_s=60.0)
    return replace(block, trajectory=replace(block.trajectory, slow_positions=process))


def test_the_slow_part_has_its_share_of_sigma_and_runs_on_through_turns(block):
    found = slow_errors(slow(block).trajectory, "position")
    assert_allclose(found.sigma, 0.9 * block.trajectory.sigma_position)
    assert found.together[0, 1] == pytest.approx(np.exp(-3 / 60))
    assert found.together[3, 4] == pytest.approx(np.exp(-63 / 60))
    assert slow_errors(slow(block).trajectory, "attitude") is None


def test_correlated_errors_need_times(block):
    timeless = replace(slow(block).trajectory, time_s=np.full(1, np.nan))
    with pytest.raises(AdjustmentError, match="errors of positions need times"):
        slow_errors(timeless, "position")


def test_what_takes_no_part_is_linked_to_nothing(block):
    trajectory = slow(block).trajectory
    sigma = trajectory.sigma_position.copy()
    sigma[5] = np.inf
    trajectory = replace(trajectory, sigma_position=sigma)
    net = adjust.mounted_orientation(replace(block, trajectory=trajectory), Model())
    linked = net.observed.linked
    assert linked[linked[:, 0] == 5].tolist() == [[5, 5]]
    assert [4, 6] in linked.tolist()


# --- Strips of a block, and how its body moves along them


@pytest.fixture(scope="module")
def strips_block():
    """Twelve exposures in three strips of four."""
    return blocks.in_strips(blocks.standard(), 4)


def with_strips(block, names, time_s):
    return replace(
        block,
        images=replace(block.images, strips=tuple(names)),
        trajectory=replace(block.trajectory, time_s=np.asarray(time_s, dtype=float)),
    )


def test_time_is_counted_from_the_middle_of_each_strip(strips_block):
    times = [10.0, 12.0, 20.0, 30.0, *range(100, 108)]
    found = strips_of(with_strips(strips_block, "AAAABBBBBBBB", times))
    assert found.names == ("A", "B")
    assert found.unit == "s"
    assert found.idx.tolist() == [0] * 4 + [1] * 8
    assert_allclose(found.elapsed[:4], [-8.0, -6.0, 2.0, 12.0], atol=1e-12)
    assert_allclose(found.elapsed[4:], np.arange(8) - 3.5, atol=1e-12)


def test_without_times_the_order_in_the_strip_counts(strips_block):
    found = strips_of(with_strips(strips_block, "ABABABABAAAA", np.full(12, np.nan)))
    assert found.unit == "exposure"
    assert_allclose(found.elapsed[[1, 3, 5, 7]], [-1.5, -0.5, 0.5, 1.5], atol=1e-12)
    assert_allclose(found.elapsed[[0, 2, 4, 6, 8, 9, 10, 11]], np.arange(8) - 3.5, atol=1e-12)


def test_an_exposure_alone_or_in_no_strip_does_not_drift(strips_block):
    times = np.array([*range(10), 20.0, 20.0])  # the last strip has one time only
    found = strips_of(with_strips(strips_block, [*"AAAB", *([""] * 6), *"CC"], times))
    assert found.names == ("A",)
    assert found.idx.tolist() == [0] * 3 + [-1] * 9
    assert_allclose(found.elapsed[3:], 0.0, atol=0)


def test_a_block_without_strips_cannot_drift():
    with pytest.raises(AdjustmentError, match=r"images\.csv needs its column strip"):
        adjust.mounted_orientation(blocks.standard(), Model(gnss=("drift",)))


# --- motion ----------------------------------------------------------------------------------


def moving(block, r, R):
    """The block along another path; its strips are those that it has."""
    trajectory = replace(block.trajectory, T_m_b=Pose(R=R, r=r))
    return replace(block, trajectory=trajectory)


def test_a_steady_flight_comes_out_exactly(strips_block):
    """At unequal intervals, along the grid's axes."""
    time = np.cumsum([0.0, 2.0, 3.0, 1.0, 240.0, 1.0, 2.0, 2.5, 200.0, 4.0, 3.0, 2.0])
    velocity, R = np.array([50.0, -30.0, 1.0]), strips_block.trajectory.T_m_b.R
    timed = with_strips(strips_block, "AAAABBBBCCCC", time)
    found = velocities(moving(timed, time[:, None] * velocity, R))
    along_grid = transform(strips_block.trajectory.R_g_m, np.tile(velocity, (12, 1)))
    assert_allclose(found, along_grid, atol=1e-10)


def test_the_velocity_of_a_strip_is_the_slope_of_its_line():
    """Numpy's line through positions that gusts have moved; neighbours would differ by metres/s."""
    block = blocks.in_strips(blocks.simulate(blocks.fly(per_strip=4)), 4)
    r = block.trajectory.T_m_b.r + np.random.default_rng(3).normal(0, 8, (16, 3))
    block = moving(block, r, block.trajectory.T_m_b.R)
    found = velocities(block)
    for rows in np.arange(16).reshape(4, 4):
        line = np.polyfit(block.trajectory.time_s[rows] - 1e5, r[rows], 1)[0]
        expected = transform(block.trajectory.R_g_m[rows], np.tile(line, (4, 1)))
        assert_allclose(found[rows], expected, atol=1e-8)


def test_a_strip_that_is_not_straight_has_no_velocity():
    """On a circle, as a drone flies around a house."""
    block = blocks.in_strips(blocks.simulate(blocks.fly(per_strip=6)), 6)
    turn = np.linspace(0, 2 * np.pi, 6, endpoint=False)
    r = block.trajectory.T_m_b.r.copy()
    r[6:12, :2] = 100 * np.column_stack([np.cos(turn), np.sin(turn)])
    around = moving(block, r, block.trajectory.T_m_b.R)
    with pytest.raises(AdjustmentError, match="strip 'B' is not flown straight at one speed"):
        velocities(around)


@pytest.mark.parametrize(
    ("strips", "time_s", "says"),
    [
        ("A" * 12, np.full(12, np.nan), "needs its column time_s"),
        ("A" * 11 + "B", np.arange(12.0), "no neighbour in a strip tells the velocity of exposure"),
        ("A" * 12, [0.0, 0.0, *range(2, 12)], "two exposures of strip 'A' have the same time"),
    ],
)
def test_a_delay_needs_times_and_neighbours(strips_block, strips, time_s, says):
    with pytest.raises(AdjustmentError, match=says):
        velocities(with_strips(strips_block, strips, time_s))


# --- Covariances between the poses of a trajectory whose errors change slowly


@pytest.fixture(scope="module")
def trajectory():
    """Positions and attitudes with processes of their own, in strips of four."""
    found = blocks.in_strips(blocks.standard(), 4).trajectory
    return replace(
        found,
        sigma_position=found.sigma_position * np.linspace(1, 2, len(found))[:, None],
        slow_positions=GaussMarkov(share=0.9, time_constant_s=20.0),
        slow_attitudes=GaussMarkov(share=0.6, time_constant_s=5.0),
    )


def test_two_exposures_have_the_covariance_of_the_process_along_the_axes_of_their_sigma(trajectory):
    found = shared_errors(trajectory)
    apart = abs(trajectory.time_s[3] - trajectory.time_s[7])
    (cov,) = found.between(np.array([3]), np.array([7]))
    grid = trajectory.R_g_m[3] @ cov[:3, :3] @ trajectory.R_g_m[7].T
    sigma = trajectory.sigma_position[3] * trajectory.sigma_position[7]
    assert_allclose(grid, np.diag(0.81 * np.exp(-apart / 20) * sigma), atol=1e-15)
    sigma = trajectory.sigma_attitude[3] * trajectory.sigma_attitude[7]
    assert_allclose(cov[3:, 3:], np.diag(0.36 * np.exp(-apart / 5) * sigma), atol=1e-20)
    assert not cov[:3, 3:].any()


def test_an_exposure_with_itself_is_left_to_the_trajectory(trajectory):
    every = np.arange(len(trajectory))
    assert not shared_errors(trajectory).between(every, every).any()


def test_what_quantities_share_is_the_sum_over_all_pairs_of_exposures(trajectory, rng):
    found, n = shared_errors(trajectory), len(trajectory)
    J = rng.normal(size=(n, 4, 6))
    cov = sum(
        J[i] @ found.between(np.array([i]), np.array([j]))[0] @ J[j].T
        for i in range(n)
        for j in range(n)
    )
    assert_allclose(found.among(J), cov, rtol=1e-12)


def test_all_errors_together_have_a_covariance_that_can_be_had(trajectory):
    """Own and shared blocks together are positive definite."""
    n = len(trajectory)
    whole = shared_errors(trajectory).among(np.eye(6 * n).reshape(6 * n, n, 6).swapaxes(0, 1))
    for i, own in enumerate(trajectory.cov):
        whole[6 * i : 6 * i + 6, 6 * i : 6 * i + 6] += own
    size = np.sqrt(np.diag(whole))
    assert np.linalg.eigvalsh(whole / size / size[:, None]).min() > 0


def test_chosen_exposures_share_what_they_share_among_all(trajectory):
    rows = np.array([1, 4, 9])
    one, other = np.array([0, 2]), np.array([1, 0])
    chosen = shared_errors(trajectory, rows).between(one, other)
    assert_allclose(chosen, shared_errors(trajectory).between(rows[one], rows[other]), rtol=1e-15)


def test_white_errors_share_nothing_and_slow_ones_need_times(trajectory):
    white = replace(trajectory, slow_positions=GaussMarkov(), slow_attitudes=GaussMarkov())
    assert shared_errors(white) is None
    with pytest.raises(AdjustmentError, match="errors of positions need times"):
        shared_errors(replace(trajectory, time_s=np.full(1, np.nan)))


# --- Declared mountings as observations


def test_what_is_declared_is_observed_where_it_has_sigma_and_is_estimated():
    sigma = (0.02, 0.02, 0.03, 1e-3, 1e-3, 2e-3)
    prior = Prior(declared=(True,) * 6, sigma=sigma, interior=(0.01, np.inf, np.inf))
    cameras = (blocks.CAMERA, replace(blocks.CAMERA, prior=prior))
    all_free = layout(2, 0, free=("f", "xp"), free_mount=MOUNT)
    found = {kind: declared(cameras, kind, all_free) for kind in DECLARED}
    assert {kind: where.tolist() for kind, (_, _, where) in found.items()} == {
        "lever_arm": [[10, 11, 12]],
        "boresight": [[13, 14, 15]],
        "interior": [[8, 9, -1]],
    }
    assert_array_equal(found["interior"][1], [[0.01, np.inf, np.inf]])
    lever_only = layout(2, 0, free=(), free_mount=MOUNT[:3])
    seen = {kind: declared(cameras, kind, lever_only)[0].tolist() for kind in DECLARED}
    assert seen == {"lever_arm": [1], "boresight": [], "interior": []}


def test_residuals_of_a_mounting_are_along_and_about_the_bodys_axes(rng):
    """Their derivatives agree with differences, far from the declared mounting, too."""
    sigma = (0.02, 0.02, 0.03, 1e-3, 1e-3, 2e-3)
    turned = Pose(R=blocks.CAMERA.T_b_c.R @ exp(np.array([0.0, 0.0, 1.4])), r=np.zeros(3))
    camera = replace(blocks.CAMERA, T_b_c=turned, prior=Prior(declared=(True,) * 6, sigma=sigma))
    about_body = np.radians([0.4, -0.3, 2.0])
    R, off = exp(about_body) @ turned.R, np.array([0.1, -0.2, 0.3])

    block = replace(blocks.standard(), cameras=(camera,))
    net = adjust.mounted_orientation(block, Model())

    def v(step):
        T = Pose(R=(R @ exp(step[3:]))[None], r=(off + step[:3])[None])
        lever, boresight = net.besides_rays(replace(net.start, T_b_c=T))[-2:]
        return np.concatenate([lever.v[0], boresight.v[0]]), (lever, boresight)

    value, (lever, boresight) = v(np.zeros(6))
    assert_allclose(value, np.concatenate([off, about_body]), atol=1e-12)
    J = np.zeros((6, 6))
    J[:3, :3], J[3:, 3:] = lever.A[0], boresight.A[0]
    assert_allclose(numeric_jacobian(lambda x: v(x)[0], np.zeros(6)), J, atol=1e-7)
