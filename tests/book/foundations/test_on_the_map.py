"""The example on the map, against PROJ's own factors and against closed forms of each mistake."""

import numpy as np
import pyproj
import pytest
from numpy.testing import assert_allclose

from acx4book.foundations import example, on_the_map
from acx4lib.calibration import mounting
from acx4lib.geometry.frames import log

RADIUS = 6_371_000.0


@pytest.fixture(scope="module")
def right():
    return calibrated(on_the_map.placed())


def calibrated(block):
    """Return focal length, its sigma, and the boresight."""
    fit = mounting.single_step(block, free=("f",), fix=("lever_arm",)).calibration
    camera = fit.cameras[0]
    return camera.interior.f, np.sqrt(fit.cov[0, 0]), camera.T_b_c.R


@pytest.mark.parametrize("height", [0.0, 900.0])
@pytest.mark.parametrize("east", [200_000.0, 500_000.0, 671_000.0])
def test_the_scale_is_that_of_the_projection_and_of_the_height(east, height):
    frame = on_the_map.frame(east_m=east)
    k = pyproj.Proj(on_the_map.CRS).get_factors(*frame.origin).meridional_scale
    lower = RADIUS / (RADIUS + height)  # the Earth's radius differs by 3e-3 at most
    assert_allclose(
        on_the_map.map_scale(frame, height), k * lower, atol=3e-3 * height / RADIUS + 1e-8
    )


def test_the_example_is_the_same_on_the_map_as_on_no_map(right):
    f, _, R = right
    local_f, _, local_R = calibrated(example.block())
    assert_allclose(f, local_f, rtol=1e-7)
    assert_allclose(R, local_R, atol=1e-7)


@pytest.mark.parametrize("east", [500_000.0, 830_000.0])
def test_map_coordinates_divide_the_focal_length_by_the_scale(east, right):
    block = on_the_map.placed(east_m=east)
    ground = on_the_map.GROUND_M + example.points()[:, 2].mean()
    s = on_the_map.map_scale(block.frame, ground)
    f = calibrated(on_the_map.in_map_coordinates(block))[0]
    assert_allclose(f - right[0], right[0] * (1 / s - 1), rtol=0.01)


def test_forgotten_convergence_goes_into_kappa(right):
    block = on_the_map.placed()
    f, sigma, R = calibrated(on_the_map.convergence_forgotten(block))
    factors = pyproj.Proj(on_the_map.CRS).get_factors(*block.frame.origin)
    turned = np.degrees(log(right[2].T @ R))
    # the images' tilts of 0.8 degrees let a hundredth of the angle go elsewhere
    assert_allclose(turned, [0, 0, factors.meridian_convergence], atol=0.01)
    assert abs(f - right[0]) < sigma


def test_a_forgotten_geoid_goes_into_the_focal_length(right):
    f, sigma, _ = calibrated(on_the_map.geoid_forgotten(on_the_map.placed(), 2.0))
    height = example.positions()[:, 2].mean() - example.points()[:, 2].mean()
    assert_allclose(f - right[0], right[0] * 2.0 / height, atol=sigma)
