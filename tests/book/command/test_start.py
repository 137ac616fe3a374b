"""How the command begins and ends, and what it says in a terminal."""

import io
import signal
import struct
import subprocess
import sys
import zlib

import cv2
import numpy as np
import pandas as pd
import pyproj
import pytest

from acx4book.command import terminal
from acx4book.command.terminal import status_of
from acx4book.typesetting import plain_text
from acx4lib.errors import AdjustmentError, FlightError

# --- start -----------------------------------------------------------------------------------


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


def run(module, *, heard=True):
    """Run a command that is interrupted when it begins to load a module."""
    signals = signal.default_int_handler if heard else signal.SIG_IGN
    return subprocess.run(
        [sys.executable, "-c", INTERRUPTED.format(module=module), "check", "no-flight"],
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signals),
    )


@pytest.mark.parametrize(
    "module",
    ["typer", "acx4book.command.acx4", "importlib.metadata", "numpy", "acx4files.flight.reader"],
)
def test_an_interruption_while_modules_are_loaded_shows_no_traceback(module):
    done = run(module)
    assert (done.returncode, done.stderr) == (130, "interrupted\n")


LOST = """
import os, signal

class Removed:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGINT)

from acx4book.command.terminal import status_of

def command():
    Removed()
    while True:
        pass

raise SystemExit(status_of(command, []))
"""


def test_an_interruption_that_python_loses_is_heard():
    command = [sys.executable, "-c", LOST]
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        check=False,
        timeout=60,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
    )
    assert (done.returncode, done.stderr) == (130, "interrupted\n")


def test_what_ignores_interruptions_goes_on():
    """As behind ``nohup``, or in the background of a script."""
    done = run("typer", heard=False)
    assert done.returncode == 2
    assert "no-flight" in done.stderr


# --- what is said on a terminal cannot move, colour or hide anything there -------------------


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        ("plain: größe, Kamera №1, σ = 3″", None),
        ("カメラ 相机 камера", None),
        ("a\u00a0b", None),
        ("\x1b[31mred\x1b[0m", r"\x1b[31mred\x1b[0m"),
        ("over\rwritten", r"over\rwritten"),
        ("two\nlines", r"two\nlines"),
        ("tab\there\x07", r"tab\there\x07"),
        ("\x9b1A", r"\x9b1A"),
        ("abc\u202exe.txt", r"abc\u202exe.txt"),
        ("line\u2028separator", r"line\u2028separator"),
        ("byte \udcff", r"byte \xff"),
    ],
)
def test_a_line_stays_a_line_of_signs(line, shown):
    assert plain_text.shown(line, "terminal") == (line if shown is None else shown)


def test_standard_error_gets_safe_lines(capsys):
    terminal.say("a\x1b[2J", "b\nc")
    assert capsys.readouterr().err == "a\\x1b[2J\nb\\nc\n"


def test_a_text_keeps_its_lines(capsys):
    terminal.show("one\ntwo\x1b[1m")
    assert capsys.readouterr().out == "one\ntwo\\x1b[1m\n"


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
        (
            ModuleNotFoundError("No module named 'pyproj'"),
            1,
            "the installation is not complete: ",
        ),
        (KeyboardInterrupt(), 130, "interrupted"),
        (SystemExit(143), 143, "terminated"),
        (
            np.linalg.LinAlgError("Singular matrix"),
            1,
            "the equations cannot be solved (Singular matrix): one number is so far from",
        ),
        (SystemExit(3), 3, ""),
        (SystemExit(None), 0, ""),
    ],
)
def test_what_is_foreseen_has_its_sentence(capsys, error, status, said):
    assert status_of(raising(error), []) == status
    err = capsys.readouterr().err
    assert err.startswith(said)
    assert len(err.splitlines()) == len(said.splitlines())


@pytest.mark.parametrize(
    "error",
    [
        cv2.error("OpenCV(5)\n(-215:Assertion failed) pixels <= MOST in function 'x'\n"),
        pyproj.exceptions.CRSError("Invalid projection"),
        pyproj.exceptions.ProjError("out of range"),
        pd.errors.EmptyDataError("No columns"),
        struct.error("unpack requires 4 bytes"),
        zlib.error("Error -3"),
        ValueError("operands could not be broadcast\x1b[2J"),
        AssertionError(),
        ZeroDivisionError("division by zero"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_what_nobody_foresaw_is_a_line_that_can_be_reported(capsys, monkeypatch, error):
    monkeypatch.delenv("ACX4_TRACEBACK", raising=False)
    assert status_of(raising(error), ["check", "my flight"]) == 1
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"this is a mistake in acx4: {type(error).__name__}: ")
    assert "acx4 check 'my flight'" in line
    assert "\x1b" not in line


def test_a_developer_may_see_where_it_was(capsys, monkeypatch):
    monkeypatch.setenv("ACX4_TRACEBACK", "1")
    assert status_of(raising(ValueError("deep below")), []) == 1
    assert "in command" in capsys.readouterr().err


@pytest.mark.parametrize(("returned", "status"), [(None, 0), (0, 0), (2, 2)])
def test_a_command_returns_its_status(returned, status):
    assert status_of(lambda: returned, []) == status
