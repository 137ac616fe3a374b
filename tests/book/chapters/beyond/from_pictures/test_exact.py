import numpy as np
import pytest

from acx4book.chapters.beyond.from_pictures import exact

pytestmark = pytest.mark.repeats


def test_ties_and_control_are_good_to_a_tenth_of_a_pixel(found):
    ties, control = exact.of_ties(found), exact.of_control(found)
    assert ties.rms < 0.1
    assert control.rms < 0.1
    assert ties.wrong == control.wrong == 0


def test_a_shifted_measurement_is_seen(found):
    errors = exact.of_control(found)
    assert np.all(np.abs(errors.off) < 0.5)
    moved = type(errors)(**{**errors.__dict__, "off": errors.off + 2.0})
    assert moved.wrong == len(errors.off)


def test_points_of_one_height_have_no_ray_of_the_other(found):
    errors = exact.of_ties(found)
    alike = exact.same_height(found, errors)
    strips = np.array([found.block.images.strips[i] in ("4", "5") for i in errors.image_idx])
    for point in np.unique(errors.point_idx[alike])[:50]:
        own = strips[errors.point_idx == point]
        assert own.all() or not own.any()
