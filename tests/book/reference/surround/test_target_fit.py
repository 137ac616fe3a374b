"""Cameras refined by the corners of their target."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from acx4book.reference.surround.corners import rms
from acx4book.reference.surround.target_fit import left_out_misfits, refined, shift, target_seen
from support.pictures.surround_rigs import all_misfits


def turned(camera, degrees):
    """Return a camera whose homography is off by a small rotation."""
    R = Rotation.from_rotvec(np.radians(degrees)).as_matrix()
    K = camera.K_undistorted
    return replace(camera, H_s_u=camera.H_s_u @ K @ R @ np.linalg.inv(K))


@pytest.mark.parametrize("free", ["rotations", "homographies", "in place"])
def test_refinement_finds_the_turns_that_were_made(cameras, corners, free):
    degrees = ([0, 0, 0], [0.4, -0.3, 0.2], [-0.2, 0.3, 0.5], [0.3, 0.2, -0.4])
    wrong = tuple(turned(c, d) for c, d in zip(cameras, degrees, strict=True))
    found = refined(wrong, corners, free=free)
    assert rms(all_misfits(wrong, corners)) > 3
    # in place, the wrong cameras are believed to 5 cm
    assert rms(all_misfits(found, corners)) < (1.0 if free == "in place" else 0.5)
    if free == "rotations":  # the others may change what the overlaps do not show
        for camera, truth in zip(found, cameras, strict=True):
            moved = shift(camera, truth, target_seen(truth))
            assert np.nanmax(np.abs(moved)) < 3  # cm; from side to side it is ten metres
    assert found[0] is wrong[0] or free == "in place"


def test_left_out_corners_are_all_corners_once(cameras, corners):
    left_out = left_out_misfits(cameras, corners, free="rotations")
    assert [len(d) for d in left_out] == [len(c.colrow_a) for c in corners]
    assert rms(np.concatenate(left_out)) < 0.6
