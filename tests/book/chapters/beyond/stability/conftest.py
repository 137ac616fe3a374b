"""The chapter's campaigns and its rig, made once."""

import pytest

from acx4book.chapters.beyond.stability import history, turned
from acx4lib.results.campaigns.comparison import compare


@pytest.fixture(scope="session")
def campaigns():
    return history.campaigns(1)


@pytest.fixture(scope="session")
def every(campaigns):
    return compare(campaigns)


@pytest.fixture(scope="session")
def before(campaigns):
    return compare(campaigns[: history.BEFORE])


@pytest.fixture(scope="session")
def rigid():
    return turned.tested(turned.turning(turned.flown(1)))
