"""One flying height, in two directions or in one; one ground speed or two."""

from dataclasses import replace

import numpy as np
import pytest

import acx4sim
from acx4lib.bundle.adjust import adjust, mounted_orientation
from acx4lib.calibration import mounting, trajectory_errors
from acx4lib.calibration.determination import weakest_combination
from acx4lib.calibration.estimates import features, not_determined, parameters
from acx4lib.flight import reader
from acx4sim.files import simulate_plan
from support import blocks

# --- one flying height over flat ground: a lever arm looks like a change of f, xp and yp -----


ONE_HEIGHT = ((1000.0, -150.0, 0.0), (1000.0, 150.0, 180.0))
TWO_HEIGHTS = (*ONE_HEIGHT, (1500.0, -80.0, 0.0), (1500.0, 80.0, 180.0))


def flown(strips):
    """Flat ground, opposite directions, nine control points."""
    return blocks.simulate(
        blocks.fly(strips, per_strip=4),
        ties=blocks.terrain(40, relief_m=5.0),
        control=blocks.crosses() * [1, 1, 0] + [0, 0, blocks.GROUND_M],
    )


def calibrated(strips, *, free=("f", "xp", "yp"), fix=()):
    """A posteriori sigmas need noise of the stated size."""
    block = blocks.noisy(flown(strips), np.random.default_rng(1))
    return mounting.single_step(block, free=free, fix=fix).calibration


def named(lines):
    return {line.split()[1] for line in lines}


@pytest.fixture(scope="module")
def lines():
    return not_determined(calibrated(ONE_HEIGHT))


def test_focal_length_and_lever_arm_are_not_determined(lines):
    assert {"f_mm", "lever_z_m", "lever_x_m", "lever_y_m"} <= named(lines)
    assert not any("boresight" in name for name in named(lines))


def test_each_names_its_twin(lines):
    line_of = {line.split()[1]: line for line in lines}
    assert "+1.00 with lever_z_m" in line_of["f_mm"]
    assert "+1.00 with f_mm" in line_of["lever_z_m"]
    assert "with xp_mm" in line_of["lever_x_m"].split(",")[0]
    assert "with yp_mm" in line_of["lever_y_m"].split(",")[0]


def test_each_asks_for_a_second_height(lines):
    assert all("two flying heights" in line for line in lines)


def test_a_second_height_determines_them():
    assert not_determined(calibrated(TWO_HEIGHTS)) == []


def test_holding_the_lever_arm_determines_the_rest():
    assert not_determined(calibrated(ONE_HEIGHT, fix=("lever_arm",))) == []


def test_holding_f_determines_the_lever_arms_height_and_nothing_else():
    assert named(not_determined(calibrated(ONE_HEIGHT, free=("xp", "yp")))) == {
        "lever_x_m",
        "lever_y_m",
    }


def test_the_second_height_is_worth_a_factor_of_ten():
    """What the paper says in 2.2, in numbers."""
    one, two = (
        {p.key: p.sigma for p in parameters(calibrated(strips))}
        for strips in (ONE_HEIGHT, TWO_HEIGHTS)
    )
    for key in ("f", "lever_x", "lever_y", "lever_z"):
        assert one[key] > 10 * two[key]


def on_control_alone(*, relief_m, hills):
    """A two-step bundle from two heights, over flat or over hilly ground."""
    x_m = blocks.crosses()
    x_m[:, 2] = blocks.GROUND_M + hills * (x_m[:, 2] - blocks.GROUND_M)
    block = blocks.simulate(
        blocks.fly(TWO_HEIGHTS, per_strip=4),
        ties=blocks.terrain(80, relief_m=relief_m),
        control=x_m,
    )
    block = blocks.noisy(block, np.random.default_rng(1))
    return not_determined(mounting.two_step(block, free=("f", "xp", "yp")).calibration)


