"""The command's exit statuses and lines, as its user meets them."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time

import pytest

from acx4book.command.acx4 import main
from acx4book.notebooks import runner
from acx4files.results import folder as results
from acx4files.results import provenance
from acx4files.results.whole_files import LOCK
from support.flights.written import change
from support.helpers import hears_interrupts, repeats, write_notebook

COMMAND = [sys.executable, "-c", "from acx4book.command.acx4 import main; main()"]
LEFT = {*results.FILES, provenance.KEPT, LOCK}
PARAMETERS = "flight_path = ''\nresults_path = ''\nseed = 1"


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    folder = tmp_path_factory.mktemp("cli") / "flight"
    with pytest.raises(SystemExit) as end:
        main(["simulate", "single-head", "--out", str(folder), "--seed", "3"])
    assert end.value.code == 0
    return folder


@pytest.fixture
def notebooks(tmp_path):
    for name in runner.NOTEBOOKS.values():
        write_notebook(tmp_path / "notebooks" / f"{name}.ipynb", PARAMETERS, "seed")
    return tmp_path / "notebooks"


@pytest.mark.parametrize(
    ("typed", "shows"),
    [
        ("run", "acx4 run my_flight --results my_results --stages mounting,validation"),
        ("plan", "low = {flying_height_m = 600, course_deg = 0, length_m = 900,"),
    ],
)
def test_help_is_quick_and_teaches(typed, shows):
    code = (
        "import contextlib, sys, acx4book.command.acx4\n"
        "with contextlib.suppress(SystemExit):\n"
        f"    acx4book.command.acx4.main([{typed!r}, '--help'])\n"
        "assert not {'numpy', 'pandas', 'papermill', 'rich'} & set(sys.modules), sys.modules.keys()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert shows in done.stdout


def test_help_lists_the_commands_in_the_order_of_their_use_with_whole_sentences(acx4):
    status, said, _ = acx4("--help")
    lines = said[said.index("Commands:") :].splitlines()[1:]
    assert status == 0
    assert [line.split()[0] for line in lines[:4]] == ["new", "import", "check", "measure"]
    assert all(line.endswith(".") and not line.endswith("...") for line in lines)


@pytest.mark.parametrize(
    ("typed", "says"),
    [
        (["rnu"], "No such command 'rnu'"),
        (["run", "f", "--sedes", "1"], "No such option: --sedes"),
        (["run", "f"], "Missing option '--results'; see acx4 run --help"),
        (["simulate", "acx4", "--out", "f", "--seed", "x"], "Invalid value for '--seed': 'x'"),
        (["check", "--\x1b[31mred", "f"], "No such option: --\\x1b[31mred"),
        (["compare", "a", "b"], "compare is gone; instead: papermill notebooks/compare.ipynb"),
        (["plan", "p.toml", "--target=a.toml"], "--target is gone; instead: leave strips out of"),
        (["export", "r", "--to=pix4d"], "pix4d is gone; instead: acx4 export --to opencv, and"),
    ],
)
def test_what_was_typed_wrong_is_one_line_and_status_2(acx4, typed, says):
    status, out, err = acx4(*typed)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert err.startswith(says)


def test_reading_a_flight_loads_nothing_that_adjusts_or_compiles():
    code = "import sys, acx4files.flight\n"
    code += "assert not {'numba', 'scipy', 'matplotlib'} & set(sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_a_simulated_flight_is_found_good(acx4, flight):
    assert json.loads((flight.parent / "flight.truth.json").read_text())
    status, out, err = acx4("check", flight)
    assert (status, err) == (0, "")
    assert "calibration" in out
    assert "validation" in out


def test_a_wrong_sign_is_a_note_of_the_check_with_the_reading_that_fits(acx4, flight, tmp_path):
    shutil.copytree(flight, tmp_path / "flipped")
    for block in ("calibration", "validation"):
        change(
            tmp_path / "flipped",
            f"{block}/trajectory.csv",
            lambda table: table.assign(pitch_deg=-table["pitch_deg"]),
        )
    status, out, err = acx4("check", tmp_path / "flipped")
    assert (status, err) == (0, "")
    for block in ("calibration", "validation"):
        says = f"{block}: with pitch of opposite sign the residuals of attitude fall from"
        assert re.search(rf"  {says} \d\.\d+° to 0\.0\d+°\n?", out)


def test_trying_readings_compiles_nothing(flight):
    code = (
        "import sys\n"
        "from acx4files.conventions import notes\n"
        "from acx4files.flight.reader import read\n"
        "assert not list(notes(read(sys.argv[1])))\n"
        "assert not {'numba', 'scipy', 'matplotlib'} & set(sys.modules)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, flight], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_simulate_names_what_it_knows_and_never_writes_over_a_flight(acx4, flight, tmp_path):
    status, out, err = acx4("simulate", "acx5", "--out", tmp_path / "new")
    assert (status, out) == (2, "")
    known = "acx4, acx4-ideal, single-head; a plan's name ends in .toml"
    assert err == f"unknown flight 'acx5'; known: {known}\n"
    before = (flight / "flight.toml").read_bytes()
    status, out, err = acx4("simulate", "single-head", "--out", flight, "--seed", 9)
    assert (status, out) == (2, "")
    assert err == f"{flight}: exists already; choose another name\n"
    assert (flight / "flight.toml").read_bytes() == before


@pytest.mark.parametrize("command", [["check"], ["run", "--results", "unused"]])
def test_every_problem_of_a_flight_is_a_line(acx4, flight, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(flight, tmp_path / "bad")
    table = tmp_path / "bad" / "calibration" / "image_points.csv"
    lines = table.read_text().splitlines()
    lines[1] = lines[1].replace(lines[1].split(",")[2], "nan")
    table.write_text("\n".join(lines))
    with (tmp_path / "bad" / "flight.toml").open("a") as toml:
        toml.write("\n[unknown]\nkey = 1\n")
    status, out, err = acx4(command[0], "bad", *command[1:])
    assert (status, out) == (2, "")
    assert [line.split(": ")[0] for line in err.splitlines()] == [
        f"bad/flight.toml:{len((tmp_path / 'bad' / 'flight.toml').read_text().splitlines()) - 1}",
        "bad/calibration/image_points.csv:2",
    ]
    assert not (tmp_path / "unused").exists()


def test_wrong_arguments_are_status_2(acx4, flight, tmp_path):
    status, _, err = acx4("run", flight, "--results", tmp_path / "r", "--stages", "heads,mountain")
    assert status == 2
    assert err == "unknown stage 'mountain'; known: heads, synthetic, mounting, validation\n"
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_one_line(acx4, flight, tmp_path, notebooks):
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file", tmp_path / "file" / "below"):
        status, out, err = acx4("run", flight, "--results", folder, "--notebooks", notebooks)
        assert (status, out) == (2, "")
        assert len(err.splitlines()) == 1
        assert str(tmp_path / "file") in err
    status, _, err = acx4("simulate", "single-head", "--out", tmp_path / "file" / "flight")
    assert status == 2
    assert len(err.splitlines()) == 1


@pytest.mark.slow
def test_a_run_says_one_line_per_stage(acx4, flight, tmp_path, notebooks):
    folder = tmp_path / "results"
    status, out, err = acx4("run", flight, "--results", folder, "--notebooks", notebooks)
    assert (status, err) == (0, "")
    done, after = out.splitlines()[:3], out.splitlines()[3:]
    assert sorted(done) == ["flight: done", "mounting: done", "validation: done"]
    assert after == [
        "heads: skipped, the flight has no block heads",
        "synthetic: skipped, the flight has no block heads",
        "validation: 1 of 60 images have no measurements: V3-01",
        f"results in {folder}",
    ]
    assert {path.name for path in folder.iterdir()} == {*LEFT, "notebooks"}


@pytest.mark.slow
def test_a_failing_notebook_is_status_1_after_what_is_not_determined(
    acx4, flight, tmp_path, notebooks
):
    said = ["mounting/single_step: CAM: lever_z_m: not determined", "CAM: k3: not determined"]
    cell = (
        "from acx4files.results import folder\n"
        "folder.replace(results_path, ['mounting'], tables={}, summary="
        f"{{'mounting/single_step': {{'not_determined': {said}}}}})"
    )
    write_notebook(notebooks / "03-mounting-calibration.ipynb", PARAMETERS, cell)
    arguments = ("run", flight, "--results", tmp_path / "results", "--notebooks", notebooks)
    status, _, err = acx4(*arguments)
    assert status == 1
    assert err.splitlines() == said
    write_notebook(
        notebooks / "04-validation.ipynb", PARAMETERS, "raise ValueError('no\\nlast line')"
    )
    status, out, err = acx4(*arguments)
    assert status == 1
    assert err.splitlines() == [*said, "notebook 04-validation, cell 2: ValueError: last line"]
    assert "validation: done" not in out
    assert (tmp_path / "results" / "failed" / "04-validation.ipynb").is_file()


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "expected"), [("FlightError", 2), ("AdjustmentError", 1)])
def test_an_error_of_the_library_is_said_as_it_is(
    acx4, flight, tmp_path, notebooks, kind, expected
):
    argument = "['run stage heads first']" if kind == "FlightError" else "'no convergence'"
    cell = f"from acx4lib.errors import {kind}\nraise {kind}({argument})"
    write_notebook(notebooks / "00-flight.ipynb", PARAMETERS, cell)
    status, out, err = acx4("run", flight, "--results", tmp_path / "r", "--notebooks", notebooks)
    assert status == expected
    assert "flight: done" not in out  # others run beside it
    assert err == argument.strip("[']") + "\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sent", "status", "said"),
    [repeats(signal.SIGINT, 130, "interrupted\n"), (signal.SIGTERM, 143, "terminated\n")],
)
def test_a_stopped_run_says_so_and_leaves_nothing_half_done(
    flight, tmp_path, notebooks, sent, status, said
):
    marker = tmp_path / "started"
    sleep = (
        f"import os, pathlib, time\npathlib.Path({str(marker)!r}).write_text(str(os.getpid()))\n"
    )
    write_notebook(notebooks / "00-flight.ipynb", PARAMETERS, sleep + "time.sleep(300)")
    command = [*COMMAND, "run", flight, "--results", tmp_path / "r", "--notebooks", notebooks]
    how = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    how |= {"preexec_fn": hears_interrupts}
    with subprocess.Popen(command, **how) as run:
        deadline = time.monotonic() + 60
        while not (marker.exists() and marker.read_text()) and time.monotonic() < deadline:
            time.sleep(0.05)
        run.send_signal(sent)
        out, err = run.communicate(timeout=60)
    assert (run.returncode, err) == (status, said)
    assert "flight: done" not in out
    assert {path.name for path in (tmp_path / "r").iterdir()} <= {*LEFT, "failed", "notebooks"}
    assert (tmp_path / "r" / "failed" / "00-flight.ipynb").is_file()
    with pytest.raises(ProcessLookupError):
        os.kill(int(marker.read_text()), 0)
