"""Figures of the chapter on frames: the Earth, its heights, and a map projection."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from acx4book.foundations import example
from acx4book.typesetting import maps, style
from acx4lib.expected import Array
from acx4lib.geometry.geodesy import GridSystem

FLAT = 0.75
"""Drawn ratio of the ellipsoid's axes; the true one is 0.9966."""


def earth() -> Figure:
    """Draw a meridian of the ellipsoid with two frames, and beside it the three surfaces."""
    with style.applied():
        fig, (left, right) = style.subplots(
            1, 2, figsize=(style.WIDTH, 3.3), width_ratios=(1.15, 1)
        )
        _meridian(left)
        _heights(right)
    return fig


def _meridian(ax: Axes) -> None:
    """Draw a quarter of the ellipsoid, Earth-centred axes, and a topocentric frame at a point."""
    angle = np.linspace(-0.25, np.pi / 2 + 0.2, 120)
    maps.scene(ax, (-0.55, 1.75), (-0.55, 1.5))
    ax.plot(np.cos(angle), FLAT * np.sin(angle), color=style.SOFT)
    foot, up = _on_ellipsoid(np.radians(40.0))
    top = foot + 0.22 * up
    north = np.array([-up[1], up[0]])
    axis = foot - foot[0] / up[0] * up  # where the normal meets the Earth's axis
    for tip, name in (([1.4, 0.0], "$X$"), ([0.0, 1.2], "$Z$")):
        maps.arrow(ax, np.zeros(2), np.array(tip), style.INK)
        ax.text(tip[0] + 0.03, tip[1] + 0.03, name)
    ax.plot(*np.stack([axis, top]).T, color=style.BLUE, lw=1.2, ls="--")
    maps.arrow(ax, top, top + 0.42 * up, style.TEAL)
    maps.arrow(ax, top, top + 0.42 * north, style.TEAL)
    ax.plot(*top, "o", color=style.INK)
    around = np.linspace(0, np.radians(40.0), 30)
    meets = foot[0] - foot[1] * up[0] / up[1]
    ax.plot(meets + 0.25 * np.cos(around), 0.25 * np.sin(around), color=style.BLUE, lw=1.2)
    for (x, y), text, colour in (
        (np.array([meets + 0.27, 0.06]), "$B$", style.BLUE),
        (top + 0.42 * up + [0.02, 0.0], "up", style.TEAL),
        (top + 0.42 * north + [-0.18, 0.05], "north", style.TEAL),
        ((foot + top) / 2 + [0.05, -0.1], "$h_e$", style.INK),
        ((axis + foot) / 2 + [-0.05, -0.22], r"$\nu$", style.BLUE),
    ):
        ax.text(x, y, text, color=colour)
    style.heading(ax, "Earth-centred and topocentric", "flattening exaggerated; east points away")


def _on_ellipsoid(latitude: float) -> tuple[Array, Array]:
    """Return the drawn ellipsoid's point at a geodetic latitude, rad, and its normal."""
    up = np.array([np.cos(latitude), np.sin(latitude)])
    point = np.array([up[0], FLAT**2 * up[1]]) / np.hypot(up[0], FLAT * up[1])
    return point, up


def _heights(ax: Axes) -> None:
    """Draw ellipsoid, geoid and ground, and the heights between them at one place."""
    x = np.linspace(0, 1, 100)
    ellipsoid, geoid = 0.05 * np.sin(np.pi * x), 0.32 + 0.06 * np.sin(5 * x)
    ground = 0.8 + 0.1 * np.sin(7 * x) + 0.08 * np.sin(17 * x)
    maps.scene(ax, (-0.02, 1.3), (-0.12, 1.2))
    ax.set_aspect("auto")
    for y, name, colour in (
        (ellipsoid, "ellipsoid", style.BLUE),
        (geoid, "geoid", style.TEAL),
        (ground, "ground", style.INK),
    ):
        ax.plot(x, y, color=colour)
        ax.text(1.02, y[-1], name, color=colour, va="center")
    for k, low, high, name in (
        (30, ellipsoid, ground, "$h_e$"),
        (50, ellipsoid, geoid, "$N$"),
        (50, geoid, ground, "$h_0$"),
    ):
        maps.arrow(ax, np.array([x[k], low[k]]), np.array([x[k], high[k]]), style.SOFT)
        ax.text(x[k] + 0.02, (low[k] + high[k]) / 2, name, va="center")
    style.heading(ax, "Three surfaces, two heights", "not to scale")


def projection(scales: Mapping[float, tuple[Array, Array]], *, focal_mm: float) -> Figure:
    """Draw the scale of the map across a zone, and the directions of its meridians.

    Parameters
    ----------
    scales : mapping of float to tuple of ndarray
        By height over the ellipsoid, m: eastings, m, and map length per length on the ground.
    focal_mm : float
        For the second axis: the change of a focal length that map coordinates cause.
    """
    with style.applied():
        fig, (left, right) = style.subplots(1, 2, figsize=(style.WIDTH, 3.5), width_ratios=(1.4, 1))
        for (height, (east, scale)), colour in zip(
            scales.items(), (style.BLUE, style.ORANGE), strict=True
        ):
            left.plot(east / 1000, 1e6 * (scale - 1), color=colour, label=f"{height:.0f} m")
        left.axhline(0, color=style.INK, lw=0.8)
        left.axvline(example.PLACE_M[0] / 1000, color=style.SOFT, ls="--", lw=1.0)
        left.set(xlabel="east (km)", ylabel="map less ground (mm per km)")
        left.legend(title="height over ellipsoid", loc="upper center", fontsize=style.SMALL)
        focal_axis = left.secondary_yaxis(
            "right",
            functions=(lambda ppm: -ppm * focal_mm / 1000, lambda um: -um * 1000 / focal_mm),
        )
        focal_axis.set_ylabel(f"change of f = {focal_mm:.0f} mm (µm)")
        left.set_title("Scale")
        _graticule(right)
    return fig


def _graticule(ax: Axes) -> None:
    """Draw meridians and parallels of the zone in map coordinates, and the example's place."""
    grid = GridSystem(crs=example.CRS)
    latitudes, longitudes = np.linspace(-30.0, -20.0, 30), np.linspace(-54.0, -48.0, 30)
    for lon in range(-54, -47):
        line = grid.grid_from_lonlat(np.column_stack([np.full(30, lon), latitudes])) / 1000
        ax.plot(*line.T, color=style.TEAL, lw=1.6 if lon == -51 else 0.9)
    for lat in range(-30, -19, 2):
        line = grid.grid_from_lonlat(np.column_stack([longitudes, np.full(30, lat)])) / 1000
        ax.plot(*line.T, color=style.SOFT, lw=0.7)
    ax.plot(*np.array(example.PLACE_M) / 1000, "o", color=style.INK)
    ax.set(xlabel="east (km)", ylabel="north (km)", aspect="equal", title="Meridians")
    ax.grid(visible=True)
