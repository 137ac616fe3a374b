"""The harness of benchmarks, its commands, and the flights whose errors are counted."""

import json
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose

from acx4book.chapters.from_pictures import STORED
from acx4book.pages.benchmarks import sigma as read_by_the_book
from acx4lib.calibration import mounting
from benchmarks import bench, command, coverage_flights, harness
from support.flights import simulated

# --- what a long run leaves is written whole, and read by the book ---------------------------


def test_the_book_reads_what_is_written(tmp_path):
    points = pd.DataFrame({"name": ["A"], "x": [1 / 3]})
    harness.write(tmp_path, "runs", {"points": points}, {"cores": 2}, digits=4)
    about, (found,) = read_by_the_book.read_stored(tmp_path, "runs", "points")
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


@pytest.fixture
def changed_file(tmp_path, monkeypatch):
    """A repository with one changed source and one changed result."""
    out = tmp_path / "data" / "benchmarks"
    out.mkdir(parents=True)
    names = ("model.py", "data/benchmarks/runs.csv")
    for name in names:
        (tmp_path / name).write_text("one\n")
    who = ("-c", "user.name=A", "-c", "user.email=a@b.c")
    for step in (["init"], ["add", *names], ["commit", "-m", "one"]):
        subprocess.run(["git", *who, *step], cwd=tmp_path, check=True, capture_output=True)
    monkeypatch.setattr(harness, "ROOT", tmp_path)
    monkeypatch.setattr(harness, "OUT", out)
    monkeypatch.setattr(harness, "commit", harness.commit.__wrapped__)
    (out / "runs.csv").write_text("two\n")
    return tmp_path / "model.py"


def test_numbers_of_the_project_come_from_a_commit(changed_file, tmp_path):
    assert len(harness.commit()) == 40
    harness.refuse_changes(harness.OUT)
    changed_file.write_text("two\n")
    assert harness.commit().endswith(", 1 files differ")
    with pytest.raises(SystemExit, match="1 files differ: commit them before"):
        harness.refuse_changes(harness.OUT)
    harness.refuse_changes(tmp_path)


# --- one harness times all benchmarks and stores what the page on speed reads ----------------


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
    assert capsys.readouterr().err.splitlines()[-1].endswith("no: not one of commands, adjustment")


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


# --- what `make coverage` writes of a flight is what the acceptance tests compute of it --------


@pytest.fixture(scope="module")
def found():
    return {name: pd.DataFrame(rows) for name, rows in coverage_flights.mountings(1).items()}


@pytest.fixture(scope="module")
def heads():
    return pd.DataFrame(coverage_flights.heads(1)["heads"]).set_index("parameter")


@pytest.fixture(scope="module")
def pair():
    return pd.DataFrame(coverage_flights.pair(1)["bias"]).set_index(["distortion_at", "parameter"])


def of(table, method):
    return table[table["method"] == method]


@pytest.mark.parametrize("method", ["two_step", "two_step_gnss", "single_step"])
def test_errors_are_those_of_the_method(found, method):
    rows = of(found["parameters"], method)
    expected = simulated.mounting_errors("acx4-ideal", method, seed=1)
    assert rows["error"].tolist() == expected.tolist()
    cov = simulated.mounting_estimates("acx4-ideal", method, seed=1).cov
    assert rows["sigma"].to_numpy() == pytest.approx(np.sqrt(np.diag(cov)))


def test_squares_of_independent_errors_add_up_to_the_joint_chi_square(found):
    rows = of(found["parameters"], "single_step")
    errors = simulated.mounting_errors("acx4-ideal", "single_step", seed=1)
    cov = simulated.mounting_estimates("acx4-ideal", "single_step", seed=1).cov
    total, n = simulated.chi_square(errors, cov)
    assert n == len(rows) == 14
    # the closest correlations leave 1e-6 of the digits
    assert np.sum(rows["decorrelated"] ** 2) == pytest.approx(total, rel=1e-6)


