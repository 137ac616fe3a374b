"""Direct georeferencing tested on an independent block (section 4.3, Table 4)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from acx4lib.calibration.estimates import Calibration
from acx4lib.flight.block import Block
from acx4lib.flight.reader import Flight
from acx4lib.georeferencing.validation import Validation, validate
from acx4lib.results import adjustments, folder, read_back
from acx4lib.results.carried import mounted_block
from acx4lib.results.validations import of_validations
from acx4lib.stages.explained import explained


@dataclass(frozen=True, kw_only=True, eq=False)
class ValidationStage:
    """The validation block, georeferenced by every calibration.

    Attributes
    ----------
    block : Block
        Carried into the synthetic image where it is measured in heads.
    calibrations : dict of str to Calibration
        By method, those whose parameters are all determined.
    validations : list of Validation
        One for each of them.
    in_heads : list of Validation
        One for each rig, in the images of the heads; empty where the block is not measured there.
    """

    block: Block
    calibrations: dict[str, Calibration]
    validations: list[Validation]
    in_heads: list[Validation]


def run(flight: Flight, results_path: str | Path) -> ValidationStage:
    """Validate the calibrations of stage mounting, and write the results.

    Parameters
    ----------
    flight : Flight
        With a block validation.
    results_path : path
        With the results of stage mounting, where the flight has a block calibration.

    Raises
    ------
    FlightError
        Where the results of stage mounting are missing.
    """
    found = folder.read(results_path)
    block = mounted_block(flight, "validation", found)
    calibrations = read_back.calibrations_for(flight, found, block.cameras)
    validations = _validated(flight, block, calibrations)
    in_heads = []
    if "validation" in flight.carried:
        measured = flight.block("validation")
        rigs = read_back.rigs_for(found, measured.cameras)
        in_heads = _validated(flight, measured, rigs)
    records = explained(of_validations([*validations, *in_heads]), flight, "validation")
    adjustments.write(results_path, "validation", records)
    return ValidationStage(
        block=block, calibrations=calibrations, validations=validations, in_heads=in_heads
    )


def _validated(
    flight: Flight, block: Block, calibrations: Mapping[str, Calibration]
) -> list[Validation]:
    return [
        validate(block, calibration, method=method, refraction=flight.refraction)
        for method, calibration in calibrations.items()
    ]
