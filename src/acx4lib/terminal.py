"""What commands share: arguments, what they say, and how far they are.

Bars on a terminal, a line for what is done where nobody looks on.
"""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from acx4lib.plain_text import shown

if TYPE_CHECKING:
    from acx4lib.runner import Tell


Flight = Annotated[
    Path, typer.Argument(metavar="FLIGHT", show_default=False, help="Folder with flight.toml.")
]
"""The first argument of most commands."""


def say(*lines: str) -> None:
    """Print on standard error, one line each."""
    for line in lines:
        typer.echo(shown(line, "terminal"), err=True)


def echo(text: object) -> None:
    """Print on standard output; names in the lines of a text are shown, not obeyed."""
    for line in str(text).split("\n"):
        typer.echo(shown(line, "terminal"))


def refuse(message: str) -> NoReturn:
    """End the command because of a wrong argument."""
    say(message)
    raise typer.Exit(2)


@contextlib.contextmanager
def image_bar() -> Iterator[Tell]:
    """Show one bar over all images with the time left, or a line for each as it is done."""
    if not sys.stdout.isatty():
        yield lambda name, done, total: echo(f"{name}: done") if 0 < total == done else None
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
            says = f"{finished} of {len(rows)} images"
            bar.update(task, description=says, completed=done_rows, total=all_rows)

        yield tell


@contextlib.contextmanager
def stage_bars(unit: str = "cells") -> Iterator[Tell]:
    """Show one bar per stage, or one line per stage where nobody looks on."""
    if not sys.stdout.isatty():
        yield lambda stage, done, total: echo(f"{stage}: done") if done == total else None
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
                tasks[stage] = bars.add_task(stage, total=total)
            bars.update(tasks[stage], completed=done)

        yield tell
