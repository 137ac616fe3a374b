"""Interior orientation, boresight and lever arm of the calibration block (section 4.2, Table 3)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from acx4files.flight.reader import Flight
from acx4files.results import folder, provenance
from acx4files.results.read_back import (
    ORIENTED,
    mounted_block,
    read_carried,
    read_relative_orientation,
)
from acx4files.stages import diagnosed
from acx4files.stages.order import rig_leads
from acx4lib import shown
from acx4lib.attempts import Failed
from acx4lib.block import Block
from acx4lib.calibration import mounting
from acx4lib.calibration.estimates import METHODS
from acx4lib.calibration.mounting import Mounting, Mountings
from acx4lib.synthetic_image import transferred_points

if TYPE_CHECKING:
    import pandas as pd

Outcome = TypeVar("Outcome", Mounting, Failed)


@dataclass(frozen=True, kw_only=True, eq=False)
class MountingStage:
    """The calibration block, adjusted by all methods.

    Attributes
    ----------
    block : Block
        With the standard deviations that the flight asks for.
    sigma_factors : mapping of str to float
        Factors of the given standard deviations, by group of observations; empty where these are
        used unchanged.
    mountings : Mountings
    """

    block: Block
    sigma_factors: Mapping[str, float]
    mountings: Mountings

    def __repr__(self) -> str:
        """Name the methods with an outcome in one line."""
        return shown.line("MountingStage", self.block.name, *self.mountings.methods)

    def table(self) -> pd.DataFrame:
        """Return the parameters of all methods side by side."""
        return self.mountings.table()

    @property
    def single_step(self) -> Mounting | None:
        """Outcome of the single step; None where it has none."""
        return self.mountings.methods.get("single_step")


def run(flight: Flight, results_path: str | Path) -> MountingStage:
    """Calibrate the mounting as `calibrate` does, and write the results.

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
    stage = calibrate(flight, measured(flight, results_path))
    methods = {
        name: with_heads(flight, results_path, found)
        for name, found in stage.mountings.methods.items()
    }
    stage = replace(stage, mountings=replace(stage.mountings, methods=methods))
    write(flight, results_path, stage.mountings, stage.sigma_factors)
    return stage


def calibrate(flight: Flight, block: Block | None = None) -> MountingStage:
    """Calibrate the mounting by all methods, by the settings of flight.toml.

    Parameters
    ----------
    flight : Flight
    block : Block, optional
        The calibration block, by default as the flight has it; where it is measured in heads, its
        points must have been transferred into synthetic images.

    Raises
    ------
    FlightError
        Where the flight has no block calibration.
    ValueError
        Where this is measured in heads, and no block is given.
    AdjustmentError
        Where no method has an outcome, or standard deviations cannot be estimated.
    """
    if block is None:
        if "calibration" in flight.transferred:
            msg = "block calibration is measured in heads: give it with points transferred, `block`"
            raise ValueError(msg)
        block = flight.block("calibration")
    block, factors = mounting.weighted(block, flight.model, weights=flight.weights)
    mountings = mounting.calibrate(block, flight.model)
    return MountingStage(block=block, sigma_factors=factors, mountings=mountings)


def measured(flight: Flight, results_path: str | Path) -> Block:
    """Return the calibration block; points measured in heads are transferred.

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
    """
    if "calibration" not in flight.transferred:
        return flight.block("calibration")
    run_results = provenance.results_before(results_path, ["synthetic"], flight)
    return mounted_block(flight, "calibration", run_results)


def with_heads(flight: Flight, results_path: str | Path, outcome: Outcome) -> Outcome:
    """Return a method's outcome with standard deviations that include errors of the heads.

    It is returned unchanged where it failed, where the block is not measured in heads, and where
    these are as declared, without a covariance.

    Parameters
    ----------
    flight : Flight
    results_path : path
        With the results of stage synthetic, where the block is measured in heads.
    outcome : Mounting or Failed
        Of the block that `measured` returns.

    Raises
    ------
    FlightError
        As `measured`.
    """
    if isinstance(outcome, Failed) or "calibration" not in flight.transferred:
        return outcome
    run_results = provenance.results_before(results_path, ["synthetic"], flight)
    source = next((name for name in ORIENTED if folder.has(run_results, name)), "")
    if not source:
        return outcome
    block = flight.block("calibration")
    return transferred_points.with_heads(
        outcome,
        block,
        read_carried(flight, block, run_results),
        read_relative_orientation(run_results, source, flight.cameras),
    )


def write(
    flight: Flight,
    results_path: str | Path,
    mountings: Mountings,
    factors: Mapping[str, float],
) -> None:
    """Write the results of all methods, failures included.

    Parameters
    ----------
    flight : Flight
    results_path : path
    mountings : Mountings
    factors : mapping of str to float
        Factors of the given standard deviations, by group of observations.
    """
    records = diagnosed.of_mountings(
        mountings, applied=factors, over_ground=flight.validation is None
    )
    methods = METHODS if rig_leads(flight) else ()  # the rig has been written before
    provenance.write(results_path, "mounting", records, flight=flight, methods=methods)
