"""What a notebook needs that runs by itself, in an empty folder: its flight, and earlier stages."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from acx4book.notebooks import runner
from acx4book.notebooks.functions import Functions
from acx4sim import designs
from acx4sim.files import flights, writer

PICTURES, REDUCE = ("H1-05", "H3-04", "C2-05"), 4
"""The exposures of the book's flight that have pictures, and at what part of the size."""


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
    """Simulate the flight of the book where there is none, and run the stages that come before.

    What is there already stays as it is: a flight of one's own, and results of an earlier run. The
    stages before are those of the flight that is given, and only the book's flight is simulated.

    Parameters
    ----------
    flight_path : path
        Folder of the flight; that of the book is called as `flight_of` says.
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
        pictured = flights.photograph(flown, PICTURES, reduce=REDUCE) if design == "acx4" else flown
        writer.write(pictured, flight_path)
    if stages and not Path(results_path).exists():
        runner.run(flight_path, results_path, way=Functions(), stages=stages)
