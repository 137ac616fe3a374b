"""One harness times all benchmarks and stores what the page on speed reads."""

import json

import pytest

from acx4book.pages.benchmarks import speed
from benchmarks import bench


def test_every_benchmark_of_the_page_is_timed():
    assert tuple(bench.BENCHMARKS) == speed.NAMES


def test_rows_and_what_belongs_to_all_are_stored(tmp_path, monkeypatch):
    asked = []

    def rows(folder, repeat):
        asked.append((folder.is_dir(), repeat))
        return [{"run": 1, "wall_s": 0.1}, {"run": 2, "wall_s": 1 / 3}], {"design": "d"}

    monkeypatch.setattr(bench, "BENCHMARKS", {"many": rows, "other": None})
    bench.main(["many", "--repeat", "2", "--out", str(tmp_path)])
    assert asked == [(True, 2)]
    assert (tmp_path / "many.csv").read_text() == "run,wall_s\n1,0.1\n2,0.3333333\n"
    about = json.loads((tmp_path / "many.json").read_text())
    assert about["design"] == "d"
    assert {"date", "commit", "processor", "versions"} <= about.keys()


def test_an_unknown_name_is_one_line(capsys):
    with pytest.raises(SystemExit):
        bench.main(["no"])
    assert (
        capsys.readouterr()
        .err.splitlines()[-1]
        .endswith("no: not one of commands, many, measuring, adjustment, rendering")
    )
