"""Figures of flown strips: collinearity, direct georeferencing and block design.

Each strip has one colour, and so have the position, the lever arm and the boresight.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from acx4book.foundations import example
from acx4book.foundations.designs import CONTROL_M, Line
from acx4book.typesetting import maps, matrix, style
from acx4lib.expected import Array

# --- differences in the image and on the ground, and effects of a camera ---------------------


STRIPS = {"A": style.BLUE, "B": style.ORANGE}
"""The colour of each strip."""

NAMES = {"A": "strip A, flown east", "B": "strip B, flown west"}

KINDS = {"turn": style.BLUE, "shift": style.TEAL, "focal": style.PLUM}
"""The colour of each kind of change."""

DEGREES, METRES, FOCAL_MM = 0.1, 1.0, 0.1
"""Turn (°) and shift (m) of the camera, and change of f (mm), in the figure of effects."""

LOOK_ALIKE_MM = 0.02
"""Length drawn as one millimetre of the image in the figure of look-alikes, mm."""


# --- differences -----------------------------------------------------------------------------


def differences(d_xy: Array, R_m_c: Array) -> Figure:
    """Draw the differences of the eight measured points in the image, and on the ground.

    Parameters
    ----------
    d_xy : ndarray, shape (4, 2, 2)
        Measured minus computed, mm: image, point, x and y.
    R_m_c : ndarray, shape (4, 3, 3)
    """
    height = example.positions()[:, None, 2] - example.points()[:, 2]
    in_camera = np.concatenate([d_xy, np.zeros((4, 2, 1))], axis=-1)
    d_m = np.einsum("nij,npj->npi", R_m_c, in_camera)[..., :2] * height[..., None] / example.F_MM
    with style.applied():
        fig, (image, ground) = style.subplots(1, 2, figsize=(style.WIDTH, 3.9))
        for i, strip in enumerate("AABB"):
            look = {"color": STRIPS[strip], "width": 0.008, "angles": "xy", "scale_units": "xy"}
            image.quiver(*example.measured()[i].T, *d_xy[i].T, scale=1 / 16, **look)
            ground.quiver(*example.points()[:, :2].T, *d_m[i].T, scale=1 / 16, **look)
        _sensor(image)
        image.set(xlabel="x (mm)", ylabel="y (mm)")
        ground.set(xlim=(-110, 110), ylim=(-165, 165), aspect="equal")
        ground.set(xlabel="east (m)", ylabel="north (m)")
        for name, place in zip(example.CONTROL["point"], example.points(), strict=True):
            ground.annotate(
                name, place[:2], (-13, 5), textcoords="offset points", fontsize=10, weight="bold"
            )
        style.heading(image, "In the image", "measured minus computed, 16 times as long")
        style.heading(ground, "On the ground", "the same, projected down; 16 times as long")
        handles = [Line2D([], [], color=STRIPS[s], lw=2, label=NAMES[s]) for s in STRIPS]
        style.legend_below(fig, handles)
    return fig


def _sensor(ax: Axes) -> None:
    """Give axes the format of the example's camera."""
    half = 0.5 * example.PIXEL_MM * np.array([example.WIDTH_PX, example.HEIGHT_PX])
    ax.set(xlim=(-half[0], half[0]), ylim=(-half[1], half[1]), aspect="equal")


# --- effects of the camera on the image -------------------------------------------------------


def grid(columns: int = 9, rows: int = 7) -> Array:
    """Return points spread over the example's image, shape (n, 2), mm."""
    half = 0.45 * example.PIXEL_MM * np.array([example.WIDTH_PX, example.HEIGHT_PX])
    x, y = np.linspace(-half[0], half[0], columns), np.linspace(-half[1], half[1], rows)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def by_turn(xy: Array) -> Array:
    """Return the derivatives of image points by a turn about the camera's axes.

    Parameters
    ----------
    xy : ndarray, shape (n, 2)
        mm from the principal point.

    Returns
    -------
    ndarray, shape (n, 2, 3)
        mm per radian.
    """
    f, (x, y) = example.F_MM, xy.T
    rows = [[-x * y / f, f + x * x / f, y], [-(f + y * y / f), x * y / f, -x]]
    return np.moveaxis(np.array(rows), -1, 0)