def test_points_are_the_differences_from_all_rays(found):
    rows = of(found["points"], "single_step")
    checked = simulated.validations("acx4-ideal", seed=1)["single_step"]
    assert rows["d_height_m"].tolist() == checked.points.d[:, 2].tolist()
    assert rows["sigma_east_m"].tolist() == checked.points.sigma[:, 0].tolist()
    assert rows["point"].is_unique


def test_errors_of_heads_are_those_of_the_relative_orientation(heads):
    errors = simulated.head_errors("relative_orientation", seed=1)
    found = simulated.head_estimates(seed=1)["relative_orientation"]
    row = found.names.index("CAM3 phi")
    assert heads.loc["CAM3 phi_deg", "error"] == pytest.approx(np.degrees(errors[row]))
    assert heads.loc["CAM3 phi_deg", "sigma"] == pytest.approx(np.degrees(found.sigma[row]))
    assert heads.loc["CAM4 Yc_mm", "error"] == errors[found.names.index("CAM4 Yc")]
    assert "CAM1 Zc_mm" not in heads.index  # held
    total, n = simulated.chi_square(errors, found.cov)
    assert n == heads["decorrelated"].count() == len(heads) - 2 == 21
    assert (heads["decorrelated"] ** 2).sum() == pytest.approx(total, rel=1e-6)


@pytest.mark.parametrize("sign", [1, -1])
def test_the_half_of_a_pair_at_adjusted_points_is_the_single_step(sign):
    flown = coverage_flights.of_sign(sign, 1)
    own = coverage_flights.single_step(flown, distortion_at="adjusted")
    theirs = mounting.single_step(flown.calibration, free=flown.estimate_mounting).calibration
    assert own.cov.tolist() == theirs.cov.tolist()


def test_what_is_odd_in_the_noise_cancels_in_a_pair(pair):
    """One pair shows the bias of f at measured points, a fifteenth of sigma; the error is 0.2."""
    z = pair["error"] / pair["sigma"]
    assert z["adjusted"].abs().max() < 0.02
    assert -0.08 < z["measured", "f_mm"] < -0.05


def test_seeds_are_in_their_order_and_those_that_fail_are_named_when_all_are_done():
    def study(seed):
        if seed in failing:
            message = "not determined"
            raise ValueError(message)
        time.sleep(0.05 / seed)
        return {"mountings": [{"seed": seed}]}

    failing = set()
    with ThreadPoolExecutor(4) as pool:
        tables = coverage_flights.flown(pool, study, 4)
        assert [table["mountings"][0]["seed"] for table in tables] == [1, 2, 3, 4]
        failing = {2, 4}
        with pytest.raises(RuntimeError, match=r"^seed 2: not determined; seed 4: not determined$"):
            coverage_flights.flown(pool, study, 4)


def test_files_of_coverage_are_replaced_whole_or_not_at_all(tmp_path, found):
    tables = {name: table.to_dict("records") for name, table in found.items()}
    coverage_flights.write(tmp_path, "coverage", tables, {"commit": "old"})
    assert json.loads((tmp_path / "coverage.json").read_text())["commit"] == "old"
    none, about = {"points": []}, {"commit": object()}  # cannot be written
    with pytest.raises(TypeError):
        coverage_flights.write(tmp_path, "coverage", none, about)
    read = pd.read_csv(tmp_path / "coverage_points.csv")
    assert read["d_north_m"].to_numpy() == pytest.approx(found["points"]["d_north_m"], rel=1e-3)
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        "coverage.json",
        "coverage_parameters.csv",
        "coverage_points.csv",
    ]


def test_slow_errors_are_calibrated_twice_on_the_same_flights():
    rows = pd.DataFrame(coverage_flights.slowly(1)[""])
    white, correlated = (rows[rows["weights"] == kind] for kind in ("white", "correlated"))
    assert white["parameter"].tolist() == correlated["parameter"].tolist()
    sigma = [own.set_index("parameter")["sigma"] for own in (white, correlated)]
    assert (sigma[1] / sigma[0]).filter(like="boresight").min() > 2
