"""The table of many flights, beside what the results of each say."""

import csv

import pytest

from acx4book.command.batch import table
from acx4book.notebooks import runner
from acx4book.notebooks.functions import Functions
from acx4lib.results import folder
from support.flights import written


@pytest.fixture(scope="module")
def left(small_flights, tmp_path_factory):
    path = tmp_path_factory.mktemp("table") / "results"
    runner.run(small_flights[0], path, way=Functions())
    return path


def test_a_row_has_the_single_step_as_it_is_written(left):
    row = table.row_of(left, ["mounting", "validation"])
    found = folder.read(left)
    parameters = folder.parameters(found, "mounting/single_step", row["camera"])
    assert len(parameters) >= 12
    for name, one in parameters.iterrows():
        assert float(row[name]) == one["value"]
        assert float(row[f"sigma_{name}"]) == one["sigma"]
    entry = found.summary["mounting/single_step"]
    assert float(row["sigma0_squared"]) == entry["sigma0_squared"]
    assert int(row["redundancy"]) == entry["redundancy"]
    assert "n_check_points" not in row  # there is no such block
    assert set(row) <= set(table.COLUMNS)


def test_a_stage_of_an_earlier_run_has_no_part_in_it(left):
    assert table.row_of(left, ["validation"]) == {}


def test_check_points_are_those_of_the_validation(tmp_path):
    flight = written.write_flight(tmp_path / "flight", blocks=("validation",))
    runner.run(flight, tmp_path / "results", way=Functions())
    row = table.row_of(tmp_path / "results", ["validation"])
    entry = folder.read(tmp_path / "results").summary["validation/given"]
    assert int(row["n_check_points"]) == entry["n_points"]
    keys = ("rms_east_m", "rms_north_m", "rms_height_m")
    assert [float(row[key]) for key in keys] == entry["points"]["rms"]
    assert float(row["mean_height_m"]) == entry["points"]["mean"][2]
    assert row["normalised_rms_east"] == repr(entry["points"]["normalised_rms"][0])


def test_tables_are_read_as_they_were_written(tmp_path):
    rows = [{"flight": 'a,"b"', "seconds": "1.5"}, {"flight": "c", "other": "left out"}]
    table.write(tmp_path / "times.csv", table.TIME_COLUMNS, rows)
    found = table.read(tmp_path / "times.csv")
    assert list(found) == ['a,"b"', "c"]
    assert found['a,"b"']["seconds"] == "1.5"
    assert found["c"] == dict.fromkeys(table.TIME_COLUMNS, "") | {"flight": "c"}
    assert table.read(tmp_path / "nowhere.csv") == {}
    with (tmp_path / "times.csv").open(newline="") as file:
        assert tuple(next(csv.reader(file))) == table.TIME_COLUMNS
    assert [path.name for path in tmp_path.iterdir()] == ["times.csv"]
