"""The command's exit statuses and lines, as its user meets them."""

import json
import os
import re
import shutil
import signal
import struct
import subprocess
import sys
import time
import zlib

import pytest

from acx4book.command.acx4 import app, main
from acx4book.notebooks import runner
from acx4files.results import folder as results
from acx4files.results import provenance
from acx4files.results.own_folder import LOCK
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


def test_help_is_quick_and_teaches():
    code = (
        "import contextlib, sys, acx4book.command.acx4\n"
        "with contextlib.suppress(SystemExit):\n"
        "    acx4book.command.acx4.main(['run', '--help'])\n"
        "assert not {'numpy', 'pandas', 'papermill', 'rich'} & set(sys.modules), sys.modules.keys()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "acx4 run my_flight --results my_results --stages mounting,validation" in done.stdout


def test_help_keeps_the_lines_of_its_lists():
    texts = [command.help for command in app.registered_commands]
    lists = [part for text in texts for part in text.split("\n\n") if "\n  " in part]
    assert [part for part in lists if not part.startswith("\b\n")] == []


def test_reading_a_flight_loads_nothing_that_adjusts_or_compiles():
    code = "import sys, acx4files.flight\n"
    code += "assert not {'numba', 'scipy', 'pandas'} & set(sys.modules)"
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
        "assert not {'numba', 'scipy', 'pandas'} & set(sys.modules)"
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


@pytest.mark.parametrize("command", [["check"], ["run", "--results", "unused"]])
def test_a_flight_that_is_not_there_is_status_2(acx4, tmp_path, monkeypatch, command):
    monkeypatch.chdir(tmp_path)
    status, out, err = acx4(command[0], "nowhere", *command[1:])
    assert (status, out) == (2, "")
    assert err.count("nowhere") >= 1
    assert list(tmp_path.iterdir()) == []


def test_wrong_arguments_are_status_2(acx4, flight, tmp_path):
    status, _, err = acx4("run", flight, "--results", tmp_path / "r", "--stages", "heads,mountain")
    assert status == 2
    assert err == "unknown stage 'mountain'; known: heads, synthetic, mounting, validation\n"
    assert acx4("run", flight)[0] == 2
    assert acx4("simulate", "acx4", "--out", tmp_path / "f", "--seed", "x")[0] == 2
    assert acx4("rnu")[0] == 2
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


def png(path, *, width, height):
    """Write the head of a PNG that claims a size, with pixels for none of it."""
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    with path.open("wb") as file:
        file.write(b"\x89PNG\r\n\x1a\n")
        for kind, data in ((b"IHDR", head), (b"IDAT", zlib.compress(b"\0" * 100))):
            checked = zlib.crc32(kind + data)
            file.write(struct.pack(">I", len(data)) + kind + data + struct.pack(">I", checked))


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("text.jpg", "is not a picture that can be read; give a JPEG, PNG or TIFF"),
        ("empty.jpg", "is not a picture that can be read; give a JPEG, PNG or TIFF"),
        ("cut.png", "is not a picture that can be read; give a JPEG, PNG or TIFF"),
        ("bomb.png", "is too large a picture; at most 1,073,741,824 pixels that fit into memory"),
        ("folder", "Is a directory"),
        ("pipe", "is no file"),
        ("missing.png", "No such file or directory"),
    ],
)
def test_a_ground_that_is_no_picture_is_one_line(capfd, tmp_path, name, said):
    path = tmp_path / name
    (tmp_path / "text.jpg").write_text("no picture", encoding="utf-8")
    (tmp_path / "empty.jpg").touch()
    png(tmp_path / "cut.png", width=2000, height=2000)
    png(tmp_path / "bomb.png", width=60_000, height=60_000)
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    pictures = ["--images", "C1-01", "--reduce", "16", "--ground", str(path)]
    with pytest.raises(SystemExit) as end:
        main(["simulate", "single-head", "--out", str(tmp_path / "new"), *pictures])
    assert end.value.code == 2
    assert capfd.readouterr().err == f"{path}: {said}\n"  # what libraries print is not said
    assert not (tmp_path / "new").exists()


def test_what_a_user_typed_wrong_is_said_without_its_escapes(acx4):
    status, out, err = acx4("check", "--\x1b[31mred", "flight")
    assert (status, out) == (2, "")
    assert "\x1b" not in err
    assert "No such option" in err


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
