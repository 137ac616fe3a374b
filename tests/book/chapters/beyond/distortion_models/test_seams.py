"""What models take up of the pattern of the synthetic image."""

from dataclasses import replace

import numpy as np
import pytest

from acx4book.chapters.beyond.distortion_models import seams
from acx4book.chapters.beyond.distortion_models.families import MODELS, by_coefficient
from acx4lib.geometry.camera import xy_from_colrow


def rms(d):
    return np.sqrt(np.mean(d**2))


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_a_pattern_that_a_camera_can_make_is_taken_up(pattern, model):
    camera, n = pattern.camera, model.n_terms
    xy = xy_from_colrow(camera, pattern.colrow)
    lever = 0.1 * camera.interior.f / pattern.height_m / camera.pixel_mm  # 10 cm along x
    waves = by_coefficient(model, camera, pattern.colrow) @ np.linspace(-1e-3, 1e-3, n)
    d = waves + 1e-4 * xy / camera.pixel_mm * [1, -1] + np.stack([lever, 0 * lever], axis=1)
    assert rms(d) > 0.1
    assert rms(seams.left(replace(pattern, d_px=d), model)) < 1e-9


def test_smooth_models_leave_most_of_the_seams_and_four_cameras_nearly_nothing(pattern):
    low = pattern.height_m == pattern.height_m.min()
    before = rms(pattern.d_px[low])
    for model in MODELS:
        assert 0.7 * before < rms(seams.left(pattern, model)[low]) <= before
    assert rms(seams.left_by_heads(pattern, MODELS[0])[low]) < 0.1 * before
