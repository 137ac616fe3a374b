"""A flight from its pictures to its camera: nothing but pixels, trajectory and control goes in."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path

from acx4lib.calibration.estimates import Parameter, parameters
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


@dataclass(frozen=True, kw_only=True, eq=False)
class Whole:
    """A flight, what was measured in its pictures, and what came of it.

    Attributes
    ----------
    simulated : SimulatedFlight
        With the truth.
    outcome : Outcome
        Of the measurement.
    block : Block
        The measured block.
    mounting : Mounting
        By the single step.
    folder : TemporaryDirectory
        With the pictures, which figures show.
    """

    simulated: SimulatedFlight
    outcome: Outcome
    block: Block
    mounting: Mounting
    folder: tempfile.TemporaryDirectory[str]

    @property
    def parameters(self) -> list[Parameter]:
        """The estimated parameters of the camera."""
        return parameters(self.mounting.calibration)

    @property
    def truth(self) -> dict[str, float]:
        """The true values of the camera, by the names of the parameters."""
        values: dict[str, float] = self.simulated.truth["cameras"]["CAM"]
        return values


def measured(seed: int) -> Whole:
    """Fly, photograph, measure and calibrate.

    The image points that the simulator wrote are thrown away before the pictures are measured.

    Parameters
    ----------
    seed : int
        Of the flight.
    """
    simulated = photograph(single_head(seed=seed), EXPOSURES, reduce=REDUCE)
    folder = tempfile.TemporaryDirectory()
    flight, out = Path(folder.name) / "flight", Path(folder.name) / "measured"
    writer.write(simulated, flight)
    (flight / "calibration" / "image_points.csv").unlink()
    (outcome,) = measure_flight(flight, out)
    found = read(out)
    block = found.block("calibration")
    return Whole(
        simulated=simulated,
        outcome=outcome,
        block=block,
        mounting=single_step(block, free=found.estimate_mounting),
        folder=folder,
    )
