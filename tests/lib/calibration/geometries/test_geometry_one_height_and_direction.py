"""One flying height in one direction: nothing tells a lever arm from f, xp and yp."""

import numpy as np
import pytest

from acx4files.results.sentences import not_determined
from acx4lib.calibration import mounting
from acx4lib.calibration.determination import weakest_combination
from acx4lib.model import Model
from support import blocks

ONE_WAY = ((1000.0, -150.0, 0.0), (1000.0, 150.0, 0.0))
SECOND_HEIGHT = (*ONE_WAY, (1500.0, -80.0, 0.0), (1500.0, 80.0, 0.0))
LEVER = {"lever_x_m", "lever_y_m", "lever_z_m"}
INTERIOR = {"f_mm", "xp_mm", "yp_mm"}


def calibrated(strips, *, with_control=False, fix=()):
    """Flat ground: hills would be a second height."""
    flat = blocks.crosses() * [1, 1, 0] + [0, 0, blocks.GROUND_M]
    block = blocks.simulate(
        blocks.fly(strips, per_strip=4),
        ties=blocks.terrain(40, relief_m=5.0),
        control=flat if with_control else None,
    )
    block = blocks.noisy(block, np.random.default_rng(1))
    return mounting.single_step(block, Model(free=("f", "xp", "yp"), fix=fix))


def lines(found):
    return {line.split()[1]: line for line in not_determined(found.calibration)}


@pytest.fixture(scope="module")
def without_control():
    return calibrated(ONE_WAY)


@pytest.fixture(scope="module")
def with_control():
    return calibrated(ONE_WAY, with_control=True)


def test_lever_arm_and_interior_orientation_are_not_determined(without_control):
    assert set(lines(without_control)) == LEVER | INTERIOR


def test_control_points_do_not_make_up_for_a_second_height(with_control):
    assert set(lines(with_control)) == LEVER | INTERIOR


def test_each_asks_for_a_second_height_and_the_lever_arm_for_more(with_control):
    said = lines(with_control)
    assert all("two flying heights" in line for line in said.values())
    for name in LEVER:
        assert "control points" in said[name].split("it would need: ")[1]


def test_f_and_the_lever_arms_height_name_each_other(with_control):
    said = lines(with_control)
    assert "(sigma" in said["f_mm"]
    assert "correlation +1.00 with lever_z_m" in said["f_mm"]
    assert "correlation +1.00 with f_mm" in said["lever_z_m"]


def test_a_second_height_alone_leaves_the_lever_arm_open():
    """Then f, xp and yp are known, and the ground floats with the lever arm."""
    assert set(lines(calibrated(SECOND_HEIGHT))) == LEVER


def test_a_second_height_and_control_points_determine_all():
    assert lines(calibrated(SECOND_HEIGHT, with_control=True)) == {}


def test_control_points_and_a_held_lever_arm_determine_the_interior_orientation():
    assert lines(calibrated(ONE_WAY, with_control=True, fix=("lever_arm",))) == {}


def test_the_weakest_combination_is_a_shift_of_the_camera(without_control):
    """Lever arm and principal point go together; no pose takes part."""
    parts = {part.unknown for part in weakest_combination(without_control.bundle)}
    assert parts <= {"CAM/lever_x_m", "CAM/lever_y_m", "CAM/xp_mm", "CAM/yp_mm"}
    assert parts >= {"CAM/lever_x_m", "CAM/xp_mm"}
