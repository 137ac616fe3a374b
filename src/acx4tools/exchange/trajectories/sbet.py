"""SBET and SMRMSG, the smoothed trajectory of Applanix's POSPac and its standard deviations.

Both are binary without a header. The frame of the velocities, and of the platform heading, is
turned by the wander angle from north; its y points west where x points north, and its z up.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acx4lib.expected import Array, Index
from acx4tools.exchange.safe.opened import Opened
from acx4tools.exchange.safe.records import records
from acx4tools.exchange.trajectories.times import continued

SBET = np.dtype(
    [
        (name, "<f8")
        for name in (
            *("time", "lat", "lon", "height", "vx", "vy", "vz", "roll", "pitch", "heading"),
            *("wander", "ax", "ay", "az", "wx", "wy", "wz"),
        )
    ]
)
"""Of one record: s of week, rad, m, m/s, m/s^2, rad/s."""

SMRMSG = np.dtype(
    [
        (name, "<f8")
        for name in (
            *("time", "north", "east", "down", "v_north", "v_east", "v_down"),
            *("roll", "pitch", "heading"),
        )
    ]
)
"""Of one record: s of week, m, m/s, arc minutes."""

LIMITS = {
    "time": (0.0, 2e6),
    "lat": (-np.pi / 2, np.pi / 2),
    "lon": (-2 * np.pi, 2 * np.pi),
    "height": (-12_000.0, 100_000.0),
    **dict.fromkeys(("roll", "pitch", "heading", "wander"), (-10.0, 10.0)),
}
"""Between these lie the values of an SBET."""

POSITIVE = ("north", "east", "down", "roll", "pitch", "heading")


@dataclass(frozen=True, kw_only=True, eq=False)
class Track:
    """A trajectory of many records.

    Attributes
    ----------
    source : Opened
    time : ndarray, shape (n,)
        Seconds, increasing; they count on through the end of a week.
    record : structured array, shape (n,)
        As the file has them.
    """

    source: Opened
    time: Array
    record: NDArray[Any]

    def lonlath(self, rows: Index) -> Array:
        """Return longitude, latitude (rad) and height (m) of records, shape (k, 3)."""
        own = self.record[rows]
        return np.stack([own["lon"], own["lat"], own["height"]], axis=-1)

    def rph(self, rows: Index) -> Array:
        """Return roll, pitch and true heading of records, rad, shape (k, 3)."""
        own = self.record[rows]
        return np.stack([own["roll"], own["pitch"], own["heading"] - own["wander"]], axis=-1)

    def velocity(self, rows: Index) -> Array:
        """Return the velocities to north, east and down of records, m/s, shape (k, 3)."""
        own = self.record[rows]
        cos, sin = np.cos(own["wander"]), np.sin(own["wander"])
        north = own["vx"] * cos - own["vy"] * sin
        east = -own["vx"] * sin - own["vy"] * cos
        return np.stack([north, east, -own["vz"]], axis=-1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Deviations:
    """Standard deviations along a trajectory.

    Attributes
    ----------
    source : Opened
    time : ndarray, shape (n,)
        On the clock of the trajectory.
    sigma : ndarray, shape (n, 6)
        To east, north and up, m; of roll, pitch and heading, degrees.
    """

    source: Opened
    time: Array
    sigma: Array


def read_track(source: Opened) -> Track:
    """Return the trajectory in an SBET file.

    Raises
    ------
    FlightError
        Where it is cut off, or a record has values that no trajectory has; the record is named.
    """
    record = records(source, SBET)
    for name, (low, high) in LIMITS.items():
        values = record[name]
        _refuse(source, name, values, ~((values >= low) & (values <= high)), f"{low:g} to {high:g}")
    return Track(source=source, time=_increasing(source, record), record=record)


def read_deviations(source: Opened) -> Deviations:
    """Return the standard deviations in an SMRMSG file.

    Raises
    ------
    FlightError
        As `read_track` does.
    """
    record = records(source, SMRMSG)
    for name in POSITIVE:
        values = record[name]
        _refuse(source, name, values, ~((values > 0) & (values < 1e6)), "a positive number")
    metres = [record[name] for name in ("east", "north", "down")]
    degrees = [record[name] / 60.0 for name in ("roll", "pitch", "heading")]
    sigma = np.stack([*metres, *degrees], axis=-1)
    return Deviations(source=source, time=_increasing(source, record), sigma=sigma)


def _increasing(source: Opened, record: NDArray[Any]) -> Array:
    values = record["time"]
    _refuse(source, "time", values, ~np.isfinite(values), "seconds of the week")
    time = continued(values)
    _refuse(source, "time", values, np.diff(time, prepend=-np.inf) <= 0, "after that before")
    return time


def _refuse(source: Opened, name: str, values: Array, bad: NDArray[Any], expected: str) -> None:
    """Refuse the first record with a value that is wrong."""
    at = np.flatnonzero(bad)
    if len(at):
        found = f"record {at[0] + 1} of {len(values)} has {values[at[0]]!r}"
        raise source.wrong(name, found.replace("np.float64", ""), f"must be {expected}")
