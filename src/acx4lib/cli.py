"""The command ``acx4``: arguments, progress and exit statuses.

Bad input ends with status 2, an adjustment or a notebook that fails with status 1; both say so
in one line per problem on standard error.
"""

from __future__ import annotations

import contextlib
import importlib.metadata
import logging
import signal
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from acx4lib.errors import Acx4Error, FlightError

if TYPE_CHECKING:
    from acx4lib.runner import Tell

# What computes is imported by the commands themselves, so that `acx4 --help` is quick.

TERMINATED = 128 + signal.SIGTERM
ENDED = {128 + signal.SIGINT: "interrupted", TERMINATED: "terminated"}
"""Exit statuses of a command that was stopped from outside, and what is said of it."""

app = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

Flight = Annotated[
    Path, typer.Argument(metavar="FLIGHT", show_default=False, help="Folder with flight.toml.")
]


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command and exit.

    Parameters
    ----------
    arguments : sequence of str, optional
        In the place of the command line's.
    """
    logging.getLogger("papermill").addHandler(logging.NullHandler())
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(TERMINATED))  # so that a run tidies up
    try:
        app(arguments, prog_name="acx4")
    except Acx4Error as error:
        _say(*getattr(error, "__notes__", ()), *str(error).splitlines())
        sys.exit(2 if isinstance(error, FlightError) else 1)
    except OSError as error:
        where = f"{error.filename}: " if error.filename is not None else ""
        _say(f"{where}{error.strerror or error}")
        sys.exit(2)
    except SystemExit as end:
        if end.code in ENDED:
            _say(ENDED[end.code])
        raise
    sys.exit(0)


def _say(*lines: str) -> None:
    """Print on standard error, one line each."""
    for line in lines:
        typer.echo(line, err=True)


def _refuse(message: str) -> NoReturn:
    """End the command because of a wrong argument."""
    _say(message)
    raise typer.Exit(2)


def _show_version(wanted: bool) -> None:
    if not wanted:
        return
    try:
        typer.echo(importlib.metadata.version("acx4lib"))
    except importlib.metadata.PackageNotFoundError:
        typer.echo("unknown: run from its sources, not installed")
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

\b
Example:
  acx4 check my_flight
"""
)
def check(flight: Flight) -> None:
    """Read a flight and print a summary."""
    from acx4lib import flight as flights  # noqa: PLC0415 quick help

    typer.echo(flights.summary(flights.read(flight)))


@app.command(
    help="""Run the stages on a flight and keep their results.

The folder gets the tables and the executed notebooks. A stage whose block is not in the flight
is skipped. A stage that is run alone takes what it needs from the results that are there, and
replaces only its own. The status is 1 where a stage does not
converge or is not determined by its data.

\b
Examples:
  acx4 run my_flight --results my_results
  acx4 run my_flight --results my_results --stages mounting,validation
"""
)
def run(
    flight: Flight,
    results: Annotated[
        Path, typer.Option(metavar="DIR", show_default=False, help="Folder for the results.")
    ],
    stages: Annotated[
        str, typer.Option(metavar="A,B", help="Stages to run, in the order of the paper.")
    ] = "heads,synthetic,mounting,validation",
    notebooks: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Your own versions of the notebooks, names as ours."),
    ] = None,
) -> None:
    """Run the stages of a flight."""
    from acx4lib import runner  # noqa: PLC0415 quick help
    from acx4lib.results import STAGES  # noqa: PLC0415 quick help

    chosen = [stage.strip() for stage in stages.split(",")]
    for stage in chosen:
        if stage not in STAGES:
            _refuse(f"unknown stage {stage!r}; known: {', '.join(STAGES)}")
    with _progress() as tell:
        report = runner.run(
            flight,
            results,
            stages=chosen,
            notebooks_path=notebooks or runner.NOTEBOOKS_PATH,
            tell=tell,
        )
    for line in [*report.skipped, *report.left_out, *report.notes]:
        typer.echo(line)
    typer.echo(f"results in {results}")
    if report.not_determined:
        _say(*report.not_determined)
        raise typer.Exit(1)


@app.command(
    help="""Write a simulated flight.

Its truth is in FLIGHT.truth.json beside it.

\b
NAME is one of
  acx4         the paper's: four heads, a synthetic camera, three blocks
  single-head  one ordinary camera, turned on its mount

\b
Examples:
  acx4 simulate single-head --out my_flight --seed 3
  acx4 simulate acx4 --out my_flight --slow-errors --gross-errors
"""
)
def simulate(
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
) -> None:
    """Write a simulated flight."""
    from acx4lib import simulate as simulator  # noqa: PLC0415 quick help

    if name not in simulator.DESIGNS:
        _refuse(f"unknown flight {name!r}; known: {', '.join(simulator.DESIGNS)}")
    if out.exists():
        _refuse(f"{out}: exists already; choose another name")
    options = simulator.Options(
        slow_errors=simulator.SlowErrors() if slow_errors else None,
        gross_errors=simulator.GrossErrors() if gross_errors else None,
        refraction="standard" if refraction else "none",
    )
    simulator.write(simulator.DESIGNS[name](seed=seed, options=options), out)
    typer.echo(f"{out}; its truth in {simulator.truth_path(out)}")


@app.command(
    help="""Write the calibration report of a run: one HTML file that can be printed.

It is made from the results folder alone.

\b
Example:
  acx4 report my_results --out my_report.html
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
) -> None:
    """Write the calibration report of a run."""
    from acx4lib import calibration_report  # noqa: PLC0415 quick help

    path = out or results / "report.html"
    with _progress() as tell:
        calibration_report.write(results, path, on_cell=lambda *cells: tell("report", *cells))
    typer.echo(path)


@contextlib.contextmanager
def _progress() -> Iterator[Tell]:
    """Show one bar per stage, or one line per stage where nobody looks on."""
    if not sys.stdout.isatty():
        yield lambda stage, done, total: typer.echo(f"{stage}: done") if done == total else None
        return
    from rich import progress  # noqa: PLC0415 quick help

    columns = (
        progress.TextColumn("{task.description:<10}"),
        progress.BarColumn(),
        progress.MofNCompleteColumn(),
        progress.TextColumn("cells"),
        progress.TimeElapsedColumn(),
    )
    with progress.Progress(*columns) as bars:
        tasks: dict[str, progress.TaskID] = {}

        def tell(stage: str, done: int, total: int) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(stage, total=total)
            bars.update(tasks[stage], completed=done)

        yield tell
