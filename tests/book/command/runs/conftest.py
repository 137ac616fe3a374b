"""Small flights without errors in their files."""

from concurrent.futures import ThreadPoolExecutor

import pytest

import acx4sim
from acx4book.command import runs
from acx4files.results import folder as results
from support.flights import planted

SEEDS = (1, 2, 3)


@pytest.fixture(scope="session")
def small_flights(tmp_path_factory):
    folder = tmp_path_factory.mktemp("many")
    paths = [folder / f"flight{seed}" for seed in SEEDS]
    for seed, path in zip(SEEDS, paths, strict=True):
        acx4sim.write(planted.clean("single-head", "geodetic", "small", seed=seed), path)
    return paths


@pytest.fixture(scope="session")
def settings():
    return runs.Settings(stages=results.STAGES)


@pytest.fixture(scope="session")
def run_here(settings):
    """Run flights one after the other in this process."""

    def run(flights, folder, tell=lambda *_: None):
        with ThreadPoolExecutor(1) as pool:
            return runs.run_all(runs.of_flights(flights, folder, settings), folder, pool, tell)

    return run
