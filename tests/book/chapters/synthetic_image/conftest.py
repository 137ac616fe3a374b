"""Results of the heads, and of the stage that refines them."""

import shutil

import pytest

from acx4lib.results import adjustments
from acx4lib.stages import heads, synthetic


@pytest.fixture(scope="session")
def folder(tmp_path_factory, stage):
    """Return a results folder that the heads stage has left."""
    folder = tmp_path_factory.mktemp("results")
    adjustments.write(folder, "heads", heads.records(stage))
    return folder


@pytest.fixture(scope="session")
def refined(flight, folder, tmp_path_factory):
    copy = shutil.copytree(folder, tmp_path_factory.mktemp("refined") / "results")
    return synthetic.run(flight, copy), copy
