"""What a run read is what it keeps, and results that were changed since are named, not used."""

import json
import re
import shutil
import subprocess
import sys

import pandas as pd
import pytest
from bs4 import BeautifulSoup

import acx4sim
from acx4book.notebooks import runner
from acx4book.notebooks.execute import Notebooks
from acx4lib import flight as flights
from acx4lib.errors import FlightError
from acx4lib.results import folder as results
from acx4lib.results import own_folder, provenance
from acx4lib.results.own_folder import MARK
from support.flights import pictured
from support.helpers import write_notebook
from support.run_results import leave_results

PARAMETERS = "flight_path = ''\npictures_path = ''\nresults_path = ''\nseed = 1"
CHANGE = """
import pathlib
from acx4lib import flight as flights
from acx4lib.results import folder
table = pathlib.Path(pictures_path) / "control_points.csv"
lines = table.read_text().splitlines()
name, east, *rest = lines[1].split(",")
lines[1] = ",".join([name, str(float(east) + 5.0), *rest])
table.write_text("\\n".join(lines) + "\\n")
flight = flights.read(flight_path, pictures=pictures_path)
read = {"east": float(flight.calibration.frame.to_grid(flight.calibration.control.x_m)[0, 0])}
folder.replace(
    results_path, ["mounting"], tables={}, summary={"mounting/single_step": {"read": read}}
)
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A flight of one camera with its results."""
    return leave_results(tmp_path_factory.mktemp("trust"))


@pytest.fixture
def own(made, tmp_path):
    """The same, to be spoilt."""
    return tuple(shutil.copytree(path, tmp_path / path.name) for path in made)


@pytest.fixture
def acx4(acx4):
    """Run the command; return status and lines of standard error."""

    def run(*arguments):
        status, _, wrong = acx4(*arguments)
        return status, wrong.splitlines()

    return run


def contents(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


@pytest.mark.slow
def test_a_file_that_changes_while_a_run_is_going_does_not_reach_its_results(tmp_path):
    at = tmp_path / "flight"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1), at)
    before = (at / "control_points.csv").read_bytes()
    notebooks = tmp_path / "notebooks"
    write_notebook(notebooks / "00-flight.ipynb", PARAMETERS, "seed")
    write_notebook(notebooks / "03-mounting-calibration.ipynb", PARAMETERS, CHANGE)
    write_notebook(notebooks / "04-validation.ipynb", PARAMETERS, "seed")
    runner.run(at, tmp_path / "results", way=Notebooks(path=notebooks))
    kept = tmp_path / "results" / "flight"
    assert (at / "control_points.csv").read_bytes() != before
    assert (kept / "control_points.csv").read_bytes() == before
    block = flights.read_kept(kept).calibration
    read = results.read(tmp_path / "results").summary["mounting/single_step"]["read"]
    assert read["east"] == block.frame.to_grid(block.control.x_m)[0, 0]
    own_folder.verify(tmp_path / "results", cure="")


def test_a_table_that_changed_after_it_was_read_is_not_kept(tmp_path):
    at = tmp_path / "flight"
    acx4sim.write(acx4sim.DESIGNS["single-head"](seed=1), at)
    read = flights.read(at)
    with (at / "calibration" / "trajectory.csv").open("a") as file:
        file.write("\n")
    with (
        own_folder.claim(tmp_path / "results", command=runner.COMMAND) as own,
        pytest.raises(FlightError, match=r"trajectory\.csv: changed while it was read; run again"),
    ):
        provenance.prepare(own, read, [])
    assert not (tmp_path / "results").exists()


def test_a_kept_flight_knows_the_checksums_of_what_was_read(made):
    at, folder = made
    assert flights.read(at).sha256 == dict(provenance.read(folder).files)


