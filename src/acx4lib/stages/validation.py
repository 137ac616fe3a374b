"""Direct georeferencing tested on an independent block (section 4.3, Table 4)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from acx4lib.calibration.estimates import Calibration
from acx4lib.flight.block import Block
from acx4lib.flight.reader import Flight
from acx4lib.georeferencing.validation import Validation, validate
from acx4lib.results import adjustments, folder, read_back
from acx4lib.results.carried import mounted_block
from acx4lib.results.validations import of_validations


@dataclass(frozen=True, kw_only=True, eq=False)
class ValidationStage:
    """The validation block, georeferenced by every calibration.

    Attributes
    ----------
    block : Block
    calibrations : dict of str to Calibration
        By method, those whose parameters are all determined.
    validations : list of Validation
        One for each of them.
    """

    block: Block
    calibrations: dict[str, Calibration]
    validations: list[Validation]


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
    block = mounted_block(flight, "validation", results_path)
    calibrations = read_back.calibrations_for(flight, found, block.cameras)
    validations = [
        validate(block, calibration, method=method, refraction=flight.refraction)
        for method, calibration in calibrations.items()
    ]
    adjustments.write(results_path, "validation", of_validations(validations))
    return ValidationStage(block=block, calibrations=calibrations, validations=validations)
