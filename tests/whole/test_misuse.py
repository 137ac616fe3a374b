"""Wrong calls that a stranger makes: each is answered at the door, with what was expected.

The rules: a programmer's misuse is a `ValueError` that names the argument, what was expected and
what was given; a folder that is not there is a `FlightError`, as a user's files are; a block that
determines too little is an `AdjustmentError`. What meets nothing is NaN, and no error.
"""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

from acx4lib import block
from acx4lib.geometry import camera, intersection
from acx4lib.geometry.frames import rotation_from_opk
from support.wrong_calls import adjustments, files, geometry, pixels
from support.wrong_calls.material import (
    BLOCK,
    CAMERA,
    CONTROL,
    FRAME,
    IMAGES,
    POINTS,
    TRAJECTORY,
    spoilt,
    ties,
)

CALLS = [
    *adjustments.measured(),
    *adjustments.blocks_and_parts(),
    *geometry.cameras_and_poses(),
    *adjustments.adjusted(),
    *geometry.ground(),
    *geometry.statistics(),
    *pixels.pixels(),
    *files.files(),
    *files.invented(),
]


@pytest.mark.parametrize("wrong", CALLS, ids=[wrong.says for wrong in CALLS])
def test_a_wrong_call_is_told_what_was_expected(wrong):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(wrong.error, match=wrong.says) as caught:
            wrong.call()
    assert type(caught.value) is wrong.error  # no LinAlgError, which is a ValueError to Python
    assert "\n" not in str(caught.value)


# --- what is allowed -------------------------------------------------------------------------


def test_a_ray_without_direction_meets_nothing():
    """NaN, and no finite point: the other two rays of its point do not outvote it."""
    origins = np.array([[0.0, 0.0, 100.0], [50.0, 0.0, 100.0], [80.0, 0.0, 100.0]])
    towards = np.array([10.0, 20.0, 0.0]) - origins
    towards /= np.linalg.norm(towards, axis=1, keepdims=True)
    met = intersection.intersect(origins, towards, np.zeros(3, dtype=int), 2)
    np.testing.assert_allclose(met[0], [10.0, 20.0, 0.0], atol=1e-9)
    towards[1] = 0.0
    met = intersection.intersect(origins, towards, np.zeros(3, dtype=int), 2)
    assert np.isnan(met).all()


def test_a_point_may_be_measured_twice_in_an_image():
    """Two observations of one thing; a flight's files refuse it, as it is a slip there."""
    twice = np.append(np.arange(len(POINTS)), 0)
    assert len(replace(BLOCK, image_points=POINTS[twice]).image_points) == len(POINTS) + 1


def test_what_takes_no_part_or_has_no_error_is_allowed():
    out = replace(POINTS, sigma_px=spoilt(POINTS.sigma_px, np.inf))
    held = replace(CONTROL, sigma_m=np.zeros_like(CONTROL.sigma_m))
    unknown = replace(TRAJECTORY, sigma_attitude=np.full((12, 3), np.inf))
    made = replace(BLOCK, image_points=out, control=held, trajectory=unknown)
    assert len(made.images) == len(IMAGES)


def test_a_block_may_be_empty_but_for_its_cameras():
    empty = block.select_images(BLOCK, np.zeros(len(IMAGES), dtype=bool))
    assert len(empty.images) == len(empty.image_points) == 0


def test_functions_take_lists_of_numbers():
    np.testing.assert_allclose(rotation_from_opk([0.0, 0.0, 0.0]), np.eye(3), atol=0)
    assert camera.xy_from_colrow(CAMERA, [[0, 0], [1, 1]]).shape == (2, 2)
    assert FRAME.from_grid([[670_000.0, 7_188_000.0, 900.0]]).shape == (1, 3)


def test_a_selection_is_of_the_same_kind():
    part = POINTS[np.array([2, 0])]
    assert type(part) is type(POINTS)
    np.testing.assert_array_equal(part.point_idx, POINTS.point_idx[[2, 0]])
    assert len(ties()[:5]) == 5
