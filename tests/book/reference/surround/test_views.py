"""Views of the ground: right pixels, hard seams, smooth feathers."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4book.reference.surround.cameras import image_from_frame
from acx4book.reference.surround.views import blended, view


def test_a_view_shows_the_right_pixels_and_takes_gains_out(cameras):
    """The image says of each pixel which one it is."""
    cols, rows = np.meshgrid(np.arange(960), np.arange(640))
    image = np.stack([cols / 4 + 5, rows / 4 + 5, 0 * cols + 200], axis=-1).astype(np.uint8)
    gains = np.zeros((3, 3))
    gains[2, 0] = np.log(2)
    found = view(cameras[1], image, coefficients=gains)
    row, col = np.nonzero(found.seen)
    at = image_from_frame(cameras[1], np.column_stack([col, row])[::97].astype(float))
    shown = found.image[row, col][::97]
    # the image was cut to whole numbers, and so was the view: a grey value is 4 px
    assert_allclose(shown[:, :2], np.floor(at / 4) + 5, atol=1)
    assert np.all(shown[:, 2] == 100)
    assert np.all(found.image[~found.seen] == 0)


@pytest.mark.parametrize("feather_px", [0.0, 30.0, 200.0])
def test_blending_equal_views_changes_nothing(views, feather_px):
    flat = [replace(v, image=np.where(v.seen[:, :, None], 77, 0).astype(np.uint8)) for v in views]
    image = blended(flat, feather_px=feather_px)
    seen = np.any([v.seen for v in views], axis=0)
    assert np.all(image[seen] == 77)
    assert np.all(image[~seen] == 0)


def test_a_seam_is_hard_and_a_feather_is_smooth(views):
    lit = [
        replace(v, image=np.where(v.seen[:, :, None], 50 * k, 0).astype(np.uint8))
        for k, v in enumerate(views, 1)
    ]
    hard = blended(lit, feather_px=0)
    assert set(np.unique(hard)) == {0, 50, 100, 150, 200}
    soft = blended(lit, feather_px=60)[:, :, 0].astype(int)
    # where two views end at one place, one goes over into the other at once
    inner = cv2.erode(np.any([v.seen for v in views], axis=0).astype(np.uint8), np.ones((61, 61)))
    steps = np.abs(np.diff(soft, axis=1))[(inner[:, 1:] & inner[:, :-1]).astype(bool)]
    assert steps.max() < 10  # of 150 between left and right; a ramp of 60 px has 2 or 3 a pixel
