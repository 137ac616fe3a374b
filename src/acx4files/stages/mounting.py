"""Interior orientation, boresight and lever arm of the calibration block (section 4.2, Table 3)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

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
from acx4lib.attempts import Failed
from acx4lib.block import Block
from acx4lib.calibration import mounting
from acx4lib.calibration.estimates import METHODS
from acx4lib.calibration.mounting import Mounting, Mountings
from acx4lib.synthetic_image import transferred_points


def run(flight: Flight, results_path: str | Path) -> Mountings:
    """Calibrate the mounting by all methods, by the settings of flight.toml; write the results.

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
        Where no method has an outcome, or standard deviations cannot be estimated.
    """
    block, factors = mounting.weighted(
        measured(flight, results_path), flight.model, weights=flight.weights
    )
    found = mounting.calibrate(block, flight.model)
    methods = {n: with_heads(flight, results_path, m) for n, m in found.methods.items()}
    found = replace(found, methods=methods)
    write(flight, results_path, found, factors)
    return found


def calibrate(flight: Flight, block: Block | None = None) -> Mountings:
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
        As `run`.
    """
    if block is None and "calibration" in flight.transferred:
        msg = "block calibration is measured in heads: give it with points transferred, `block`"
        raise ValueError(msg)
    block, _ = mounting.weighted(
        block or flight.block("calibration"), flight.model, weights=flight.weights
    )
    return mounting.calibrate(block, flight.model)


def measured(flight: Flight, results_path: str | Path) -> Block:
    """Return the calibration block; points measured in heads are transferred.

    Arguments and errors are those of `run`.
    """
    if "calibration" not in flight.transferred:
        return flight.block("calibration")
    found = provenance.results_before(results_path, ["synthetic"], flight)
    return mounted_block(flight, "calibration", found)


Outcome = TypeVar("Outcome", Mounting, Failed)


def with_heads(flight: Flight, results_path: str | Path, outcome: Outcome) -> Outcome:
    """Return a method's outcome with standard deviations that include errors of the heads.

    It is returned unchanged where it failed, where the block is not measured in heads, and where
    these are as declared, without a covariance.

    Parameters
    ----------
    flight, results_path
        As in `run`.
    outcome : Mounting or Failed
        Of the block that `measured` returns.
    """
    if isinstance(outcome, Failed) or "calibration" not in flight.transferred:
        return outcome
    found = provenance.results_before(results_path, ["synthetic"], flight)
    source = next((name for name in ORIENTED if folder.has(found, name)), "")
    if not source:
        return outcome
    block = flight.block("calibration")
    heads = read_relative_orientation(found, source, flight.cameras)
    carried = read_carried(flight, block, found)
    return transferred_points.with_heads(outcome, block, carried, heads)


def write(
    flight: Flight, results_path: str | Path, mountings: Mountings, factors: Mapping[str, float]
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
