"""The stored tables, whatever is on this machine."""

import pytest

from acx4book.reference import comparisons


@pytest.fixture
def stored(tmp_path):
    return lambda name: comparisons.computed_or_stored(name, folder=str(tmp_path)).table
