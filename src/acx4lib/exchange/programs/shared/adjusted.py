"""A program's adjusted orientations as a trajectory, where the user asks for that."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from acx4lib.exchange.programs.shared import tables
from acx4lib.exchange.safe.opened import refusal
from acx4lib.flight.text.in_memory import Columns
from acx4lib.geometry.frames import Pose
from acx4lib.geometry.geodesy import GridSystem

EARTH = (6.3e6, 6.5e6)
"""Distances from the Earth's centre, m, of what flies over it."""

MEANS_NOTHING = (
    "The trajectory is what the program adjusted, camera and body being one: the boresight and "
    "the lever arm that a calibration finds on it mean nothing"
)


@dataclass(frozen=True, kw_only=True)
class Flown:
    """A trajectory, or none, and what is said of it.

    Attributes
    ----------
    table : table or None
        trajectory.csv.
    settings : mapping
        Keys of flight.toml on the coordinate system.
    assumed, left_out : tuple of str
    """

    table: Columns | None = None
    settings: Mapping[str, str | float] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()


def flown(
    source: Path, exposures: Sequence[str], T_w_b: Pose, *, crs: str | None, wanted: str
) -> Flown:
    """Return the trajectory of a model whose own coordinates are those of a projected CRS.

    Parameters
    ----------
    source : Path
        The model, for messages.
    exposures : sequence of str
        Of each image; the first image of an exposure has its pose.
    T_w_b : Pose
        The body of each image in the model, the library's axes.
    crs : str, optional
        Projected CRS in whose east, north and height the model is, or in whose ECEF frame; the
        size of the coordinates tells which.
    wanted : str
        "adjusted", or no trajectory.

    Raises
    ------
    FlightError
        Where a CRS is needed and not given, or cannot be used.
    """
    if crs is None:
        if wanted == "adjusted":
            raise refusal(
                str(source), 1, "--crs", "missing", "adjusted orientations need a projected CRS"
            )
        return Flown(left_out=(f"{len(exposures)} adjusted orientations",))
    try:
        grid = GridSystem(crs=crs)
    except ValueError as error:
        raise refusal(str(source), 1, "--crs", str(error), "must be a projected CRS") from None
    settings = {"crs": crs, "heights": "ellipsoidal"}
    if wanted != "adjusted":
        return Flown(settings=settings, left_out=(f"{len(exposures)} adjusted orientations",))
    names, of = tables.first_use(exposures)
    first = np.unique(of, return_index=True)[1]
    bodies = T_w_b[first]
    distance = np.linalg.norm(bodies.r, axis=1)
    if ((distance > EARTH[0]) & (distance < EARTH[1])).all():
        enh, opk = tables.grid_poses_of_ecef(grid, bodies)
        said = f"The model is in the earth-centred frame of {crs}"
    else:
        enh, opk = bodies.r, bodies.opk
        said = f"The model's x, y, z are east, north and ellipsoidal height of {crs}"
    return Flown(
        table=tables.trajectory_in_grid(names, enh, opk),
        settings=settings,
        assumed=(said, MEANS_NOTHING),
    )
