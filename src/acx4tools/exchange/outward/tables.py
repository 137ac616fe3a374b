"""Exterior orientations as tables of text, which most programs read by declared columns."""

from __future__ import annotations

from collections.abc import Callable

import pandas as pd

from acx4tools.exchange.outward import orientations
from acx4tools.exchange.outward.orientations import Oriented
from acx4tools.exchange.outward.taken import Taken

FILE = "orientations.csv"

DIGITS = {"_m": 5, "_deg": 9}
"""Decimals of metres and degrees; those of latitude and longitude are a tenth of a millimetre."""

OPK = (
    "omega, phi, kappa of R = Rx(omega) Ry(phi) Rz(kappa), from the camera's axes, x right and y "
    "up in the image, to those of {}"
)
GRID = "grid east, grid north and the ellipsoid's normal at the image: {}; heights: {}"
ELLIPSOIDAL = "heights are ellipsoidal"
CENTRE = "positions are those of the perspective centre, by trajectory, boresight and lever arm"
RPH = (
    "roll, pitch and heading are those of the image, not of the body: a camera that looks down is "
    "level, its heading, from true north, is that of the top edge, positive pitch lifts the view "
    "ahead, positive roll lowers the right edge; as a trajectory of a flight they belong to a "
    "camera with mount_kappa_deg = -90"
)
SIGMA_OF = "sigma: a priori of the trajectory, a posteriori of the calibration, with correlations"


def opk(oriented: Oriented) -> Taken:
    """Return positions and angles in the grid of the flight, with a priori sigma."""
    grid = oriented.block.frame.grid
    axes = GRID.format(grid.crs, grid.heights)
    return _taken(orientations.in_grid, oriented, (CENTRE, OPK.format(axes), SIGMA_OF))


def topocentric(oriented: Oriented) -> Taken:
    """Return positions and angles in topocentric axes."""
    axes = f"east, north, up at {oriented.origin}"
    return _taken(orientations.topocentric, oriented, (CENTRE, OPK.format(axes)))


def rph(oriented: Oriented) -> Taken:
    """Return geographic positions and roll, pitch, heading of the images."""
    return _taken(orientations.geographic, oriented, (CENTRE, ELLIPSOIDAL, RPH))


def _taken(
    table_of: Callable[[Oriented], pd.DataFrame], oriented: Oriented, assumed: tuple[str, ...]
) -> Taken:
    table = table_of(oriented)
    for name in table.columns[1:]:
        unit = next(unit for unit in DIGITS if name.endswith(unit))
        table[name] = [f"{value:.{DIGITS[unit]}f}" for value in table[name]]
    text = table.to_csv(index=False, lineterminator="\n")
    left_out = () if "sigma_east_m" in table else ("standard deviations: --to opk has them",)
    return Taken(files={FILE: text}, assumed=assumed, left_out=left_out)
