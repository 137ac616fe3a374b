"""What is read from a lens: distortion at border and corners."""

from dataclasses import replace

import numpy as np
import pytest

from acx4lib.calibration import lens
from acx4lib.geometry.camera import Interior


def test_border_distortion_is_the_papers_15_pixels(fits):
    r, px, sigma = lens.radial_profile(fits["CAM1"])
    assert r[-1] == pytest.approx(np.hypot(8984, 6732) / 2 * 0.006)
    assert px[-1] == pytest.approx(15.0, abs=1.0)  # "approximately 15 pixels"
    assert 0 < sigma[-1] < 0.3


def test_the_worst_corner_has_the_decentring_too(fits):
    camera = fits["CAM1"].cameras[0]
    radial = replace(camera, interior=Interior(f=74.0, k1=2.27e-6))
    assert lens.largest_at_corners(radial) == pytest.approx(14.45, abs=0.01)
    assert lens.largest_at_corners(camera) == pytest.approx(18.3, abs=0.5)
