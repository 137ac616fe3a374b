"""One flight of many: run, kept, or failed with a reason in one line."""

import csv
import shutil
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from pathlib import Path

import distributed
import pytest

import acx4sim
from acx4book.command import runs
from acx4book.notebooks import runner
from acx4book.planning import plan as plans
from acx4files.flight import reader
from acx4files.results import folder, provenance
from acx4files.results import folder as results
from acx4lib.errors import AdjustmentError, FlightError, OutputError
from support.flights import written
from support.flights.planned import values
from support.flights.written import change


def run(job):
    """Run a flight in the folder of its results."""
    with ThreadPoolExecutor(1) as pool:
        return runs.run_all([job], job.results.parent, pool)[job.name]


def rows(path):
    """Rows of a table by flight."""
    with path.open(newline="", encoding="utf-8") as file:
        return {row["flight"]: row for row in csv.DictReader(file)}


@pytest.fixture
def job(small_flights, settings, tmp_path):
    shutil.copytree(small_flights[0], tmp_path / "flight")
    (one,) = runs.of_flights([tmp_path / "flight"], tmp_path / "all", settings)
    return one


def test_a_flight_is_run_once_and_again_when_it_was_changed(job):
    first = run(job)
    assert (first.status, first.reason, first.kept) == (0, "", False)
    assert run(job) == replace(first, kept=True)
    change(job.flight, "control_points.csv", lambda t: t.assign(height_m=t["height_m"] + 0.01))
    changed = run(job)
    assert not changed.kept
    assert changed.row["lever_z_m"] != first.row["lever_z_m"]


def test_bad_input_is_status_2_with_its_first_line_and_no_old_numbers(job):
    run(job)
    change(job.flight, "calibration/image_points.csv", lambda t: t.assign(col_px=-1e9))
    found = run(job)
    assert (found.status, found.row) == (2, {})
    assert found.reason.startswith(
        "calibration/image_points.csv:2: col_px: -1000000000.0; must lie"
    )
    assert " more)" in found.reason
    assert "\n" not in found.reason


def test_a_stage_that_fails_is_status_1_with_what_was_found_before_and_no_old_numbers(
    job, monkeypatch
):
    run(job)
    change(job.flight, "control_points.csv", lambda t: t.assign(height_m=t["height_m"] + 0.01))

    def fail(*_):
        message = "mounting: does\nnot converge"
        raise AdjustmentError(message)

    with monkeypatch.context() as patched:
        patched.setattr(runner.mounting, "run", fail)
        found = run(job)
    assert (found.status, found.row) == (1, {})
    assert found.reason == "mounting: does (and 1 more)"
    assert run(job).status == 0  # it is tried again


def test_any_error_is_a_line(job, monkeypatch):
    def fail(*_, **__):
        raise OSError(28, "No space left on device", "/x/y")

    monkeypatch.setattr(runner, "run", fail)
    found = run(job)
    assert (found.status, found.reason) == (2, "/x/y: No space left on device")


def test_a_seed_is_simulated_once_and_run_as_the_two_commands_would(tmp_path, settings):
    (job,) = runs.of_seeds(["single-head"], [3], tmp_path / "all", settings)
    found = run(job)
    assert (found.status, found.reason) == (0, "")
    assert (tmp_path / "all" / "simulated" / "single-head-3.truth.json").is_file()
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=3), tmp_path / "alone")
    runner.run(tmp_path / "alone", tmp_path / "results")
    for name in results.FILES:
        assert (job.results / name).read_bytes() == (tmp_path / "results" / name).read_bytes()
    before = (job.flight / "flight.toml").stat().st_mtime_ns
    assert run(job).kept
    assert (job.flight / "flight.toml").stat().st_mtime_ns == before


def test_a_plan_is_flown_by_its_seeds_and_its_flights_are_not_those_of_another(tmp_path, settings):
    plan = tmp_path / "village.toml"
    plan.write_text(plans.written(values()))
    job, other = runs.of_seeds([str(plan)], [1, 2], tmp_path / "all", settings)
    assert [job.name, other.name] == ["village-1", "village-2"]
    found = run(job)
    assert (found.status, found.reason, found.kept) == (0, "", False)
    assert job.flight.with_name("village-1.plan.toml").read_bytes() == plan.read_bytes()
    assert run(job).kept
    assert run(other).row["f_mm"] != found.row["f_mm"]
    plan.write_text(plans.written({**values(), "name": "another name"}))
    refused = run(job)
    assert refused.status == 2
    assert "was flown by another plan than" in refused.reason
    assert "choose another folder" in refused.reason


# --- Many flights in one folder: equal bytes wherever they are run, whatever fails or is killed


@pytest.fixture(scope="module")
def one_by_one(small_flights, tmp_path_factory):
    """Return the bytes of the results of every flight, run by itself."""
    folder = tmp_path_factory.mktemp("one-by-one")
    for path in small_flights:
        runner.run(path, folder / path.name)
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


