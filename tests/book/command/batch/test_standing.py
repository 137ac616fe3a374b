"""Which results are kept: those that a run would leave as they are."""

import json
import shutil
from dataclasses import replace

import pytest

from acx4book.command.batch import standing
from acx4book.notebooks import runner
from acx4book.notebooks.functions import Functions
from acx4lib.flight import reader
from acx4lib.results import provenance
from acx4lib.results.runs import EXECUTED
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
    assert standing.is_whole(flight, left, settings)
    assert standing.stages_of(left) == ["mounting"]
    assert not standing.is_whole(flight, tmp_path / "nowhere", settings)
    assert standing.stages_of(tmp_path / "nowhere") == []


def test_results_of_another_flight_are_not(small_flights, left, settings):
    assert not standing.is_whole(reader.read(small_flights[1]), left, settings)


@pytest.mark.parametrize("name", ["parameters.csv", "summary.json", "flight/flight.toml"])
def test_results_that_were_changed_are_not(flight, left, settings, name):
    with (left / name).open("a") as file:
        file.write(" ")
    assert not standing.is_whole(flight, left, settings)


def test_results_of_another_version_are_not(flight, left, settings, monkeypatch):
    before = provenance.versions()
    monkeypatch.setattr(provenance, "versions", lambda: before | {"numpy": "0.1"})
    assert not standing.is_whole(flight, left, settings)


def test_a_stage_that_is_missing_counts(tmp_path, settings):
    path = written.write_flight(tmp_path / "flight", blocks=("heads",))
    flight, results = reader.read(path), tmp_path / "results"
    runner.run(path, results, way=Functions(), stages=["heads"])
    assert standing.is_whole(flight, results, replace(settings, stages=("heads",)))
    assert not standing.is_whole(flight, results, settings)
    runner.run(path, results, way=Functions())
    assert standing.is_whole(flight, results, settings)
    (results / ".acx4.json").unlink()
    summary = json.loads((results / "summary.json").read_text())
    del summary["mounting/rig"]  # as of a run that was killed before its last part
    (results / "summary.json").write_text(json.dumps(summary))
    shutil.move(results, tmp_path / "killed")
    with runner.claims.claim(results, command=runner.COMMAND) as own:
        own.expect(str(p.relative_to(tmp_path / "killed")) for p in files(tmp_path / "killed"))
        shutil.copytree(tmp_path / "killed", results, dirs_exist_ok=True)
        own.seal()
    assert not standing.is_whole(flight, results, settings)


def files(folder):
    return [path for path in folder.rglob("*") if path.is_file()]


def test_notebooks_that_are_wanted_must_be_there_with_the_cells_that_they_have(
    flight, left, settings, tmp_path
):
    for folder, more in ((tmp_path / "notebooks", ""), (left / EXECUTED, "seed = 2")):
        for part in ("flight", "mounting"):
            write_notebook(folder / f"{runner.NOTEBOOKS[part]}.ipynb", f"seed = 1\n{more}", "seed")
    wanted = replace(settings, notebooks=tmp_path / "notebooks")
    assert standing.is_whole(flight, left, wanted)
    write_notebook(
        tmp_path / "notebooks" / f"{runner.NOTEBOOKS['mounting']}.ipynb", "seed = 1", "seed + 1"
    )
    assert not standing.is_whole(flight, left, wanted)
    (left / EXECUTED / f"{runner.NOTEBOOKS['flight']}.ipynb").unlink()
    assert not standing.is_whole(flight, left, wanted)
    assert standing.is_whole(flight, left, settings)
