"""Cameras as flight.toml has them, there and back."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.flight.setup import camera_of, camera_table, camera_toml
from acx4lib.geometry.parameters import Prior
from support import blocks

SIGMA = (0.01, 0.02, 0.03, 1e-4, 2e-4, 3e-4)
KNOWN = replace(blocks.SECOND, prior=Prior(declared=(True,) * 6, sigma=SIGMA))
QUOTED = replace(blocks.CAMERA, name='Phase "One" / 150')


@pytest.mark.parametrize("camera", [blocks.CAMERA, KNOWN, QUOTED], ids=lambda camera: camera.name)
def test_a_camera_comes_back_from_its_lines_in_flight_toml(camera):
    written = tomllib.loads(camera_toml(camera))["cameras"]
    assert written == {camera.name: camera_table(camera)}
    back = camera_of(camera.name, written[camera.name])
    assert (back.width_px, back.height_px) == (camera.width_px, camera.height_px)
    assert_allclose(back.pixel_mm, camera.pixel_mm, rtol=1e-15)
    assert back.interior == camera.interior
    assert_allclose(back.T_b_c.R, camera.T_b_c.R, atol=1e-15)
    assert_allclose(back.T_b_c.r, camera.T_b_c.r, atol=0)
    assert_allclose(back.prior.sigma, camera.prior.sigma, rtol=1e-14)
    assert np.all(back.prior.declared)
