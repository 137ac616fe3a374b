"""Fixtures: a small flight whose pictures are of one known scene, and its tie points."""

import pytest

from acx4lib import flight as flights
from acx4lib.stages import pictures as taken
from support.flights import pictured


@pytest.fixture(scope="session")
def scene_path(tmp_path_factory):
    return pictured.write_flight(tmp_path_factory.mktemp("pixels") / "flight")


@pytest.fixture(scope="session")
def scene_flight(scene_path):
    return flights.read(scene_path)


@pytest.fixture(scope="session")
def scene_orientation():
    return pictured.orientation()


@pytest.fixture(scope="session")
def scene_pictures(scene_flight, scene_orientation):
    return taken.read_pictures(scene_flight, scene_orientation)


@pytest.fixture(scope="session")
def scene_ties(scene_pictures, scene_orientation):
    return taken.find(scene_pictures, scene_orientation)
