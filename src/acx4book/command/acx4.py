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
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from acx4book.command import render, run, teaching, terminal
from acx4book.command.endings import TERMINATED, status_of

# The commands import the modules that compute themselves, so that `acx4 --help` is quick.

ONE_THREAD = {f"{library}_NUM_THREADS": "1" for library in ("OMP", "OPENBLAS", "MKL")}
"""Linear algebra on one thread: with more, sums in another order differ in the last bits, and
matrices this small take longer."""

GARBAGE = 100_000
"""Objects made between two searches for garbage. With Python's 700, libraries that are being
loaded, of which nothing is garbage, are searched again and again: a tenth of a small flight."""

app = typer.Typer(
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
    os.environ |= ONE_THREAD
    gc.set_threshold(GARBAGE)
    terminal.prepare_streams()
    for library in ("papermill", "matplotlib"):  # their remarks are on their own affairs
        logging.getLogger(library).addHandler(logging.NullHandler())
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(TERMINATED))  # so that a run cleans up
    given = sys.argv[1:] if arguments is None else [*arguments]
    command = partial(app, given, prog_name="acx4", standalone_mode=False)
    sys.exit(status_of(command, given))


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
    from acx4lib.conventions.search import notes  # noqa: PLC0415 quick help
    from acx4lib.flight.reader import read  # noqa: PLC0415 quick help
    from acx4lib.flight.summary import summary  # noqa: PLC0415 quick help

    found = read(flight)
    terminal.show(summary(replace(found, notes=(*found.notes, *notes(found)))))


app.command(help=run.HELP)(run.run)


@app.command(
    help="""Write a simulated flight.

Its truth is in FLIGHT.truth.json beside it. It has pixels where --images names exposures: the
pictures of all cameras that expose together, 16 bit.

\b
NAME is one of
  acx4         the paper's: four heads that measure in all three blocks
  acx4-ideal   the same with an ideal synthetic camera in the blocks 2 and 3
  single-head  one ordinary camera, turned on its mount

\b
Examples:
  acx4 simulate single-head --out my_flight --seed 3
  acx4 simulate acx4 --out my_flight --slow-errors --gross-errors
  acx4 simulate acx4 --out my_flight --images H3-04,C2-05 --reduce 4
"""
)
def simulate(  # noqa: PLR0913, PLR0917 one for every option
    name: Annotated[str, typer.Argument(metavar="NAME", show_default=False)],
    out: Annotated[
        Path,
        typer.Option(metavar="FLIGHT", show_default=False, help="New folder for the flight."),
    ],
    seed: Annotated[
        int, typer.Option(metavar="N", min=0, help="The same seed gives the same flight.")
    ] = 1,
    slow_errors: Annotated[
        bool, typer.Option("--slow-errors", help="Trajectory errors that change slowly.")
    ] = False,
    gross_errors: Annotated[
        bool, typer.Option("--gross-errors", help="Mistakes in the calibration block.")
    ] = False,
    refraction: Annotated[
        bool, typer.Option("--refraction", help="Rays bent by the standard atmosphere.")
    ] = False,
    images: Annotated[
        str, typer.Option(metavar="A,B", help="Exposures that get pictures.", show_default=False)
    ] = "",
    reduce: Annotated[
        int, typer.Option(metavar="K", min=1, help="Pictures at 1/K of the size.")
    ] = 1,
    ground: Annotated[
        Path | None,
        typer.Option(
            metavar="PHOTO",
            show_default=False,
            help="A picture to lie on the ground, a pixel every 12.5 cm; else a landscape.",
        ),
    ] = None,
) -> None:
    """Write a simulated flight."""
    from acx4lib.results.own_folder import claims, places  # noqa: PLC0415 quick help
    from acx4sim.designs import DESIGNS  # noqa: PLC0415 quick help
    from acx4sim.files.flights import photograph  # noqa: PLC0415 quick help
    from acx4sim.files.writer import TRUTH_MARK, truth_path, write  # noqa: PLC0415 quick help
    from acx4sim.plan import GrossErrors, Options, SlowErrors  # noqa: PLC0415 quick help

    if name not in DESIGNS:
        terminal.refuse(f"unknown flight {name!r}; known: {', '.join(DESIGNS)}")
    places.check_new(out)
    truth = truth_path(out)
    places.check_file(truth, mark=TRUTH_MARK, what="the truth of a simulated flight")
    options = Options(
        slow_errors=SlowErrors() if slow_errors else None,
        gross_errors=GrossErrors() if gross_errors else None,
        refraction="standard" if refraction else "none",
    )
    exposures = [exposure.strip() for exposure in images.split(",") if exposure.strip()]
    if not exposures and (reduce > 1 or ground is not None):
        terminal.refuse("--reduce and --ground are for pictures; name exposures with --images")
    flight = DESIGNS[name](seed=seed, options=options)
    if exposures:
        try:
            flight = photograph(flight, exposures, reduce=reduce, photo=ground)
        except ValueError as error:
            terminal.refuse(str(error))
    with terminal.stage_bars("rows") as tell, claims.placed(out, command="acx4 simulate") as draft:
        write(flight, draft, tell=tell)
    terminal.show(f"{out}; its truth in {truth}")


@app.command(
    help="""Write the calibration report of a run: one HTML file that can be printed.

It is made from the results folder alone. Its first page is a certificate, with what the table
[certificate] of flight.toml states. A file .json beside it has the same values for machines.

\b
Examples:
  acx4 report my_results
  acx4 report my_results --out my_report.html --pdf
"""
)
def report(
    results: Annotated[
        Path, typer.Argument(metavar="RESULTS", show_default=False, help="Folder of a run.")
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.html", show_default=False, help="The file; else report.html in RESULTS."
        ),
    ] = None,
    pdf: Annotated[bool, typer.Option("--pdf", help="Print it by Chromium, too.")] = False,
) -> None:
    """Write the calibration report of a run."""
    terminal.need_book("report")
    from acx4book.report.page import page  # noqa: PLC0415 quick help

    path = out or results / "report.html"
    if pdf:
        page.check_pdf(path)
    with terminal.stage_bars() as tell:
        page.write(results, path, on_cell=lambda *cells: tell("report", *cells))
    terminal.show(path)
    if pdf:
        terminal.show(page.write_pdf(path))


app.command(help=render.HELP)(render.render)
app.command(help=teaching.LAB_HELP)(teaching.lab)
app.command(help=teaching.GRADE_HELP)(teaching.grade)
