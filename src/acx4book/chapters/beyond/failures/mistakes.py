"""One flight of an ordinary camera, and what plants mistakes in its tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pandas as pd

from acx4lib.expected import Array
from acx4sim.designs import single_head
from acx4sim.earth import Grid
from acx4sim.files.flights import SimulatedFlight
from acx4sim.plan import GrossErrors, Options

BLOCK = "calibration"
TRAJECTORY, CONTROL = f"{BLOCK}/trajectory.csv", "control_points.csv"


def flown(seed: int, *, gross_errors: bool = False) -> SimulatedFlight:
    """Return the flight without a systematic mistake.

    Parameters
    ----------
    seed : int
    gross_errors : bool
        Whether single observations are wrong.
    """
    wrong = GrossErrors() if gross_errors else None
    return single_head(seed=seed, options=Options(blocks=(BLOCK,), gross_errors=wrong))


def changed(
    flight: SimulatedFlight, tables: Mapping[str, Mapping[str, pd.Series]]
) -> SimulatedFlight:
    """Return a flight with other columns in some of its tables.

    Parameters
    ----------
    flight : SimulatedFlight
    tables : mapping of str to mapping of str to Series
        Columns by their names, by the file of the table.
    """
    others = {path: flight.tables[path].assign(**columns) for path, columns in tables.items()}
    return replace(flight, tables={**flight.tables, **others})


def convergence_deg(flight: SimulatedFlight) -> Array:
    """Return the convergence of the meridians at the exposures, degrees, shape (n,)."""
    table = flight.tables[TRAJECTORY]
    geodetic = np.column_stack([np.radians(table[["lat_deg", "lon_deg"]]), table["height_m"]])
    out: Array = np.degrees(Grid(crs=flight.plan.crs).convergence(geodetic))
    return out


def late(flight: SimulatedFlight, by_s: float) -> pd.DataFrame:
    """Return the positions that the aircraft has a little later, strip by strip.

    Parameters
    ----------
    flight : SimulatedFlight
    by_s : float

    Returns
    -------
    DataFrame
        lat_deg, lon_deg, height_m.
    """
    table = flight.tables[TRAJECTORY]
    names = ["lat_deg", "lon_deg", "height_m"]
    rates = [
        own[names].apply(lambda column, t=own["time_s"]: np.gradient(column, t))
        for _, own in table.groupby(table["exposure"].str.partition("-")[0], sort=False)
    ]
    return table[names] + by_s * pd.concat(rates)


def only(flight: SimulatedFlight, strips: Sequence[str]) -> SimulatedFlight:
    """Return a flight of which only some strips are left."""
    images = flight.tables[f"{BLOCK}/images.csv"]
    images = images[images["strip"].isin(strips)]
    points = flight.tables[f"{BLOCK}/image_points.csv"]
    track = flight.tables[TRAJECTORY]
    kept = {
        f"{BLOCK}/images.csv": images,
        f"{BLOCK}/image_points.csv": points[points["image"].isin(images["image"])],
        TRAJECTORY: track[track["exposure"].isin(images["exposure"])],
    }
    return replace(flight, tables={**flight.tables, **kept})
