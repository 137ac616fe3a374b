"""Figures of the chapters on rotations and frames: axes and angles, the Earth, a map projection."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from scipy.spatial.transform import Rotation

from acx4book.foundations import example
from acx4book.typesetting import maps, style
from acx4lib.expected import Array
from acx4lib.geometry.frames import (
    opk_jacobian,
    rotation_from_opk,
    rph_from_rotation,
    turn,
)
from acx4lib.geometry.geodesy import GridSystem

# --- turned axes, matrices mistaken for each other, phi near 90 degrees ----------------------


TIMES = 20
"""Factor by which omega and phi are drawn too large; in true size they would be invisible."""

COLOURS = (style.ORANGE, style.TEAL, style.PLUM)
"""Colours of the three angles."""


def axes() -> Figure:
    """Draw the body axes of A1 and B1 above the ground, omega and phi `TIMES` too large."""
    view = maps.view(18, 22)
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 3.4))
        ground = np.array([[-7.2, -3, 0], [8.6, -3, 0], [8.6, 4, 0], [-7.2, 4, 0]])
        ax.add_patch(Polygon(view.apply(ground)[:, :2], fc=style.PAPER, ec=style.LAND_EDGE, lw=1))
        corner = np.array([-6.2, -2.2, 0.0])
        maps.triad(ax, view, corner, 1.6 * np.eye(3), ("east", "north", "up"), maps.MAPPING)
        for row, east in ((0, -4.0), (2, 5.6)):
            place = np.array([east, 0.6, 4.2])
            _body(ax, view, place, example.attitudes()[row] * [TIMES, TIMES, 1])
            ax.plot(
                *view.apply([place, place * [1, 1, 0]])[:, :2].T, color=style.SOFT, lw=0.8, ls=":"
            )
            name = f"{example.EXPOSURES['image'][row]}, flown {'east' if row == 0 else 'west'}"
            maps.note(ax, view.apply(place)[:2], name, style.INK, shift=(44, -46))
        maps.blank(fig)
    return fig


def _body(ax: Axes, view: Rotation, place: Array, opk: Array) -> None:
    """Draw the axes of a body, and thin ones that point to the east, to the north and up."""
    for axis in 1.9 * np.eye(3):
        ax.plot(*view.apply([place, place + axis])[:, :2].T, color=maps.MAPPING, lw=1, ls="--")
    names = ("$x$ forward", "$y$ left", "$z$ up")
    maps.triad(ax, view, place, 2.1 * rotation_from_opk(opk).T, names, maps.BODY)


# --- mistakes --------------------------------------------------------------------------------


def mistaken(opk: Array) -> dict[str, Array]:
    """Return the matrices of omega, phi, kappa by three usual mistakes, in place of M^T.

    Parameters
    ----------
    opk : ndarray, shape (3,)
        Radians.

    Returns
    -------
    dict of str to ndarray, shape (3, 3)
        By the name of the mistake.
    """
    omega, phi, kappa = opk
    return {
        "transposed": rotation_from_opk(opk).T,
        "axes for vectors": turn(0, -omega) @ turn(1, -phi) @ turn(2, -kappa),
        "other order": turn(2, kappa) @ turn(1, phi) @ turn(0, omega),
    }


def mistakes(height_m: float) -> Figure:
    """Draw where the axes of A1 and of B1 meet the ground with each mistaken matrix."""
    with style.applied():
        fig, panels = style.subplots(1, 3, figsize=(style.WIDTH, 3.2), sharex=True, sharey=True)
        for row, colour in ((0, style.BLUE), (2, style.ORANGE)):
            opk, image = example.attitudes()[row], example.EXPOSURES["image"][row]
            R = rotation_from_opk(opk)
            for ax, (name, wrong) in zip(panels, mistaken(opk).items(), strict=True):
                ax.set(title=name, xlabel="to the east (m)", aspect="equal")
                _shift(ax, _nadir_shift(R, wrong, height_m), image, colour)
        panels[0].set(xlim=(-19, 19), ylim=(-17, 11), ylabel="to the north (m)")
    return fig


def _nadir_shift(R: Array, wrong: Array, height_m: float) -> Array:
    """Return the shift of the point below the axis by a wrong matrix, east and north, m."""
    right, false = (height_m * axis[:2, 2] / -axis[2, 2] for axis in (R, wrong))
    shift: Array = false - right
    return shift


def _shift(ax: Axes, shift: Array, image: str, colour: str) -> None:
    """Draw the shift of the point below an image's axis."""
    length = np.hypot(*shift)
    if long := length > 1:
        maps.arrow(ax, np.zeros(2), shift, colour)
    else:
        ax.plot(*shift, "o", color=colour, ms=7)
    text = f"{image}: {length:.1f} m"
    maps.note(ax, shift, text, colour, shift=(0, -10) if long else (10, 11))


