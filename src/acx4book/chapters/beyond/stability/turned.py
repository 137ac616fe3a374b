"""A simulated rig of which one head turns at one exposure, by less than a pixel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pandas as pd

from acx4lib.calibration.trust.rigidity import Rigidity
from acx4sim.designs import acx4
from acx4sim.files.flights import SimulatedFlight
from acx4sim.plan import Options

HEAD, EXPOSURE, ARCSEC = "CAM3", "H2-04", 10.0
"""The head that turns about its own y axis, when, and by how much."""

POINTS = "heads/image_points.csv"


def flown(seed: int) -> SimulatedFlight:
    """Return the heads' block of the paper's flight; the rig is rigid."""
    return acx4(seed=seed, options=Options(blocks=("heads",)))


def turning(flight: SimulatedFlight) -> SimulatedFlight:
    """Return the flight with the head turned at the exposure.

    A turn by a small angle about the camera's y axis moves a point by f + x²/f along x and by x y/f
    along y, times the angle, x and y counted from the principal point.
    """
    camera, table = flight.plan.cameras[HEAD], flight.tables[POINTS].copy()
    images = flight.tables["heads/images.csv"]
    own = images[(images["camera"] == HEAD) & (images["exposure"] == EXPOSURE)]["image"]
    rows = table["image"].isin(own)
    f_px = camera.f_mm / camera.pixel_um * 1000
    x = table.loc[rows, "col_px"] - (camera.width_px - 1) / 2
    y = (camera.height_px - 1) / 2 - table.loc[rows, "row_px"]
    angle = np.radians(ARCSEC / 3600)
    table.loc[rows, "col_px"] += angle * (f_px + x**2 / f_px)
    table.loc[rows, "row_px"] -= angle * x * y / f_px
    return replace(flight, tables={**flight.tables, POINTS: table})


def planted(found: Rigidity) -> pd.Series:
    """Return the test of the exposure at which the head turned, with the turn that was found.

    Returns
    -------
    Series
        p_joint, turn_arcsec, sigma_arcsec (about the head's y axis).
    """
    at, head = found.exposures.index(EXPOSURE), found.heads.index(HEAD)
    arcsec = 3600 * np.degrees([found.turns[at, head, 1], found.sigma[at, head, 1]])
    return pd.Series([found.p_joint[at], *arcsec], index=["p_joint", "turn_arcsec", "sigma_arcsec"])
