import pytest

from acx4book.chapters.beyond.from_pictures.whole import EXPOSURES

pytestmark = pytest.mark.repeats


def test_every_parameter_is_within_four_sigma_of_the_truth(found):
    assert len(found.parameters) == 14
    for one in found.parameters:
        assert abs(one.value - found.truth[one.name]) < 4 * one.sigma, one.name


def test_nothing_but_the_pictures_was_measured(found):
    assert found.block.images.names == EXPOSURES
    assert len(found.block.image_points) == len(found.outcome.matched.rays) + len(
        found.outcome.surveyed.rows
    )