def effects(xy: Array, height_m: float) -> dict[str, Array]:
    """Return the effects of small changes of a camera on image points, each (n, 2), mm, by name."""
    turn = np.radians(DEGREES) * by_turn(xy)
    shift = METRES * _by_shift(xy, height_m)
    return {
        "turn about y": turn[:, :, 1],
        "turn about x": turn[:, :, 0],
        "focal length": FOCAL_MM * xy / example.F_MM,
        "turn about z": turn[:, :, 2],
        "shift along −x": -shift[:, :, 0],
        "shift along y": shift[:, :, 1],
        "shift along −z": -shift[:, :, 2],
    }


def _by_shift(xy: Array, height_m: float) -> Array:
    """Return the derivatives by a shift along the camera's axes, over flat ground."""
    f, (x, y) = example.F_MM, xy.T
    rows = [[f + 0 * x, 0 * x, x], [0 * y, f + 0 * y, y]]
    return -np.moveaxis(np.array(rows), -1, 0) / height_m


def columns(height_m: float) -> Figure:
    """Draw the columns of the Jacobian as arrows over the image, look-alikes below each other."""
    xy = grid()
    fields: Mapping[str, Array] = effects(xy, height_m)
    with style.applied():
        fig, panels = style.subplots(2, 4, figsize=(style.WIDTH, 3.3), sharex=True, sharey=True)
        for ax, (name, d) in zip(panels.flat, fields.items(), strict=False):
            longest = np.hypot(*d.T).max()
            _field(ax, xy, d * 5.5 / longest, KINDS[name.split()[0]])
            style.heading(ax, name, f"longest {1000 * longest:.0f} µm")
        panels[1, 3].set_visible(False)
    return fig


def _field(ax: Axes, xy: Array, d: Array, colour: str) -> None:
    """Draw arrows of lengths in mm over the image."""
    ax.quiver(
        xy[:, 0], xy[:, 1], d[:, 0], d[:, 1],
        color=colour, width=0.011, angles="xy", scale_units="xy", scale=1,
    )  # fmt: skip
    _sensor(ax)
    ax.set(xticks=[], yticks=[])
    ax.grid(visible=False)


def look_alike(height_m: float) -> Figure:
    """Draw a turn about y, the most similar shift along -x, and their difference."""
    xy = grid()
    fields = effects(xy, height_m)
    turn, shift = fields["turn about y"], fields["shift along −x"]
    factor = float(np.sum(turn * shift) / np.sum(shift * shift))
    residual = turn - factor * shift
    drawn = (
        (f"{DEGREES}° about y", turn, 1, KINDS["turn"]),
        (f"{factor * METRES:.2f} m along −x", factor * shift, 1, KINDS["shift"]),
        ("what is left", residual, 5, style.BRICK),
    )
    with style.applied():
        fig, panels = style.subplots(1, 3, figsize=(style.WIDTH, 2.4))
        for ax, (name, d, times, colour) in zip(panels, drawn, strict=True):
            _field(ax, xy, times * d / LOOK_ALIKE_MM, colour)
            rms = 1000 * np.sqrt(np.mean(np.sum(d * d, axis=1)))
            longer = f", drawn {times} times longer" if times > 1 else ""
            style.heading(ax, name, f"RMS {rms:.0f} µm{longer}")
    return fig


# --- direct georeferencing -------------------------------------------------------------------


POSITION, LEVER_ARM, BORESIGHT = maps.BODY, style.TEAL, maps.RAY


def vector_sum() -> Figure:
    """Draw eq. (14) from the side: three vectors from the origin to a point on the ground."""
    m, b, c, i = (np.array(x) for x in ([0.3, 0.0], [4.6, 4.1], [5.5, 3.5], [7.6, 0.35]))
    a = c + 0.27 * (i - c)
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 3.6))
        maps.scene(ax, (-0.6, 10.4), (-0.7, 5.0))
        ground = np.linspace(-0.4, 10.2, 60)
        ax.plot(ground, 0.17 * np.sin(ground / 1.6) + 0.17 * ground / 7.6, color=style.SOFT)
        for tip in ([1.2, 0.0], [0.0, 1.2]):
            maps.arrow(ax, m, m + tip, style.INK)
        across = np.array([i - c, [-(i - c)[1], (i - c)[0]]]) / np.hypot(*(i - c))
        ax.plot(*(a + 0.8 * np.outer([-1, 1], across[1])).T, color=style.INK, lw=2.2)
        maps.arrow(ax, m, b, POSITION)
        maps.arrow(ax, b, c, LEVER_ARM)
        maps.arrow(ax, c, i, BORESIGHT)
        ax.plot(*np.stack([b, c, a, i]).T, "o", color=style.INK)
        for place, beside, text, colour in (
            (m, (0.1, -0.45), "mapping frame $m$", style.INK),
            (b, (-0.15, 0.3), "IMU, $b$", style.INK),
            (c, (0.25, 0.25), "perspective centre, $c$", style.INK),
            (a, (0.8, 0.35), "image point $a$", style.INK),
            (i, (-0.3, -0.55), "ground point $i$", style.INK),
            ((m + b) / 2, (-1.5, 0.25), r"$r_b^m$: GNSS", POSITION),
            ((b + c) / 2, (-0.75, -0.5), r"$R_b^m r_c^b$", LEVER_ARM),
            ((a + i) / 2, (0.35, 0.0), r"$\lambda\, R_b^m R_c^b\, r_i^c$", BORESIGHT),
        ):
            x, y = place + np.array(beside)
            ax.text(x, y, text, color=colour, fontsize=9.0)
    return fig


