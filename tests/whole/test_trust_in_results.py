"""Results of strangers are text, and nothing is written over what a command did not write."""

from __future__ import annotations

import json
import shutil

import pandas as pd
import pytest
from bs4 import BeautifulSoup

from acx4files.results import folder as results
from acx4files.results import own_folder, provenance
from acx4files.results.own_folder import MARK
from acx4lib.errors import FlightError
from support.run_results import leave_results


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A flight of one camera with its results."""
    return leave_results(tmp_path_factory.mktemp("trust"))


@pytest.fixture
def own(made, tmp_path):
    """The same, to be spoilt."""
    return tuple(shutil.copytree(path, tmp_path / path.name) for path in made)


@pytest.fixture
def typed(acx4):
    """Run the command; return status and lines of standard error."""

    def run(*arguments):
        status, _, wrong = acx4(*arguments)
        return status, wrong.splitlines()

    return run


def contents(folder):
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_results_of_before_the_mark_are_read_and_never_written_into(own, typed):
    at, folder = own
    (folder / MARK).unlink()
    before = contents(folder)
    status, err = typed("run", at, "--results", folder)
    assert status == 2
    assert err == [
        f"{folder}: holds what acx4 run did not write (check_points.csv, covariance.csv, "
        "exterior_orientation.csv, …); choose a new or empty folder"
    ]
    assert contents(folder) == before
    assert len(results.read(folder).parameters)


EVIL = "<img src=x onerror=x()> {{7*7}} $x$ ![a](http://evil.example/p) `{eval-rst}` <b>"


@pytest.mark.slow
def test_the_report_of_a_strangers_results_is_text(own, typed):
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
    assert typed("report", folder) == (0, [])
    page = BeautifulSoup((folder / "report.html").read_text(), "html.parser")
    assert EVIL in page.get_text()
    assert not page.find_all(["a", "img", "script", "iframe", "object", "link"])
    assert not [code for code in page.find_all("code") if "eval" in code.get_text()]


def test_results_in_above_or_at_the_flight_are_refused(own, typed, monkeypatch):
    at, _ = own
    before = contents(at.parent)
    monkeypatch.chdir(at.parent)
    for place in (at, at / "results", at / "calibration", at.parent, ".", "flight/../flight/r"):
        status, err = typed("run", "flight", "--results", place)
        assert status == 2
        assert len(err) == 1
        assert "the flight" in err[0]
    for place in (at / "r.html", at / "flight.toml", "/dev/full"):
        status, err = typed("report", "results", "--out", place)
        assert (status, len(err)) == (2, 1)
    assert contents(at.parent) == before


def test_simulate_writes_over_nothing(typed, tmp_path):
    out = tmp_path / "flight"
    (tmp_path / "flight.truth.json").write_text("mine")
    status, err = typed("simulate", "single-head", "--out", out)
    assert status == 2
    assert err == [
        f"{out}.truth.json: is there and is not the truth of a simulated flight; choose another "
        "name"
    ]
    assert [path.name for path in tmp_path.iterdir()] == ["flight.truth.json"]
    (tmp_path / "flight.truth.json").unlink()
    assert typed("simulate", "single-head", "--out", tmp_path / "new" / "below" / "flight")[0] == 0
    assert typed("simulate", "single-head", "--out", out)[0] == 0
    own_folder.clear(out)
    assert typed("simulate", "single-head", "--out", out, "--seed", "2")[0] == 0  # an older truth
    for place in ("/dev/full", tmp_path, out):
        status, err = typed("simulate", "single-head", "--out", place)
        assert (status, len(err)) == (2, 1)


def test_a_kept_flight_that_is_a_link_out_of_the_results_is_refused(own):
    _, folder = own
    shutil.move(folder / "flight", folder.parent / "elsewhere")
    (folder / "flight").symlink_to(folder.parent / "elsewhere")
    with pytest.raises(FlightError, match=r"is a link that leads out of the results"):
        provenance.read_run(folder)
