"""A simulated flight in one call: as it is read from its files, with what is true of it."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from acx4lib.flight import reader
from acx4lib.flight.block import Block
from acx4lib.flight.reader import Flight
from acx4sim.designs import DESIGNS
from acx4sim.files import writer
from acx4sim.files.flights import SimulatedFlight
from acx4sim.plan import Options

STANDARD = Options()

EXACT = Options(image_noise=0.0, control_noise=0.0, gnss_noise=0.0, attitude_noise=0.0)
"""A flight whose measurements have no noise; their standard deviations are those of others."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Flown:
    """A simulated flight.

    Attributes
    ----------
    flight : Flight
        As its files say.
    truth : mapping of str to float
        True values of the camera of its calibration block, by the names of results.
    """

    flight: Flight
    truth: Mapping[str, float]

    @property
    def block(self) -> Block:
        """Its calibration block."""
        return self.flight.block("calibration")

    def __repr__(self) -> str:
        return f"simulated flight {self.flight.name!r}"


def fly(
    design: str,
    seed: int,
    options: Options = STANDARD,
    *,
    blocks: Sequence[str] = ("calibration",),
) -> Flown:
    """Fly a design of the simulator.

    Parameters
    ----------
    design : str
        Of `acx4sim.DESIGNS`.
    seed : int
    options : Options
        Whose blocks are replaced.
    blocks : sequence of str
        Those that are flown.
    """
    simulated = DESIGNS[design](seed=seed, options=replace(options, blocks=tuple(blocks)))
    flight = read(simulated)
    camera = flight.block(blocks[0]).cameras[0].name
    return Flown(flight=flight, truth=simulated.truth["cameras"][camera])


def read(simulated: SimulatedFlight) -> Flight:
    """Return a simulated flight as its files say.

    Parameters
    ----------
    simulated : SimulatedFlight

    Raises
    ------
    FlightError
        Where its tables were changed so that it is refused.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "flight"
        writer.write(simulated, path)
        return reader.read(path)