@pytest.mark.parametrize("name", results.FILES)
def test_a_report_names_a_file_that_was_cut(own, acx4, name):
    _, folder = own
    whole = (folder / name).read_bytes()
    (folder / name).write_bytes(whole[: len(whole) // 2])
    status, err = acx4("report", folder)
    assert status == 2
    assert err == [
        f"{folder / name}: was cut or changed since acx4 run wrote it, {len(whole) // 2} of "
        f"{len(whole)} bytes; run all stages again"
    ]
    assert not (folder / "report.html").exists()


def test_a_stage_alone_does_not_build_upon_changed_results(own, acx4):
    at, folder = own
    (folder / "parameters.csv").write_text("mine\n")
    (folder / "covariance.csv").unlink()
    before = contents(folder)
    status, err = acx4("run", at, "--results", folder, "--stages", "validation")
    assert status == 2
    size = json.loads(before[MARK])["files"]["parameters.csv"]["bytes"]
    assert err == [
        f"{folder}/parameters.csv: was cut or changed since acx4 run wrote it, 5 of {size} bytes; "
        "run all stages again",
        f"{folder}/covariance.csv: is gone since acx4 run wrote it; run all stages again",
    ]
    assert contents(folder) == before


@pytest.mark.slow
def test_a_run_of_all_stages_replaces_results_that_were_changed(own, tmp_path):
    at, folder = own
    notebooks = tmp_path / "notebooks"
    for stage in ("flight", "mounting", "validation"):
        write_notebook(notebooks / f"{runner.NOTEBOOKS[stage]}.ipynb", PARAMETERS, "seed")
    (folder / "parameters.csv").write_text("mine\n")
    runner.run(at, folder, way=Notebooks(path=notebooks))
    assert results.read(folder).parameters.empty
    own_folder.verify(folder, cure="")


def test_a_book_is_not_made_of_changed_results(own):
    at, folder = own
    (folder / "validation.csv").write_text("mine\n")
    done = subprocess.run(
        [sys.executable, "-m", "acx4book.pages", at, folder, at.parent / "book"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert line.startswith(f"{folder}/validation.csv: was cut or changed since acx4 run wrote it")
    assert not (at.parent / "book").exists()


def test_rendering_does_not_use_changed_results(tmp_path, acx4):
    flight = pictured.write_flight(tmp_path / "flight")
    folder = pictured.write_results(tmp_path / "results", flight)
    table = folder / "parameters.csv"
    table.write_text(table.read_text().replace("omega_deg,", "omega_deg,1"))
    status, err = acx4("render", flight, "--results", folder, "--out", tmp_path / "out")
    assert (status, err) == (
        2,
        [f"{table}: was changed since acx4 run wrote it; run all stages again"],
    )
    assert not (tmp_path / "out").exists()


def test_results_of_before_the_mark_are_read_and_never_written_into(own, acx4):
    at, folder = own
    (folder / MARK).unlink()
    before = contents(folder)
    status, err = acx4("run", at, "--results", folder)
    assert status == 2
    assert err == [
        f"{folder}: holds what acx4 run did not write (check_points.csv, covariance.csv, "
        "exterior_orientation.csv, …); choose a new or empty folder"
    ]
    assert contents(folder) == before
    assert len(results.read(folder).parameters)


@pytest.mark.parametrize(
    ("name", "key", "value", "says"),
    [
        ("mounting/single_step", "sigma0_squared", "one", "'one'; must be zero, positive or null"),
        ("mounting/single_step", "redundancy", None, "is missing; an adjustment has it"),
        ("mounting/single_step", "not_determined", [1], "[1]; must be a list of sentences"),
        ("mounting/single_step", "correlated", [["a"]], "must be a list of two parameters"),
        ("validation/single_step", "mean", [1.0, 2.0], "must be a list of three numbers"),
        ("validation/single_step", "points", {"classes": {"nssda": 7}}, "must be mean, std, rms"),
        ("validation/single_step", "n_pairs", None, "is missing; an adjustment has it"),
    ],
)
def test_an_odd_entry_of_the_summary_is_a_line(own, acx4, name, key, value, says):
    _, folder = own
    (folder / MARK).unlink()
    path = folder / "summary.json"
    said = json.loads(path.read_text())
    said[name][key] = value
    path.write_text(json.dumps(said))
    status, err = acx4("report", folder)
    assert status == 2
    assert len(err) == 1
    assert re.match(rf"{path}:\d+: {name}: {key}: ", err[0])
    assert says in err[0]


@pytest.mark.parametrize(
    "said",
    [
        *([], 1, {}, {"files": [], "stages": {}}, {"files": {"flight.toml": 7}, "stages": {}}),
        {"files": {"flight.toml": ""}, "stages": {"mounting": 1}},
        {"files": {"flight.toml": ""}, "stages": {"mounting": {"flight": ""}}},
        {"files": {"../../secret": ""}, "stages": {}},
    ],
)
def test_an_odd_provenance_is_a_line(own, acx4, said):
    _, folder = own
    (folder / MARK).unlink()
    (folder / "provenance.json").write_text(json.dumps(said))
    status, err = acx4("report", folder)
    assert status == 2
    assert 1 <= len(err) <= 2
    assert all(line.startswith(f"{folder / 'provenance.json'}:1: ") for line in err)


EVIL = "<img src=x onerror=x()> {{7*7}} $x$ ![a](http://evil.example/p) `{eval-rst}` <b>"


@pytest.mark.slow
def test_the_report_of_a_strangers_results_is_text(own, acx4):
    """Every text of the results is an attack; the folder has no mark."""
    _, folder = own
    (folder / MARK).unlink()
    said = json.loads((folder / "summary.json").read_text())
    for entry in said.values():
        entry |= {key: [EVIL] for key in ("notes", "left_out", "not_determined")}
        entry |= {"weakest": {EVIL: 0.5}, "correlated": [[EVIL, EVIL, 0.99]]}
    of_points = said["validation/single_step"]["points"]["classes"]
    of_points["nssda"]["statement"] = EVIL
    of_points["pec_pcd"][EVIL] = {"plan": EVIL, "height": EVIL}
    said[f"mounting/{EVIL}"] = {"converged": False}
    (folder / "summary.json").write_text(json.dumps(said))
    made = json.loads((folder / "provenance.json").read_text())
    for stage in made["stages"].values():
        stage["versions"][EVIL] = EVIL
    (folder / "provenance.json").write_text(json.dumps(made))
    table = pd.read_csv(folder / "rejected.csv", dtype=str, keep_default_na=False)
    table["reason"] = EVIL
    table.to_csv(folder / "rejected.csv", index=False)
    assert acx4("report", folder) == (0, [])
    page = BeautifulSoup((folder / "report.html").read_text(), "html.parser")
    assert EVIL in page.get_text()
    pictures = [image["src"] for image in page.find_all("img")]
    assert pictures
    assert all(source.startswith("data:image/svg+xml;base64,") for source in pictures)
    assert not page.find_all(["a", "script", "iframe", "object", "link"])
    assert not [code for code in page.find_all("code") if "eval" in code.get_text()]


def test_results_in_above_or_at_the_flight_are_refused(own, acx4, monkeypatch):
    at, _ = own
    before = contents(at.parent)
    monkeypatch.chdir(at.parent)
    for place in (at, at / "results", at / "calibration", at.parent, ".", "flight/../flight/r"):
        status, err = acx4("run", "flight", "--results", place)
        assert status == 2
        assert len(err) == 1
        assert "the flight" in err[0]
    for place in (at / "r.html", at / "flight.toml", "/dev/full"):
        status, err = acx4("report", "results", "--out", place)
        assert (status, len(err)) == (2, 1)
    assert contents(at.parent) == before


def test_simulate_writes_over_nothing(acx4, tmp_path):
    out = tmp_path / "flight"
    (tmp_path / "flight.truth.json").write_text("mine")
    status, err = acx4("simulate", "single-head", "--out", out)
    assert status == 2
    assert err == [
        f"{out}.truth.json: is there and is not the truth of a simulated flight; choose another "
        "name"
    ]
    assert [path.name for path in tmp_path.iterdir()] == ["flight.truth.json"]
    (tmp_path / "flight.truth.json").unlink()
    assert acx4("simulate", "single-head", "--out", tmp_path / "new" / "below" / "flight")[0] == 0
    assert acx4("simulate", "single-head", "--out", out)[0] == 0
    own_folder.clear(out)
    assert acx4("simulate", "single-head", "--out", out, "--seed", "2")[0] == 0  # an older truth
    for place in ("/dev/full", tmp_path, out):
        status, err = acx4("simulate", "single-head", "--out", place)
        assert (status, len(err)) == (2, 1)
