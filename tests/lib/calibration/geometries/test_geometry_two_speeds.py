"""Strips at two ground speeds tell a delay from the lever arm; at one speed nothing does."""

from dataclasses import replace

import numpy as np
import pytest

import acx4sim
from acx4files.flight import reader
from acx4files.results import sentences
from acx4lib.bundle.adjust import adjust, mounted_orientation
from acx4lib.calibration import mounting, trajectory_errors
from acx4lib.calibration.estimates import features
from acx4lib.model import Model
from acx4sim.files import simulate_plan
from support import blocks

DELAY_S = 0.02
TIES = {"calibration": 100}
N_FLIGHTS = 6


def flown(folder, seed, speeds_m_s, **options):
    """The calibration block of the paper's design, with strips at these speeds in turn."""
    options = acx4sim.Options(tie_points=TIES, blocks=("calibration",), **options)
    plan = acx4sim.DESIGNS["acx4-ideal"](seed=seed, options=options).plan
    block = plan.blocks["calibration"]
    strips = tuple(
        replace(strip, speed_m_s=speeds_m_s[k % len(speeds_m_s)])
        for k, strip in enumerate(block.strips)
    )
    plan = replace(plan, blocks=plan.blocks | {"calibration": replace(block, strips=strips)})
    acx4sim.write(simulate_plan(plan, seed=seed, options=options), folder / "flight")
    return reader.read(folder / "flight")


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """A delay of 20 ms, estimated of flights at 55 and 85 m/s."""
    out = []
    for seed in range(1, N_FLIGHTS + 1):
        folder = tmp_path_factory.mktemp("two_speeds")
        flight = flown(folder, seed, (55.0, 85.0), gnss_delay_s=DELAY_S)
        block, free = flight.blocks["calibration"], flight.estimate_mounting
        out.append(mounting.single_step(block, Model(free=free, gnss=("delay",))).bundle)
    return out


def test_delays_of_20_ms_come_out_within_their_sigma(found):
    """The chi-square of 6 normalised errors, 99 % two-sided; each sigma far below the delay."""
    listed = [p for bundle in found for p in trajectory_errors.parameters(bundle)]
    assert [p.name for p in listed] == ["gnss_delay_s"] * N_FLIGHTS
    total = sum(((p.value - DELAY_S) / p.sigma) ** 2 for p in listed)
    assert 0.68 < total < 18.5
    assert all(p.sigma < 0.1 * DELAY_S for p in listed)


def test_a_delay_is_said_in_words(found):
    (position,) = trajectory_errors.parameters(found[0])
    lines = sentences.on_trajectory(found[0])
    value, sigma = 1000 * position.value, 1000 * position.sigma
    assert lines[0] == f"GNSS positions are recorded {value:.1f} ± {sigma:.1f} ms late"
    assert lines[1].startswith("the delay is this block's own")
    assert sentences.trajectory_not_determined(found[0]) == []


def test_a_negative_delay_is_early(tmp_path):
    flight = flown(tmp_path, 1, (55.0, 85.0), gnss_delay_s=-DELAY_S)
    block, free = flight.blocks["calibration"], flight.estimate_mounting
    bundle = mounting.single_step(block, Model(free=free, gnss=("delay",))).bundle
    assert sentences.on_trajectory(bundle)[0].endswith(" ms early")


def test_different_speeds_are_a_feature_of_a_flight(found):
    assert "speeds" in features(found[0].network.block)


# --- one speed -------------------------------------------------------------------------------


def steady(strips, seconds):
    """Strips of three exposures, 220 m apart, in level flight; seconds between exposures."""
    block = blocks.simulate(
        blocks.fly(strips, tilt_deg=0.0),
        ties=blocks.terrain(150, half_m=450.0),
        control=blocks.crosses(),
    )
    block = blocks.in_strips(block, 3)
    time = np.concatenate([300.0 * k + s * np.arange(3) for k, s in enumerate(seconds)])
    return replace(block, trajectory=replace(block.trajectory, time_s=time))


BOTH_WAYS = ((1000.0, 0.0, 0.0), (1300.0, 0.0, 180.0), (1000.0, 0.0, 180.0), (1300.0, 0.0, 0.0))


def test_at_one_speed_a_delay_and_the_lever_arm_are_one_unknown():
    block = steady(BOTH_WAYS, (4.0,) * 4)
    bundle = adjust(mounted_orientation(block, Model(free=("f",), gnss=("delay",))))
    (line,) = sentences.trajectory_not_determined(bundle)
    assert line.startswith("gnss_delay_s is not determined")
    assert "strips flown at different speeds, or the lever arm held" in line
    held = adjust(
        mounted_orientation(block, Model(free=("f",), fix=("lever_arm",), gnss=("delay",)))
    )
    assert sentences.trajectory_not_determined(held) == []
    slower = steady(BOTH_WAYS, (4.0, 4.0, 6.0, 6.0))
    fast_and_slow = adjust(mounted_orientation(slower, Model(free=("f",), gnss=("delay",))))
    assert sentences.trajectory_not_determined(fast_and_slow) == []


def test_one_strip_does_not_tell_shift_delay_and_lever_arm_apart():
    block = steady(((1000.0, 0.0, 0.0), (1300.0, 0.0, 0.0)), (4.0, 4.0))
    gnss = ("shift", "drift", "delay")
    lines = sentences.trajectory_not_determined(
        adjust(mounted_orientation(block, Model(free=("f",), gnss=gnss)))
    )
    said = {line.split()[0] for line in lines}
    assert {"gnss_shift_east_m", "gnss_shift_north_m", "gnss_delay_s"} <= said
    (delay,) = [line for line in lines if line.startswith("gnss_delay_s")]
    assert "different speeds" in delay
