"""Figures of the chapter on direct georeferencing.

The strips of the example have one colour each, and so have the position, the lever arm and the
boresight.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from acx4book.foundations.drawings.collinearity import STRIPS
from acx4book.typesetting import maps, style
from acx4lib.expected import Array

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
