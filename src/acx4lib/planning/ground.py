"""The ground of a plan: hills, and where points lie on it. The same in every run.

The simulator has the same rules, written for itself: see `acx4sim.earth.terrain_height`.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from acx4lib.expected import Array
from acx4lib.planning.plan import Area, Plan, Points

WAVES = (
    (30.0, 4300.0, 20.0, 0.4),
    (23.0, 2650.0, 105.0, 2.1),
    (15.0, 1480.0, 62.0, 4.0),
    (8.0, 830.0, 151.0, 1.2),
    (3.0, 310.0, 85.0, 5.3),
)
"""The hills are a sum of sines: amplitude (m), wavelength (m), azimuth (degrees), phase."""

RELIEF_M = float(np.sqrt(sum(wave[0] ** 2 for wave in WAVES) / 2))
"""Root mean square of the hills as they stand; a plan's relief multiplies them."""

METRES_PER_RAD = 6.37e6

STEPS = np.array([0.7548776662, 0.5698402910])
"""Multiples of these, without their whole parts, fill a square evenly (the sequence R2)."""

LAYOUTS = ("grid", "corners", "border", "at")

_CORNERS = np.array(
    [[1, 1], [-1, -1], [1, -1], [-1, 1], [0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]], dtype=float
)


def places(points: Points) -> Array:
    """Return where surveyed points lie, forward and left of the block's middle, m, shape (n, 2).

    A ``grid`` has rows along and columns across the axis forward. ``corners`` takes the first of
    the four corners, the middle, and the middles of the four sides. ``border`` goes around the
    rectangle in equal steps from a corner. ``at`` lists them.
    """
    half = 0.5 * np.array(points.area_m)
    if points.layout == "at":
        return np.array(points.at_m, dtype=float).reshape(-1, 2)
    if points.layout == "grid":
        regular = _grid(points.number, half)
    elif points.layout == "corners":
        regular = half * _CORNERS[: points.number[0]]
    else:
        regular = half * _around(np.arange(points.number[0]) / max(points.number[0], 1))
    play = evenly(len(regular), first=0) * 2 - 1
    return regular + points.play_m * play


def _grid(number: Sequence[int], half: Array) -> Array:
    forward, left = np.meshgrid(
        *(
            np.linspace(-h, h, n) if n > 1 else np.zeros(n)
            for h, n in zip(half, number, strict=True)
        )
    )
    return np.column_stack([forward.ravel(), left.ravel()])


def _around(way: Array) -> Array:
    """Return points on the border of the square from -1 to 1; `way` is 0 to 1 around it."""
    corners = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]])
    at = np.linspace(0.0, 1.0, 5)
    return np.column_stack([np.interp(way, at, corners[:, k]) for k in range(2)])


def evenly(n: int, *, first: int = 1) -> Array:
    """Return points that fill the unit square evenly, shape (n, 2)."""
    out: Array = (np.arange(first, first + n)[:, None] * STEPS) % 1
    return out


def on_map(area: Area, local: Array) -> Array:
    """Return east and north of positions forward and left of an area's middle, shape (n, 2)."""
    course = np.radians(area.course_deg)
    forward = np.array([np.sin(course), np.cos(course)])
    left = np.array([-forward[1], forward[0]])
    out: Array = (
        np.array([area.east_m, area.north_m]) + local[:, :1] * forward + local[:, 1:2] * left
    )
    return out


def on_ground(plan: Plan, area: Area, local: Array) -> Array:
    """Return east, north and height of the ground at positions of an area, m, shape (n, 3)."""
    en = on_map(area, local)
    lon, lat = np.radians(plan.setup.grid.lonlat_from_grid(en)).T
    return np.column_stack([en, heights(lon, lat, plan)])


def heights(lon: Array, lat: Array, plan: Plan) -> Array:
    """Return the heights of the hills at longitudes and latitudes in radians, m, shape (n,)."""
    out = np.full(len(lon), plan.terrain.height_m)
    if len(lon) == 0:
        return out
    east, north = METRES_PER_RAD * np.cos(lat.mean()) * lon, METRES_PER_RAD * lat
    for amplitude, wavelength, azimuth_deg, phase in WAVES:
        azimuth = np.radians(azimuth_deg)
        way = east * np.sin(azimuth) + north * np.cos(azimuth)
        high = plan.terrain.relief_m / RELIEF_M * amplitude
        out += high * np.sin(2 * np.pi * way / wavelength + phase)
    return out
