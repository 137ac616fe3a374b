"""Many flights in one folder: equal bytes wherever they are run, whatever fails or is killed."""

import json
import os
import shutil
import signal
import threading
import time

import distributed
import pytest

from acx4book.command.batch import executors, jobs, runs, standing
from acx4book.notebooks import runner
from acx4book.notebooks.functions import Functions
from acx4lib.errors import OutputError
from support.flights.spoilt import change


@pytest.fixture(scope="module")
def one_by_one(small_flights, tmp_path_factory):
    """Return the bytes of the results of every flight, run by itself."""
    folder = tmp_path_factory.mktemp("one-by-one")
    for path in small_flights:
        runner.run(path, folder / path.name, way=Functions())
    return contents(folder)


@pytest.fixture(scope="module")
def in_one_process(run_here, small_flights, one_by_one, tmp_path_factory):
    """Return the folder of all flights, run here one after the other: each as by itself."""
    folder = tmp_path_factory.mktemp("one") / "all"
    run_here(small_flights, folder)
    assert contents(folder) == one_by_one
    return folder


@pytest.fixture
def cluster():
    """Start a scheduler and two workers, each a process that is replaced when it dies."""
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0"
    ) as started:
        yield started.scheduler_address


@pytest.fixture
def killing(tmp_path):
    """Kill the process that is the first to write results below a folder."""
    stop, killed = threading.Event(), []

    def watch():
        while not (stop.is_set() or killed):
            for lock in tmp_path.glob("all/*/.acx4.lock"):
                try:
                    owner = json.loads(lock.read_text())["process"]
                except (OSError, ValueError):  # not yet, or no more
                    continue
                if owner != os.getpid():
                    os.kill(owner, signal.SIGKILL)
                    killed.append(lock.parent.name)
                    break
            time.sleep(0.001)

    thread = threading.Thread(target=watch)
    thread.start()
    yield killed
    stop.set()
    thread.join()


def contents(folder):
    """Return the bytes of all files of all flights, by flight and name."""
    paths = [path for path in folder.glob("*/**/*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


def run_in(executor, flights, folder, settings):
    with executor as pool:
        return runs.run_all(jobs.of_flights(flights, folder, settings), folder, pool)


def test_a_second_call_runs_only_what_is_missing_or_was_changed(
    run_here, small_flights, one_by_one, tmp_path
):
    own = [shutil.copytree(path, tmp_path / path.name) for path in small_flights]
    said = []
    run_here(own[:2], tmp_path / "all")
    change(own[1], "control_points.csv", lambda t: t.assign(height_m=t["height_m"] + 0.01))
    times = standing.read(tmp_path / "all" / runs.TIMES)
    found = run_here(own, tmp_path / "all", tell=lambda *now: said.append(now))
    assert [one.kept for one in found.values()] == [True, False, False]
    assert sorted(said) == sorted((p.name, done, 1) for p in own for done in (0, 1))
    again = standing.read(tmp_path / "all" / runs.TIMES)
    assert again["flight1"] == times["flight1"]  # what it took when it was run
    assert again["flight2"] != times["flight2"]
    left = contents(tmp_path / "all")
    for name in ("flight1", "flight3"):
        expected = {k: v for k, v in one_by_one.items() if k.startswith(name)}
        assert {k: v for k, v in left.items() if k.startswith(name)} == expected


def test_a_flight_that_fails_stops_no_other(run_here, small_flights, one_by_one, tmp_path):
    bad = shutil.copytree(small_flights[1], tmp_path / "bad")
    change(bad, "control_points.csv", lambda t: t.assign(sigma_east_m=-1.0))
    flights = [small_flights[0], bad, tmp_path / "nowhere", *small_flights[1:]]
    found = run_here(flights, tmp_path / "all")
    assert [one.status for one in found.values()] == [0, 2, 2, 0, 0]
    assert contents(tmp_path / "all") == one_by_one
    rows = standing.read(tmp_path / "all" / runs.TABLE)
    assert list(rows) == ["flight1", "bad", "nowhere", "flight2", "flight3"]
    assert rows["bad"]["reason"].startswith("control_points.csv:2: sigma_east_m: -1")
    assert rows["bad"]["f_mm"] == ""
    assert float(rows["flight3"]["sigma_f_mm"]) > 0


def test_a_folder_of_something_else_is_left_alone(run_here, small_flights, tmp_path):
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "notes.txt").touch()
    with pytest.raises(OutputError, match="holds what acx4 run of many flights did not write"):
        run_here(small_flights, tmp_path / "theirs")
    with pytest.raises(OutputError, match="holds the flight"):
        run_here(small_flights, small_flights[0].parent)
    assert [path.name for path in (tmp_path / "theirs").iterdir()] == ["notes.txt"]


def test_an_interrupt_leaves_the_table_of_what_is_finished(run_here, small_flights, tmp_path):
    def interrupt(_name, done, _total):
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_here(small_flights, tmp_path / "all", tell=interrupt)
    assert list(standing.read(tmp_path / "all" / runs.TABLE)) == ["flight1"]
    found = run_here(small_flights, tmp_path / "all")
    assert found["flight1"].kept
    assert [one.status for one in found.values()] == [0, 0, 0]


@pytest.mark.slow
def test_two_processes_leave_the_bytes_of_one_and_one_that_is_killed_is_reported(
    in_one_process, small_flights, one_by_one, settings, tmp_path, killing
):
    folder = tmp_path / "all"
    found = run_in(executors.on_processes(2), small_flights, folder, settings)
    (name,) = killing
    assert {key: one.status for key, one in found.items() if one.status} == {name: 1}
    assert found[name].reason.startswith("its process was ended by signal SIGKILL")
    found = run_in(executors.on_processes(2), small_flights, folder, settings)
    assert {key for key, one in found.items() if not one.kept} == {name}
    assert contents(folder) == one_by_one
    assert (folder / runs.TABLE).read_bytes() == (in_one_process / runs.TABLE).read_bytes()


@pytest.mark.slow
def test_a_cluster_leaves_the_same_bytes_also_where_a_worker_is_killed(
    in_one_process, small_flights, one_by_one, settings, tmp_path, cluster, killing
):
    """The scheduler gives the flight of the worker that died to another."""
    folder = tmp_path / "all"
    found = run_in(executors.on_cluster(cluster), small_flights, folder, settings)
    assert len(killing) == 1
    assert [one.reason for one in found.values()] == ["", "", ""]
    assert contents(folder) == one_by_one
    assert (folder / runs.TABLE).read_bytes() == (in_one_process / runs.TABLE).read_bytes()
