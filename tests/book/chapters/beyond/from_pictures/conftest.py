"""The chapter's flight, measured once; it takes half a minute."""

import pytest

from acx4book.chapters.beyond.from_pictures import whole


@pytest.fixture(scope="session")
def measured():
    """Return the flight with what was measured, and its single step."""
    found, mounting = whole.measured(1)
    yield found, mounting
    found.folder.cleanup()


@pytest.fixture(scope="session")
def found(measured):
    return measured[0]
