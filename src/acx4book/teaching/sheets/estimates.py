"""Estimated parameters as right answers."""

from __future__ import annotations

from collections.abc import Mapping

from acx4book.teaching.case import Right, estimated
from acx4lib.calibration import estimates
from acx4lib.calibration.estimates import Calibration
from acx4lib.geometry.parameters import REPORTED

TITLES = {
    "f_mm": "focal length",
    "xp_mm": "x of the principal point",
    "yp_mm": "y of the principal point",
    "lever_x_m": "x of the lever arm",
    "lever_y_m": "y of the lever arm",
    "lever_z_m": "z of the lever arm",
    "boresight_omega_deg": "ω of the boresight",
    "boresight_phi_deg": "φ of the boresight",
    "boresight_kappa_deg": "κ of the boresight",
}
"""Parameters in words."""


def units(name: str) -> str:
    """Return the unit of a parameter."""
    return next(unit for reported, unit in REPORTED.values() if reported == name)


def parameters(calibration: Calibration, truth: Mapping[str, float]) -> dict[str, Right]:
    """Return the parameters of a calibration of one camera, beside what was simulated."""
    return {
        p.name: estimated(p.value, p.sigma, truth[p.name])
        for p in estimates.parameters(calibration)
        if p.name in truth
    }