def test_in_a_bundle_on_control_points_alone_a_second_height_is_not_enough_but_hills_are():
    flat = [line for line in on_control_alone(relief_m=5.0, hills=0) if " f_mm " in line]
    assert "hills or tilted images in a bundle on control points alone" in flat[0]
    assert on_control_alone(relief_m=300.0, hills=8) == []


# --- one flying height in one direction: nothing tells a lever arm from f, xp and yp ---------


ONE_WAY = ((1000.0, -150.0, 0.0), (1000.0, 150.0, 0.0))
SECOND_HEIGHT = (*ONE_WAY, (1500.0, -80.0, 0.0), (1500.0, 80.0, 0.0))
LEVER = {"lever_x_m", "lever_y_m", "lever_z_m"}
INTERIOR = {"f_mm", "xp_mm", "yp_mm"}


def calibrated_one_height_and_direction(strips, *, with_control=False, fix=()):
    """Flat ground: hills would be a second height."""
    flat = blocks.crosses() * [1, 1, 0] + [0, 0, blocks.GROUND_M]
    block = blocks.simulate(
        blocks.fly(strips, per_strip=4),
        ties=blocks.terrain(40, relief_m=5.0),
        control=flat if with_control else None,
    )
    block = blocks.noisy(block, np.random.default_rng(1))
    return mounting.single_step(block, free=("f", "xp", "yp"), fix=fix)


def lines_one_height_and_direction(found):
    return {line.split()[1]: line for line in not_determined(found.calibration)}


@pytest.fixture(scope="module")
def without_control():
    return calibrated_one_height_and_direction(ONE_WAY)


@pytest.fixture(scope="module")
def with_control():
    return calibrated_one_height_and_direction(ONE_WAY, with_control=True)


def test_lever_arm_and_interior_orientation_are_not_determined(without_control):
    assert set(lines_one_height_and_direction(without_control)) == LEVER | INTERIOR


def test_control_points_do_not_make_up_for_a_second_height(with_control):
    assert set(lines_one_height_and_direction(with_control)) == LEVER | INTERIOR


def test_each_asks_for_a_second_height_and_the_lever_arm_for_more(with_control):
    said = lines_one_height_and_direction(with_control)
    assert all("two flying heights" in line for line in said.values())
    for name in LEVER:
        assert "control points" in said[name].split("it would need: ")[1]


def test_f_and_the_lever_arms_height_name_each_other(with_control):
    said = lines_one_height_and_direction(with_control)
    assert "(sigma" in said["f_mm"]
    assert "correlation +1.00 with lever_z_m" in said["f_mm"]
    assert "correlation +1.00 with f_mm" in said["lever_z_m"]


def test_a_second_height_alone_leaves_the_lever_arm_open():
    """Then f, xp and yp are known, and the ground floats with the lever arm."""
    assert (
        set(lines_one_height_and_direction(calibrated_one_height_and_direction(SECOND_HEIGHT)))
        == LEVER
    )


def test_a_second_height_and_control_points_determine_all():
    assert (
        lines_one_height_and_direction(
            calibrated_one_height_and_direction(SECOND_HEIGHT, with_control=True)
        )
        == {}
    )


def test_control_points_and_a_held_lever_arm_determine_the_interior_orientation():
    assert (
        lines_one_height_and_direction(
            calibrated_one_height_and_direction(ONE_WAY, with_control=True, fix=("lever_arm",))
        )
        == {}
    )


def test_the_weakest_combination_is_a_shift_of_the_camera(without_control):
    """Lever arm and principal point go together; no pose takes part."""
    parts = {part.unknown for part in weakest_combination(without_control.bundle)}
    assert parts <= {"CAM/lever_x_m", "CAM/lever_y_m", "CAM/xp_mm", "CAM/yp_mm"}
    assert parts >= {"CAM/lever_x_m", "CAM/xp_mm"}


# --- strips at two ground speeds tell a delay from the lever arm; at one speed nothing does --


DELAY_S = 0.02
TIES = {"calibration": 100}
DELAYS = ("delay", "attitude_delay")
NAMES = ("gnss_delay_s", "attitude_delay_s")
N_FLIGHTS = 6


