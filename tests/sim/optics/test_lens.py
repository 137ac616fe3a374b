"""The lens of the simulator: inverted exactly, or not at all."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4sim.designs import SYNTHETIC, acx4_plan, single_head_plan
from acx4sim.optics import lens


@pytest.mark.parametrize(
    "camera", [*acx4_plan().cameras.values(), single_head_plan().cameras["CAM"]]
)
def test_distortion_is_inverted_to_1e_12_mm(camera):
    half = camera.pixel_um / 2000 * np.array([camera.width_px, camera.height_px])
    x, y = np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 41))
    ideal = half * np.column_stack([x.ravel(), y.ravel()])
    xy = lens.measured_from_ideal(camera, ideal)
    dxy, _ = lens.correction(camera, xy)
    assert_allclose(xy - dxy, ideal, atol=1e-12, rtol=0)


def test_a_lens_that_folds_is_refused():
    fold = replace(SYNTHETIC, k1=1e-3)
    with pytest.raises(ValueError, match="cannot be inverted"):
        lens.measured_from_ideal(fold, np.array([[30.0, 40.0]]))


def test_a_point_behind_the_camera_is_nan():
    assert np.isnan(lens.project(SYNTHETIC, np.array([[0.0, 0.0, 10.0]]))).all()
