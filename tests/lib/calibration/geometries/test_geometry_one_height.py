"""One flying height over flat ground: a lever arm looks like a change of f, xp and yp."""

import numpy as np
import pytest

from acx4files.results.sentences import not_determined
from acx4lib.calibration import mounting
from acx4lib.calibration.estimates import parameters
from acx4lib.model import Model
from support import blocks

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
    return mounting.single_step(block, Model(free=free, fix=fix)).calibration


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
    return not_determined(mounting.two_step(block, Model(free=("f", "xp", "yp"))).calibration)


def test_in_a_bundle_on_control_points_alone_a_second_height_is_not_enough_but_hills_are():
    flat = [line for line in on_control_alone(relief_m=5.0, hills=0) if " f_mm " in line]
    assert "hills or tilted images in a bundle on control points alone" in flat[0]
    assert on_control_alone(relief_m=300.0, hills=8) == []
