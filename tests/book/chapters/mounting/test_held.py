"""The explorer of the held lever arm: what it shows is what the library's two-step method finds."""

from dataclasses import replace

import numpy as np
import pytest

from acx4book.chapters.mounting import held
from acx4lib.calibration.mounting import two_step_gnss
from acx4lib.flight import design
from acx4lib.geometry.frames import Pose
from support import blocks


@pytest.fixture(scope="module")
def found(ideal, mountings):
    block, free = ideal.calibration, ideal.estimate_mounting
    return held.held(block, mountings["two_step_gnss"], mountings["single_step"], free=free)


def column(shown, values, row):
    return [float(text.replace("\N{MINUS SIGN}", "-")) for text in shown.readings(values)[row]]


def test_readings_are_those_of_the_two_step_method_with_this_lever_arm(ideal, mountings, found):
    values, shown = [0.6, -0.1, 0.35], held.explorer(found)
    again = two_step_gnss(
        design.with_lever_arm(ideal.calibration, values),
        free=ideal.estimate_mounting,
        after=mountings["single_step"],
    ).calibration.cameras[0]
    changed = 1000 * (held.interior(again) - held.interior(found.single))
    # µm, as shown to a tenth; the rest is the second order of half a metre
    assert column(shown, values, 1) == pytest.approx(changed, abs=0.15)
    for row, height in enumerate((*sorted(found.heights_m), 2 * max(found.heights_m)), 3):
        off = 100 * held.off_ground(again, found.single, height)
        assert column(shown, values, row) == pytest.approx(off, abs=0.5)


def test_what_the_single_step_finds_is_wrong_nowhere(found):
    assert np.abs(found.ground_cm(1000.0).at(found.single.T_b_c.r)).max() < 0.3
    assert np.abs(found.interior_um.at(found.single.T_b_c.r)).max() < 0.3


def test_the_ground_is_straight_over_the_heights_that_a_line_joins(found):
    low, middle, high = (found.ground_cm(h).at([0.5, 0.0, 0.0]) for h in (600.0, 1800.0, 3000.0))
    assert middle == pytest.approx((low + high) / 2, abs=1e-3)


CAMERA = replace(blocks.CAMERA, T_b_c=Pose(R=np.eye(3), r=np.zeros(3)))


def test_a_lever_arm_alone_moves_the_ground_by_itself_from_any_height():
    moved = replace(CAMERA, T_b_c=Pose(R=np.eye(3), r=np.array([0.3, -0.2, 0.1])))
    for height in (500.0, 2000.0):
        off = held.off_ground(moved, CAMERA, height)
        assert off == pytest.approx([0.3, -0.2, 0.1], abs=1e-9)


def test_a_focal_length_alone_lowers_the_ground_with_the_height():
    longer = replace(CAMERA, interior=replace(CAMERA.interior, f=1.001 * CAMERA.interior.f))
    assert held.off_ground(longer, CAMERA, 1000.0) == pytest.approx([0, 0, -1.0], abs=1e-6)


def test_of_several_cameras_there_is_none(mountings):
    single = mountings["single_step"]
    two = blocks.standard(cameras=(blocks.CAMERA, replace(blocks.CAMERA, name="AFT")))
    assert held.view(two, mountings["two_step_gnss"], single, free=("f",)) is None
