"""Nothing of one flight is judged by another in silence."""

import re
import shutil

import numpy as np
import pandas as pd
import pytest

import acx4sim
from acx4book.command import acx4
from acx4book.notebooks import runner
from acx4book.report import material
from acx4book.report.findings import findings
from acx4files.flight import reader
from acx4files.results import folder, provenance
from acx4files.stages import validation
from acx4lib.errors import FlightError
from support.flights import written
from support.run_results import stamp

NAME = "One camera turned by 90 degrees, simulated"


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """Return a folder with the flights A and B, and the results of both."""
    at = tmp_path_factory.mktemp("two")
    for name, seed in (("A", 1), ("B", 2)):
        acx4sim.write(acx4sim.DESIGNS["single-head"](seed=seed), at / name)
        runner.run(at / name, at / f"results_{name}")
    return at


def command(*words):
    """Run acx4, and return the status."""
    with pytest.raises(SystemExit) as ended:
        acx4.main([*map(str, words)])
    return ended.value.code


def digest(path):
    return provenance.identity(reader.read(path))["sha256"]


def copied(flown, tmp_path, name):
    """Return a copy of results that a test may change."""
    shutil.copytree(flown / name, tmp_path / name)
    return tmp_path / name


def test_a_stage_on_the_results_of_another_flight_stops_and_names_both(flown, tmp_path, capsys):
    results = copied(flown, tmp_path, "results_A")
    before = (results / "summary.json").read_bytes()
    status = command(
        *("run", flown / "B", "--results", results, "--stages", "validation", "--numbers-only")
    )
    said = capsys.readouterr().err.splitlines()
    assert status == 2
    assert len(said) == 1
    for path in (flown / "A", flown / "B"):
        assert f"(SHA-256 {digest(path)[:12]}" in said[0]
    assert said[0].count(repr(NAME)) == 1
    assert "--calibration" in said[0]
    assert (results / "summary.json").read_bytes() == before
    provenance.read_run(results)  # is whole, and still that of flight A


def test_a_run_of_all_stages_replaces_the_results_of_a_flight_that_was_changed(flown, tmp_path):
    changed = tmp_path / "A"
    shutil.copytree(flown / "A", changed)
    toml = changed / "flight.toml"
    toml.write_text(toml.read_text() + "[session]\ntemperature_c = 12.0\n")
    results = copied(flown, tmp_path, "results_A")
    with pytest.raises(FlightError, match="results of stage mounting are of another flight"):
        runner.run(changed, results, stages=["validation"])
    runner.run(changed, results)
    assert folder.entries(results)["mounting/single_step"]["flight"]["sha256"] == digest(changed)


def test_the_calibration_of_an_earlier_flight_is_validated_by_name(flown, tmp_path, capsys):
    results = tmp_path / "results"
    status = command(
        *("run", flown / "B", "--results", results, "--numbers-only"),
        *("--calibration", flown / "results_A"),
    )
    assert status == 0
    assert digest(flown / "A")[:12] in capsys.readouterr().out
    entry = folder.entries(results)["validation/single_step"]
    said = entry["calibration"]
    assert said["flight"] == {"name": NAME, "sha256": digest(flown / "A")}
    assert said["method"] == "mounting/single_step"
    assert said["results"] == "results_A"
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", said["computed"])
    assert entry["flight"]["sha256"] == digest(flown / "B")
    stamped = provenance.read(results).stages["validation"]["calibration"]
    assert stamped == {key: value for key, value in said.items() if key != "method"}
    own = folder.read(flown / "results_B")
    assert not folder.has(folder.read(results), "mounting")
    d = folder.rows(own, "check_points", "validation/single_step")
    by_earlier = folder.rows(folder.read(results), "check_points", "validation/single_step")
    assert list(d["point"]) == list(by_earlier["point"])
    assert not np.allclose(d["d_height_m"], by_earlier["d_height_m"], atol=1e-3)


def test_the_report_says_whose_calibration_was_validated(flown, tmp_path):
    runner.run(
        *(flown / "B", tmp_path / "results"),
        stages=["validation"],
        calibration=flown / "results_A",
    )
    run = material.read(tmp_path / "results")
    found = {f.question: f for f in findings(run)}
    said = found["Calibration of an earlier flight"]
    assert said.state == "note"
    assert digest(flown / "A")[:12] in said.answer
    assert material.validated(run) == "validation/single_step"
    assert "RMS at" in found["Independent check points"].answer


def test_sigma_of_the_earlier_parameters_enters_the_differences(flown, tmp_path):
    """A calibration with ten times the sigma makes the predicted differences larger."""
    results = copied(flown, tmp_path, "results_A")
    before = validation.run(reader.read(flown / "B"), tmp_path / "one", results)
    path = results / "covariance.csv"
    lines = path.read_text().splitlines()
    cells = [line.rpartition(",") for line in lines[1:]]
    scaled = [f"{names},{100 * float(value)!r}" for names, _, value in cells]
    path.write_text("\n".join([lines[0], *scaled]) + "\n")
    parameters = pd.read_csv(results / "parameters.csv", dtype={"value": str})
    tenfold = 10 * parameters["sigma"]
    parameters.assign(sigma=tenfold).to_csv(results / "parameters.csv", index=False)
    stamp(results)
    after = validation.run(reader.read(flown / "B"), tmp_path / "two", results)
    for method, old in before.items():
        assert np.all(after[method].points.sigma > old.points.sigma)
    assert np.median(after["single_step"].points.sigma[:, 2]) > 0.2


def test_other_cameras_are_named_a_line_each(flown, tmp_path):
    other = written.write_flight(tmp_path / "other", blocks=("calibration", "validation"))
    sizes = (
        "11608 x 8708 pixels of 4.6 µm, in the flight to be validated 4000 x 3000 pixels of 5 µm"
    )
    assert refusal(flown, tmp_path, other) == [f"camera CAM has {sizes}"]
    renamed = tmp_path / "renamed"
    shutil.copytree(flown / "B", renamed)
    for path in (renamed / "flight.toml", *renamed.glob("*/images.csv")):
        path.write_text(path.read_text().replace("CAM", "DRONE"))
    assert refusal(flown, tmp_path, renamed) == [
        f"camera DRONE of {renamed} is not calibrated; CAM is"
    ]


def refusal(flown, tmp_path, flight):
    """Return why flight A's calibration is refused for another flight, in lines."""
    with pytest.raises(FlightError) as caught:
        validation.run(reader.read(flight), tmp_path / "results", flown / "results_A")
    assert not (tmp_path / "results").exists()
    return [line.removeprefix(f"{flown}/results_A: ") for line in str(caught.value).splitlines()]


def test_a_folder_has_one_calibration(flown, tmp_path):
    results = copied(flown, tmp_path, "results_B")
    with pytest.raises(FlightError, match="has the flight's own calibration beside"):
        runner.run(
            *(flown / "B", results),
            stages=["validation"],
            calibration=flown / "results_A",
        )
    later = tmp_path / "later"
    runner.run(
        *(flown / "B", later),
        stages=["validation"],
        calibration=flown / "results_A",
    )
    with pytest.raises(FlightError, match="has the flight's own calibration beside"):
        runner.run(flown / "B", later, stages=["mounting"])
    runner.run(flown / "B", later)
    assert "calibration" not in provenance.read(later).stages["validation"]
