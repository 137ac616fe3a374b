"""The lens of the simulator: inverted exactly, or not at all."""

import tomllib
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

import acx4sim
from acx4sim import optics
from acx4sim.designs import SYNTHETIC, acx4_plan, single_head_plan


@pytest.mark.parametrize(
    "camera", [*acx4_plan().cameras.values(), single_head_plan().cameras["CAM"]]
)
def test_distortion_is_inverted_to_1e_12_mm(camera):
    half = camera.pixel_um / 2000 * np.array([camera.width_px, camera.height_px])
    x, y = np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 41))
    ideal = half * np.column_stack([x.ravel(), y.ravel()])
    xy = optics.measured_from_ideal(camera, ideal)
    dxy, _ = optics.correction(camera, xy)
    assert_allclose(xy - dxy, ideal, atol=1e-12, rtol=0)


def test_a_lens_that_folds_is_refused():
    fold = replace(SYNTHETIC, k1=1e-3)
    with pytest.raises(ValueError, match="cannot be inverted"):
        optics.measured_from_ideal(fold, np.array([[30.0, 40.0]]))


def test_a_point_behind_the_camera_is_nan():
    assert np.isnan(optics.project(SYNTHETIC, np.array([[0.0, 0.0, 10.0]]))).all()


# --- Refraction against the tabulated standard atmosphere


BLOCK = ("calibration",)

EXACT = {"image_noise": 0, "control_noise": 0, "gnss_noise": 0, "attitude_noise": 0}


def acx4(**options):
    return acx4sim.acx4_ideal(seed=1, options=acx4sim.Options(blocks=BLOCK, **options))


def test_a_ray_is_bent_as_the_tabulated_atmosphere_bends_it():
    """The mean density of a layer is the difference of its pressures over g times its height.

    Pressures and density are the ICAO table's at 1000 m and 5000 m, geopotential.
    """
    mean = (89874.6 - 54019.9) / (9.80665 * 4000.0)
    expected = 2.7769e-4 * (mean - 0.736116) / 1.2250  # rad per tangent, n - 1 of 0.56 um
    for tangent in (0.1, 1.0, 3.0):
        ray = np.array([[4000.0 * tangent, 0.0, -4000.0]])
        bent = optics.bent(ray, np.array([[0.0, 0.0, 1.0]]), np.array([1000.0]))
        turned = np.arctan2(bent[0, 0], 4000.0) - np.arctan(tangent)
        # the table has six digits; the bend is not quite proportional to the tangent
        assert turned == pytest.approx(expected * tangent, rel=5e-4)


def test_rays_straight_down_and_upward_are_not_bent():
    rays = np.array([[0.0, 0.0, -1000.0], [500.0, 0.0, 800.0], [90_000.0, 0.0, -100.0]])
    up = np.tile([0.0, 0.0, 1.0], (3, 1))
    assert_allclose(optics.bent(rays, up, np.zeros(3)), rays, rtol=1e-15)


def test_refraction_moves_image_points_outward_by_k_tan_of_the_angle():
    """K is 12e-6 and 17e-6 at 1000 m and 1500 m over ground at 900 m, and images are tilted."""
    straight = acx4(**EXACT)
    bent = acx4(**EXACT, refraction="standard")
    names = ["image", "point"]
    a, b = (f.tables["calibration/image_points.csv"] for f in (straight, bent))
    both = a.merge(b, on=names, suffixes=("", "_bent"))
    xy = both[["col_px", "row_px"]].to_numpy() - [5999.5, 8099.5]
    moved = both[["col_px_bent", "row_px_bent"]].to_numpy() - both[["col_px", "row_px"]].to_numpy()
    r = np.hypot(*xy.T)
    outward = np.sum(moved * xy, axis=1) / r
    tangent = r * 0.0056 / 74.44
    K = outward * 0.0056 / 74.44 / (tangent * (1 + tangent**2))
    far = r > 4000  # px: near the middle a tilted image hides which way is outward
    assert np.all(outward[far] > 0)
    assert 12e-6 < np.median(K[far]) < 17e-6
    assert tomllib.loads(bent.toml)["refraction"] == "standard"
    assert "refraction" not in tomllib.loads(straight.toml)
    assert bent.truth["cameras"] == straight.truth["cameras"]
