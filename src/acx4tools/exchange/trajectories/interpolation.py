"""Position, attitude and standard deviations between the records of a trajectory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4lib.expected import Array, Index
from acx4lib.geometry import frames
from acx4tools.exchange.trajectories.sbet import Deviations, Track

AXIS_M, FLATTENING = 6_378_137.0, 1 / 298.257222101
"""GRS 80; that of WGS 84 differs by 0.1 mm. It turns velocities into rates of angles."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Between:
    """Where times lie between the records of a trajectory.

    Attributes
    ----------
    before : ndarray of int, shape (n,)
        The record before each time; the next is the one after it.
    share : ndarray, shape (n,)
        Of the interval that has passed, 0 to 1.
    interval : ndarray, shape (n,)
        Seconds.
    """

    before: Index
    share: Array
    interval: Array


def between(times: Array, t: Array) -> Between:
    """Return where times lie between increasing ones, two at least; outside: the end interval."""
    before = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
    interval = times[before + 1] - times[before]
    return Between(before=before, share=(t - times[before]) / interval, interval=interval)


def positions(track: Track, at: Between, *, by_velocity: bool) -> Array:
    """Return longitude, latitude (deg) and height (m), shape (n, 3).

    Parameters
    ----------
    track : Track
    at : Between
    by_velocity : bool
        Whether the velocities hold: then a cubic through positions and velocities, whose error
        grows with the fourth power of the interval; else a straight line.
    """
    first, last = track.lonlath(at.before), track.lonlath(at.before + 1)
    step = last - first
    step[:, 0] = (step[:, 0] + np.pi) % (2 * np.pi) - np.pi
    s = at.share[:, None]
    x = first + s * step
    if by_velocity:
        begin, end = (at.interval[:, None] * rates(track, at.before + k) for k in (0, 1))
        x += s * (1 - s) * ((1 - s) * (begin - step) - s * (end - step))
    x[:, 0] = (x[:, 0] + np.pi) % (2 * np.pi) - np.pi
    return np.column_stack([np.degrees(x[:, :2]), x[:, 2]])


def rates(track: Track, rows: Index) -> Array:
    """Return the rates of longitude, latitude (rad/s) and height (m/s) of records, shape (k, 3)."""
    _, lat, height = track.lonlath(rows).T
    north, east, down = track.velocity(rows).T
    e_sq = FLATTENING * (2 - FLATTENING)
    w_sq = 1 - e_sq * np.sin(lat) ** 2
    along = AXIS_M * (1 - e_sq) / w_sq**1.5 + height
    across = AXIS_M / np.sqrt(w_sq) + height
    return np.stack([east / (across * np.cos(lat)), north / along, -down], axis=-1)


def attitudes(track: Track, at: Between) -> Array:
    """Return roll, pitch and true heading, rad, shape (n, 3); the body turns at a constant rate."""
    R_n_b, after = (frames.rotation_from_rph(track.rph(at.before + k)) for k in (0, 1))
    turned = frames.log(np.swapaxes(R_n_b, -1, -2) @ after)
    rph = frames.rph_from_rotation(R_n_b @ frames.exp(at.share[:, None] * turned))
    return np.column_stack([rph[:, :2], rph[:, 2] % (2 * np.pi)])


def deviations(of: Deviations, t: Array) -> Array:
    """Return standard deviations at times, linear between records, shape (n, 6)."""
    return np.stack([np.interp(t, of.time, column) for column in of.sigma.T], axis=-1)


def velocity_misfit(track: Track, at: Between) -> tuple[float, float]:
    """Return how much velocities and changes of position differ, and the speed; medians, m/s."""
    rows = np.unique(at.before)
    first, last = track.lonlath(rows), track.lonlath(rows + 1)
    step = last - first
    step[:, 0] = (step[:, 0] + np.pi) % (2 * np.pi) - np.pi
    dt = (track.time[rows + 1] - track.time[rows])[:, None]
    said = 0.5 * (rates(track, rows) + rates(track, rows + 1))
    across = np.column_stack([AXIS_M * np.cos(first[:, 1]), np.full((len(rows), 2), [AXIS_M, 1.0])])
    off = np.linalg.norm(across * (step / dt - said), axis=1)
    return float(np.median(off)), float(np.median(np.linalg.norm(across * said, axis=1)))
