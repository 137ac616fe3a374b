"""The flight of the chapter, examined once."""

import pytest

from acx4book.chapters.beyond.error_budget import examined, heights


@pytest.fixture(scope="session")
def found():
    return examined.flown(seed=1)


@pytest.fixture(scope="session")
def flown(found):
    return heights.of(found)
