"""The chapter's campaigns and its rig, made once."""

import pytest

from acx4book.chapters.beyond.stability import history
from acx4lib.results.campaigns.comparison import compare
from support.campaigns import campaign, rigidity_of_a_turned_head


@pytest.fixture(scope="session")
def campaigns():
    return [campaign(one) for one in history.flights(1)]


@pytest.fixture(scope="session")
def every(campaigns):
    return compare(campaigns)


@pytest.fixture(scope="session")
def before(campaigns):
    return compare(campaigns[: history.BEFORE])


@pytest.fixture(scope="session")
def rigid():
    return rigidity_of_a_turned_head(1)
