"""Interior orientation, boresight and lever arm of the calibration block (section 4.2, Table 3)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypedDict

from acx4lib import expected
from acx4lib.calibration import mounting, weights
from acx4lib.calibration.mounting import Mounting, Mountings
from acx4lib.flight.block import Block
from acx4lib.flight.reader import Flight
from acx4lib.results import adjustments, provenance
from acx4lib.results.carried import mounted_block
from acx4lib.stages.explained import explained, explaining, solving


class Settings(TypedDict):
    """What flight.toml says of the adjustments, as the functions of `calibration` take it."""

    free: tuple[str, ...]
    fix: tuple[str, ...]
    refraction: str
    gnss: tuple[str, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class MountingStage:
    """The calibration block, adjusted by all methods.

    Attributes
    ----------
    block : Block
        With the standard deviations that the flight asks for.
    sigma_factors : mapping of str to float
        By what the given standard deviations were multiplied, by group of observations; empty
        where they are taken as given.
    settings : Settings
    mountings : Mountings
    """

    block: Block
    sigma_factors: Mapping[str, float]
    settings: Settings
    mountings: Mountings

    @property
    def single_step(self) -> Mounting | None:
        """Outcome of the single step; None where it has none."""
        return self.mountings.methods.get("single_step")


def calibrate(flight: Flight, block: Block | None = None) -> MountingStage:
    """Calibrate the mounting by all methods, by the settings of flight.toml.

    Parameters
    ----------
    flight : Flight
    block : Block, optional
        The calibration block, by default as the flight has it; where it is measured in heads, its
        points must have been carried into synthetic images, as `results.carried` has them.

    Raises
    ------
    FlightError
        Where the flight has no block calibration.
    ValueError
        Where this is measured in heads, and no block is given.
    AdjustmentError
        Where no method has an outcome, or standard deviations cannot be estimated.
    """
    expected.instance("flight", flight, Flight)
    if block is None:
        block = _as_measured(flight)
    settings = Settings(
        free=flight.estimate_mounting,
        fix=flight.fix,
        refraction=flight.refraction,
        gnss=flight.gnss,
    )
    block, factors = weights.weighted(block, weights=flight.weights, **settings)
    mountings = mounting.calibrate(block, **settings)
    return MountingStage(block=block, sigma_factors=factors, settings=settings, mountings=mountings)


def _as_measured(flight: Flight) -> Block:
    if "calibration" in flight.carried:
        msg = "block calibration is measured in heads: give it with its points carried, as `block`"
        raise ValueError(msg)
    return flight.block("calibration")


def run(flight: Flight, results_path: str | Path) -> MountingStage:
    """Return what `calibrate` does, and write it to the results.

    Parameters
    ----------
    flight : Flight
        With a block calibration.
    results_path : path
        With the results of stage synthetic, where the block is measured in heads.

    Raises
    ------
    FlightError
        Where these are missing or of another flight, or this one has no block calibration.
    AdjustmentError
        As `calibrate`.
    """
    block = flight.block("calibration")
    if "calibration" in flight.carried:
        found = provenance.results_before(results_path, ["synthetic"], flight)
        block = mounted_block(flight, "calibration", found)
    with solving(flight, "calibration"):
        with explaining(flight, "calibration"):
            stage = calibrate(flight, block)
        records = adjustments.of_mountings(
            stage.mountings,
            applied=stage.sigma_factors,
            over_ground=flight.validation is None,
        )
        records = explained(records, flight, "calibration")
    adjustments.write(results_path, "mounting", records, flight=flight)
    return stage
