"""Common parts of the commands: arguments, messages, progress.

Progress is shown by bars on a terminal, else by one line for each finished part.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import os
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from acx4book.typesetting.plain_text import shown
from acx4lib import system

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
    *("IPython", "PIL", "markdown_it", "matplotlib", "nbformat", "papermill", "traitlets", "yaml"),
    "jinja2",
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
        abandon(sys.stderr)


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
        abandon(sys.stdout)
        sys.exit(NOBODY_READS)
    except OSError as error:
        abandon(sys.stdout)
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


def abandon(stream: IO[str]) -> None:
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
