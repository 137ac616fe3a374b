"""Figures of chapter 1: the ray and its similar triangles, and the pixel origin of programs."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle

from acx4book.typesetting import maps, style

F, H, TO_A = 2.1, 6.0, 3.4
"""Focal length, height, and the distance of A from the axis, as they are drawn."""


def ray() -> Figure:
    """Draw a section through a camera: perspective centre, image, ray, and ground."""
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 4.6))
        to_a = TO_A * F / H
        for run, drop, tint in ((TO_A, H, style.LAND), (to_a, F, style.SHEET)):
            corners = np.array([[0, 0], [0, -drop], [run, -drop]])
            ax.add_patch(Polygon(corners, fc=tint, ec="none", zorder=0))
        ax.plot([-1.6, 1.9], [-F, -F], color=maps.CAMERA, lw=4, solid_capstyle="butt")
        ax.plot([-4.6, 4.9], [-H, -H], color=maps.MAPPING, lw=2)
        ax.plot([0, 0], [0, -H], color=style.SOFT, lw=1, ls="--")
        ax.plot([0, TO_A], [0, -H], color=maps.RAY, lw=2)
        _points(ax, to_a)
        _lengths(ax, to_a)
        ax.set(xlim=(-4.8, 5.1), ylim=(-6.9, 0.7))
        maps.blank(fig)
    return fig


def _points(ax: Axes, to_a: float) -> None:
    named = (
        ((0, 0), "perspective centre", style.INK, (66, 4)),
        ((0, -F), "principal point", maps.CAMERA, (-56, -12)),
        ((to_a, -F), "image point $a$", maps.RAY, (58, 10)),
        ((TO_A, -H), "point $A$", maps.RAY, (34, 10)),
    )
    for place, name, colour, shift in named:
        ax.plot(*place, "o", color=colour, ms=6, zorder=5)
        maps.note(ax, np.array(place), name, colour, shift=shift)
    maps.note(ax, np.array([-1.6, -F]), "image", maps.CAMERA, shift=(-24, 0))
    maps.note(ax, np.array([-4.0, -H]), "ground", maps.MAPPING, shift=(0, 11))


def _lengths(ax: Axes, to_a: float) -> None:
    """Draw the four sides of the two triangles beside them."""
    sides = (
        ((-0.35, 0), (-0.35, -F), "$f$", (-10, 0)),
        ((-2.9, 0), (-2.9, -H), "$H$", (-10, 0)),
        ((0, -F - 0.35), (to_a, -F - 0.35), "$x - x_p$", (0, -11)),
        ((0, -H - 0.35), (TO_A, -H - 0.35), "$(x - x_p)\\,H / f$", (0, -12)),
    )
    for start, end, name, shift in sides:
        arrow = {"arrowstyle": "<|-|>", "color": style.INK, "lw": 1, "shrinkA": 0, "shrinkB": 0}
        ax.annotate("", xy=end, xytext=start, arrowprops=arrow)
        middle = 0.5 * (np.array(start) + np.array(end))
        maps.note(ax, middle, name, style.INK, shift=shift)
    ax.plot([-2.9, 0], [0, 0], color=style.SOFT, lw=0.7, ls=":")


def first_pixels() -> Figure:
    """Draw the corner of an image with (0, 0) at a pixel's centre, and at its corner."""
    with style.applied():
        fig, panels = style.subplots(1, 2, figsize=(style.WIDTH, 2.9))
        for ax, origin, place in zip(panels, (0.5, 0.0), ("centre", "corner"), strict=True):
            for column, row in np.ndindex(4, 3):
                ax.add_patch(Rectangle((column, row), 1, 1, fc="none", ec=style.SOFT, lw=0.8))
            start = np.array([origin, origin])
            for name, tip, shift in (
                ("col", (4.5, origin), (14, 0)),
                ("row", (origin, 3.5), (0, -9)),
            ):
                maps.arrow(ax, start, np.array(tip), maps.CAMERA)
                maps.note(ax, np.array(tip), name, maps.CAMERA, shift=shift)
            target = np.array([2.5, 1.5])
            ax.plot(*target, "+", color=maps.RAY, ms=11, mew=2)
            text = "({:g}, {:g})".format(*(target - start))
            maps.note(ax, target, text, maps.RAY, shift=(2, 13))
            ax.set(xlim=(-0.3, 5.0), ylim=(3.8, -0.4))
            ax.set_title(f"(0, 0) at the {place} of the first pixel")
        maps.blank(fig)
    return fig
