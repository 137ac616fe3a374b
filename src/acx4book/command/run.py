"""The command ``acx4 run``, of one flight or of many."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from acx4book.command import terminal
from acx4lib.errors import AdjustmentError

if TYPE_CHECKING:
    from acx4book.command.runs import Job, Outcome, Settings

HELP = """Run the stages on a flight and keep their results.

The folder gets the tables and the executed notebooks. A stage whose block is not in the flight
is skipped. A stage that is run alone takes what it needs from the results that are there, and
replaces only its own. The status is 1 where a stage does not
converge or is not determined by its data.

Results of another flight are never used in silence: a stage that is run alone on them ends with
status 2. With --calibration, FLIGHT is validated with the calibration of an earlier flight,
RESULTS, and this stands in the results and the report.

With --numbers-only the tables are the same, without notebooks: much sooner, and without the
requirements of acx4lib[book].

With --seeds, each FLIGHT is a design of acx4 simulate, or the file of a plan, and is flown by these
seeds. Of many flights, or with --seeds, --jobs or --cluster, DIR gets a folder for each, and
flights.csv with a row for each; no notebooks, unless --with-notebooks. A flight that fails stops no
other. What is there already, of the same flight, is not run again. The status is the largest.

\b
Examples:
  acx4 run my_flight --results my_results
  acx4 run my_flight --results my_results --numbers-only
  acx4 run my_flight --results my_results --stages mounting,validation
  acx4 run my_flight --results later_results --calibration earlier_results
  acx4 run flights/* --results all_results --jobs 4
  acx4 run single-head --seeds 1-200 --results monte_carlo --jobs 2
  acx4 run my_plan.toml --seeds 1-20 --results flown_20_times
  acx4 run flights/* --results all_results --cluster tcp://host:8786
"""


def run(  # noqa: PLR0913, PLR0917 every option is an argument
    flights: Annotated[
        list[Path],
        terminal.argument(
            "FLIGHT", "Folders with flight.toml; with --seeds, designs or PLAN.toml."
        ),
    ],
    results: Annotated[Path, terminal.option("DIR", "Folder for the results.")],
    stages: Annotated[
        str, typer.Option(metavar="A,B", help="Stages to run, in the order of the paper.")
    ] = "heads,synthetic,mounting,validation",
    calibration: Annotated[
        Path | None,
        terminal.option("RESULTS", "Validate with the calibration of an earlier flight."),
    ] = None,
    notebooks: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR", help="Your own versions of the notebooks, with the same names."
        ),
    ] = None,
    numbers_only: Annotated[
        bool | None,
        typer.Option(
            "--numbers-only/--with-notebooks",
            show_default=False,
            help="Tables and summary alone, the default of many flights, or notebooks too.",
        ),
    ] = None,
    seeds: Annotated[
        str | None,
        terminal.option("A-B", "Simulate each FLIGHT, a design or a plan, with these seeds."),
    ] = None,
    jobs: Annotated[
        int | None, terminal.option("N", "How many flights run at a time.", min=1)
    ] = None,
    cluster: Annotated[str | None, terminal.option("ADDRESS", "Dask scheduler to run on.")] = None,
) -> None:
    """Run the stages of a flight, or of many."""
    are_many = len(flights) > 1 or (seeds, jobs, cluster) != (None, None, None)
    if numbers_only and notebooks is not None:
        terminal.refuse("--notebooks names what --numbers-only leaves out; give one of them")
    if jobs is not None and cluster is not None:
        terminal.refuse("--jobs are of this computer, --cluster has its own; give one of them")
    if numbers_only is None:
        numbers_only = are_many and notebooks is None
    if cluster is not None and not numbers_only:
        terminal.refuse("--cluster computes the numbers only; for notebooks use --jobs")
    if not numbers_only:
        terminal.need_book("run")
    settings = _settings(stages, notebooks, calibration, numbers_only=numbers_only)
    if are_many:
        named = _jobs(flights, results, seeds, settings)
        _run_many(named, results, jobs or 1, cluster)
    else:
        _run_one(flights[0], results, settings)


def _run_one(flight: Path, results: Path, settings: Settings) -> None:
    """Run the stages of a flight, and print its notes and undetermined parameters."""
    from acx4book.notebooks import runner  # noqa: PLC0415 quick help
    from acx4lib.least_squares import processors  # noqa: PLC0415 quick help

    numbers_only = settings.notebooks is None
    if numbers_only:
        processors.keep_memory()
    with terminal.stage_bars("stages" if numbers_only else "cells") as tell:
        try:
            report = runner.run(
                flight,
                results,
                notebooks=settings.notebooks,
                stages=settings.stages,
                calibration=settings.calibration or "",
                tell=tell,
            )
        except AdjustmentError as error:
            error.args = ("; ".join([str(error), *_explained(flight)]),)
            raise
    terminal.say_if_not_kept()
    for line in [*report.skipped, *report.left_out, *report.notes]:
        terminal.show(line)
    terminal.show(f"results in {results}")
    if report.not_determined:
        terminal.say(*report.not_determined, *_explained(flight))
        raise typer.Exit(1)


def _explained(flight: Path) -> list[str]:
    """Return the reading of each block that fits it much better than the one it was run with."""
    from acx4files import conventions  # noqa: PLC0415 quick help
    from acx4files.flight import reader  # noqa: PLC0415 quick help

    read = reader.read(flight)
    found = {name: conventions.best_reading(read, name) for name in read.blocks}
    return [f"block {name}: {reading.sentence}" for name, reading in found.items() if reading]


def _settings(
    stages: str, notebooks: Path | None, calibration: Path | None, *, numbers_only: bool
) -> Settings:
    """Return the settings of a run from its options, or end the command."""
    from acx4book.command.runs import Settings, absolute  # noqa: PLC0415 quick help
    from acx4book.notebooks.runner import NOTEBOOKS_PATH  # noqa: PLC0415 quick help
    from acx4files.results.folder import STAGES  # noqa: PLC0415 quick help

    chosen = tuple(stage.strip() for stage in stages.split(","))
    for stage in chosen:
        if stage not in STAGES:
            terminal.refuse(f"unknown stage {stage!r}; known: {', '.join(STAGES)}")
    if calibration is not None:
        if chosen not in (STAGES, ("validation",)):
            terminal.refuse("--calibration is for the stage validation alone; leave --stages out")
        chosen, calibration = ("validation",), absolute(calibration)
    folder = None if numbers_only else absolute(notebooks or NOTEBOOKS_PATH)
    return Settings(stages=chosen, notebooks=folder, calibration=calibration)


# --- many flights: where they are run, and the table on the screen


HEADER = ("flight", "σ0²", "f_mm", "σ", "RMS east", "north", "height m", "status")
"""Heading of the table on the screen."""

_SHOWN = (
    ("sigma0_squared", ".3f"),
    ("f_mm", ".4f"),
    ("sigma_f_mm", ".4f"),
    ("rms_east_m", ".3f"),
    ("rms_north_m", ".3f"),
    ("rms_height_m", ".3f"),
)


def _run_many(named: Sequence[Job], results: Path, jobs: int, cluster: str | None) -> None:
    """Run many flights, and show a line for each."""
    from acx4book.command import runs  # noqa: PLC0415 quick help

    with runs.executor(jobs, cluster) as executor, terminal.counting_bar("flights") as tell:
        outcomes = runs.run_all(named, results, executor, tell)
    for line in terminal.aligned(
        [HEADER, *(_shown(name, outcome) for name, outcome in outcomes.items())]
    ):
        terminal.show(line)
    failed = {name: outcome for name, outcome in outcomes.items() if outcome.status}
    n_kept = sum(outcome.kept for outcome in outcomes.values())
    counted = f"{len(outcomes)} flights: {n_kept} there already, {len(failed)} failed"
    terminal.show(f"{counted}; {results / runs.TABLE}")
    terminal.say(*(f"{name}: {outcome.reason}" for name, outcome in failed.items()))
    if failed:
        raise typer.Exit(max(outcome.status for outcome in failed.values()))


def _jobs(
    flights: Sequence[Path], results: Path, seeds: str | None, settings: Settings
) -> list[Job]:
    from acx4book.command import runs  # noqa: PLC0415 quick help

    try:
        if seeds is None:
            return runs.of_flights(flights, results, settings)
        chosen = runs.seeds_of(seeds)
        return runs.of_seeds([_simulated(f) for f in flights], chosen, results, settings)
    except ValueError as error:
        terminal.refuse(str(error) if seeds is None else f"--seeds: {error}")


def _simulated(flight: Path) -> str:
    """Return the name of a design or the absolute path of a plan; refuse other texts."""
    from acx4book.command import runs  # noqa: PLC0415 quick help
    from acx4book.notebooks import simulated  # noqa: PLC0415 quick help

    name = str(flight)
    simulated.check(name)
    return str(runs.absolute(flight)) if simulated.is_plan(name) else name


def _shown(name: str, outcome: Outcome) -> tuple[str, ...]:
    numbers = (
        format(float(outcome.row[key]), form) if outcome.row.get(key) else "-"
        for key, form in _SHOWN
    )
    return (name, *numbers, str(outcome.status))