def contents(folder):
    """Return the bytes of all files of all flights, by flight and name."""
    paths = [path for path in folder.glob("*/**/*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in paths}


def run_in(executor, flights, folder, settings):
    with executor as pool:
        return runs.run_all(runs.of_flights(flights, folder, settings), folder, pool)


def test_a_second_call_runs_only_what_is_missing_or_was_changed(
    run_here, small_flights, one_by_one, tmp_path
):
    own = [shutil.copytree(path, tmp_path / path.name) for path in small_flights]
    said = []
    run_here(own[:2], tmp_path / "all")
    change(own[1], "control_points.csv", lambda t: t.assign(height_m=t["height_m"] + 0.01))
    found = run_here(own, tmp_path / "all", tell=lambda *now: said.append(now))
    assert [one.kept for one in found.values()] == [True, False, False]
    assert sorted(said) == sorted((p.name, done, 1) for p in own for done in (0, 1))
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
    table = rows(tmp_path / "all" / runs.TABLE)
    assert list(table) == ["flight1", "bad", "nowhere", "flight2", "flight3"]
    assert table["bad"]["reason"].startswith("control_points.csv:2: sigma_east_m: -1")
    assert table["bad"]["f_mm"] == ""
    assert float(table["flight3"]["sigma_f_mm"]) > 0


def test_a_folder_of_something_else_is_left_alone(run_here, small_flights, tmp_path):
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "notes.txt").touch()
    with pytest.raises(OutputError, match="holds files that acx4 did not write"):
        run_here(small_flights, tmp_path / "theirs")
    assert [path.name for path in (tmp_path / "theirs").iterdir()] == ["notes.txt"]


def test_an_interrupt_leaves_the_table_of_what_is_finished(run_here, small_flights, tmp_path):
    def interrupt(_name, done, _total):
        if done:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_here(small_flights, tmp_path / "all", tell=interrupt)
    assert list(rows(tmp_path / "all" / runs.TABLE)) == ["flight1"]
    found = run_here(small_flights, tmp_path / "all")
    assert found["flight1"].kept
    assert [one.status for one in found.values()] == [0, 0, 0]


@pytest.mark.slow
def test_two_processes_leave_the_bytes_of_one(
    in_one_process, small_flights, one_by_one, settings, tmp_path
):
    folder = tmp_path / "all"
    found = run_in(runs.executor(2, None), small_flights, folder, settings)
    assert [one.status for one in found.values()] == [0, 0, 0]
    assert contents(folder) == one_by_one
    assert (folder / runs.TABLE).read_bytes() == (in_one_process / runs.TABLE).read_bytes()


def test_a_process_that_dies_is_a_line_and_the_same_call_goes_on(small_flights, settings, tmp_path):
    class Dying(ThreadPoolExecutor):
        def submit(self, *_, **__):
            dead = Future()
            dead.set_exception(BrokenProcessPool("terminated abruptly"))
            return dead

    found = run_in(Dying(1), small_flights[:1], tmp_path / "all", settings)
    assert found["flight1"].reason.startswith("BrokenProcessPool: terminated abruptly; short of")
    found = run_in(ThreadPoolExecutor(1), small_flights[:1], tmp_path / "all", settings)
    assert found["flight1"].status == 0


def test_a_scheduler_that_is_not_there_is_one_line():
    with (
        pytest.raises(FlightError, match=r"--cluster tcp://127.0.0.1:9: no Dask scheduler answers"),
        runs.executor(1, "tcp://127.0.0.1:9"),
    ):
        pass


@pytest.mark.slow
@pytest.mark.repeats
def test_a_cluster_leaves_the_same_bytes(
    in_one_process, small_flights, one_by_one, settings, tmp_path, cluster
):
    folder = tmp_path / "all"
    found = run_in(runs.executor(1, cluster), small_flights, folder, settings)
    assert [one.reason for one in found.values()] == ["", "", ""]
    assert contents(folder) == one_by_one
    assert (folder / runs.TABLE).read_bytes() == (in_one_process / runs.TABLE).read_bytes()


# --- Names and folders of many flights -------------------------------------------------------


SETTINGS = runs.Settings(stages=("mounting",))


def named(*paths):
    return [job.name for job in runs.of_flights([Path(p) for p in paths], Path("out"), SETTINGS)]


def test_a_name_is_that_of_the_folder_however_it_is_called(tmp_path, monkeypatch):
    flight = tmp_path / "real"
    flight.mkdir()
    (tmp_path / "link").symlink_to(flight)
    monkeypatch.chdir(flight)
    assert named(".", "../link", "../other/") == ["real", "link", "other"]
    (job, *_) = runs.of_flights([Path()], Path("../out"), SETTINGS)
    assert (job.flight, job.results) == (flight, tmp_path / "out" / "real")


@pytest.mark.parametrize("paths", [["/a/f", "/a/../a/f"], ["/a/flights.csv"], ["/a/.hidden"]])
def test_flights_that_cannot_be_named_are_refused(paths):
    with pytest.raises(ValueError, match=r"cannot be the one name of a flight's results; rename"):
        named(*paths)


def test_seeds_are_of_every_design_and_have_places_for_their_flights(tmp_path):
    found = runs.of_seeds(["acx4", "single-head", "acx4"], [2, 5], tmp_path, SETTINGS)
    assert [job.name for job in found] == ["acx4-2", "acx4-5", "single-head-2", "single-head-5"]
    assert (found[3].design, found[3].seed) == ("single-head", 5)
    assert found[3].flight == tmp_path / "simulated" / "single-head-5"
    assert found[3].results == tmp_path / "single-head-5"


def test_seeds_are_ranges_and_numbers_each_once():
    assert runs.seeds_of("1-3") == [1, 2, 3]
    assert runs.seeds_of("7, 1-3,2,0") == [7, 1, 2, 3, 0]


@pytest.mark.parametrize("text", ["", "1-", "3-1", "1.5", "1,,2", "a"])
def test_what_names_no_seeds_is_refused(text):
    with pytest.raises(ValueError, match="names no seeds; give whole numbers, as in 1-200"):
        runs.seeds_of(text)


# --- Which results are kept: those that a run would leave as they are ------------------------


@pytest.fixture(scope="module")
def left(small_flights, tmp_path_factory):
    folder = tmp_path_factory.mktemp("left") / "results"
    runner.run(small_flights[0], folder)
    return folder


@pytest.mark.parametrize(
    ("changed", "flown", "is_whole"),
    [
        ("", 0, True),
        ("", 1, False),
        ("parameters.csv", 0, False),
        ("residuals.csv", 0, False),
        ("flight/flight.toml", 0, False),
    ],
)
def test_results_are_whole_as_long_as_they_are_those_of_the_flight(
    small_flights, left, settings, tmp_path, changed, flown, is_whole
):
    own = shutil.copytree(left, tmp_path / "results")
    if changed:
        with (own / changed).open("a") as file:
            file.write(" ")
    assert runs.is_whole(reader.read(small_flights[flown]), own, settings) == is_whole


def test_other_versions_stages_and_notebooks_are_run_again(
    small_flights, left, settings, tmp_path, monkeypatch
):
    flight = reader.read(small_flights[0])
    assert not runs.is_whole(flight, tmp_path / "nowhere", settings)
    assert not runs.is_whole(flight, left, replace(settings, notebooks=tmp_path))
    before = provenance.versions()
    monkeypatch.setattr(provenance, "versions", lambda: before | {"numpy": "0.1"})
    assert not runs.is_whole(flight, left, settings)


def test_a_stage_that_is_missing_counts(tmp_path, settings):
    path = written.write_flight(tmp_path / "flight", blocks=("heads",))
    flight, results = reader.read(path), tmp_path / "results"
    runner.run(path, results, stages=["heads"])
    assert runs.is_whole(flight, results, replace(settings, stages=("heads",)))
    assert not runs.is_whole(flight, results, settings)


# --- The table of many flights, beside what the results of each say


def test_a_row_has_the_single_step_as_it_is_written(run_here, small_flights, tmp_path):
    row = run_here(small_flights[:1], tmp_path / "all")["flight1"].row
    found = folder.read(tmp_path / "all" / "flight1")
    parameters = folder.parameters(found, "mounting/single_step", row["camera"])
    assert len(parameters) >= 12
    for name, one in parameters.iterrows():
        assert float(row[name]) == one["value"]
        assert float(row[f"sigma_{name}"]) == one["sigma"]
    entry = found.summary["mounting/single_step"]
    assert float(row["sigma0_squared"]) == entry["sigma0_squared"]
    assert int(row["redundancy"]) == entry["redundancy"]
    assert "n_check_points" not in row  # there is no such block
    with (tmp_path / "all" / runs.TABLE).open(newline="", encoding="utf-8") as file:
        (written_row,) = csv.DictReader(file)
    assert tuple(written_row) == runs.COLUMNS
    assert (
        written_row == dict.fromkeys(runs.COLUMNS, "") | {"flight": "flight1", "status": "0"} | row
    )


def test_check_points_are_those_of_the_validation(run_here, tmp_path):
    flight = written.write_flight(tmp_path / "flight", blocks=("validation",))
    row = run_here([flight], tmp_path / "all")["flight"].row
    entry = folder.read(tmp_path / "all" / "flight").summary["validation/given"]
    assert int(row["n_check_points"]) == entry["n_points"]
    keys = ("rms_east_m", "rms_north_m", "rms_height_m")
    assert [float(row[key]) for key in keys] == entry["points"]["rms"]
    assert float(row["mean_height_m"]) == entry["points"]["mean"][2]
    assert row["normalised_rms_east"] == repr(entry["points"]["normalised_rms"][0])
