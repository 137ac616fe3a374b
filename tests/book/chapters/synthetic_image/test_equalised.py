"""Grey values equalised, and the image rendered of them."""

import numpy as np
import pytest

from acx4book.chapters.synthetic_image import equalised, sentences
from acx4lib import flight as flights
from acx4lib.stages import pictures as taken
from support.flights import pictured


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return pictured.write_flight(tmp_path_factory.mktemp("pixels") / "flight")


@pytest.fixture(scope="module")
def flight(path):
    return flights.read(path)


@pytest.fixture(scope="module")
def orientation():
    return pictured.orientation()


@pytest.fixture(scope="module")
def pictures(flight, orientation):
    return taken.read_pictures(flight, orientation)


def test_grey_values_agree_after_equalisation(pictures, orientation):
    fit = equalised.response(pictures, orientation, seed=1)
    assert all(np.max(one.after) < 0.01 for one in fit.overlaps)
    assert "disagree by" in sentences.response(orientation, fit)


@pytest.mark.parametrize("feather_px", [0.0, 150.0])
def test_the_rendered_image_is_the_scene(pictures, orientation, feather_px):
    """Interpolated twice, cubic and bilinear: a few per cent of the scene's contrast."""
    image = equalised.image(pictures, orientation, None, feather_px=feather_px)
    scene = pictured.frame_of(pictured.scene(2))  # the middle one of two exposures is the second
    assert image.shape == scene.shape
    seen = (image > 0).all(axis=2)
    assert seen.mean() > 0.5
    left = image[seen].astype(float) - scene[seen]
    assert np.sqrt(np.mean(left**2)) < 0.15 * scene.std()
