"""What an interior orientation takes up of a lever arm, over the study's calibration block."""

from __future__ import annotations

from acx4lib.calibration import mounting
from acx4lib.calibration.absorption import Absorption, absorption
from acx4lib.flight.reader import Flight


def of_flight(flight: Flight) -> Absorption | None:
    """Adjust the calibration block by the methods of Table 3 and compare them.

    Parameters
    ----------
    flight : Flight
        Of the study's design.

    Returns
    -------
    Absorption or None
        None where the calibration block is not measured in the synthetic image, or the methods
        cannot be compared.

    Raises
    ------
    AdjustmentError
        Where no method has an outcome.
    """
    block = flight.calibration
    if block is None or [camera.name for camera in block.cameras] != ["SYN"]:
        return None
    found = mounting.calibrate(
        block,
        free=flight.estimate_mounting,
        fix=flight.fix,
        refraction=flight.refraction,
        gnss=flight.gnss,
    )
    return absorption(found)
