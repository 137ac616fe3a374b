"""A flight is asked only for what it does not have."""

import numpy as np
import pytest

from acx4lib.calibration import mounting
from acx4lib.calibration.estimates import not_determined
from acx4lib.calibration.trust.needs import ENOUGH, NEEDS, features, needed
from acx4lib.flight.block import select_images
from acx4lib.geometry.parameters import REPORTED
from support import blocks

ALL = {"heights", "control", "opposite", "crosswise", "corners", "sides"}


def flown(strips=blocks.BOTH_WAYS, **options):
    options = {"ties": blocks.terrain(150, half_m=450.0), "control": blocks.crosses()} | options
    return blocks.simulate(blocks.fly(strips, tilt_deg=0.0), **options)


def test_a_flight_with_everything_has_every_feature():
    assert features(flown()) >= ALL


@pytest.mark.parametrize(
    ("strips", "lacking"),
    [
        (((1000.0, -150.0, 0.0), (1000.0, 150.0, 180.0)), {"heights", "crosswise"}),
        (((1000.0, 0.0, 0.0), (1500.0, 0.0, 0.0)), {"opposite", "crosswise"}),
        (((1000.0, 0.0, 0.0), (1500.0, 0.0, 90.0)), {"opposite"}),
    ],
)
def test_strips_lack_what_they_do_not_fly(strips, lacking):
    assert ALL - features(flown(strips)) == lacking


def test_without_control_points_the_block_has_none():
    assert ALL - features(flown(control=None)) == {"control"}


def test_points_in_two_strips_are_an_overlap():
    block = blocks.in_strips(blocks.standard(), 3)
    assert "overlap" in features(block)
    alone = select_images(block, np.array(block.images.strips) == "A")
    assert "overlap" not in features(alone)


def test_measurements_in_the_middle_are_neither_in_corners_nor_on_all_sides():
    over_one_place = ((1000.0, 0.0, 0.0), (1000.0, 0.0, 180.0))
    block = blocks.simulate(
        blocks.fly(over_one_place, base_m=20.0), ties=blocks.terrain(60, half_m=60.0)
    )
    assert not {"corners", "sides"} & features(block)


@pytest.mark.parametrize("key", [*REPORTED, "shift", "delay"])
def test_every_need_can_be_met(key):
    have = frozenset(need.features[0] for need in NEEDS[key])
    assert needed(key, have) == ENOUGH
    for need in NEEDS[key]:
        assert needed(key, have - set(need.features)) == need.text
    assert needed(key) == ", and ".join(need.text for need in NEEDS[key])


def test_a_flight_without_control_but_two_heights_is_not_asked_for_heights():
    block = blocks.noisy(blocks.standard(control=None), np.random.default_rng(3))
    found = mounting.single_step(block, free=("f", "xp", "yp")).calibration
    (line,) = not_determined(found, features(block))
    assert line.endswith("it would need: control points")
    assert not_determined(found)[0].endswith(
        "it would need: control points, and two flying heights or f held"
    )
