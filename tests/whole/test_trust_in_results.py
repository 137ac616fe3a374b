"""What a run read is what it keeps, and results that were changed since are named, not used."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil
import subprocess
import sys

import pandas as pd
import pytest
from bs4 import BeautifulSoup

import acx4sim
from acx4book.notebooks import runner
from acx4files import flight as flights
from acx4files.results import folder as results
from acx4files.results import own_folder, provenance
from acx4files.results.own_folder import MARK
from acx4lib.errors import FlightError, OutputError
from support.flights import pictured, written
from support.helpers import write_notebook
from support.run_results import leave_results, seal_again

PARAMETERS = "flight_path = ''\npictures_path = ''\nresults_path = ''\nseed = 1"
CHANGE = """
import pathlib
from acx4files import flight as flights
from acx4files.results import folder
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
def typed(acx4):
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
    runner.run(at, tmp_path / "results", notebooks=notebooks)
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
def test_a_report_names_a_file_that_was_cut(own, typed, name):
    _, folder = own
    whole = (folder / name).read_bytes()
    (folder / name).write_bytes(whole[: len(whole) // 2])
    status, err = typed("report", folder)
    assert status == 2
    assert err == [
        f"{folder / name}: was cut or changed since acx4 run wrote it, {len(whole) // 2} of "
        f"{len(whole)} bytes; run all stages again"
    ]
    assert not (folder / "report.html").exists()


def test_a_stage_alone_does_not_build_upon_changed_results(own, typed):
    at, folder = own
    (folder / "parameters.csv").write_text("mine\n")
    (folder / "covariance.csv").unlink()
    before = contents(folder)
    status, err = typed("run", at, "--results", folder, "--stages", "validation")
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
    runner.run(at, folder, notebooks=notebooks)
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


def test_rendering_does_not_use_changed_results(tmp_path, typed):
    flight = pictured.write_flight(tmp_path / "flight")
    folder = pictured.write_results(tmp_path / "results", flight)
    table = folder / "parameters.csv"
    table.write_text(table.read_text().replace("omega_deg,", "omega_deg,1"))
    status, err = typed("render", flight, "--results", folder, "--out", tmp_path / "out")
    assert (status, err) == (
        2,
        [f"{table}: was changed since acx4 run wrote it; run all stages again"],
    )
    assert not (tmp_path / "out").exists()


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
def test_an_odd_entry_of_the_summary_is_a_line(own, typed, name, key, value, says):
    _, folder = own
    (folder / MARK).unlink()
    path = folder / "summary.json"
    said = json.loads(path.read_text())
    said[name][key] = value
    path.write_text(json.dumps(said))
    status, err = typed("report", folder)
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
def test_an_odd_provenance_is_a_line(own, typed, said):
    _, folder = own
    (folder / MARK).unlink()
    (folder / "provenance.json").write_text(json.dumps(said))
    status, err = typed("report", folder)
    assert status == 2
    assert 1 <= len(err) <= 2
    assert all(line.startswith(f"{folder / 'provenance.json'}:1: ") for line in err)


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
    pictures = [image["src"] for image in page.find_all("img")]
    assert pictures
    assert all(source.startswith("data:image/svg+xml;base64,") for source in pictures)
    assert not page.find_all(["a", "script", "iframe", "object", "link"])
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


# --- results that were tampered with, or half copied, are refused by file, line and column -----


SINGLE = "mounting/single_step"


@pytest.fixture(scope="module")
def all_stages(tmp_path_factory):
    """A small flight of two heads, and the results of all its stages."""
    folder = tmp_path_factory.mktemp("tampered")
    blocks = ("heads", "calibration", "validation")
    flight = written.write_flight(folder / "flight", blocks=blocks)
    runner.run(flight, folder / "results")
    return folder


@pytest.fixture
def tampered(all_stages, tmp_path):
    """A copy to be tampered with."""
    return shutil.copytree(all_stages / "results", tmp_path / "results")


def rows_of(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.reader(file))


def put_rows(path, rows):
    with path.open("w", newline="", encoding="utf-8") as file:
        csv.writer(file, lineterminator="\n").writerows(rows)


def cell(table, column, value, *, row=1, of=()):
    """Return what puts a value into a cell of the row that begins so, or of row 1."""

    def change(folder):
        path = folder / f"{table}.csv"
        rows = rows_of(path)
        mine = [k for k, one in enumerate(rows) if k and tuple(one[: len(of)]) == tuple(of)]
        rows[mine[row - 1]][rows[0].index(column)] = value
        put_rows(path, rows)

    return change


def lines(table, change):
    """Return what changes the lines of a table."""

    def changed(folder):
        path = folder / f"{table}.csv"
        path.write_text("".join(change(path.read_text().splitlines(keepends=True))))

    return changed


def entry(name, key, value):
    """Return what puts a value into an entry of summary.json; None removes it."""

    def change(folder):
        path = folder / "summary.json"
        said = json.loads(path.read_text())
        said[name][key] = value
        if value is None:
            del said[name][key]
        path.write_text(json.dumps(said, indent=2))

    return change


def text(name, content):
    return lambda folder: (folder / name).write_text(content)


def without(table, *begin):
    """Return what removes all rows of a table that begin so."""
    start = ",".join(begin) + ","
    return lines(table, lambda rows: [row for row in rows if not row.startswith(start)])


MINE = ("mounting", "single_step")


def of_mine(table, change):
    """Return what changes the lines of a table that are of the single step."""
    begin = ",".join(MINE)

    def changed(rows):
        mine = [row for row in rows if row.startswith(begin)]
        return [rows[0], *change(mine), *(r for r in rows[1:] if not r.startswith(begin))]

    return lines(table, changed)


TAMPERED = [
    # numbers
    (cell("parameters", "value", "inf"), r"parameters.csv:2: value: inf; must lie between"),
    (cell("parameters", "value", "1e308"), r"parameters.csv:2: value: 1e\+308; must lie between"),
    (cell("parameters", "value", "nan"), r"parameters.csv:2: value: 'nan'; must be a finite num"),
    (cell("parameters", "value", ""), r"parameters.csv:2: value: is empty; must lie between"),
    (cell("parameters", "value", "12,5"), r"parameters.csv:2: value: '12,5'; must be a finite nu"),
    (cell("parameters", "sigma", "-0.1"), r"parameters.csv:2: sigma: -0.1; must be zero or posi"),
    (cell("parameters", "sigma", ""), r"parameters.csv:2: sigma: is empty; must be a finite num"),
    (cell("covariance", "value", "1e308"), r"covariance.csv:2: value: 1e\+308; must lie between"),
    (cell("covariance", "value", "-1"), r"covariance.csv:2: value: -1; a variance must be zero"),
    (cell("validation", "d_east_m", "inf"), r"validation.csv:2: d_east_m: inf; must lie between"),
    (cell("validation", "sigma_east_m", "-1"), r"validation.csv:2: sigma_east_m: -1.0; must be z"),
    (cell("check_points", "n_images", "2.5"), r"check_points.csv:2: n_images: 2.5; must be a who"),
    (cell("check_points", "d_north_m", "1e308"), r"check_points.csv:2: d_north_m: 1e\+308; must"),
    (cell("exterior_orientation", "kappa_deg", "inf"), r"orientation.csv:2: kappa_deg: inf; must"),
    (cell("residuals", "v", "inf", of=MINE), r"residuals.csv:\d+: v: inf; must lie between"),
    (cell("residuals", "sigma", "-1", of=MINE), r"residuals.csv:\d+: sigma: -1.0; must be zero"),
    # names and words
    (cell("parameters", "camera", "X"), r"parameters.csv:2: camera: 'X' is unknown; must be a c"),
    (cell("parameters", "parameter", "k9"), r"parameters.csv:2: parameter: 'k9' is unknown; mus"),
    (cell("parameters", "unit", "ft"), r"parameters.csv:2: unit: 'ft'; must be mm"),
    (cell("parameters", "stage", "mount"), r"parameters.csv:2: stage: 'mount' is unknown.*; mus"),
    (cell("validation", "image_a", "X"), r"validation.csv:2: image_a: 'X' is unknown; must be a"),
    (cell("exterior_orientation", "image", "X"), r"exterior_orientation.csv:2: image: 'X' is unk"),
    (cell("residuals", "kind", "gps", of=MINE), r"residuals.csv:\d+: kind: 'gps' is unknown.*; m"),
    # rows
    (lines("parameters", lambda r: [*r[:2], r[1], *r[2:]]), r"parameters.csv:3: row: .* line 2 "),
    (lines("covariance", lambda r: [*r[:2], r[1], *r[2:]]), r"covariance.csv:3: row: .* line 2 "),
    (lines("validation", lambda r: [*r, r[-1]]), r"validation.csv:\d+: row: .*stands in line"),
    (lines("validation", lambda r: r[:-1]), r"summary.json:\d+: validation/.*: n_pairs: \d+; vali"),
    (of_mine("residuals", lambda r: r[:-1]), r"residuals.csv:1: row: has .* rows of mounting/sing"),
    (of_mine("residuals", lambda r: [*r, r[-1]]), r"residuals.csv:1: row: has .* rows of mounting"),
    (lines("covariance", lambda r: [r[0], *r[2:]]), r"covariance.csv:\d+: column: 1 rows of heads"),
    (
        lines("covariance", lambda r: [*r[:2], *r[3:]]),
        r"covariance.csv:\d+: row: .*; must have a r",
    ),
    (without("covariance", *MINE), r"parameters.csv:\d+: parameter: 'CAM/f_mm' of mounting/single"),
    (cell("covariance", "value", "7", row=2), r"covariance.csv:3: value: 7; must equal its count"),
    (cell("parameters", "sigma", "7"), r"parameters.csv:2: sigma: 7; must be the square root of"),
    # whole files
    (
        lines("parameters", lambda r: [*r[:-1], r[-1][:9]]),
        r"parameters.csv:\d+: row: has [123] cel",
    ),
    (lines("parameters", lambda r: [*r[:-1], r[-1][:-1]]), r"parameters.csv:\d+: row: has no line"),
    (lines("validation", lambda r: [r[0], "single_step\n"]), r"validation.csv:2: row: has 1 cells"),
    (lines("validation", lambda r: [r[0], ",,\n,\n"]), r"validation.csv:2: row: has 3 cells; must"),
    (text("parameters.csv", ""), r"parameters.csv:1: header: is empty; must be stage,method,camer"),
    (text("rejected.csv", "a,b\n"), r"rejected.csv:1: header: 'a,b'; must be stage,method,kind"),
    (lambda f: (f / "validation.csv").write_bytes(b"\xff"), r"validation.csv:1: header: "),
    (
        lines("check_points", lambda r: [r[0], "\0" + r[1]]),
        r"points.csv:2: stage: '.x00validation' is unk",
    ),
    # summary.json and provenance.json
    (text("summary.json", "{"), r"summary.json:1: file: not JSON \(.*\); must be one object per"),
    (text("summary.json", '{"a": 1, "a": 2}'), r"summary.json:1: file: .*'a' stands twice"),
    (text("summary.json", "[" * 100_000), r"summary.json:1: file: not JSON"),
    (entry(SINGLE, "sigma0_squared", 1e308), r"summary.json:\d+: .*: sigma0_squared: 1e\+308; m"),
    (
        entry(SINGLE, "sigma0_squared", 10**400),
        r"summary.json:\d+: .*: sigma0_squared: 10.*; must",
    ),
    (entry(SINGLE, "sigma0_squared", -1), r"summary.json:\d+: .*: sigma0_squared: -1; must be ze"),
    (entry(SINGLE, "redundancy", None), r"summary.json:\d+: .*: redundancy: is missing; an adjus"),
    (entry(SINGLE, "redundancy", 1.5), r"summary.json:\d+: .*: redundancy: 1.5; must be a whole"),
    (entry(SINGLE, "chi_square_p", 2), r"summary.json:\d+: .*: chi_square_p: 2; must be between"),
    (entry(SINGLE, "notes", 7), r"summary.json:\d+: .*: notes: 7; must be a list of sentences"),
    (entry("validation/single_step", "points", 1), r"summary.json:\d+: .*: points: 1; must be me"),
    (text("provenance.json", "{}"), r"provenance.json:1: files: None; must be an object; run all"),
    (
        text("provenance.json", '{"files": {"a": 1}, "stages": {}}'),
        r"e.json:\d+: files: a: 1; mu",
    ),
]


@pytest.mark.parametrize(("tamper", "says"), TAMPERED, ids=[says[:50] for _, says in TAMPERED])
def test_each_kind_of_damage_is_a_line_with_its_place(tampered, acx4, tmp_path, tamper, says):
    """Whoever tampers knows how to compute a checksum anew."""
    tamper(tampered)
    seal_again(tampered)
    status, out, err = acx4("report", tampered, "--out", tmp_path / "report.html")
    assert (status, out.replace("report: done\n", "")) == (2, "")
    assert any(re.search(says, line) for line in err.splitlines()), err


@pytest.mark.parametrize("command", ["compare", "export", "render", "run"])
def test_every_command_that_reads_results_refuses_the_same(
    all_stages, tampered, acx4, tmp_path, command
):
    cell("parameters", "camera", "X", of=("heads",))(tampered)
    cell("parameters", "camera", "X", of=("mounting",))(tampered)
    seal_again(tampered)
    status, _, err = acx4(command, *arguments(command, all_stages, tampered, tmp_path / "out"))
    assert status == 2
    assert "parameters.csv:" in err
    assert "camera: 'X' is unknown; must be a camera of flight.toml" in err


def arguments(command, all_stages, tampered, out):
    of_flight = {"render": ("--out", out), "run": ("--numbers-only", "--stages", "validation")}
    if command in of_flight:
        return all_stages / "flight", "--results", tampered, *of_flight[command]
    return tampered, "--out", out, *(("--to", "opencv") if command == "export" else ())


def test_results_of_other_stages_may_be_of_an_earlier_flight(all_stages, tampered, acx4, tmp_path):
    """A flight that lost an exposure is run again into the same folder."""
    flight = shutil.copytree(all_stages / "flight", tmp_path / "flight")
    for name in ("images", "image_points"):
        path = flight / "validation" / f"{name}.csv"
        kept = [row for row in path.read_text().splitlines(keepends=True) if "E0_CAM" not in row]
        path.write_text("".join(kept))
    status, _, err = acx4("run", flight, "--results", tampered, "--numbers-only")
    assert status == 0, err
    provenance.read_run(tampered)


# --- links -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["parameters.csv", "residuals.csv", "summary.json", "provenance.json", MARK]
)
def test_a_file_that_is_a_link_out_of_the_results_is_refused(all_stages, tampered, name):
    (tampered / name).unlink()
    (tampered / name).symlink_to(all_stages / "results" / name)
    with pytest.raises((FlightError, OutputError), match=rf"{name}.*: is a link"):
        read_all(tampered)


def test_a_kept_flight_that_is_a_link_out_of_the_results_is_refused(all_stages, tampered):
    shutil.rmtree(tampered / "flight")
    (tampered / "flight").symlink_to(all_stages / "results" / "flight")
    with pytest.raises(FlightError, match=r"is a link that leads out of the results"):
        read_all(tampered)


def test_a_block_of_the_kept_flight_that_is_a_link_is_refused(all_stages, tampered):
    shutil.rmtree(tampered / "flight" / "validation")
    (tampered / "flight" / "validation").symlink_to(all_stages / "flight" / "validation")
    with pytest.raises(FlightError, match=r"is a link that leads out of the results"):
        read_all(tampered)


def test_results_are_read_through_a_link_to_the_whole_folder(tampered, tmp_path):
    (tmp_path / "link").symlink_to(tampered)
    assert len(read_all(tmp_path / "link").parameters)


def test_a_pipe_in_the_place_of_a_table_is_refused_at_once(tampered):
    (tampered / MARK).unlink()
    (tampered / "covariance.csv").unlink()
    os.mkfifo(tampered / "covariance.csv")
    with pytest.raises(FlightError, match=r"covariance.csv:1: file: is no regular file; must be"):
        read_all(tampered)


def read_all(folder):
    found = provenance.read_run(folder).found
    assert len(found.residuals)
    return found


# --- the kept flight -------------------------------------------------------------------------


def test_a_kept_flight_is_checked_as_a_flight(tampered):
    path = tampered / "flight" / "validation" / "images.csv"
    path.write_text(path.read_text().replace(",CAM,", ",XXX,", 1))
    seal_again(tampered)
    with pytest.raises(FlightError, match=r"images.csv:2: camera: 'XXX' is unknown"):
        read_all(tampered)


def test_a_table_beside_those_that_the_run_kept_is_refused(tampered):
    shutil.copy(tampered / "flight" / "control_points.csv", tampered / "flight" / "heads")
    with pytest.raises(FlightError, match=r"provenance.json:\d+: files: without heads/control_p"):
        read_all(tampered)
