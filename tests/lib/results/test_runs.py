"""Stages that write their results by themselves leave the folder as a run of all of them does."""

import shutil

import pytest
from threadpoolctl import threadpool_limits

import acx4sim
from acx4book.notebooks import runner
from acx4book.notebooks.functions import Functions
from acx4lib.errors import FlightError, OutputError
from acx4lib.flight import reader
from acx4lib.results import provenance
from acx4lib.stages import mounting, validation


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Two flights, and the results of the first by a run."""
    at = tmp_path_factory.mktemp("flown")
    for name, seed in (("flight", 1), ("other", 2)):
        acx4sim.write(acx4sim.DESIGNS["single-head"](seed=seed), at / name)
    runner.run(at / "flight", at / "results", way=Functions())
    return at


def contents(folder):
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_stages_one_by_one_leave_the_bytes_of_a_run(flown, tmp_path):
    flight = reader.read(flown / "flight")
    with threadpool_limits(1, user_api="blas"):  # as in a run
        mounting.run(flight, tmp_path / "results")
        validation.run(flight, tmp_path / "results")
        assert contents(tmp_path / "results") == contents(flown / "results")
        validation.run(flight, tmp_path / "results")
    assert contents(tmp_path / "results") == contents(flown / "results")
    assert provenance.read_run(tmp_path / "results").flight.name == flight.name


def test_a_folder_of_somebody_else_is_left_as_it_is(flown, tmp_path):
    (tmp_path / "letter.txt").write_text("dear all")
    with pytest.raises(OutputError, match=r"holds what acx4 run did not write \(letter\.txt\)"):
        mounting.run(reader.read(flown / "flight"), tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["letter.txt"]


def test_results_of_another_flight_are_not_left_beside_new_ones(flown, tmp_path):
    results = shutil.copytree(flown / "results", tmp_path / "results")
    before = contents(results)
    with pytest.raises(FlightError, match="the results of stage validation are of the flight"):
        mounting.run(reader.read(flown / "other"), results)
    assert contents(results) == before


def test_changed_results_are_not_built_upon(flown, tmp_path):
    results = shutil.copytree(flown / "results", tmp_path / "results")
    with (results / "summary.json").open("a") as file:
        file.write("\n")
    before = contents(results)
    with pytest.raises(FlightError, match=r"summary\.json: was changed since acx4 run wrote it"):
        validation.run(reader.read(flown / "flight"), results)
    assert contents(results) == before


def test_a_calibration_of_an_earlier_flight_is_not_set_beside_the_own(flown, tmp_path):
    other, results = reader.read(flown / "other"), tmp_path / "results"
    with threadpool_limits(1, user_api="blas"):
        validation.run(other, results, flown / "results")
    runner.run(
        flown / "other",
        tmp_path / "by_run",
        way=Functions(),
        stages=["validation"],
        calibration=flown / "results",
    )
    assert contents(results) == contents(tmp_path / "by_run")
    assert "calibration" in provenance.read(results).stages["validation"]
    with pytest.raises(FlightError, match="own calibration beside a validation of an earlier"):
        mounting.run(other, results)


def test_the_copy_of_a_run_is_written_into_as_it_is(flown, tmp_path):
    flight = reader.read(flown / "flight")
    (tmp_path / provenance.COPY).write_text("")
    with provenance.written(tmp_path, "mounting", flight) as folder:
        assert folder == tmp_path
    assert [path.name for path in tmp_path.iterdir()] == [provenance.COPY]
