"""Grey values equalised, and the image rendered of them."""

import numpy as np
import pytest

from acx4book.chapters.synthetic_image import equalised, sentences
from support.flights import pictured


def test_grey_values_agree_after_equalisation(scene_pictures, scene_orientation):
    fit = equalised.response(scene_pictures, scene_orientation, seed=1)
    assert all(np.max(one.after) < 0.01 for one in fit.overlaps)
    assert "disagree by" in sentences.response(scene_orientation, fit)


@pytest.mark.parametrize("feather_px", [0.0, 150.0])
def test_the_rendered_image_is_the_scene(scene_pictures, scene_orientation, feather_px):
    """Interpolated twice, cubic and bilinear: a few per cent of the scene's contrast."""
    image = equalised.image(scene_pictures, scene_orientation, None, feather_px=feather_px)
    scene = pictured.frame_of(pictured.scene(2))  # the middle one of two exposures is the second
    assert image.shape == scene.shape
    seen = (image > 0).all(axis=2)
    assert seen.mean() > 0.5
    left = image[seen].astype(float) - scene[seen]
    assert np.sqrt(np.mean(left**2)) < 0.15 * scene.std()
