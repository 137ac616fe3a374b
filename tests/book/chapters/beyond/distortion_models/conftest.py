"""One flight of the chapter's cases, and what is stored of many."""

import pytest

from acx4book.chapters.beyond.distortion_models import cases, seams, study


@pytest.fixture(scope="session")
def decentred():
    return cases.decentred(1)


@pytest.fixture(scope="session")
def stored():
    return study.read()


@pytest.fixture(scope="session")
def pattern():
    return seams.read(cases.synthetic_camera())
