"""One flying direction and no control points: a lever arm is a shift of the whole ground."""

import numpy as np
import pytest

from acx4files.results.sentences import not_determined
from acx4lib.calibration import mounting
from acx4lib.model import Model
from support import blocks

ONE_WAY = ((1000.0, -150.0, 0.0), (1000.0, 150.0, 0.0), (1500.0, -80.0, 0.0), (1500.0, 80.0, 0.0))
BOTH_WAYS = tuple((h, y, way) for (h, y, _), way in zip(ONE_WAY, (0.0, 180.0) * 2, strict=True))


def calibrated(strips, *, with_control=False):
    block = blocks.simulate(
        blocks.fly(strips, per_strip=4),
        ties=blocks.terrain(40, relief_m=5.0),
        control=blocks.crosses() if with_control else None,
    )
    block = blocks.noisy(block, np.random.default_rng(1))
    return mounting.single_step(block, Model(free=("f", "xp", "yp"))).calibration


def named(calibration):
    return {line.split()[1] for line in not_determined(calibration)}


@pytest.fixture(scope="module")
def one_way():
    return calibrated(ONE_WAY)


def test_the_lever_arm_is_not_determined(one_way):
    assert named(one_way) == {"lever_x_m", "lever_y_m", "lever_z_m"}


def test_no_pair_of_parameters_gives_it_away(one_way):
    """The twin is the ground, which is no parameter: pairwise correlations stay small."""
    for line in not_determined(one_way):
        largest = float(line.split("correlation ")[1].split()[0])
        assert abs(largest) < 0.9


def test_what_would_help_is_named(one_way):
    for line in not_determined(one_way):
        if "lever_z" not in line:
            assert line.endswith("control points or strips flown in opposite directions")


def test_opposite_directions_leave_only_the_height_open():
    assert named(calibrated(BOTH_WAYS)) == {"lever_z_m"}


def test_control_points_determine_all_of_it():
    assert named(calibrated(ONE_WAY, with_control=True)) == set()
