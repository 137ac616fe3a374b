"""What is promised of files: none is half, none is another's, and no path leaves its folder."""

import errno
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest

from acx4files.flight import reader
from acx4files.results import folder as results
from acx4files.results import provenance, whole_files
from acx4files.results.read_back import read_calibration
from acx4files.results.whole_files import file_stem
from acx4lib.calibration.estimates import METHODS
from acx4lib.errors import FlightError, OutputError
from support.flights import written

WRITES = """
import sys
from pathlib import Path
import pandas as pd
from acx4files.flight import reader
from acx4files.results import folder, provenance
flight = reader.read(sys.argv[1])
for value in range(*map(int, sys.argv[3:])):
    row = ("{stage}", "{stage}", "CAM", "f_mm", float(value), 0.1, "mm", 0.0)
    rows = pd.DataFrame([row] * 2000, columns=folder.COLUMNS["parameters"])
    summary = {{"{stage}/{stage}": {{"value": value}}}}
    record = folder.Record(tables={{"parameters": rows{more}}}, summary=summary)
    provenance.write(sys.argv[2], "{stage}", [record], flight=flight)
    print(value, flush=True)
"""
OF_MOUNTING = WRITES.format(
    stage="mounting",
    more=', "covariance": pd.DataFrame([("mounting", "mounting", "a", "a", value)] * 2000,'
    ' columns=folder.COLUMNS["covariance"])',
)
OF_HEADS = WRITES.format(stage="heads", more="")


@pytest.fixture(scope="module")
def flight_path(tmp_path_factory):
    return written.write_flight(tmp_path_factory.mktemp("flight") / "F")


