"""The mounting of a flight, calibrated by the settings of its flight.toml."""

from __future__ import annotations

from typing import Any

from acx4lib import expected
from acx4lib.calibration import mounting, weights
from acx4lib.errors import FlightError
from acx4lib.flight.reader import Flight


def calibrate(flight: Flight) -> mounting.Mountings:
    """Calibrate interior orientation, boresight and lever arm by all methods of Table 3.

    Parameters
    ----------
    flight : Flight
        Its block `calibration` is adjusted; flight.toml says what is free and what is held,
        whether rays refract, which GNSS errors are unknowns, and whose weights count.

    Returns
    -------
    Mountings
        ``calibrate(flight)["single_step"].calibration`` is one method's calibration.

    Raises
    ------
    FlightError
        If the flight has no block `calibration`.
    AdjustmentError
        If no method has an outcome.
    """
    expected.instance("flight", flight, Flight)
    if flight.calibration is None:
        raise FlightError([f"{flight.path}: has no folder calibration; nothing to calibrate"])
    settings: dict[str, Any] = {
        "free": flight.estimate_mounting,
        "fix": flight.fix,
        "refraction": flight.refraction,
        "gnss": flight.gnss,
    }
    block, _ = weights.weighted(flight.calibration, weights=flight.weights, **settings)
    return mounting.calibrate(block, **settings)
