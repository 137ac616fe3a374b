"""The harness of benchmarks, and its commands."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.from_pictures import STORED
from acx4book.pages.benchmarks import speed
from acx4book.pages.benchmarks import stored as read_by_the_book
from benchmarks import bench, command, harness

# --- what a long run leaves is written whole, and read by the book ---------------------------


def test_the_book_reads_what_is_written(tmp_path):
    points = pd.DataFrame({"name": ["A"], "x": [1 / 3]})
    harness.write(tmp_path, "runs", {"points": points}, {"cores": 2}, digits=4)
    about, (found,) = read_by_the_book.read(tmp_path, "runs", "points")
    assert about["cores"] == 2
    assert "date" in about
    assert_allclose(found["x"], 0.3333, rtol=0)


def test_files_are_replaced_whole_or_not_at_all(tmp_path):
    harness.write(tmp_path, "runs", {"": pd.DataFrame({"x": [1]})}, {})
    with pytest.raises(TypeError):
        harness.write(tmp_path, "runs", {"": pd.DataFrame({"x": [2]})}, {"cannot": object()})
    assert (tmp_path / "runs.csv").read_text() == "x\n1\n"
    assert "cannot" not in json.loads((tmp_path / "runs.json").read_text())
    assert sorted(path.name for path in tmp_path.iterdir()) == ["runs.csv", "runs.json"]


# --- one harness times all benchmarks and stores what the page on speed reads ----------------


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


# --- what a command is said to have taken ----------------------------------------------------


def test_a_command_tells_its_seconds_and_its_memory(tmp_path):
    script = Path(command.__file__)
    made = "import time; b = b'x' * 200_000_000; time.sleep(0.2)"
    done = subprocess.run(
        [sys.executable, str(script), sys.executable, "-c", made],
        capture_output=True,
        text=True,
        check=True,
    )
    found = json.loads(done.stdout)
    assert found["wall_s"] > 0.2
    assert 0 < found["cpu_s"] < found["wall_s"]
    assert 200e6 / 2**20 < found["peak_mb"] < 260  # and Python itself


def test_a_command_that_fails_is_a_failure():
    script = Path(command.__file__)
    done = subprocess.run(
        [sys.executable, str(script), sys.executable, "-c", "raise SystemExit(3)"],
        capture_output=True,
        check=False,
    )
    assert done.returncode == 3
    assert done.stdout == b""


def test_memory_is_that_of_all_processes_together():
    child = "import time; b = b'x' * 100_000_000; time.sleep(1)"
    made = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {child!r}])"
    both = f"{made.replace('.run', '.Popen')}; b = b'y' * 100_000_000; import time; time.sleep(1.5)"
    done = subprocess.run(
        [sys.executable, command.__file__, sys.executable, "-c", both],
        capture_output=True,
        text=True,
        check=True,
    )
    found = json.loads(done.stdout)
    assert found["peak_mb"] < 150 < 200e6 / 2**20 < found["tree_mb"] < 260


# --- what is stored of flights that were measured in pictures is what the chapter reads ------


def test_errors_of_all_parameters_of_six_flights_are_stored():
    found = pd.read_csv(STORED / "measured_flights.csv")
    assert found.groupby("seed").size().tolist() == [14] * 6
    assert found.groupby("seed")["sigma0_squared"].nunique().tolist() == [1] * 6
    assert np.abs(found["error"] / found["sigma"]).max() < 4
