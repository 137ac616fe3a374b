"""One flight of many: run, kept, or failed with a reason in one line."""

import errno
import shutil
from dataclasses import replace

import pytest

import acx4sim
from acx4book.command.batch import jobs, work
from acx4book.command.batch.processes import ProcessDiedError
from acx4book.notebooks import functions, runner
from acx4lib.errors import AdjustmentError
from acx4lib.results import folder as results
from acx4lib.results import provenance
from acx4tools.planning import plan as plans
from support.flights.planned import values
from support.flights.spoilt import change


@pytest.fixture
def job(small_flights, settings, tmp_path):
    shutil.copytree(small_flights[0], tmp_path / "flight")
    (one,) = jobs.of_flights([tmp_path / "flight"], tmp_path / "all", settings)
    return one


def test_a_flight_is_run_once_and_again_when_it_was_changed(job):
    first = work.run(job)
    assert (first.status, first.reason, first.kept) == (0, "", False)
    assert float(first.times["seconds"]) > 0
    again = work.run(job)
    assert again == replace(first, kept=True, times={})
    change(job.flight, "control_points.csv", lambda t: t.assign(height_m=t["height_m"] + 0.01))
    changed = work.run(job)
    assert not changed.kept
    assert changed.row["lever_z_m"] != first.row["lever_z_m"]


def test_bad_input_is_status_2_with_its_first_line_and_no_old_numbers(job):
    work.run(job)
    change(job.flight, "calibration/image_points.csv", lambda t: t.assign(col_px=-1e9))
    found = work.run(job)
    assert (found.status, found.row) == (2, {})
    assert found.reason.startswith(
        "calibration/image_points.csv:2: col_px: -1000000000.0; must lie"
    )
    assert " more)" in found.reason
    assert "\n" not in found.reason


def test_a_stage_that_fails_is_status_1_with_what_was_found_before_and_no_old_numbers(
    job, monkeypatch
):
    work.run(job)
    change(job.flight, "control_points.csv", lambda t: t.assign(height_m=t["height_m"] + 0.01))

    def fail(*_):
        message = "mounting: does\nnot converge"
        raise AdjustmentError(message)

    with monkeypatch.context() as patched:
        patched.setitem(functions.RUNS, "mounting", fail)
        found = work.run(job)
    assert (found.status, found.row) == (1, {})
    assert found.reason == "mounting: does (and 1 more)"
    assert work.run(job).status == 0  # it is tried again


def test_what_a_run_says_of_the_results_is_said_of_kept_ones_too(job, monkeypatch):
    work.run(job)
    monkeypatch.setattr(runner, "wrong", lambda *_: iter(["mounting/single_step: weak"]))
    found = work.run(job)
    assert (found.kept, found.status, found.reason) == (True, 1, "mounting/single_step: weak")
    assert found.row["f_mm"]


@pytest.mark.parametrize(
    ("error", "status", "reason"),
    [
        (OSError(28, "No space left on device", "/x/y"), 2, "/x/y: No space left on device"),
        (KeyError("k"), 1, "this is a mistake in acx4: KeyError: 'k'"),
    ],
)
def test_any_error_is_a_line(job, monkeypatch, error, status, reason):
    def fail(*_, **__):
        raise error

    monkeypatch.setattr(runner, "run", fail)
    found = work.run(job)
    assert (found.status, found.reason) == (status, reason)


def test_a_seed_is_simulated_once_and_run_as_the_two_commands_would(tmp_path, settings):
    (job,) = jobs.of_seeds(["single-head"], [3], tmp_path / "all", settings)
    found = work.run(job)
    assert (found.status, found.reason) == (0, "")
    assert (tmp_path / "all" / "simulated" / "single-head-3.truth.json").is_file()
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=3), tmp_path / "alone")
    runner.run(tmp_path / "alone", tmp_path / "results", way=work.way_of(None))
    for name in (*results.FILES, provenance.FILE):
        assert (job.results / name).read_bytes() == (tmp_path / "results" / name).read_bytes()
    before = (job.flight / "flight.toml").stat().st_mtime_ns
    assert work.run(job).kept
    assert (job.flight / "flight.toml").stat().st_mtime_ns == before


def test_a_plan_is_flown_by_its_seeds_and_its_flights_are_not_those_of_another(tmp_path, settings):
    plan = tmp_path / "village.toml"
    plan.write_text(plans.written(values()))
    job, other = jobs.of_seeds([str(plan)], [1, 2], tmp_path / "all", settings)
    assert [job.name, other.name] == ["village-1", "village-2"]
    found = work.run(job)
    assert (found.status, found.reason, found.kept) == (0, "", False)
    assert (work.plan_beside(job.flight)).read_bytes() == plan.read_bytes()
    assert work.run(job).kept
    assert work.run(other).row["f_mm"] != found.row["f_mm"]
    plan.write_text(plans.written({**values(), "name": "another name"}))
    refused = work.run(job)
    assert refused.status == 2
    assert "was flown by another plan than" in refused.reason
    assert "choose another folder" in refused.reason


def test_a_worker_that_died_is_a_line():
    gone = work.lost(FileNotFoundError(errno.ENOENT, "the current folder is no more"))
    assert (gone.status, gone.reason) == (2, "the current folder is no more")
    found = work.lost(ProcessDiedError("its process was ended\nby signal SIGKILL"))
    assert found.status == 1
    assert found.reason.startswith("its process was ended by signal SIGKILL; short of memory?")
