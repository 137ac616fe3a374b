"""A flight of which nothing is measured yet: its pictures, its trajectory, its control points."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from acx4lib import shown
from acx4lib.calibration.estimates import parameters
from acx4lib.calibration.mounting import Mounting, single_step
from acx4lib.flight.block import Block
from acx4lib.flight.reader import read
from acx4lib.measuring.measure import Outcome, measure_flight
from acx4sim.designs import single_head
from acx4sim.files import writer
from acx4sim.files.flights import SimulatedFlight, photograph

EXPOSURES = ("C1-03", "C1-05", "C2-04", "C2-06", "C3-04", "C4-03", "C4-05", "C5-05")
"""Three strips at the lower height, one of them in the other direction, and two across at the
higher one."""

REDUCE = 7
"""Pictures have 1/7 of the size, so that the page is computed in half a minute."""

STORED = Path(str(resources.files("acx4book.chapters.beyond.from_pictures") / "stored"))
"""Folder of the measured flights that the project brings; ``make coverage`` measures them."""


@shown.briefly
@dataclass(frozen=True, kw_only=True, eq=False)
class Whole:
    """A flight, and what was measured in its pictures.

    Attributes
    ----------
    simulated : SimulatedFlight
        With the truth.
    outcome : Outcome
        Of the measurement.
    block : Block
        The measured block.
    folder : TemporaryDirectory
        With the pictures, which figures show.
    """

    simulated: SimulatedFlight
    outcome: Outcome
    block: Block
    folder: tempfile.TemporaryDirectory[str]

    def truth(self, mounting: Mounting) -> list[float]:
        """Return the true values of the estimated parameters, in their order."""
        values: dict[str, float] = self.simulated.truth["cameras"]["CAM"]
        return [values[one.name] for one in parameters(mounting.calibration)]


def written(simulated: SimulatedFlight) -> tempfile.TemporaryDirectory[str]:
    """Write a flight without its image points into ``flight`` in a new folder.

    Parameters
    ----------
    simulated : SimulatedFlight
        With pictures of its block ``calibration``.

    Returns
    -------
    TemporaryDirectory
        Removed when the value is.
    """
    folder = tempfile.TemporaryDirectory()
    flight = Path(folder.name) / "flight"
    writer.write(simulated, flight)
    (flight / "calibration" / "image_points.csv").unlink()
    return folder


def measured(seed: int) -> tuple[Whole, Mounting]:
    """Fly, photograph, measure and calibrate, as the notebook does.

    Parameters
    ----------
    seed : int
        Of the flight.
    """
    simulated = photograph(single_head(seed=seed), EXPOSURES, reduce=REDUCE)
    folder = written(simulated)
    (outcome,) = measure_flight(f"{folder.name}/flight", f"{folder.name}/measured")
    flight = read(f"{folder.name}/measured")
    block = flight.block("calibration")
    found = Whole(simulated=simulated, outcome=outcome, block=block, folder=folder)
    return found, single_step(block, free=flight.estimate_mounting)
