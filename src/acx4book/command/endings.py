"""The end of a command: with its result, or with a sentence and a status, never a traceback.

Expected errors have their sentences where they are raised. Any other error gets one line here.
"""

from __future__ import annotations

import _thread
import contextlib
import io
import os
import shlex
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import typer

from acx4book.command.start import INTERRUPTED, SAYS, stop
from acx4book.command.terminal import NOBODY_READS, abandon, say
from acx4lib.errors import Acx4Error, FlightError, OutputError, unsolvable

TERMINATED = 128 + signal.SIGTERM
ENDED = {INTERRUPTED: SAYS, TERMINATED: "terminated"}
"""Exit statuses of a command stopped from outside, and their messages."""

AGAIN_S = 0.02
"""Delay before a lost interruption is repeated, s."""

TRACEBACK = "ACX4_TRACEBACK"
"""Environment variable that makes an unexpected error show its traceback."""

Command = Callable[[], object]


def status_of(command: Command, arguments: Sequence[str]) -> int:
    """Run a command, print the reason if it fails, and return its exit status.

    Parameters
    ----------
    command : callable
        It returns its exit status, or None for zero.
    arguments : sequence of str
        Arguments of the command line, for a message on an unexpected error.
    """
    try:
        with _interruptible():
            status = _guarded(command, arguments)
    except KeyboardInterrupt:
        status = INTERRUPTED
    if status in ENDED:
        say(ENDED[status])
    return _flushed(status)


@contextlib.contextmanager
def _interruptible() -> Iterator[None]:
    """Turn an interruption into an exception, so that a command cleans up."""
    before, hook = signal.getsignal(signal.SIGINT), sys.unraisablehook
    if before is stop:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    sys.unraisablehook = _interrupt_again
    try:
        yield
    finally:
        sys.unraisablehook = hook
        if before is stop:
            signal.signal(signal.SIGINT, stop)


def _interrupt_again(ignored: sys.UnraisableHookArgs) -> None:
    """Repeat an interruption lost by Python, for example while it removes an object."""
    if issubclass(ignored.exc_type, KeyboardInterrupt):
        threading.Timer(AGAIN_S, _thread.interrupt_main).start()  # not while this is called
    else:
        sys.__unraisablehook__(ignored)


def _guarded(command: Command, arguments: Sequence[str]) -> int:
    """Run a command, print its error, and return its status."""
    try:
        status = command()
    except SystemExit as end:
        status = end.code
    except Acx4Error as error:
        say(*getattr(error, "__notes__", ()), *str(error).splitlines())
        status = 2 if isinstance(error, FlightError | OutputError) else 1
    except OSError as error:
        say(_said_of_file(error))
        status = 2
    except Exception as error:  # the last resort: for any error a user gets a sentence
        status = _said_of_others(error, arguments)
    return status if isinstance(status, int) else int(status is not None)


def _said_of_others(error: Exception, arguments: Sequence[str]) -> int:
    """Print an error of neither a flight nor a file, and return the status."""
    if isinstance(error, ImportError):
        say(f"the installation is not complete: {_one_line(error)}")
        return 1
    if isinstance(error, MemoryError | RecursionError):
        resource = "memory" if isinstance(error, MemoryError) else "stack"
        say(f"not enough {resource} for this input ({_one_line(error)})")
        return 1
    if type(error).__name__ == "LinAlgError":  # of numpy, which most commands need not load
        say(str(unsolvable(_one_line(error))))
        return 1
    return _unforeseen(error, arguments)


def _unforeseen(error: Exception, arguments: Sequence[str]) -> int:
    """Print the parser's message on a wrong option, or report a mistake in acx4."""
    show: Callable[..., None] | None = getattr(error, "show", None)
    if show is not None:  # an error of the command line shows usage, and has its own status
        text = io.StringIO()
        show(file=text)
        say(*text.getvalue().splitlines())
        return int(getattr(error, "exit_code", 2))
    if isinstance(error, typer.Abort):
        return INTERRUPTED
    if os.environ.get(TRACEBACK):
        say(*"".join(traceback.format_exception(error)).splitlines())
    message = f"{type(error).__name__}: {_one_line(error)}"
    typed = shlex.join(["acx4", *arguments])
    say(
        f"this is a mistake in acx4: {message}; please report it with the command "
        f"{typed} and what it shows with {TRACEBACK}=1"
    )
    return 1


def _said_of_file(error: OSError) -> str:
    """Return the message on a file, with its name if known."""
    message = error.strerror or _one_line(error)
    if error.filename is not None:
        name = error.filename
        return f"{os.fsdecode(name) if isinstance(name, str | bytes) else name}: {message}"
    try:
        Path.cwd()
    except OSError:
        return f"the current folder is no more: {message}"
    return message


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _flushed(status: int) -> int:
    """Write the remaining output, or print the reason for a failure; return the status."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except BrokenPipeError:
        abandon(sys.stdout)
        return status or NOBODY_READS
    except OSError as error:
        abandon(sys.stdout)
        say(f"standard output: {error.strerror}")
        return status or 2
    return status
