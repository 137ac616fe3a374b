"""``acx4 run`` of many flights: what is to be run, where, and the table on the screen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from acx4book.command import terminal

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from acx4book.command.runs import Job, Outcome, Settings

HEADER = ("flight", "σ0²", "f_mm", "σ", "RMS east", "north", "height m", "status")
"""Of the table on the screen."""

_SHOWN = (
    ("sigma0_squared", ".3f"),
    ("f_mm", ".4f"),
    ("sigma_f_mm", ".4f"),
    ("rms_east_m", ".3f"),
    ("rms_north_m", ".3f"),
    ("rms_height_m", ".3f"),
)


@dataclass(frozen=True, kw_only=True)
class Where:
    """Where flights are run, images rendered, or pairs of pictures matched.

    Attributes
    ----------
    jobs : int
        Number of processes of this computer.
    cluster : str or None
        Address of a Dask scheduler; its workers are used instead.
    """

    jobs: int = 1
    cluster: str | None = None

    def executor(self) -> AbstractContextManager[Executor]:
        """Return what runs them, as a context."""
        from acx4book.command import processes  # noqa: PLC0415 quick help

        if self.cluster is not None:
            return processes.on_cluster(self.cluster)
        return processes.on_processes(self.jobs)

    def maybe_executor(self) -> AbstractContextManager[Executor | None]:
        """Return the same; None in it where this process is enough."""
        return nullcontext() if self._is_here else self.executor()

    @property
    def threads(self) -> int | None:
        """Number of threads of each call; None for all that there are."""
        from acx4lib.least_squares.processors import cores  # noqa: PLC0415 quick help

        if self._is_here:
            return None
        return 1 if self.cluster is not None else max(cores() // self.jobs, 1)

    @property
    def _is_here(self) -> bool:
        return self.jobs == 1 and self.cluster is None


def run_many(
    flights: Sequence[Path], results: Path, *, seeds: str | None, where: Where, settings: Settings
) -> None:
    """Run many flights, or many seeds of designs and plans, and show a line for each."""
    from acx4book.command import runs  # noqa: PLC0415 quick help
    from acx4book.command.runs import TABLE  # noqa: PLC0415 quick help

    jobs = _jobs(flights, results, seeds, settings)
    with where.executor() as executor, terminal.counting_bar("flights") as tell:
        outcomes = runs.run_all(jobs, results, executor, tell)
    for line in table_of(outcomes):
        terminal.show(line)
    failed = {name: one for name, one in outcomes.items() if one.status}
    there = sum(one.kept for one in outcomes.values())
    terminal.show(
        f"{len(outcomes)} flights: {there} there already, {len(failed)} failed; {results / TABLE}"
    )
    terminal.say(*(f"{name}: {one.reason}" for name, one in failed.items()))
    if failed:
        raise typer.Exit(max(one.status for one in failed.values()))


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
    """Return the name of a design, or the path of a plan from the root; refuse all others."""
    from acx4book.command import runs  # noqa: PLC0415 quick help
    from acx4book.notebooks import simulated  # noqa: PLC0415 quick help

    name = str(flight)
    simulated.check(name)
    return str(runs.absolute(flight)) if simulated.is_plan(name) else name


def table_of(outcomes: Mapping[str, Outcome]) -> list[str]:
    """Return the table for the screen, a line for each flight under a header."""
    return terminal.aligned([HEADER, *(_shown(name, one) for name, one in outcomes.items())])


def _shown(name: str, outcome: Outcome) -> tuple[str, ...]:
    numbers = (
        format(float(outcome.row[key]), form) if outcome.row.get(key) else "-"
        for key, form in _SHOWN
    )
    return (name, *numbers, str(outcome.status))
