"""The chapter's flight, measured once; it takes half a minute."""

import pytest

from acx4book.chapters.beyond.from_pictures import whole


@pytest.fixture(scope="session")
def found():
    one = whole.measured(1)
    yield one
    one.folder.cleanup()