def ground_errors(
    *, height_m: float, half_m: tuple[float, float], position_m: Array, attitude_rad: Array
) -> Figure:
    """Draw the effect of one standard deviation of each observation on the points of an image.

    Parameters
    ----------
    height_m : float
        Of a camera that looks straight down, over flat ground.
    half_m : tuple of float
        Half of the footprint, forward and left.
    position_m, attitude_rad : ndarray, shape (3,)
        Errors forward, left and up, and about these axes.
    """
    forward, left = (h * np.linspace(-1, 1, 5) for h in half_m)
    points = np.stack([x.ravel() for x in np.meshgrid(forward, left)], axis=-1)
    kinds = [("position forward", 0), ("height", 2), ("roll", 3), ("pitch", 4), ("heading", 5)]
    errors = np.diag(np.concatenate([position_m, attitude_rad]))
    with style.applied():
        fig, axes = style.subplots(2, 3, figsize=(style.WIDTH, 4.1))
        for ax, (title, row) in zip(axes.flat, kinds, strict=False):
            d = moved_on_ground(points, height_m, errors[row, :3], errors[row, 3:])
            _arrows(ax, points, d, half_m, colour=POSITION if row < 3 else BORESIGHT)
            longest = 100 * np.hypot(*d.T).max()
            style.heading(ax, title, f"at most {longest:.1f} cm")
        _legend(axes.flat[-1])
    return fig


def moved_on_ground(at: Array, height_m: float, shift_m: Array, turned: Array) -> Array:
    """Return the shifts of points of flat ground by errors of position and attitude, m, (n, 2).

    Parameters
    ----------
    at : ndarray, shape (n, 2)
        Points forward and left of the camera, which looks straight down.
    height_m : float
        Of the camera over the ground.
    shift_m, turned : ndarray, shape (3,)
        Error of the position forward, left and up, m; small rotation about these axes, rad.
    """
    ray = np.column_stack([at, np.full(len(at), -height_m)])
    d: Array = np.cross(turned, ray) + shift_m
    return d[:, :2] + ray[:, :2] * d[:, 2:] / height_m


def misclosures(xy_mm: Array, before_um: Array, after_um: Array) -> Figure:
    """Draw observed minus computed image points without and with the calibrated boresight.

    Parameters
    ----------
    xy_mm : ndarray, shape (8, 2)
        Image points of the example, two for every image.
    before_um, after_um : ndarray, shape (8, 2)
        Micrometres; they are drawn to different scales.
    """
    with style.applied():
        fig, axes = style.subplots(1, 2, figsize=(style.WIDTH, 3.2), sharey=True)
        for ax, d, title in zip(
            axes, (before_um, after_um), ("boresight zero", "boresight calibrated"), strict=True
        ):
            longest = float(np.hypot(*d.T).max())
            length = style.round_length(longest)
            for strip, rows in (("A", slice(0, 4)), ("B", slice(4, 8))):
                _quiver(ax, xy_mm[rows], d[rows] * 7.0 / longest, STRIPS[strip], f"strip {strip}")
            _quiver(
                ax, np.array([[-18.0, -17.5]]), np.array([[length * 7 / longest, 0]]), style.INK, ""
            )
            ax.text(-18 + 7 * length / longest + 1, -17.5, f"{length:g} µm", va="center")
            ax.set(xlim=(-20, 20), ylim=(-20, 15), aspect="equal", xlabel="$x$ (mm)", title=title)
        axes[0].set_ylabel("$y$ (mm)")
        style.legend_below(fig, axes[0].get_legend_handles_labels()[0][:2])
    return fig


