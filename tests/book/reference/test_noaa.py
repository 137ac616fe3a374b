"""Applanix orientations of real frames, down to the ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acx4book.reference import data, noaa
from acx4lib.geometry.camera import Interior
from support.helpers import needs

pytestmark = needs("noaa-dss-dg")


@pytest.fixture(scope="module", params=noaa.FRAMES)
def frame(request):
    return noaa.read(data.path(f"noaa-dss-dg/{request.param}.geom"))


def test_corners_and_centre_within_a_centimetre(frame):
    d, _ = noaa.differences(frame)
    assert d.shape == (5, 3)
    assert np.hypot(*d[:, :2].T).max() < 0.01  # m
    assert np.abs(d[:, 2]).max() < 1e-3  # both lie on the same surface


def test_the_distortion_is_subtracted(frame):
    """Without it the corners of the higher frame are up to 10 m off, with the other sign 20."""
    interior = frame.camera.interior
    plain = Interior(f=interior.f, xp=interior.xp, yp=interior.yp)
    turned = replace(interior, k1=-interior.k1, k2=-interior.k2, k3=-interior.k3)
    worst = []
    for other in (plain, turned):
        d, _ = noaa.differences(replace(frame, camera=frame.camera.with_interior(other)))
        worst.append(np.hypot(*d[:4, :2].T).max())
    above_m = frame.enh[2] - frame.ground_m
    assert worst[0] == pytest.approx(10 * above_m / 1128, rel=0.15)
    assert worst[1] == pytest.approx(2 * worst[0], rel=0.05)


def test_the_reference_point_is_not_the_middle_of_the_image(frame):
    """Half a pixel of the image is half a pixel on the ground."""
    shifted = replace(frame, colrow=frame.colrow + 0.5)
    d, ground_pixel_m = noaa.differences(shifted)
    assert np.hypot(*d[4, :2]) == pytest.approx(ground_pixel_m / np.sqrt(2), rel=0.1)
