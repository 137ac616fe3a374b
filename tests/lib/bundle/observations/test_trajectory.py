"""What positions and attitudes are off in common: a shift, drifts along strips, delays."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle import uses
from acx4lib.bundle.observations.strips import Strips
from acx4lib.bundle.observations.trajectory import position_errors, slow_errors
from acx4lib.errors import AdjustmentError
from acx4lib.geometry.frames import Pose, exp, transform
from acx4lib.least_squares.statistical.gauss_markov import GaussMarkov
from support import blocks
from support.helpers import numeric_jacobian


@pytest.fixture(scope="module")
def block():
    """Twelve exposures in three strips of four, 3 s apart, with 60 s to turn."""
    found = blocks.in_strips(blocks.standard(), 4)
    time = np.arange(12) * 3.0 + np.repeat([0.0, 60.0, 120.0], 4)
    return replace(found, trajectory=replace(found.trajectory, time_s=time))


def test_positions_are_off_by_the_shift_and_what_the_drift_has_added_up():
    net = uses.mounted_orientation(blocks.standard(), free=())
    strips = Strips(names=("A", "B"), idx=np.array([0, 1, -1]), elapsed=np.array([2.0, -3.0, 0.0]))
    drift = np.array([[0.1, 0.0, 0.0], [0.0, 0.2, 0.01]])
    found = position_errors(
        replace(net.observed, strips=strips),
        replace(net.start, shift=np.array([1.0, 2.0, 3.0]), drift=drift),
    )
    assert_allclose(found, [[1.2, 2.0, 3.0], [1.0, 1.4, 2.97], [1.0, 2.0, 3.0]], atol=1e-15)


def test_observed_positions_are_the_true_ones_and_their_errors(block):
    """At the truth, positions shifted and drifting along the grid's axes leave no residual."""
    net = uses.mounted_orientation(block, free=(), gnss=("shift", "drift"))
    shift, drift = np.array([0.3, -0.2, 0.1]), 0.01 * np.arange(9).reshape(3, 3)
    by = position_errors(net.observed, replace(net.start, shift=shift, drift=drift))
    off = uses.mounted_orientation(
        blocks.changed(block, "gnss", by), free=(), gnss=("shift", "drift")
    )
    truth = replace(off.start, T_m_b=net.start.T_m_b, shift=shift, drift=drift)
    v, _ = off.residuals(truth)[2]
    assert_allclose(v, 0.0, atol=1e-9)  # m, of coordinates of 1e3


# --- delays ----------------------------------------------------------------------------------


DELAYED = ("delay", "attitude_delay")


@pytest.fixture(scope="module")
def straight():
    """Four straight strips of three exposures, about 4 s apart."""
    return blocks.in_strips(blocks.standard(), 3)


def test_what_is_recorded_late_is_the_pose_of_a_later_time(straight):
    """At the truth, positions and attitudes of 20 ms later leave no residual."""
    net = uses.mounted_orientation(straight, free=(), gnss=DELAYED)
    motion, T = net.observed.motion, net.start.T_m_b
    R_m_g = np.swapaxes(straight.trajectory.R_g_m, -1, -2)
    late = Pose(R=T.R @ exp(0.02 * motion.rate), r=T.r + transform(R_m_g, 0.02 * motion.velocity))
    truth = replace(net.start, delay=np.array([0.02, 0.02]))
    observed = replace(net.observed, T_m_b=late)
    for v, _ in replace(net, observed=observed).residuals(truth)[2:4]:
        assert_allclose(v, 0.0, atol=1e-9)


def test_derivatives_by_delays_and_poses_agree_with_differences(straight, rng):
    net = uses.mounted_orientation(straight, free=(), free_mount=(), gnss=DELAYED)
    turned = exp(rng.normal(0, 0.02, (12, 3)))
    motion = replace(net.observed.motion, rate=rng.normal(0, 0.3, (12, 3)))
    net = replace(net, observed=replace(net.observed, motion=motion))
    T = Pose(R=net.start.T_m_b.R @ turned, r=net.start.T_m_b.r + rng.normal(0, 1, (12, 3)))
    state = replace(net.start, T_m_b=T, delay=np.array([0.3, -0.4]))

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
    net = uses.mounted_orientation(replace(block, trajectory=trajectory), free=())
    linked = net.observed.linked
    assert linked[linked[:, 0] == 5].tolist() == [[5, 5]]
    assert [4, 6] in linked.tolist()
