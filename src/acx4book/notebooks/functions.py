"""The way of the functions: every stage by the function that its notebook calls, without pictures.

It needs none of the requirements of notebooks and figures.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from threadpoolctl import threadpool_limits

from acx4book.notebooks import runner
from acx4book.notebooks.runner import Step, Way
from acx4lib.flight.reader import Flight
from acx4lib.stages import heads, mounting, rig, validation
from acx4sim import designs, files


def _synthetic(flight: Flight, staging: Path) -> object:
    from acx4lib.stages import synthetic  # noqa: PLC0415 loads what works on pictures

    return synthetic.run(flight, staging)


RUNS: Mapping[str, Callable[[Flight, Path], object]] = {
    "heads": heads.run,
    "synthetic": _synthetic,
    "mounting": mounting.run,
    "rig": rig.run,
    "validation": validation.run,
}
"""Functions that compute and write the results of every stage."""


@dataclass(frozen=True)
class Functions:
    """Stages run by their functions, in this process; all read the flight that was checked."""

    def steps(
        self,
        flight: Flight,
        folder: Path,  # noqa: ARG002 of the way
        stages: Sequence[str],
        calibration: str,
    ) -> dict[str, Step]:
        """Return the step of each stage, as `runner.Way` requires."""
        validate = partial(validation.run, calibration_path=calibration)
        runs: dict[str, Callable[[Flight, Path], object]] = {**RUNS, "validation": validate}
        return {stage: partial(_compute, runs[stage], flight) for stage in stages}


def _compute(
    run: Callable[[Flight, Path], object],
    flight: Flight,
    staging: Path,
    tell: Callable[[int, int], None],
) -> None:
    """Run a stage with linear algebra on one thread, as in a notebook, so that bytes are equal."""
    tell(0, 1)
    with threadpool_limits(1, user_api="blas"):
        run(flight, staging)
    tell(1, 1)


# --- Inputs of a notebook that runs by itself, in an empty folder: its flight, and earlier
# stages


PICTURES, REDUCE = ("H1-05", "H3-04", "C2-05"), 4
"""Exposures of the book's flight with pictures, and the factor of reduction of these."""


def flight_of(design: str) -> str:
    """Return the name of the folder of a flight that a notebook simulates for itself."""
    return f"flight-{design}"


def prepare(
    flight_path: str | Path,
    results_path: str | Path,
    *,
    design: str = "acx4",
    stages: Sequence[str] = (),
) -> None:
    """Simulate the flight of the book where it is missing, and run the earlier stages.

    An existing flight and results of an earlier run stay as they are. The earlier
    stages are those of the given flight; only the book's flight is simulated.

    Parameters
    ----------
    flight_path : path
        Folder of the flight; `flight_of` returns the name of the book's.
    results_path : path
        Folder of the results.
    design : str
        One of `acx4sim.DESIGNS`; the flight of the book has pictures, others have none.
    stages : sequence of str
        Stages whose results the notebook needs, of `acx4lib.results.folder.STAGES`.

    Raises
    ------
    FlightError, OutputError, AdjustmentError
        As `runner.run`.
    """
    if not Path(flight_path).exists() and Path(flight_path).name == flight_of(design):
        flown = designs.DESIGNS[design]()
        pictured = files.photograph(flown, PICTURES, reduce=REDUCE) if design == "acx4" else flown
        files.write(pictured, flight_path)
    if stages and not Path(results_path).exists():
        runner.run(flight_path, results_path, way=Functions(), stages=stages)


def way_of(notebooks: Path | None) -> Way:
    """Return the way of the notebooks in a folder, or that of the functions for None.

    Raises
    ------
    ImportError
        The extra ``book`` is not installed, which notebooks need.
    """
    if notebooks is None:
        return Functions()
    from acx4book.notebooks.execute import Notebooks  # noqa: PLC0415 needs the extra book

    return Notebooks(path=notebooks)