def three_flights() -> Figure:
    """Draw from the side how a forgotten boresight, lever arm or GNSS shift misdirects the ray.

    Each of them on a line flown forth, one flown back, and one flown forth twice as high.
    """
    with style.applied():
        fig, axes = style.subplots(3, 1, figsize=(style.WIDTH, 6.3), sharex=True)
        for ax, title, subtitle, colour in zip(
            axes,
            ("boresight", "lever arm", "GNSS shift"),
            (
                "turns with the aircraft, grows with the height",
                "turns with the aircraft, the same at any height",
                "does not turn, the same at any height",
            ),
            (BORESIGHT, LEVER_ARM, POSITION),
            strict=True,
        ):
            maps.scene(ax, (-0.6, 9.6), (-0.35, 2.6))
            ax.axhline(0, color=style.SOFT, lw=1.0)
            for start, way, height in ((1.5, 1, 1.0), (4.5, -1, 1.0), (7.5, 1, 2.0)):
                _flown(ax, start, way, height, title, colour)
            style.heading(ax, title, subtitle)
    return fig


def _flown(ax: Axes, at: float, way: int, height: float, kind: str, colour: str) -> None:
    start, end = (at + d for d in _missed(kind, way, height))
    ax.plot([at, at], [height, 0], color=style.SOFT, ls="--", lw=1.0)
    ax.plot([start, end], [height, 0], color=colour, lw=1.6)
    ax.plot(at, 0, "^", color=style.INK)
    maps.arrow(ax, np.array([at, -0.2]), np.array([end, -0.2]), colour)
    maps.arrow(
        ax, np.array([at - 0.6 * way, height]), np.array([at + 0.6 * way, height]), style.INK
    )
    ax.text(at, height + 0.13, "flown " + ("forth" if way > 0 else "back"), ha="center")


def _missed(kind: str, way: int, height: float) -> tuple[float, float]:
    """Return the errors of the ray at its start and on the ground, in drawing units."""
    if kind == "boresight":
        return 0.0, 0.5 * way * height
    shift = 0.5 * way if kind == "lever arm" else 0.5
    return shift, shift


# --- small parts -----------------------------------------------------------------------------


def _quiver(ax: Axes, points: Array, d: Array, colour: str, label: str) -> None:
    scale: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.008}
    ax.quiver(*points.T, *d.T, color=colour, label=label, **scale)


EXAGGERATED = 1200.0
"""Factor by which `ground_errors` draws displacements too long."""


def _arrows(ax: Axes, points: Array, d: Array, half_m: tuple[float, float], *, colour: str) -> None:
    """Draw displacements over a footprint; forward is to the right."""
    maps.scene(ax, (-1.45 * half_m[0], 1.45 * half_m[0]), (-1.3 * half_m[1], 1.3 * half_m[1]))
    x, y = half_m
    ax.plot([-x, x, x, -x, -x], [-y, -y, y, y, -y], color=style.SOFT, lw=0.8)
    _quiver(ax, points, EXAGGERATED * d, colour, "")


def _legend(ax: Axes) -> None:
    """Draw the scale of `ground_errors` and the direction of flight."""
    maps.scene(ax, (-280.0, 280.0), (-190.0, 190.0))
    length = 0.05 * EXAGGERATED
    for y, text in ((60.0, "5 cm on the ground"), (-40.0, "flight")):
        maps.arrow(ax, np.array([-150.0, y]), np.array([-150.0 + length, y]), style.INK)
        ax.text(-70.0, y, text, va="center")


# --- block design: planned lines, correlations, the second height ----------------------------


DIRECTIONS = {90.0: style.BLUE, 270.0: style.ORANGE, 0.0: style.TEAL, 180.0: style.PLUM}
"""Colours of lines by their azimuth."""

ASIDE_M = 22.0
"""Lines are drawn this far left of their direction, so that opposite ones do not coincide."""

READABLE = 0.3
"""Smallest correlation whose number is written."""


