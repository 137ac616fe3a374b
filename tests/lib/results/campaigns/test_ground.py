"""What parameters move on the ground: closed forms of a camera that looks straight down."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from acx4lib.geometry.camera import Camera, Interior
from acx4lib.results.campaigns.ground import ground_effects

HEIGHT, F = 800.0, 50.0
NAMES = (
    *("f_mm", "xp_mm", "yp_mm", "k1", "lever_x_m", "lever_y_m", "lever_z_m"),
    *("boresight_omega_deg", "boresight_phi_deg", "boresight_kappa_deg"),
)
CAMERA = Camera(name="CAM", width_px=6001, height_px=4001, pixel_mm=0.005, interior=Interior(f=F))


@pytest.fixture(scope="module")
def effects():
    return ground_effects(CAMERA, NAMES, np.full(len(NAMES), 1e-6), height_m=HEIGHT)


def xy_mm(effects):
    middle = np.array([3000.0, 2000.0])
    return (effects.colrow - middle) * CAMERA.pixel_mm * [1, -1]


def test_nodes_lie_where_their_rays_meet_the_ground(effects):
    assert_allclose(effects.xy, HEIGHT / F * xy_mm(effects), atol=1e-9)


def test_derivatives_are_those_of_the_pinhole(effects):
    x, y = xy_mm(effects).T
    zero, one, scale = np.zeros_like(x), np.ones_like(x), HEIGHT / F
    degree = np.radians(1) * HEIGHT
    r2 = x**2 + y**2
    expected = {
        "f_mm": (-scale * x / F, -scale * y / F),
        "xp_mm": (-scale * one, zero),
        "yp_mm": (zero, -scale * one),
        "lever_x_m": (one, zero),
        "lever_y_m": (zero, one),
        "lever_z_m": (x / F, y / F),
        "boresight_omega_deg": (degree * x * y / F**2, degree * (1 + y**2 / F**2)),
        "boresight_phi_deg": (-degree * (1 + x**2 / F**2), -degree * x * y / F**2),
        "boresight_kappa_deg": (-degree * y / F, degree * x / F),
    }
    for name, (forward, left) in expected.items():
        J = effects.J[:, :, NAMES.index(name)]
        assert_allclose(J, np.column_stack([forward, left]), rtol=1e-5, atol=1e-6, err_msg=name)
    radial = effects.J[:, :, NAMES.index("k1")]
    assert_allclose(
        np.abs(radial), scale * np.abs(np.column_stack([x, y])) * r2[:, None], rtol=1e-4, atol=1e-2
    )


def test_sizes_are_those_of_the_vectors(effects):
    d = np.zeros(len(NAMES))
    d[4] = 0.3
    assert_allclose(effects.rms(d)[4], 0.3, rtol=1e-6)
    assert_allclose(np.hypot(*effects.moved(d).T), 0.3, rtol=1e-6)
    cov = np.zeros((len(NAMES),) * 2)
    cov[4, 4], cov[5, 5] = 0.3**2, 0.4**2
    assert_allclose(effects.sigma(cov), 0.5, rtol=1e-6)
    part = effects.of(np.array([4]))
    assert_allclose(part.moved(d[[4]]), effects.moved(d))


def test_what_correlates_may_cancel_on_the_ground(effects):
    d = np.zeros(len(NAMES))
    d[0], d[6] = 0.1, 0.1 * HEIGHT / F  # a longer focal length, and a higher camera
    assert np.abs(effects.moved(d)).max() < 1e-6 < effects.rms(d)[0]


@pytest.mark.parametrize(("steps", "height"), [(np.zeros(1), 10.0), (np.ones(1), 0.0)])
def test_steps_and_height_are_positive(steps, height):
    with pytest.raises(ValueError, match=r"must|expected"):
        ground_effects(CAMERA, ["f_mm"], steps, height_m=height)
