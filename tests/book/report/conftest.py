"""Results of a small run, and a copy of them to be spoilt."""

import shutil

import pytest

from acx4book.report.material import read
from support.run_results import leave_results


@pytest.fixture(scope="session")
def made(tmp_path_factory):
    return leave_results(tmp_path_factory.mktemp("report"))


@pytest.fixture(scope="session")
def run(made):
    return read(made[1])


@pytest.fixture
def folder(made, tmp_path):
    """A copy of the results, to be spoilt."""
    shutil.copytree(made[1], tmp_path / "results")
    return tmp_path / "results"
