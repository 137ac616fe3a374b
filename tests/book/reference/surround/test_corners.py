"""Corners of one target in two views."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from acx4book.reference.surround.corners import corner_misfits, image_misfits, rms
from support.pictures.surround_rigs import all_misfits


def test_corners_of_the_right_cameras_are_in_one_place(cameras, corners):
    assert min(len(c.colrow_a) for c in corners) >= 10
    # an eighth of a pixel of an image, which has several centimetres where it is far away
    assert rms(all_misfits(cameras, corners)) < 0.5
    every = np.concatenate([image_misfits(cameras, c) for c in corners])
    assert rms(every) < 0.15
    for c in corners:  # of squares of 40 cm, outer edges of the first pixels
        at = corner_misfits(cameras, c)[0] + 0.5
        assert_allclose(at, 20 * np.rint(at / 20), atol=1.0)


def test_misfits_are_those_of_the_cameras(cameras, corners):
    moved = replace(
        cameras[1], H_s_u=np.array([[1, 0, 7.0], [0, 1, -3], [0, 0, 1]]) @ cameras[1].H_s_u
    )
    d = corner_misfits((cameras[0], moved, *cameras[2:]), corners[0])[1]
    assert_allclose(d - corner_misfits(cameras, corners[0])[1], [[7, -3]] * len(d), atol=1e-9)
