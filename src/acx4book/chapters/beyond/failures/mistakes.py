"""One flight of an ordinary camera, and the mistakes that are planted in its tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pandas as pd

from acx4sim.designs import single_head
from acx4sim.earth import Grid
from acx4sim.files.flights import SimulatedFlight
from acx4sim.plan import GrossErrors, Options

BLOCK = "calibration"
TRAJECTORY, CONTROL = f"{BLOCK}/trajectory.csv", "control_points.csv"

GEOID_M, DELAY_S = 45.0, 0.1
"""Height of the geoid above the ellipsoid at the field; what the clock of positions is late by."""

ONE_WAY = ("1", "3")
"""The strips that are flown at one height in one direction."""

Plants = Callable[[SimulatedFlight], SimulatedFlight]


def flown(seed: int, *, gross_errors: GrossErrors | None = None) -> SimulatedFlight:
    """Return the flight without a systematic mistake.

    Parameters
    ----------
    seed : int
    gross_errors : GrossErrors, optional
    """
    return single_head(seed=seed, options=Options(blocks=(BLOCK,), gross_errors=gross_errors))


def _as_flown(flight: SimulatedFlight) -> SimulatedFlight:
    return flight


def _changed(flight: SimulatedFlight, path: str, change: pd.DataFrame) -> SimulatedFlight:
    """Return a flight with other columns in one table."""
    return replace(flight, tables={**flight.tables, path: flight.tables[path].assign(**change)})


def _sign(flight: SimulatedFlight) -> SimulatedFlight:
    table = flight.tables[TRAJECTORY]
    return _changed(flight, TRAJECTORY, -table[["pitch_deg"]])


def _axes(flight: SimulatedFlight) -> SimulatedFlight:
    return _changed(flight, TRAJECTORY, _exchanged(flight, TRAJECTORY, "roll_deg", "pitch_deg"))


def _coordinates(flight: SimulatedFlight) -> SimulatedFlight:
    return _changed(flight, CONTROL, _exchanged(flight, CONTROL, "east_m", "north_m"))


def _exchanged(flight: SimulatedFlight, path: str, a: str, b: str) -> pd.DataFrame:
    return flight.tables[path][[a, b]].rename(columns={a: b, b: a})


def _convergence(flight: SimulatedFlight) -> SimulatedFlight:
    """Count headings from grid north where the files mean true north."""
    table = flight.tables[TRAJECTORY]
    geodetic = np.column_stack([np.radians(table[["lat_deg", "lon_deg"]]), table["height_m"]])
    to_grid = np.degrees(Grid(crs=flight.plan.crs).convergence(geodetic))
    return _changed(flight, TRAJECTORY, table[["heading_deg"]].sub(to_grid, axis=0))


def _geoid(flight: SimulatedFlight) -> SimulatedFlight:
    return _changed(flight, CONTROL, flight.tables[CONTROL][["height_m"]] - GEOID_M)


def _delay(flight: SimulatedFlight) -> SimulatedFlight:
    """Write the positions that the aircraft has a little later, strip by strip."""
    table = flight.tables[TRAJECTORY]
    names = ["lat_deg", "lon_deg", "height_m"]
    rates = [
        own[names].apply(lambda column, t=own["time_s"]: np.gradient(column, t))
        for _, own in table.groupby(table["exposure"].str.partition("-")[0], sort=False)
    ]
    return _changed(flight, TRAJECTORY, table[names] + DELAY_S * pd.concat(rates))


def _one_way(flight: SimulatedFlight) -> SimulatedFlight:
    """Leave out all strips but those of one height and one direction."""
    images = flight.tables[f"{BLOCK}/images.csv"]
    images = images[images["strip"].isin(ONE_WAY)]
    points = flight.tables[f"{BLOCK}/image_points.csv"]
    track = flight.tables[TRAJECTORY]
    kept = {
        f"{BLOCK}/images.csv": images,
        f"{BLOCK}/image_points.csv": points[points["image"].isin(images["image"])],
        TRAJECTORY: track[track["exposure"].isin(images["exposure"])],
    }
    return replace(flight, tables={**flight.tables, **kept})


def _gross(flight: SimulatedFlight) -> SimulatedFlight:
    return flown(flight.seed, gross_errors=GrossErrors())


MISTAKES: Mapping[str, Plants] = MappingProxyType(
    {
        "no mistake": _as_flown,
        "wrong sign": _sign,
        "angles exchanged": _axes,
        "coordinates exchanged": _coordinates,
        "convergence": _convergence,
        "geoid": _geoid,
        "delay": _delay,
        "one direction": _one_way,
        "gross errors": _gross,
    }
)
"""What is planted, by the name on the page; the first is nothing."""
