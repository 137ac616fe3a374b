"""An SBET and an SMRMSG of a motion in closed form."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

AXIS_M, E_SQ = 6_378_137.0, 0.0066943800229
PERIOD_S, CLIMB = 8.0, 3.0


def motion(t):
    """Return lon, lat (rad), height (m), NED velocity (m/s) and roll, pitch, heading (rad).

    Latitude and longitude grow evenly but for a swing in longitude, the height swings.
    """
    w = 2 * np.pi / PERIOD_S
    lat = 0.5 + 8e-6 * t
    lon = -2.0 + 4e-6 * t + 1e-6 * np.sin(w * t)
    height = 900.0 + CLIMB * np.sin(w * t)
    root = np.sqrt(1 - E_SQ * np.sin(lat) ** 2)
    north = 8e-6 * (AXIS_M * (1 - E_SQ) / root**3 + height)
    east = (4e-6 + 1e-6 * w * np.cos(w * t)) * (AXIS_M / root + height) * np.cos(lat)
    down = -CLIMB * w * np.cos(w * t)
    rph = np.stack([0.02 * np.sin(w * t), 0.01 + 0 * t, 6.2 + 0.05 * t], axis=-1)
    return np.stack([lon, lat, height], axis=-1), np.stack([north, east, down], axis=-1), rph


def sbet(t, *, wander=0.3, start=0.0):
    """Return the bytes of an SBET of `motion` at times, which the file counts from `start`."""
    lonlath, velocity, rph = motion(t)
    cos, sin = np.cos(wander), np.sin(wander)
    north, east, down = velocity.T
    records = np.zeros((len(t), 17))
    records[:, 0] = (start + t) % 604_800
    records[:, 1:4] = lonlath[:, [1, 0, 2]]
    records[:, 4] = cos * north - sin * east  # x at azimuth -wander
    records[:, 5] = -sin * north - cos * east  # y west of it
    records[:, 6] = -down
    records[:, 7:9] = rph[:, :2]
    records[:, 9] = (rph[:, 2] + wander + np.pi) % (2 * np.pi) - np.pi
    records[:, 10] = wander
    return records.astype("<f8").tobytes()


def smrmsg(t, *, start=0.0):
    """Return the bytes of an SMRMSG whose deviations grow from 1 to 2 cm, 3 to 6 arc minutes."""
    share = (t - t[0]) / (t[-1] - t[0])
    records = np.zeros((len(t), 10))
    records[:, 0] = (start + t) % 604_800
    records[:, 1:4] = 0.01 * (1 + share)[:, None] * [1, 2, 3]
    records[:, 7:10] = 3.0 * (1 + share)[:, None] * [1, 2, 3]
    return records.astype("<f8").tobytes()


@pytest.fixture
def made():
    """The functions that make such files, and the motion that they hold."""
    return SimpleNamespace(motion=motion, sbet=sbet, smrmsg=smrmsg)
