import pytest

from acx4book.chapters.beyond.from_pictures.whole import EXPOSURES

pytestmark = pytest.mark.repeats


def test_nothing_but_the_pictures_was_measured(found):
    assert found.block.images.names == EXPOSURES
    assert len(found.block.image_points) == len(found.outcome.matched.rays) + len(
        found.outcome.surveyed.rows
    )
