"""A single strip: as one height and one direction, and the block may roll about the strip."""

import numpy as np
import pytest

from acx4files.results.sentences import not_determined
from acx4lib.calibration import mounting
from acx4lib.calibration.estimates import parameters
from acx4lib.model import Model
from support import blocks

STRIP = ((1000.0, 0.0, 0.0),)
THERE_AND_BACK = (*STRIP, (1000.0, 0.0, 180.0))
FREE = ("f", "xp", "yp")


def calibrated(strips, *, with_control, fix=(), per_strip=6):
    """Flat ground: hills would be a second height."""
    flat = blocks.crosses() * [1, 1, 0] + [0, 0, blocks.GROUND_M]
    block = blocks.simulate(
        blocks.fly(strips, per_strip=per_strip),
        ties=blocks.terrain(40, relief_m=5.0),
        control=flat if with_control else None,
    )
    block = blocks.noisy(block, np.random.default_rng(1))
    return mounting.single_step(block, Model(free=FREE, fix=fix)).calibration


def lines(calibration):
    return {line.split()[1]: line for line in not_determined(calibration)}


@pytest.fixture(scope="module")
def floating():
    return calibrated(STRIP, with_control=False)


def test_also_the_boresight_about_the_strip_is_not_determined(floating):
    """With a mount that hardly turns, omega tilts across the strip: ground and block roll."""
    assert set(lines(floating)) == {
        *("f_mm", "xp_mm", "yp_mm"),
        *("lever_x_m", "lever_y_m", "lever_z_m"),
        "boresight_omega_deg",
    }


def test_the_cure_of_the_boresight_is_named(floating):
    line = lines(floating)["boresight_omega_deg"]
    assert line.endswith("it would need: strips flown in opposite directions, and control points")


def test_control_points_or_the_way_back_determine_the_boresight(floating):
    """Either is enough to come below the limit of 0.1 degrees; both are better than one."""
    found = [
        calibrated(STRIP, with_control=True),
        calibrated(THERE_AND_BACK, with_control=False),
        calibrated(THERE_AND_BACK, with_control=True),
    ]
    sigma = [{p.key: p.sigma for p in parameters(c)}["boresight_x"] for c in [floating, *found]]
    assert sigma[0] > 0.1
    assert max(sigma[1:]) < 0.1
    assert sigma[3] < min(sigma[1:3])


def test_one_height_leaves_the_rest_open_whatever_else_there_is():
    assert {"f_mm", "lever_x_m", "lever_y_m", "lever_z_m"} <= set(
        lines(calibrated(THERE_AND_BACK, with_control=True))
    )


def test_a_held_lever_arm_and_control_points_make_a_strip_enough():
    assert lines(calibrated(STRIP, with_control=True, fix=("lever_arm",))) == {}
