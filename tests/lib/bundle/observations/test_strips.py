"""Strips of a block, and how its body moves along them."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.bundle import uses
from acx4lib.bundle.observations.strips import motion_of, strips_of
from acx4lib.errors import AdjustmentError
from acx4lib.geometry.frames import Pose, exp, transform
from support import blocks


@pytest.fixture(scope="module")
def block():
    """Twelve exposures in three strips of four."""
    return blocks.in_strips(blocks.standard(), 4)


def with_strips(block, names, time_s):
    return replace(
        block,
        images=replace(block.images, strips=tuple(names)),
        trajectory=replace(block.trajectory, time_s=np.asarray(time_s, dtype=float)),
    )


def test_time_is_counted_from_the_middle_of_each_strip(block):
    times = [10.0, 12.0, 20.0, 30.0, *range(100, 108)]
    found = strips_of(with_strips(block, "AAAABBBBBBBB", times))
    assert found.names == ("A", "B")
    assert found.unit == "s"
    assert found.idx.tolist() == [0] * 4 + [1] * 8
    assert_allclose(found.elapsed[:4], [-8.0, -6.0, 2.0, 12.0], atol=1e-12)
    assert_allclose(found.elapsed[4:], np.arange(8) - 3.5, atol=1e-12)


def test_without_times_the_order_in_the_strip_counts(block):
    found = strips_of(with_strips(block, "ABABABABAAAA", np.full(12, np.nan)))
    assert found.unit == "exposure"
    assert_allclose(found.elapsed[[1, 3, 5, 7]], [-1.5, -0.5, 0.5, 1.5], atol=1e-12)
    assert_allclose(found.elapsed[[0, 2, 4, 6, 8, 9, 10, 11]], np.arange(8) - 3.5, atol=1e-12)


def test_an_exposure_alone_or_in_no_strip_does_not_drift(block):
    times = np.array([*range(10), 20.0, 20.0])  # the last strip has one time only
    found = strips_of(with_strips(block, [*"AAAB", *([""] * 6), *"CC"], times))
    assert found.names == ("A",)
    assert found.idx.tolist() == [0] * 3 + [-1] * 9
    assert_allclose(found.elapsed[3:], 0.0, atol=0)


def test_a_block_without_strips_cannot_drift():
    with pytest.raises(AdjustmentError, match=r"images\.csv needs its column strip"):
        uses.mounted_orientation(blocks.standard(), free=(), gnss=("drift",))


# --- motion ----------------------------------------------------------------------------------


def moving(block, r, R):
    """The block along another path; its strips are those that it has."""
    trajectory = replace(block.trajectory, T_m_b=Pose(R=R, r=r))
    return replace(block, trajectory=trajectory)


def test_a_steady_flight_and_a_steady_turn_come_out_exactly(block):
    """At unequal intervals, along the grid's axes and about the body's."""
    time = np.cumsum([0.0, 2.0, 3.0, 1.0, 240.0, 1.0, 2.0, 2.5, 200.0, 4.0, 3.0, 2.0])
    velocity, rate = np.array([50.0, -30.0, 1.0]), np.array([0.01, -0.02, 0.03])
    R_0 = exp(np.array([0.1, -0.2, 1.3]))
    timed = with_strips(block, "AAAABBBBCCCC", time)
    found = motion_of(moving(timed, time[:, None] * velocity, R_0 @ exp(time[:, None] * rate)))
    along_grid = transform(block.trajectory.R_g_m, np.tile(velocity, (12, 1)))
    assert_allclose(found.velocity, along_grid, atol=1e-10)
    assert_allclose(found.rate, np.tile(rate, (12, 1)), atol=1e-12)


def test_the_velocity_of_a_strip_is_the_slope_of_its_line():
    """Numpy's line through positions that gusts have moved; neighbours would differ by metres/s."""
    block = blocks.in_strips(blocks.simulate(blocks.fly(per_strip=4)), 4)
    r = block.trajectory.T_m_b.r + np.random.default_rng(3).normal(0, 8, (16, 3))
    block = moving(block, r, block.trajectory.T_m_b.R)
    found = motion_of(block).velocity
    for rows in np.arange(16).reshape(4, 4):
        line = np.polyfit(block.trajectory.time_s[rows] - 1e5, r[rows], 1)[0]
        expected = transform(block.trajectory.R_g_m[rows], np.tile(line, (4, 1)))
        assert_allclose(found[rows], expected, atol=1e-8)


def test_a_strip_that_is_not_straight_has_no_velocity():
    """On a circle, as a drone flies around a house; its attitudes have their rates all the same."""
    block = blocks.in_strips(blocks.simulate(blocks.fly(per_strip=6)), 6)
    turn = np.linspace(0, 2 * np.pi, 6, endpoint=False)
    r = block.trajectory.T_m_b.r.copy()
    r[6:12, :2] = 100 * np.column_stack([np.cos(turn), np.sin(turn)])
    around = moving(block, r, block.trajectory.T_m_b.R)
    with pytest.raises(AdjustmentError, match="strip 'B' is not flown straight at one speed"):
        motion_of(around, delays=("delay",))
    assert np.any(motion_of(around, delays=("attitude_delay",)).rate)


@pytest.mark.parametrize("samples", [4, 10])
def test_of_an_oscillation_the_share_that_its_sampling_shows_is_seen(block, samples):
    """sin(a) / a of its rate, a the phase between neighbours."""
    a = 2 * np.pi / samples
    roll = 1e-4 * np.sin(a * np.arange(12))
    R = exp(roll[:, None] * np.array([1.0, 0.0, 0.0]))
    timed = with_strips(block, "A" * 12, np.arange(12.0))
    still = moving(timed, np.zeros((12, 3)), R)
    found = motion_of(still, delays=("attitude_delay",)).rate[1:-1, 0]
    true = 1e-4 * a * np.cos(a * np.arange(12))[1:-1]
    assert_allclose(found, np.sin(a) / a * true, atol=1e-12)


@pytest.mark.parametrize(
    ("strips", "time_s", "says"),
    [
        ("A" * 12, np.full(12, np.nan), "needs its column time_s"),
        ("A" * 11 + "B", np.arange(12.0), "no neighbour in a strip tells the velocity of exposure"),
        ("A" * 12, [0.0, 0.0, *range(2, 12)], "has the time of another of its strip"),
    ],
)
def test_a_delay_needs_times_and_neighbours(block, strips, time_s, says):
    with pytest.raises(AdjustmentError, match=says):
        motion_of(with_strips(block, strips, time_s))
