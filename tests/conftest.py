"""The same examples every time, few of them; the command, and blocks that many tests adjust."""

import gc
import os
import sys

import numpy as np
import pytest
from hypothesis import settings

from acx4book.command.acx4 import GRAMMAR, main
from acx4files import flight
from acx4files.stages import pictures as taken
from acx4lib.bundle import adjust
from acx4lib.calibration.heads import calibrate_heads
from acx4lib.model import Model
from support import blocks
from support.flights import pictured
from support.flights.simulated import HEADS, fly

settings.register_profile("same", derandomize=True, max_examples=20, deadline=None)
settings.load_profile("same")

# what Python makes of the sources is kept: hundreds of processes load the same ones
sys.dont_write_bytecode = False
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.modules.setdefault(GRAMMAR, None)  # as the command does

gc.disable()  # while modules are imported and tests collected, all of which stay


def pytest_collection_finish():
    gc.freeze()  # so that no test has them looked through
    gc.set_threshold(20_000, 20, 20)  # tests make many small objects, and few circles of them
    gc.enable()


FREE = ("f", "xp", "yp", "k1", "p1", "p2")


@pytest.fixture
def rng():
    return np.random.default_rng(20180)


@pytest.fixture(scope="session")
def exact_block():
    """Two heights, opposite directions, nine control points; no noise."""
    return blocks.standard()


@pytest.fixture(scope="session")
def noisy_block(exact_block):
    """The same with noise of the size that its sigmas state."""
    return blocks.noisy(exact_block, np.random.default_rng(7))


@pytest.fixture(scope="session")
def mounted(noisy_block):
    """The noisy block adjusted in one step."""
    return adjust.adjust(
        adjust.mounted_orientation(blocks.approximate(noisy_block), Model(free=FREE))
    )


@pytest.fixture(scope="session")
def self_calibrated(noisy_block):
    """The noisy block adjusted with free exterior orientation."""
    return adjust.adjust(
        adjust.free_orientation(blocks.approximate(noisy_block), Model(free=("xp", "yp", "k1")))
    )


@pytest.fixture(scope="session")
def fits():
    """The study's heads, simulated and calibrated one by one."""
    flown = fly("acx4", seed=1, blocks=("heads",)).flight
    return calibrate_heads(flown.heads, HEADS, Model(free=flown.estimate_heads)).bundles


@pytest.fixture
def acx4(capsys):
    """Run the command; return status, standard output and standard error."""

    def run(*arguments):
        with pytest.raises(SystemExit) as end:
            main([str(argument) for argument in arguments])
        captured = capsys.readouterr()
        assert "Traceback" not in captured.err
        return end.value.code, captured.out, captured.err

    return run


# --- a small flight whose pictures are of one known scene, and its tie points ---------------------


@pytest.fixture(scope="session")
def scene_path(tmp_path_factory):
    return pictured.write_flight(tmp_path_factory.mktemp("pixels") / "flight")


@pytest.fixture(scope="session")
def scene_flight(scene_path):
    return flight.read(scene_path)


@pytest.fixture(scope="session")
def scene_orientation():
    return pictured.orientation()


@pytest.fixture(scope="session")
def scene_pictures(scene_flight, scene_orientation):
    return taken.read_pictures(scene_flight, scene_orientation)


@pytest.fixture(scope="session")
def scene_ties(scene_pictures, scene_orientation):
    return taken.find(scene_pictures, scene_orientation)
