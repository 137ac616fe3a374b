"""Results that were tampered with, or half copied, are refused by file, line and column."""

from __future__ import annotations

import csv
import json
import os
import re
import shutil

import pytest

from acx4book.notebooks import functions, runner
from acx4lib.errors import FlightError, OutputError
from acx4lib.results import provenance
from acx4lib.results.own_folder import MARK
from support.flights import written
from support.run_results import seal_again

SINGLE = "mounting/single_step"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A small flight of two heads, and the results of all its stages."""
    folder = tmp_path_factory.mktemp("tampered")
    blocks = ("heads", "calibration", "validation")
    flight = written.write_flight(folder / "flight", blocks=blocks)
    runner.run(flight, folder / "results", way=functions.Functions())
    return folder


@pytest.fixture
def results(made, tmp_path):
    """A copy to be tampered with."""
    return shutil.copytree(made / "results", tmp_path / "results")


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
def test_each_kind_of_damage_is_a_line_with_its_place(results, acx4, tmp_path, tamper, says):
    """Whoever tampers knows how to compute a checksum anew."""
    tamper(results)
    seal_again(results)
    status, out, err = acx4("report", results, "--out", tmp_path / "report.html")
    assert (status, out.replace("report: done\n", "")) == (2, "")
    assert any(re.search(says, line) for line in err.splitlines()), err


@pytest.mark.parametrize("command", ["compare", "export", "render", "run"])
def test_every_command_that_reads_results_refuses_the_same(made, results, acx4, tmp_path, command):
    cell("parameters", "camera", "X", of=("heads",))(results)
    cell("parameters", "camera", "X", of=("mounting",))(results)
    seal_again(results)
    status, _, err = acx4(command, *arguments(command, made, results, tmp_path / "out"))
    assert status == 2
    assert "parameters.csv:" in err
    assert "camera: 'X' is unknown; must be a camera of flight.toml" in err


def arguments(command, made, results, out):
    of_flight = {"render": ("--out", out), "run": ("--numbers-only", "--stages", "validation")}
    if command in of_flight:
        return made / "flight", "--results", results, *of_flight[command]
    return results, "--out", out, *(("--to", "opencv") if command == "export" else ())


def test_results_of_other_stages_may_be_of_an_earlier_flight(made, results, acx4, tmp_path):
    """A flight that lost an exposure is run again into the same folder."""
    flight = shutil.copytree(made / "flight", tmp_path / "flight")
    for name in ("images", "image_points"):
        path = flight / "validation" / f"{name}.csv"
        kept = [row for row in path.read_text().splitlines(keepends=True) if "E0_CAM" not in row]
        path.write_text("".join(kept))
    status, _, err = acx4("run", flight, "--results", results, "--numbers-only")
    assert status == 0, err
    provenance.read_run(results)


# --- links -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "name", ["parameters.csv", "residuals.csv", "summary.json", "provenance.json", MARK]
)
def test_a_file_that_is_a_link_out_of_the_results_is_refused(made, results, name):
    (results / name).unlink()
    (results / name).symlink_to(made / "results" / name)
    with pytest.raises((FlightError, OutputError), match=rf"{name}.*: is a link"):
        read_all(results)


def test_a_kept_flight_that_is_a_link_out_of_the_results_is_refused(made, results):
    shutil.rmtree(results / "flight")
    (results / "flight").symlink_to(made / "results" / "flight")
    with pytest.raises(FlightError, match=r"is a link that leads out of the results"):
        read_all(results)


def test_a_block_of_the_kept_flight_that_is_a_link_is_refused(made, results):
    shutil.rmtree(results / "flight" / "validation")
    (results / "flight" / "validation").symlink_to(made / "flight" / "validation")
    with pytest.raises(FlightError, match=r"is a link that leads out of the results"):
        read_all(results)


def test_results_are_read_through_a_link_to_the_whole_folder(results, tmp_path):
    (tmp_path / "link").symlink_to(results)
    assert len(read_all(tmp_path / "link").parameters)


def test_a_pipe_in_the_place_of_a_table_is_refused_at_once(results):
    (results / MARK).unlink()
    (results / "covariance.csv").unlink()
    os.mkfifo(results / "covariance.csv")
    with pytest.raises(FlightError, match=r"covariance.csv:1: file: is no regular file; must be"):
        read_all(results)


def read_all(folder):
    found = provenance.read_run(folder).found
    assert len(found.residuals)
    return found


# --- the kept flight -------------------------------------------------------------------------


def test_a_kept_flight_is_checked_as_a_flight(results):
    path = results / "flight" / "validation" / "images.csv"
    path.write_text(path.read_text().replace(",CAM,", ",XXX,", 1))
    seal_again(results)
    with pytest.raises(FlightError, match=r"images.csv:2: camera: 'XXX' is unknown"):
        read_all(results)


def test_a_table_beside_those_that_the_run_kept_is_refused(results):
    shutil.copy(results / "flight" / "control_points.csv", results / "flight" / "heads")
    with pytest.raises(FlightError, match=r"provenance.json:\d+: files: without heads/control_p"):
        read_all(results)
