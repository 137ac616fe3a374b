"""The chapter's plan, and what is computed of it, once."""

import pytest

from acx4book.chapters.beyond.design import compared, curves, plans


@pytest.fixture(scope="session")
def plan():
    return plans.papers()


@pytest.fixture(scope="session")
def tables(plan):
    return {
        name: getattr(curves, f"over_{name}")(plan)
        for name in ("ratio", "turn", "pairs", "same_way", "control")
    }


@pytest.fixture(scope="session")
def chosen(plan):
    return compared.choice(plan, 1.25)
