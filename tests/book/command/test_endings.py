"""Whatever comes up from below a command, its user gets a line and a status."""

import struct
import zlib

import cv2
import numpy as np
import pandas as pd
import pyproj
import pytest

from acx4book.command.endings import status_of
from acx4lib.errors import AdjustmentError, FlightError


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
