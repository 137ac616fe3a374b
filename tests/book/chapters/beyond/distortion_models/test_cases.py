"""The cameras are what their names say."""

import numpy as np
from numpy.testing import assert_allclose

from acx4book.chapters.beyond.distortion_models import candidates, cases
from acx4book.chapters.beyond.distortion_models.families import MODELS
from acx4lib.geometry.camera import colrow_from_xy


def test_a_dent_shifts_its_middle_by_h_r_over_f_and_far_places_not_at_all(decentred):
    camera = decentred.calibration.cameras[0]
    half_mm = camera.pixel_mm / 2 * np.array([camera.width_px, camera.height_px])
    at = half_mm * cases.DENT_AT
    places = colrow_from_xy(camera, np.array([at, -2 * at, [0.0, 0.0]]))
    shift = cases.dent_px(camera, places, 25.0)
    assert_allclose(shift[0], np.array([1, -1]) * 0.025 * at / camera.interior.f / camera.pixel_mm)
    assert np.abs(shift[1]).max() < 0.02
    assert_allclose(shift[2], 0)


def test_no_depth_is_no_dent(decentred):
    flat = cases.with_dent(decentred, 0.0)
    for name in ("calibration", "validation"):
        before, after = getattr(decentred, name), getattr(flat, name)
        assert_allclose(after.image_points.colrow, before.image_points.colrow)


def test_the_symmetric_lens_has_no_decentring():
    found = candidates.single_step(cases.symmetric(1).calibration, MODELS[0])
    sigma = np.sqrt(np.diagonal(found.covariance(found.distortion_columns)))
    assert np.abs(found.estimates[3:] / sigma[3:]).max() < 4  # p1, p2
    assert abs(found.estimates[0] / sigma[0]) > 50  # k1


def test_the_synthetic_image_is_one_camera_of_all_heads():
    own = cases.synthetic(1)
    assert [camera.name for camera in own.calibration.cameras] == ["SYN"]
    assert len(own.calibration.images) == 52
