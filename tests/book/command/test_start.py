"""How the command begins and ends, and what it says in a terminal."""

import io
import signal
import subprocess
import sys

import cv2
import numpy as np
import pyproj
import pytest

from acx4book.command import terminal
from acx4book.command.terminal import status_of
from acx4lib.errors import AdjustmentError, FlightError

INTERRUPTED = """
import os, signal, sys

def hear(event, args, begun=[]):
    if event == "import" and args[0] == {module!r} and not begun:
        begun.append(args[0])
        os.kill(os.getpid(), signal.SIGINT)

sys.addaudithook(hear)
from acx4book.command.start import main
main()
"""


@pytest.mark.parametrize("module", ["typer", "acx4book.command.acx4", "acx4files.flight.reader"])
def test_an_interruption_while_modules_are_loaded_shows_no_traceback(module):
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED.format(module=module), "check", "no-flight"],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert (done.returncode, done.stderr) == (130, "interrupted\n")


# --- what is said on a terminal cannot move, colour or hide anything there -------------------


class Screen(io.StringIO):
    """A terminal."""

    def isatty(self):
        return True


@pytest.mark.parametrize("bars", [terminal.stage_bars, terminal.counting_bar])
def test_a_name_in_a_bar_is_no_markup(monkeypatch, bars):
    screen = Screen()
    monkeypatch.setattr("sys.stdout", screen)
    with bars("rows") as tell:
        tell("[/bold] [link=http://x]a[/link]\x1b[2J", 1, 2)
        tell("[/bold] [link=http://x]a[/link]\x1b[2J", 2, 2)
    assert "\x1b[2J" not in screen.getvalue()
    assert "\x1b]8" not in screen.getvalue()  # a link
    assert "http" not in screen.getvalue() or "[link=http://x]" in screen.getvalue()


# --- whatever comes up from below a command, its user gets a line and a status ---------------


MISTAKE = "this is a mistake in acx4: "


def raising(error):
    def command():
        raise error

    return command


@pytest.mark.parametrize(
    ("error", "status", "said"),
    [
        (FlightError(["a.csv:1: x", "b.csv:2: y"]), 2, "a.csv:1: x\nb.csv:2: y"),
        (AdjustmentError("no convergence"), 1, "no convergence"),
        (FileNotFoundError(2, "No such file", "a"), 2, "a: No such file"),
        (PermissionError(13, "Permission denied", b"a\xff"), 2, r"a\xff: Permission denied"),
        (OSError("no more"), 2, "no more"),
        (MemoryError("Unable to allocate 9 GiB"), 1, "not enough memory for this input ("),
        (RecursionError("maximum depth"), 1, "not enough stack for this input (maximum depth)"),
        (ModuleNotFoundError("No module named 'pyproj'"), 1, "the installation is not complete"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (SystemExit(143), 143, "terminated"),
        (np.linalg.LinAlgError("Singular matrix"), 1, "the equations cannot be solved (Singular"),
        (SystemExit(3), 3, ""),
        (SystemExit(None), 0, ""),
        (cv2.error("OpenCV(5)\n(-215:Assertion failed)\n"), 1, f"{MISTAKE}error: OpenCV(5) (-215"),
        (pyproj.exceptions.ProjError("out of range"), 1, f"{MISTAKE}ProjError: out of range"),
        (ValueError("shapes\x1b[2J"), 1, rf"{MISTAKE}ValueError: shapes\x1b[2J; please report it"),
    ],
)
def test_every_end_has_its_line_and_status(capsys, monkeypatch, error, status, said):
    monkeypatch.delenv("ACX4_TRACEBACK", raising=False)
    assert status_of(raising(error), ["check", "my flight"]) == status
    err = capsys.readouterr().err
    assert err.startswith(said)
    assert len(err.splitlines()) == len(said.splitlines())
    assert err.startswith(MISTAKE) == ("acx4 check 'my flight' and what it shows" in err)


def test_a_developer_may_see_where_it_was(capsys, monkeypatch):
    monkeypatch.setenv("ACX4_TRACEBACK", "1")
    assert status_of(raising(ValueError("deep below")), []) == 1
    assert "in command" in capsys.readouterr().err


@pytest.mark.parametrize(("returned", "status"), [(None, 0), (0, 0), (2, 2)])
def test_a_command_returns_its_status(returned, status):
    assert status_of(lambda: returned, []) == status