# --- roll and pitch --------------------------------------------------------------------------


NED_ENU = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
FLU_FRD = np.diag([1, -1, -1])
"""North-east-down from east-north-up, and forward-left-up from forward-right-down."""


def headings() -> Figure:
    """Draw roll and pitch while kappa goes round and omega and phi stay those of A1."""
    kappa = np.linspace(-180, 180, 181)
    omega, phi, _ = example.attitudes()[0]
    opk = np.stack([omega + 0 * kappa, phi + 0 * kappa, np.radians(kappa)], axis=-1)
    roll, pitch, _ = np.degrees(rph_from_rotation(NED_ENU @ rotation_from_opk(opk) @ FLU_FRD)).T
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 2.8))
        ax.axhline(0, color=style.SOFT, lw=0.6)
        for angles, angle, name, colour in (
            (roll, omega, "roll", COLOURS[0]),
            (pitch, -phi, "pitch", COLOURS[1]),
        ):
            ax.plot(kappa, angles, color=colour, lw=2, label=name)
            symbol = "ω" if name == "roll" else "−φ"
            ax.axhline(np.degrees(angle), color=colour, lw=1, ls="--", label=symbol)
        for row in (0, 2):
            flown = np.degrees(example.attitudes()[row, 2])
            ax.axvline(flown, color=style.INK, lw=0.8, ls=":")
            strip = example.EXPOSURES["image"][row][0]
            ax.annotate(f"strip {strip}", (flown, -0.95), (-4, 0), textcoords="offset points",
                        ha="right", va="center")  # fmt: skip
        ax.set(xlim=(-180, 180), ylim=(-1.05, 1.05), xticks=range(-180, 181, 45))
        ax.set(xlabel="κ (deg)", ylabel="roll and pitch (deg)")
        style.legend_below(fig, ax.get_legend_handles_labels()[0], ncols=4)
    return fig


# --- phi near 90 degrees ---------------------------------------------------------------------


def singularity() -> Figure:
    """Draw the axes of the three turns at phi = 0, 60 and 90 degrees, and sigma of the angles."""
    with style.applied():
        fig = style.figure(figsize=(style.WIDTH, 5.0))
        panels = fig.subplot_mosaic("abc;ddd", height_ratios=(1.1, 1))
        for name, degrees in zip("abc", (0, 60, 90), strict=True):
            _turning(panels[name], np.radians(degrees))
            panels[name].set_title(f"φ = {degrees}°")
        _sigmas(panels["d"])
        for name in "abc":
            panels[name].set_aspect("equal")
            panels[name].axis("off")
    return fig


def _turning(ax: Axes, phi: float) -> None:
    view = maps.view(-18, 26)
    for axis, name, colour in zip(_turning_axes(phi), ("ω", "φ", "κ"), COLOURS, strict=True):
        ends = view.apply(np.array([-0.55, 1.0])[:, None] * axis)[:, :2]
        last = name == "κ"
        maps.arrow(ax, ends[0], ends[1], colour, width=3.2 if last else 1.8)
        maps.note(ax, ends[1], name, colour, shift=(-9 if last else 9, 9))
    ax.set(xlim=(-1.15, 1.15), ylim=(-0.85, 1.25))


def _turning_axes(phi: float) -> Array:
    """Return the axes about which omega, phi and kappa turn, rows, in the mapping frame."""
    return np.stack([np.eye(3)[0], np.eye(3)[1], turn(1, phi)[:, 2]])


def _sigmas(ax: Axes) -> None:
    degrees = np.linspace(0, 88, 177)
    sigma, correlation = _angle_sigmas(np.radians(degrees))
    ax.plot(degrees, sigma[:, 0], color=COLOURS[0], lw=2.4, label="σ of ω, the same as of κ")
    ax.plot(degrees, sigma[:, 1], color=COLOURS[1], label="σ of φ")
    ax.plot(degrees, correlation, color=style.INK, ls="--", label="correlation of ω and κ")
    ax.axhline(0, color=style.SOFT, lw=0.6)
    ax.set(xlim=(0, 90), ylim=(-1.3, 10), xlabel="φ (deg)", ylabel="σ over σ about an axis (1)")
    ax.legend(loc="upper left")


def _angle_sigmas(phi: Array) -> tuple[Array, Array]:
    """Return the sigma of the three angles of a camera with equal sigma about all its axes."""
    J = opk_jacobian(np.stack([0 * phi, phi, 0 * phi], axis=-1))
    cov = J @ np.swapaxes(J, -1, -2)
    sigma = np.sqrt(np.diagonal(cov, axis1=-2, axis2=-1))
    return sigma, cov[:, 0, 2] / (sigma[:, 0] * sigma[:, 2])


# --- the Earth, its heights, and a map projection --------------------------------------------


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
