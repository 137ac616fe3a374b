"""Two names that were exchanged are named by the run and the report, and the results are right."""

import shutil

import numpy as np
import pandas as pd
import pytest

import acx4sim
from acx4book.command import acx4
from acx4book.notebooks import runner
from acx4book.notebooks.functions import Functions
from acx4lib.calibration.mounting import single_step
from acx4lib.flight import reader
from acx4lib.results import folder
from support.helpers import repeats
from support.run_results import state

EXCHANGED = {
    "neighbours": ("calibration/trajectory.csv", "exposure", "C1-03", "C1-04"),
    "strips": ("calibration/trajectory.csv", "exposure", "C1-02", "C5-07"),
    "control": ("control_points.csv", "point", "P01", "P04"),
    "check": ("validation/control_points.csv", "point", "N01", "N04"),
}
KINDS = {"control": "control_point", "check": "check_point"}


@pytest.fixture(scope="module")
def good(tmp_path_factory):
    path = tmp_path_factory.mktemp("good") / "flight"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=3), path)
    return path


def exchange(flight, into, table, column, a, b):
    """Copy a flight, with two names exchanged."""
    shutil.copytree(flight, into)
    rows = pd.read_csv(into / table, dtype=str)
    rows[column] = rows[column].replace({a: b, b: a})
    rows.to_csv(into / table, index=False)
    return into


@pytest.mark.parametrize("name", ["strips", "check", repeats("neighbours"), repeats("control")])
def test_the_two_are_named_and_the_finding_does_not_hold(good, tmp_path, name, capsys):
    flight = exchange(good, tmp_path / "flight", *EXCHANGED[name])
    with pytest.raises(SystemExit) as ended:
        acx4.main(["run", str(flight), "--results", str(tmp_path / "r"), "--numbers-only"])
    assert ended.value.code == 0
    a, b = EXCHANGED[name][2:]
    said = [line for line in capsys.readouterr().out.splitlines() if "were exchanged" in line]
    assert said
    assert all(f" {a} and {b} were" in line or f" {b} and {a} were" in line for line in said)
    stage = "validation" if name == "check" else "mounting"
    entries = folder.entries(tmp_path / "r")
    ((kind, *names),) = entries[f"{stage}/single_step"]["exchanged_names"]
    assert {*names} == {a, b}
    assert kind == KINDS.get(name, "exposure")
    answer = state(tmp_path / "r", "Gross errors")
    assert answer[0] == "fails"
    assert a in answer[1]
    assert b in answer[1]


def test_the_results_are_those_of_the_right_names_without_the_two(good, tmp_path):
    flight = exchange(good, tmp_path / "flight", *EXCHANGED["strips"])
    for path, results in ((good, "right"), (flight, "mixed")):
        runner.run(path, tmp_path / results, way=Functions(), stages=["mounting"])
    right, mixed = (
        folder.parameters(folder.read(tmp_path / name), "mounting/single_step", "CAM")
        for name in ("right", "mixed")
    )
    assert np.all(np.abs(mixed["value"] - right["value"]) < right["sigma"])


def test_two_gross_errors_are_no_exchange(good, tmp_path):
    flight = tmp_path / "flight"
    shutil.copytree(good, flight)
    rows = pd.read_csv(flight / "calibration" / "trajectory.csv")
    rows.loc[[2, 9], "height_m"] += [3.0, -4.0]
    rows.to_csv(flight / "calibration" / "trajectory.csv", index=False)
    control = pd.read_csv(flight / "control_points.csv")
    control.loc[[0, 3], "east_m"] += [5.0, -5.0]
    control.to_csv(flight / "control_points.csv", index=False)
    read = reader.read(flight)
    bundle = single_step(read.calibration, free=read.estimate_mounting).bundle
    assert {(r.kind, r.row) for r in bundle.rejected} >= {("gnss", 2), ("gnss", 9)}
    assert bundle.exchanged == ()


def test_two_pairs_are_both_named_beside_another_error(good, tmp_path):
    flight = exchange(good, tmp_path / "one", *EXCHANGED["neighbours"])
    flight = exchange(flight, tmp_path / "two", *EXCHANGED["control"])
    rows = pd.read_csv(flight / "calibration" / "trajectory.csv")
    rows.loc[20, "height_m"] += 5.0
    rows.to_csv(flight / "calibration" / "trajectory.csv", index=False)
    read = reader.read(flight)
    bundle = single_step(read.calibration, free=read.estimate_mounting).bundle
    named = {frozenset(one.names) for one in bundle.exchanged}
    assert named == {frozenset({"C1-03", "C1-04"}), frozenset({"P01", "P04"})}
