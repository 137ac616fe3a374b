"""Common parts of the commands: arguments, messages, progress, and how they end.

Progress is shown by bars on a terminal, else by one line for each finished part. A command ends
with its result, or with a sentence and a status, never with a traceback. Expected errors have their
sentences where they are raised; any other error gets one line here.
"""

from __future__ import annotations

import _thread
import contextlib
import importlib.util
import io
import os
import shlex
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from acx4book.command.start import INTERRUPTED, SAYS, stop
from acx4book.typesetting.plain_text import shown
from acx4lib import system
from acx4lib.errors import Acx4Error, FlightError, OutputError, unsolvable

if TYPE_CHECKING:
    from acx4book.notebooks.runner import Tell


def option(metavar: str, said: str, *names: str, **more: Any) -> Any:
    """Return an option of a command whose default is not shown.

    Parameters
    ----------
    metavar, said : str
        Placeholder for its value, and its line of help.
    *names : str
        Names of the option, if they differ from the parameter's.
    **more
        Other arguments of ``typer.Option``.
    """
    return typer.Option(*names, metavar=metavar, show_default=False, help=said, **more)


def argument(metavar: str, said: str | None = None) -> Any:
    """Return an argument of a command."""
    return typer.Argument(metavar=metavar, show_default=False, help=said)


Flight = Annotated[Path, argument("FLIGHT", "Folder with flight.toml.")]
"""The first argument of most commands."""


BOOK = (
    *("IPython", "PIL", "ipykernel", "jinja2", "matplotlib", "nbformat"),
    *("papermill", "traitlets", "yaml"),
)
"""Modules of the extra ``book``."""

NOBODY_READS = 128 + system.SIGPIPE
"""Exit status, without a message, of a command with output that nobody reads to its end."""


def say(*lines: str) -> None:
    """Print lines on standard error, if it is open."""
    try:
        for line in lines:
            sys.stderr.write(f"{shown(line, 'terminal')}\n")
        sys.stderr.flush()
    except OSError:  # its reader is gone
        _abandon(sys.stderr)


def say_if_not_kept() -> None:
    """Warn if compiled code cannot be kept: then the next run takes as long as this one."""
    try:
        from acx4lib import compiling  # noqa: PLC0415 quick help
    except ImportError:  # nothing is compiled
        return
    if compiling.NOT_KEPT:
        say(compiling.NOT_KEPT)


def show(text: object) -> None:
    """Print on standard output, line by line; end the command if nobody reads it."""
    try:
        for line in str(text).split("\n"):
            sys.stdout.write(f"{shown(line, 'terminal')}\n")
        sys.stdout.flush()
    except BrokenPipeError:
        _abandon(sys.stdout)
        sys.exit(NOBODY_READS)
    except OSError as error:
        _abandon(sys.stdout)
        raise OSError(error.errno, error.strerror, "standard output") from None


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the lines of a table: its first column to the left, the others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.rjust(width) if k else cell.ljust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def _abandon(stream: IO[str]) -> None:
    """Discard the remaining output of a stream, so that Python ends without an error."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


def prepare_streams() -> None:
    """Make standard streams accept any text, and replace closed streams by the null device.

    Otherwise a file that is opened later could become the standard output of a library.
    """
    while (free := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(free)
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))  # noqa: SIM115 stays open
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def refuse(message: str) -> NoReturn:
    """End the command because of a wrong argument."""
    say(message)
    raise typer.Exit(2)


def need_book(command: str) -> None:
    """End a command for notebooks or pages if the extra ``book`` is not installed."""
    missing = [name for name in BOOK if importlib.util.find_spec(name) is None]
    if missing:
        needs = f"acx4 {command} needs {', '.join(missing)}"
        refuse(f"{needs}, not installed here: pip install 'acx4lib[book]'")


@contextlib.contextmanager
def counting_bar(what: str) -> Iterator[Tell]:
    """Show one bar with the time left for all images or flights; without a terminal, a line each.

    Parameters
    ----------
    what : str
        Name of the counted things, in the plural.
    """
    if not sys.stdout.isatty():
        yield lambda name, done, total: show(f"{name}: done") if 0 < total == done else None
        return
    from rich import progress  # noqa: PLC0415 quick help

    columns = (
        progress.TextColumn("{task.description}", markup=False),
        progress.BarColumn(),
        progress.TaskProgressColumn(),
        progress.TimeRemainingColumn(),
    )
    with progress.Progress(*columns) as bar:
        task = bar.add_task("reading", total=None)
        rows: dict[str, tuple[int, int]] = {}

        def tell(name: str, done: int, total: int) -> None:
            rows[name] = done, total
            done_rows, all_rows = (sum(column) for column in zip(*rows.values(), strict=True))
            finished = sum(done == total for done, total in rows.values())
            says = f"{finished} of {len(rows)} {what}"
            bar.update(task, description=says, completed=done_rows, total=all_rows)

        yield tell


@contextlib.contextmanager
def stage_bars(unit: str = "cells") -> Iterator[Tell]:
    """Show one bar per stage; without a terminal, one line."""
    if not sys.stdout.isatty():
        yield lambda stage, done, total: show(f"{stage}: done") if done == total else None
        return
    from rich import progress  # noqa: PLC0415 quick help

    columns = (
        progress.TextColumn("{task.description:<10}", markup=False),
        progress.BarColumn(),
        progress.MofNCompleteColumn(),
        progress.TextColumn(unit, markup=False),
        progress.TimeElapsedColumn(),
    )
    with progress.Progress(*columns) as bars:
        tasks: dict[str, progress.TaskID] = {}

        def tell(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(shown(stage, "terminal"), total=total)
            bars.update(tasks[stage], completed=done)

        yield tell


# --- the end of a command --------------------------------------------------------------------


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
        _abandon(sys.stdout)
        return status or NOBODY_READS
    except OSError as error:
        _abandon(sys.stdout)
        say(f"standard output: {error.strerror}")
        return status or 2
    return status
