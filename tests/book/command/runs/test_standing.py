"""Which results are kept: those that a run would leave as they are."""

import csv
import json
import shutil
from dataclasses import replace

import pytest

from acx4book.command import runs
from acx4book.notebooks import runner
from acx4book.notebooks.runner import Functions
from acx4lib.flight import reader
from acx4lib.results import folder, provenance
from acx4lib.results.provenance import EXECUTED
from support.flights import written
from support.helpers import write_notebook


@pytest.fixture
def flight(small_flights):
    return reader.read(small_flights[0])


@pytest.fixture
def left(small_flights, tmp_path):
    runner.run(small_flights[0], tmp_path / "results", way=Functions())
    return tmp_path / "results"


def test_results_of_the_flight_as_it_is_are_whole(flight, left, settings, tmp_path):
    assert runs.is_whole(flight, left, settings)
    assert not runs.is_whole(flight, tmp_path / "nowhere", settings)


def test_results_of_another_flight_are_not(small_flights, left, settings):
    assert not runs.is_whole(reader.read(small_flights[1]), left, settings)


@pytest.mark.parametrize("name", ["parameters.csv", "summary.json", "flight/flight.toml"])
def test_results_that_were_changed_are_not(flight, left, settings, name):
    with (left / name).open("a") as file:
        file.write(" ")
    assert not runs.is_whole(flight, left, settings)


def test_results_of_another_version_are_not(flight, left, settings, monkeypatch):
    before = provenance.versions()
    monkeypatch.setattr(provenance, "versions", lambda: before | {"numpy": "0.1"})
    assert not runs.is_whole(flight, left, settings)


def test_a_stage_that_is_missing_counts(tmp_path, settings):
    path = written.write_flight(tmp_path / "flight", blocks=("heads",))
    flight, results = reader.read(path), tmp_path / "results"
    runner.run(path, results, way=Functions(), stages=["heads"])
    assert runs.is_whole(flight, results, replace(settings, stages=("heads",)))
    assert not runs.is_whole(flight, results, settings)
    runner.run(path, results, way=Functions())
    assert runs.is_whole(flight, results, settings)
    (results / ".acx4.json").unlink()
    summary = json.loads((results / "summary.json").read_text())
    del summary["mounting/rig"]  # as of a run that was killed before its last part
    (results / "summary.json").write_text(json.dumps(summary))
    shutil.move(results, tmp_path / "killed")
    with runner.own_folder.claim(results, command=runner.COMMAND) as own:
        own.expect(str(p.relative_to(tmp_path / "killed")) for p in files(tmp_path / "killed"))
        shutil.copytree(tmp_path / "killed", results, dirs_exist_ok=True)
        own.seal()
    assert not runs.is_whole(flight, results, settings)


def files(folder):
    return [path for path in folder.rglob("*") if path.is_file()]


def test_notebooks_that_are_wanted_must_be_there_with_the_cells_that_they_have(
    flight, left, settings, tmp_path
):
    for place, more in ((tmp_path / "notebooks", ""), (left / EXECUTED, "seed = 2")):
        for part in ("flight", "mounting"):
            write_notebook(place / f"{runner.NOTEBOOKS[part]}.ipynb", f"seed = 1\n{more}", "seed")
    wanted = replace(settings, notebooks=tmp_path / "notebooks")
    assert runs.is_whole(flight, left, wanted)
    write_notebook(
        tmp_path / "notebooks" / f"{runner.NOTEBOOKS['mounting']}.ipynb", "seed = 1", "seed + 1"
    )
    assert not runs.is_whole(flight, left, wanted)
    (left / EXECUTED / f"{runner.NOTEBOOKS['flight']}.ipynb").unlink()
    assert not runs.is_whole(flight, left, wanted)
    assert runs.is_whole(flight, left, settings)


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
