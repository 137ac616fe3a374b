"""The command ``acx4``: arguments, progress and exit statuses.

Bad input ends with status 2, an adjustment or a notebook that fails with status 1; both say so
in one line per problem on standard error.
"""

from __future__ import annotations

import gc
import logging
import os
import signal
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup

from acx4book.command import importing, pictures, planning, results, run, teaching, terminal
from acx4book.command.gone import instead
from acx4book.command.terminal import TERMINATED, status_of

# Commands import the computing modules inside their functions, so that `acx4 --help` is quick.

ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
"""Linear algebra on one thread: with more, sums in another order differ in the last bits, and
matrices this small take longer."""

GARBAGE = 100_000
"""Objects made between two garbage collections. With Python's default of 700, collections without
effect while libraries are loaded take a tenth of the time of a small flight."""

GRAMMAR = "rfc3987_syntax"
"""Grammar of international addresses, unused by notebooks: nbformat's validator would build its
parser at every start, which takes longer than all other imports of a run."""

ORDER = ("new", "import", "check", "measure", "run", "report", "book", "export", "render")
"""Commands on a flight in the order of their use; others follow."""


class _InOrder(TyperGroup):
    """The commands in the order of their use."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Return the names of the commands."""
        return [*ORDER, *(name for name in super().list_commands(ctx) if name not in ORDER)]


app = typer.Typer(
    cls=_InOrder,
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command and exit.

    Parameters
    ----------
    arguments : sequence of str, optional
        Replaces the arguments of the command line.
    """
    sys.modules.setdefault(GRAMMAR, None)  # type: ignore[arg-type] # as if it were not installed
    os.environ |= ONE_THREAD
    gc.set_threshold(GARBAGE)
    terminal.prepare_streams()
    for library in ("papermill", "matplotlib"):  # their remarks are on their own affairs
        logging.getLogger(library).addHandler(logging.NullHandler())
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(TERMINATED))  # so that a run cleans up
    given = sys.argv[1:] if arguments is None else [*arguments]
    if answer := instead(given):
        terminal.say(answer)
        sys.exit(2)
    command = partial(_parser(), given, prog_name="acx4", standalone_mode=False)
    sys.exit(status_of(command, given))


@cache
def _parser() -> Callable[..., object]:
    """Return the parser of all commands; built once, since this takes a while."""
    return typer.main.get_command(app)


def _show_version(wanted: bool) -> None:
    if not wanted:
        return
    import importlib.metadata  # noqa: PLC0415 quick help

    try:
        terminal.show(importlib.metadata.version("acx4lib"))
    except importlib.metadata.PackageNotFoundError:
        terminal.show("unknown: run from its sources, not installed")
    raise typer.Exit


@app.callback(
    help="""In-flight calibration of aerial cameras: interior orientation, boresight, lever arm.

\b
A first run, on a flight that was never flown:
  acx4 simulate single-head --out my_flight
  acx4 check my_flight
  acx4 run my_flight --results my_results
"""
)
def _acx4(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version."),
    ] = False,
) -> None:
    """Take the options that belong to no command."""


@app.command(
    help="""Read and cross-check a flight, and print a summary.

Every problem is one line on standard error, with its file, line and column; the status is then 2.
Where another reading of the numbers fits much better, a sign, an order or a unit, a note names it.

\b
Example:
  acx4 check my_flight
"""
)
def check(flight: terminal.Flight) -> None:
    """Read a flight and print a summary."""
    from acx4files.conventions import notes  # noqa: PLC0415 quick help
    from acx4files.flight.reader import read  # noqa: PLC0415 quick help
    from acx4files.flight.summary import summary  # noqa: PLC0415 quick help
    from acx4lib.errors import FlightError  # noqa: PLC0415 quick help

    flown = read(flight)
    files = [path for paths in flown.image_files.values() for path in paths if path is not None]
    if files:
        from acx4files.images.head_images import is_cut_off  # noqa: PLC0415 slow to import

        files = [path for path in files if is_cut_off(path)]
    if files:
        says = "is cut off, its pixels have no end; copy it again"
        raise FlightError([f"{path}: {says}" for path in files])
    terminal.show(summary(replace(flown, notes=(*flown.notes, *notes(flown)))))


app.command(help=run.HELP)(run.run)


app.command(help=planning.PLAN_HELP)(planning.plan)
app.command(help=planning.SIMULATE_HELP)(planning.simulate)


@app.command(
    help="""Write the calibration report of a run.

It is one page of HTML, with --pdf a PDF/A as well, made from the results folder alone, and begins
as a certificate, with what the table [certificate] of flight.toml states. A file .json beside it
has the same values for machines.

\b
Examples:
  acx4 report my_results
  acx4 report my_results --out my_report.html --pdf
"""
)
def report(
    results: Annotated[Path, terminal.argument("RESULTS", "Folder of a run.")],
    out: Annotated[
        Path | None, terminal.option("FILE.html", "The file; else report.html in RESULTS.")
    ] = None,
    pdf: Annotated[bool, typer.Option("--pdf", help="Write it as PDF/A, too.")] = False,
) -> None:
    """Write the calibration report of a run."""
    terminal.need_book("report")
    from acx4book.report import page  # noqa: PLC0415 quick help
    from acx4files.results import folder  # noqa: PLC0415 quick help

    path = out or folder.of_run(results) / "report.html"
    page.write(results, path, pdf=pdf)
    terminal.show(path)
    if pdf:
        terminal.show(path.with_suffix(".pdf"))


app.command(help=results.BOOK_HELP)(results.book)
app.add_typer(importing.app, name="import")
app.command(help=planning.NEW_HELP)(planning.new)
app.command(help=results.EXPORT_HELP)(results.export)
app.command(help=pictures.MEASURE_HELP)(pictures.measure)
app.command(help=pictures.RENDER_HELP)(pictures.render)
app.command(help=teaching.LAB_HELP)(teaching.lab)
app.command(help=teaching.GRADE_HELP)(teaching.grade)
