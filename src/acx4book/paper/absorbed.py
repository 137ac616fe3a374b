"""What an interior orientation takes up of a lever arm, over the study's calibration block."""

from __future__ import annotations

from acx4lib.calibration.determination import Absorption, absorption
from acx4lib.flight.block import Block
from acx4lib.flight.reader import Flight
from acx4lib.results import folder
from acx4lib.results.adjustments import mounted_block
from acx4lib.stages import mounting


def of_run(flight: Flight, found: folder.Results) -> Absorption | None:
    """Adjust a run's calibration block by the methods of Table 3 and compare them.

    Parameters
    ----------
    flight : Flight
        Of the study's design.
    found : Results
        With the measurements carried into synthetic images, where heads made them.

    Returns
    -------
    Absorption or None
        None where the mounting was not calibrated, or the methods cannot be compared.

    Raises
    ------
    AdjustmentError
        Where no method has an outcome.
    """
    if "mounting/single_step" not in found.summary:
        return None
    return of_block(flight, mounted_block(flight, "calibration", found))


def of_block(flight: Flight, block: Block) -> Absorption | None:
    """Do what `of_run` does for a block that is measured in the synthetic image."""
    return absorption(mounting.calibrate(flight, block).mountings)
