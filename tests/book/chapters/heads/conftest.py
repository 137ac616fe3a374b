"""Parts of the calibrated heads, and the heads with other focal lengths."""

import pytest

from acx4book.chapters.heads.held_focal_length import all_heads


@pytest.fixture(scope="session")
def fits(stage):
    return stage.heads.bundles


@pytest.fixture(scope="session")
def orientation(stage):
    return stage.orientation


@pytest.fixture(scope="session")
def held(flight, stage):
    return all_heads(flight, stage, (-0.5, 0.0, 0.5))