def started(code, *arguments):
    command = [sys.executable, "-c", code, *map(str, arguments)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    process.stdout.readline()  # it has written once
    return process


def value_of(folder, stage):
    """Return the value of which a stage wrote, if all of its files have it."""
    found = results.read(folder)
    rows = found.parameters[found.parameters["stage"] == stage]
    (value,) = {*rows["value"], found.summary[f"{stage}/{stage}"]["value"]}
    assert len(rows) == 2000
    return value


def write(flight, folder, value, stage="mounting"):
    row = (stage, stage, "CAM", "f_mm", value, 0.1, "mm", 0.0)
    rows = pd.DataFrame([row] * 2000, columns=results.COLUMNS["parameters"])
    summary = {f"{stage}/{stage}": {"value": value}}
    record = results.Record(tables={"parameters": rows}, summary=summary)
    provenance.write(folder, stage, [record], flight=flight)


# --- killed, on a full disk, beside another writer --------------------------------------------


@pytest.mark.slow
def test_who_is_killed_leaves_whole_results_or_a_line_that_says_what_to_run_again(
    flight_path, tmp_path
):
    """At twenty moments; the next run mends what was interrupted, and what is left lying."""
    flight, said = reader.read(flight_path), set()
    for k in range(20):
        process = started(OF_MOUNTING, flight_path, tmp_path / "results", k * 1000, (k + 1) * 1000)
        time.sleep(0.003 * k)
        process.kill()
        process.communicate()
        try:
            value = value_of(tmp_path / "results", "mounting")
            covariance = results.read(tmp_path / "results").covariance["value"]
            assert {*covariance} == {value}
        except FlightError as error:
            said.add(str(error))
    assert all("run all stages again" in line and "\n" not in line for line in said), said
    provenance.begin(tmp_path / "results", flight, results.STAGES)
    write(flight, tmp_path / "results", 7.0)
    assert value_of(tmp_path / "results", "mounting") == 7.0
    left = {path.name for path in (tmp_path / "results").iterdir()}
    assert left == {*results.FILES, provenance.KEPT, whole_files.LOCK}


@pytest.mark.parametrize("k", range(len(results.COLUMNS) + 1))
def test_a_stage_that_is_interrupted_while_files_take_their_places_is_noticed(
    flight_path, tmp_path, monkeypatch, k
):
    flight = reader.read(flight_path)
    write(flight, tmp_path, 1.0, "heads")
    write(flight, tmp_path, 1.0)
    place, done = whole_files.Path.replace, []

    def interrupted(draft, target):
        done.append(target)
        if len(done) > k:
            raise KeyboardInterrupt
        return place(draft, target)

    monkeypatch.setattr(whole_files.Path, "replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write(flight, tmp_path, 2.0)
    monkeypatch.undo()
    if k == 0:
        assert value_of(tmp_path, "mounting") == 1.0
        return
    for use in (results.read, provenance.read_run, lambda to: write(flight, to, 3.0)):
        with pytest.raises(FlightError, match="run all stages again"):
            use(tmp_path)
    provenance.begin(tmp_path, flight, results.STAGES)
    write(flight, tmp_path, 3.0)
    assert value_of(tmp_path, "mounting") == 3.0


def test_a_full_disk_is_one_line_and_the_old_results_stay(flight_path, tmp_path, monkeypatch):
    flight = reader.read(flight_path)
    write(flight, tmp_path, 1.0)
    before = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    written = whole_files.Path.write_bytes

    def full(path, content):
        if path.suffix == ".csv":
            raise OSError(errno.ENOSPC, "No space left on device")
        return written(path, content)

    monkeypatch.setattr(whole_files.Path, "write_bytes", full)
    with pytest.raises(OutputError, match=r"parameters\.csv: No space left .* MB are free$"):
        write(flight, tmp_path, 2.0)
    monkeypatch.undo()
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == before


LIMITED = """
import resource, signal, sys
from acx4files.results import whole_files
from pathlib import Path
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
whole_files.write(Path(sys.argv[1]), "x" * 200_000)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="it has no limit of a file's size")
def test_a_file_beyond_the_limit_of_the_system_is_not_there(tmp_path):
    (tmp_path / "table.csv").write_text("old")
    done = subprocess.run(
        [sys.executable, "-c", LIMITED, tmp_path / "table.csv"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert "table.csv: File too large" in done.stderr
    assert [path.read_text() for path in tmp_path.iterdir()] == ["old"]


@pytest.mark.slow
def test_two_who_write_wait_for_each_other(flight_path, tmp_path):
    """A stage each, as notebooks side by side; both results are there, of one flight."""
    codes = (OF_HEADS, OF_MOUNTING)
    both = [started(code, flight_path, tmp_path / "results", 0, 20) for code in codes]
    assert [process.communicate()[0].split()[-1] for process in both] == ["19", "19"]
    for stage in ("heads", "mounting"):
        assert value_of(tmp_path / "results", stage) == 19.0


def test_who_waits_too_long_says_so(tmp_path):
    with whole_files.locked(tmp_path):
        for use in (whole_files.locked(tmp_path, wait=0.1), whole_files.claim(tmp_path, signs=[])):
            with pytest.raises(OutputError, match="another process is writing there"), use:
                pass
    with whole_files.claim(tmp_path, signs=[]):
        pass


# --- what is not the command's ------------------------------------------------------------------


@pytest.mark.parametrize("name", ["notes.txt", "parameters.csv", "flight.toml"])
def test_a_folder_of_others_is_left_alone(flight_path, tmp_path, name):
    flight = reader.read(flight_path)
    (tmp_path / name).write_text("mine")
    with pytest.raises(OutputError, match=r"choose a new or empty folder"):
        write(flight, tmp_path, 1.0)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "mine"


def test_a_summary_of_others_is_left_alone(flight_path, tmp_path):
    (tmp_path / "summary.json").write_text('{"my plan": {}}')
    with pytest.raises(FlightError, match="my plan is not of a stage of acx4 run"):
        write(reader.read(flight_path), tmp_path, 1.0)
    assert (tmp_path / "summary.json").read_text() == '{"my plan": {}}'


def test_a_folder_with_executed_notebooks_is_that_of_their_results(flight_path, tmp_path):
    """As papermill leaves it, before the notebook writes."""
    (tmp_path / "notebooks").mkdir()
    (tmp_path / "03.ipynb").touch()
    write(reader.read(flight_path), tmp_path, 1.0)
    assert value_of(tmp_path, "mounting") == 1.0
    (tmp_path / "mine.txt").write_text("mine")
    write(reader.read(flight_path), tmp_path, 2.0)
    assert (tmp_path / "mine.txt").read_text() == "mine"


def test_results_of_another_flight_are_refused_and_stay(flight_path, tmp_path):
    changed = shutil.copytree(flight_path, tmp_path / "other") / "flight.toml"
    changed.write_text(changed.read_text() + "[session]\ntemperature_c = 12.0\n")
    other = reader.read(tmp_path / "other")
    write(reader.read(flight_path), tmp_path / "results", 1.0, "heads")
    with pytest.raises(FlightError, match="the results of stage heads are of another flight"):
        write(other, tmp_path / "results", 2.0)
    assert value_of(tmp_path / "results", "heads") == 1.0
    write(other, tmp_path / "new", 2.0)
    with pytest.raises(FlightError, match="of another flight"):
        provenance.results_before(tmp_path / "new", ["mounting"], reader.read(flight_path))


def test_a_table_that_was_changed_by_hand_is_named(flight_path, tmp_path):
    flight = reader.read(flight_path)
    write(flight, tmp_path, 1.0)
    table = tmp_path / "parameters.csv"
    table.write_text(table.read_text().replace("1.0", "1.5"))
    with pytest.raises(FlightError, match=r"parameters\.csv: is not .*; run all stages again"):
        results.read(tmp_path)


# --- results of the version before ----------------------------------------------------------------


def test_results_of_the_version_before_are_read_and_gone_on_with(tmp_path):
    """Of the small flight of `written`; they have provenance.json, and no digests of tables."""
    folder = shutil.copytree(Path(__file__).parent / "version_1", tmp_path / "results")
    run = provenance.read_run(folder)
    assert set(run.found.summary) == {f"mounting/{m}" for m in METHODS}
    assert run.provenance.stages["mounting"]["flight"] == provenance.identity(run.flight)["sha256"]
    (camera,) = run.flight.calibration.cameras
    for method in METHODS:
        read_calibration(run.found, f"mounting/{method}", [camera])
    counted = run.found.summary["mounting/single_step"]["n_observations"]
    rows = results.rows(run.found, "residuals", "mounting/single_step")
    assert len(rows) == counted
    before = {path.name: path.read_bytes() for path in folder.glob("*.csv")}
    write(reader.read(folder / "flight"), folder, 1.0, "validation")
    after = {path.name: path.read_bytes() for path in folder.glob("*.csv")}
    old, new = (files.pop("parameters.csv") for files in (before, after))
    assert after == before
    assert new.startswith(old)
    assert results.is_whole(folder)
    assert set(provenance.read_run(folder).provenance.stages) == {"mounting", "validation"}
    assert not (folder / results.EARLIER).exists()


# --- names become files below their folder ------------------------------------------------------


NAMES = ["../up", "a/b", "a\\b", "con", ".hidden", "end.", " x ", "ä", "A", "a", "%2F", "x" * 300]


def test_every_name_is_another_file_in_the_folder(tmp_path):
    stems = [file_stem(name) for name in NAMES]
    assert len({stem.casefold() for stem in stems if stem.lower() != "a"}) == len(NAMES) - 2
    for stem in stems:
        assert (tmp_path / f"{stem}.tif").resolve().parent == tmp_path
        (tmp_path / f"{stem}.tif").write_text("")
    assert file_stem("C1-01_CAM 2") == "C1-01_CAM 2"
