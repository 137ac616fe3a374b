"""Four simulated cameras around a car, what they see, and the corners of their target."""

from __future__ import annotations

import pytest

from acx4book.reference.surround.corners import find_corners
from acx4book.reference.surround.views import view
from support.pictures import surround_rigs
from support.pictures.surround_rigs import NAMES


@pytest.fixture(scope="session")
def cameras():
    return tuple(surround_rigs.camera(name) for name in NAMES)


@pytest.fixture(scope="session")
def images():
    ground = surround_rigs.chequered_ground()
    return tuple(surround_rigs.photograph(name, ground) for name in NAMES)


@pytest.fixture(scope="session")
def views(cameras, images):
    return tuple(view(c, image) for c, image in zip(cameras, images, strict=True))


@pytest.fixture(scope="session")
def corners(cameras, views):
    return find_corners(cameras, views)