def flown_two_speeds(folder, seed, speeds_m_s, **options):
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
    """Delays of 20 ms, estimated of flights at 55 and 85 m/s."""
    out = []
    for seed in range(1, N_FLIGHTS + 1):
        folder = tmp_path_factory.mktemp("two_speeds")
        late = {"gnss_delay_s": DELAY_S, "attitude_delay_s": DELAY_S}
        flight = flown_two_speeds(folder, seed, (55.0, 85.0), **late)
        block, free = flight.blocks["calibration"], flight.estimate_mounting
        out.append(mounting.single_step(block, free=free, gnss=DELAYS).bundle)
    return out


def test_delays_of_20_ms_come_out_within_their_sigma(found):
    """The chi-square of 12 normalised errors, 99 % two-sided; each sigma far below the delay."""
    listed = [p for bundle in found for p in trajectory_errors.parameters(bundle)]
    assert [p.name for p in listed] == [*NAMES] * N_FLIGHTS
    total = sum(((p.value - DELAY_S) / p.sigma) ** 2 for p in listed)
    assert 3.07 < total < 28.3
    assert all(p.sigma < 0.1 * DELAY_S for p in listed)


def test_a_delay_is_said_in_words(found):
    position, attitude = trajectory_errors.parameters(found[0])
    lines = trajectory_errors.notes(found[0])
    value, sigma = 1000 * position.value, 1000 * position.sigma
    assert lines[0] == f"GNSS positions are recorded {value:.1f} ± {sigma:.1f} ms late"
    assert lines[1].startswith(f"attitudes are recorded {1000 * attitude.value:.1f} ± ")
    assert lines[2].startswith("delays are this block's own")
    assert trajectory_errors.not_determined(found[0]) == []


def test_a_negative_delay_is_early(tmp_path):
    flight = flown_two_speeds(tmp_path, 1, (55.0, 85.0), gnss_delay_s=-DELAY_S)
    block, free = flight.blocks["calibration"], flight.estimate_mounting
    bundle = mounting.single_step(block, free=free, gnss=("delay",)).bundle
    assert trajectory_errors.notes(bundle)[0].endswith(" ms early")


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
    bundle = adjust(mounted_orientation(block, free=("f",), gnss=("delay",)))
    (line,) = trajectory_errors.not_determined(bundle)
    assert line.startswith("gnss_delay_s is not determined")
    assert "strips flown at different speeds, or the lever arm held" in line
    held = adjust(
        mounted_orientation(block, free=("f",), free_mount=blocks.MOUNT[3:], gnss=("delay",))
    )
    assert trajectory_errors.not_determined(held) == []
    slower = steady(BOTH_WAYS, (4.0, 4.0, 6.0, 6.0))
    fast_and_slow = adjust(mounted_orientation(slower, free=("f",), gnss=("delay",)))
    assert trajectory_errors.not_determined(fast_and_slow) == []


def test_one_strip_does_not_tell_shift_delay_and_lever_arm_apart():
    block = steady(((1000.0, 0.0, 0.0), (1300.0, 0.0, 0.0)), (4.0, 4.0))
    gnss = ("shift", "drift", "delay")
    lines = trajectory_errors.not_determined(
        adjust(mounted_orientation(block, free=("f",), gnss=gnss))
    )
    said = {line.split()[0] for line in lines}
    assert {"gnss_shift_east_m", "gnss_shift_north_m", "gnss_delay_s"} <= said
    (delay,) = [line for line in lines if line.startswith("gnss_delay_s")]
    assert "different speeds" in delay


def test_attitudes_that_do_not_change_tell_no_delay():
    bundle = adjust(
        mounted_orientation(steady(BOTH_WAYS, (4.0,) * 4), free=("f",), gnss=("attitude_delay",))
    )
    lines = trajectory_errors.not_determined(bundle)
    assert [line.split()[0] for line in lines] == ["attitude_delay_s"]
    assert "attitudes that change from one exposure to the next" in lines[0]
