"""Common parts of the commands: arguments, messages, progress, and how they end.

Progress is shown by bars on a terminal, else by one line for each finished part. A command ends
with its result, or with a sentence and a status, never with a traceback. Expected errors have their
sentences where they are raised; any other error gets one line here.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import os
import shlex
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from acx4book.typesetting.plain_text import shown
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
    *("IPython", "ipykernel", "jinja2", "matplotlib", "nbformat"),
    *("papermill", "traitlets", "yaml"),
)
"""Modules of the extra ``book``."""

NOBODY_READS = 128 + 13  # SIGPIPE
"""Exit status, without a message, of a command with output that nobody reads to its end."""

INTERRUPTED, TERMINATED = 128 + signal.SIGINT, 128 + signal.SIGTERM
ENDED: dict[object, str] = {INTERRUPTED: "interrupted", TERMINATED: "terminated"}
"""Exit statuses of a command that was stopped from outside, and what is said."""

TRACEBACK = "ACX4_TRACEBACK"
"""Environment variable that makes an unexpected error show its traceback."""


def say(*lines: str) -> None:
    """Print lines on standard error."""
    with contextlib.suppress(BrokenPipeError):
        for line in lines:
            sys.stderr.write(f"{shown(line, 'terminal')}\n")


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
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # Python flushes it at last
        if isinstance(error, BrokenPipeError):
            sys.exit(NOBODY_READS)
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


def prepare_streams() -> None:
    """Make standard streams accept any text."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
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


def status_of(command: Callable[[], object], arguments: Sequence[str]) -> int:
    """Run a command, print the reason if it fails, and return its exit status.

    Parameters
    ----------
    command : callable
        It returns its exit status, or None for zero.
    arguments : sequence of str
        Arguments of the command line, for a message on an unexpected error.
    """
    try:
        status = command()
        sys.stdout.flush()
    except SystemExit as end:
        status = end.code
    except KeyboardInterrupt:
        status = INTERRUPTED
    except Exception as error:  # the last resort: for any error a user gets a sentence
        lines, status = said_of(error, arguments)
        say(*lines)
    if status in ENDED:
        say(ENDED[status])
    return status if isinstance(status, int) else int(status is not None)


FORESEEN = (
    (MemoryError, "not enough memory for this input"),
    (RecursionError, "not enough stack for this input"),
    (ImportError, "the installation is not complete"),
)
"""Errors that any command may meet."""


def said_of(error: Exception, arguments: Sequence[str]) -> tuple[list[str], int]:
    """Return what is said of an error, and the status."""
    said = " ".join(str(error).split())
    if type(error).__name__ == "LinAlgError":  # of numpy, which most commands need not load
        error = unsolvable(said)
    if isinstance(error, Acx4Error):
        lines = [*getattr(error, "__notes__", ()), *str(error).splitlines()]
        return lines, 2 if isinstance(error, FlightError | OutputError) else 1
    if isinstance(error, OSError):
        name = error.filename
        place = os.fsdecode(name) + ": " if isinstance(name, str | bytes | os.PathLike) else ""
        return [f"{place}{error.strerror or said}"], 2
    if isinstance(error, typer.Abort) or hasattr(error, "format_message"):
        return _of_command_line(error)
    for kind, says in FORESEEN:
        if isinstance(error, kind):
            return [f"{says} ({said})"], 1
    shown_by = [] if not os.environ.get(TRACEBACK) else traceback.format_exception(error)
    typed = shlex.join(["acx4", *arguments])
    last = (
        f"this is a mistake in acx4: {type(error).__name__}: {said}; please report it with the "
        f"command {typed} and what it shows with {TRACEBACK}=1"
    )
    return [*"".join(shown_by).splitlines(), last], 1


def _of_command_line(error: Any) -> tuple[list[str], int]:
    """Return what is said of a wrong option or argument: a line; without any, the help."""
    if isinstance(error, typer.Abort):
        return [], INTERRUPTED
    message = error.format_message()
    if type(error).__name__ == "NoArgsIsHelpError":
        return message.splitlines(), error.exit_code
    context = getattr(error, "ctx", None)
    path = context.command_path if context else "acx4"
    return [f"{' '.join(message.split()).rstrip('.')}; see {path} --help"], error.exit_code