def plans(designs: Mapping[str, Sequence[Line]]) -> Figure:
    """Draw the lines of designs, the footprints of their middle images, and the control points."""
    with style.applied():
        fig, axes = style.subplots(
            1, len(designs), figsize=(style.WIDTH, 2.1), sharex=True, sharey=True
        )
        for ax, (name, lines) in zip(axes, designs.items(), strict=True):
            style.bare(ax)
            ax.set(title=name, aspect="equal", xticks=[], yticks=[], xlim=(-430, 430))
            ax.set(ylim=(-320, 320), facecolor="none")
            for line in lines:
                _line(ax, line, lowest=min(each.height_m for each in lines))
            ax.plot(*np.transpose(CONTROL_M), "D", color=style.INK, mfc="none", ms=4)
    return fig


def _line(ax: Axes, line: Line, *, lowest: float) -> None:
    """Draw one line; a higher one is dashed."""
    azimuth = np.radians(line.azimuth_deg)
    forward = np.array([np.sin(azimuth), np.cos(azimuth)])
    left = np.array([-forward[1], forward[0]])
    colour, high = DIRECTIONS[line.azimuth_deg], line.height_m > lowest
    half = 0.5 * line.base_m * (line.n - 1) * forward
    middle = (ASIDE_M + (2 * ASIDE_M if high else 0.0)) * left
    arrow = {
        "arrowstyle": "-|>",
        "color": colour,
        "lw": 1.6,
        "ls": "--" if high else "-",
        "shrinkA": 0,
        "shrinkB": 0,
    }
    ax.annotate("", xy=tuple(middle + half), xytext=tuple(middle - half), arrowprops=arrow)
    ax.plot(*_footprint(line).T, color=colour, lw=0.7, ls="--" if high else "-")


def _footprint(line: Line) -> Array:
    """Return the corners of the middle image on flat ground, east and north, m, shape (5, 2)."""
    azimuth = np.radians(line.azimuth_deg)
    forward = np.array([np.sin(azimuth), np.cos(azimuth)])
    left = np.array([-forward[1], forward[0]])
    half = 0.5 * example.PIXEL_MM * line.height_m / example.F_MM
    x, y = half * example.WIDTH_PX, half * example.HEIGHT_PX
    corners = np.array([[x, y], [-x, y], [-x, -y], [x, -y], [x, y]])
    return corners @ np.array([forward, left])


def correlations(designs: Mapping[str, pd.DataFrame]) -> Figure:
    """Draw correlation matrices side by side, with numbers where they are `READABLE` or more.

    Parameters
    ----------
    designs : mapping of str to DataFrame
        By the name of the design: square, with the same names.
    """
    with style.applied():
        fig, axes = style.subplots(1, len(designs), figsize=(style.WIDTH, 4.0), sharey=True)
        for ax, (title, table) in zip(axes, designs.items(), strict=True):
            names = [str(name).partition(",")[0] for name in table.index]
            _matrix(ax, table.to_numpy(), names)
            ax.set_title(title)
        matrix.scale(fig, axes, location="bottom", shrink=0.5, aspect=24)
    return fig


def _matrix(ax: Axes, values: Array, names: Sequence[str]) -> None:
    n = len(names)
    matrix.signed_cells(ax, values)
    ax.set_xticks(np.arange(n) + 0.5, names, rotation=90)
    ax.set_yticks(np.arange(n) + 0.5, names)
    for i, j in zip(*np.nonzero(np.abs(values) >= READABLE), strict=True):
        if i != j:
            shown = f"{values[i, j]:.2f}".replace("0.", ".").replace("1.00", "1.0")
            matrix.write(ax, i, j, values[i, j], shown)


def against_ratio(table: pd.DataFrame) -> Figure:
    """Draw standard deviations against the ratio of two flying heights, on logarithmic scales.

    Parameters
    ----------
    table : DataFrame
        A row for each unknown, named with its unit; columns are the ratios.
    """
    groups = (("lever x, m", "lever y, m", "lever z, m"), ("xp, mm", "yp, mm", "f, mm"))
    with style.applied():
        fig, axes = style.subplots(1, 2, figsize=(style.WIDTH, 3.0))
        for ax, names in zip(axes, groups, strict=True):
            for name, colour in zip(names, (style.BLUE, style.ORANGE, style.TEAL), strict=True):
                label, unit = name.split(", ")
                ax.plot(table.columns, table.loc[name], "o-", color=colour, label=label)
            ax.set(yscale="log", xlabel="second height over first", ylabel=f"σ ({unit})")
            ax.legend()
    return fig
