"""Fisheye lenses after Pix4D's documentation, projected by its formulas."""

import numpy as np
import pytest

from acx4lib.geometry.camera import colrow_from_xy, distort
from acx4tools.exchange.pictures import lens
from acx4tools.exchange.pictures.fisheye import fisheye_camera
from acx4tools.exchange.pictures.tags import read
from support.pictures import tagged

POLYNOMIAL = np.array([0.0, 1.0, 0.016, -0.154])
MATRIX = np.array([[1660.0, 0.1], [0.1, 1655.0]])
CENTRE = np.array([640.3, 478.8])
"""Of the size of those of a Sequoia, 1280 x 960 px of 3.75 um."""


def projected(xyz):
    """The formulas as they are documented, from points to pixels; y down, z ahead."""
    x, y, z = xyz.T
    r = np.hypot(x, y)
    theta = 2 / np.pi * np.arctan(r / z)
    rho = sum(p * theta**k for k, p in enumerate(POLYNOMIAL))
    return np.stack([rho * x / r, rho * y / r], axis=1) @ MATRIX.T + CENTRE


def test_points_are_seen_where_the_formulas_have_them():
    camera, left = fisheye_camera(
        POLYNOMIAL, MATRIX, CENTRE, name="F", width_px=1280, height_px=960, pixel_mm=0.00375
    )
    rng = np.random.default_rng(1)
    xyz = np.column_stack(
        [rng.uniform(-0.5, 0.5, 200), rng.uniform(-0.38, 0.38, 200), np.ones(200)]
    )
    f = camera.interior.f
    seen = colrow_from_xy(camera, distort(camera.interior, f * xyz[:, :2] * [1, -1]))
    assert left.largest_px < 1
    assert left.rms_px < 0.15
    assert np.abs(seen - projected(xyz)).max() < left.largest_px * 1.5 + 1e-3


def test_a_picture_says_that_its_lens_is_a_fisheye(tmp_path):
    said = {
        "Camera:ModelType": "fisheye",
        lens.POLYNOMIAL: "0,1,0,0",
        lens.MATRIX: f"{364 * np.pi / 2},0,0,{364 * np.pi / 2}",
        lens.POINT: "2.3925,1.7925",
    }
    found = lens.lens_of(read(tagged.write(tmp_path / "a.tif", said)), "F")
    assert found.camera.interior.f == pytest.approx(364 * tagged.PIXEL_MM)
    assert found.fitted.largest_px < 0.2


@pytest.mark.parametrize("polynomial", [[0.9, 0, 0, 0], [0, -1, 0, 0], [5, 1, 0, 0]])
def test_what_sees_no_ray_is_refused(polynomial):
    with pytest.raises(ValueError, match="ray"):
        fisheye_camera(
            np.array(polynomial, float),
            MATRIX,
            CENTRE,
            name="F",
            width_px=1280,
            height_px=960,
            pixel_mm=0.00375,
        )
