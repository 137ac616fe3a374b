"""The chapter's flight, measured once; it takes half a minute."""

import pytest

from acx4book.chapters import from_pictures
from acx4book.chapters.from_pictures import EXPOSURES


@pytest.fixture(scope="session")
def measured():
    """Return the flight with what was measured, and its single step."""
    found, mounting = from_pictures.measured(1)
    yield found, mounting
    found.folder.cleanup()


@pytest.fixture(scope="session")
def found(measured):
    return measured[0]


pytestmark = pytest.mark.repeats


def test_nothing_but_the_pictures_was_measured(found):
    assert found.block.images.names == EXPOSURES
    assert len(found.block.image_points) == len(found.outcome.matched.rays) + len(
        found.outcome.surveyed.rows
    )


def test_ties_and_control_are_good_to_a_tenth_of_a_pixel(found):
    ties, control = from_pictures.of_ties(found), from_pictures.of_control(found)
    assert ties.rms < 0.1
    assert control.rms < 0.1
    assert ties.wrong == control.wrong == 0


def test_every_parameter_is_within_four_sigma_of_the_truth(measured):
    found, mounting = measured
    table = from_pictures.camera(mounting, found.truth(mounting))
    assert len(table) == 14
    assert (table["difference / σ"].abs() < 4).all()
    off = table["value"] - table["truth"].str.replace("\N{MINUS SIGN}", "-").iloc[:3].astype(float)
    assert (off.dropna().abs() < 0.01).all()
