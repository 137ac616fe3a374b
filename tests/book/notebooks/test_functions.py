"""Results without notebooks: the same tables, and nothing that draws or runs notebooks."""

import os
import shutil
import subprocess
import sys

import pytest
from threadpoolctl import threadpool_limits

import acx4sim
from acx4book.command.acx4 import ONE_THREAD
from acx4book.command.terminal import BOOK
from acx4book.notebooks import runner
from acx4book.notebooks.runner import NOTEBOOKS_PATH
from acx4files.results import folder as results_folder
from acx4files.results.provenance import EXECUTED
from acx4lib.errors import AdjustmentError
from support.flights import written

COMMAND = "from acx4book.command.acx4 import main; main()"


@pytest.fixture(scope="module")
def flight_path(tmp_path_factory):
    path = tmp_path_factory.mktemp("simulated") / "flight"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1), path)
    return path


@pytest.fixture(scope="module")
def computed(tmp_path_factory, flight_path):
    """Results of that flight; a test that changes them has a copy."""
    folder = tmp_path_factory.mktemp("computed") / "results"
    with threadpool_limits(1, user_api="blas"):
        runner.run(flight_path, folder)
    return folder


def tables(folder):
    return {name: (folder / name).read_bytes() for name in results_folder.FILES}


@pytest.mark.slow
@pytest.mark.repeats  # `test_payloads` has all notebooks of a flight of heads
def test_the_results_of_heads_and_rig_are_those_of_the_notebooks(tmp_path):
    """Also in a folder of a run with notebooks, which are gone with their results."""
    path = written.write_flight(tmp_path / "flight", blocks=("heads",))
    made = []
    for notebooks in (NOTEBOOKS_PATH, None):
        report = runner.run(path, tmp_path / "results", notebooks=notebooks)
        assert report.ran == ("heads", "synthetic", "rig")
        made.append(tables(tmp_path / "results"))
    assert made[0] == made[1]
    assert not (tmp_path / "results" / EXECUTED).exists()
    assert results_folder.is_whole(tmp_path / "results")


@pytest.fixture(scope="module")
def told(tmp_path_factory, flight_path):
    """A folder of results, and what their run said, in an environment that asks for two threads."""
    results = tmp_path_factory.mktemp("told") / "results"
    code = (
        "import atexit, sys\n"
        f"unwanted = {set(BOOK) - {'yaml'}!r}  # numba loads yaml where it is installed\n"
        "atexit.register(lambda: print('loaded', sorted(unwanted & set(sys.modules))))\n" + COMMAND
    )
    given = ("run", flight_path, "--results", results, "--numbers-only")
    done = subprocess.run(
        [sys.executable, "-c", code, *given],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | dict.fromkeys(ONE_THREAD, "2"),
    )
    return results, done


def test_nothing_that_draws_or_runs_notebooks_is_loaded(told):
    results, done = told
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == [
        "mounting: done",
        "validation: done",
        "heads: skipped, the flight has no block heads",
        "synthetic: skipped, the flight has no block heads",
        "validation: 1 of 60 images have no measurements: V3-01",
        f"results in {results}",
        "loaded []",
    ]


def test_threads_of_linear_algebra_change_no_bit(told, computed):
    """Whatever the user's environment asks for."""
    assert tables(told[0]) == tables(computed)


def test_a_stage_alone_replaces_only_its_own(tmp_path, flight_path, computed):
    folder = shutil.copytree(computed, tmp_path / "results")
    before = tables(folder)
    runner.run(flight_path, folder, stages=["validation"])
    assert tables(folder) == before


def test_a_stage_that_fails_leaves_no_results_of_an_earlier_run(
    tmp_path, flight_path, computed, monkeypatch
):
    folder = shutil.copytree(computed, tmp_path / "results")

    def fail(flight, path):
        msg = "no convergence"
        raise AdjustmentError(msg)

    monkeypatch.setattr(runner.mounting, "run", fail)
    with pytest.raises(AdjustmentError, match="no convergence"):
        runner.run(flight_path, folder)
    found = results_folder.read(folder)
    assert (found.summary, len(found.parameters)) == ({}, 0)
