"""Figures of chapters 1 and 4: the ray, pixel origins of programs, and distortion of lenses."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon, Rectangle
from matplotlib.ticker import FuncFormatter

from acx4book.paper import printed
from acx4book.typesetting import maps, style
from acx4lib.expected import Array
from acx4lib.geometry.camera import Interior, distortion

# --- the ray, and pixels ---------------------------------------------------------------------


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


# --- distortion of Table 1's lenses, and errors where programs misread it --------------------


UM = 1000.0
"""Micrometres in a millimetre."""


def _radial(interior: Interior, r: Array) -> Array:
    """Return the radial distortion at radii around the principal point, eqs (7)-(8), mm."""
    return r**3 * (interior.k1 + r**2 * (interior.k2 + r**2 * interior.k3))


def border(column: str) -> float:
    """Return the distance of an image's corners from its middle, mm."""
    return float(np.linalg.norm(printed.corners(column)[0]))


def curves() -> Figure:
    """Draw the radial distortion of the four heads of Table 1, with the paper's border value."""
    pixel = UM * printed.pixel_mm("CAM1")
    r = np.linspace(0, border("CAM1"), 120)
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 3.3))
        for head, colour in zip(printed.HEADS, style.PALETTE, strict=False):
            values = UM * _radial(printed.interior(1, head), r)
            ax.plot(r, values, color=colour, label=head)
        border_um = pixel * printed.statement("head_border_distortion_px")
        place = [border("CAM1")], [border_um]
        ax.plot(*place, "D", color=style.PRINTED, mfc="none", ms=7, label="as printed")
        ax.set(xlabel="radius (mm)", ylabel="radial distortion (µm)", ylim=(0, 110))
        ax.set_xlim(0, 35)
        to_px, to_um = partial(np.multiply, 1 / pixel), partial(np.multiply, pixel)
        beside = ax.secondary_yaxis("right", functions=(to_px, to_um))
        beside.set_ylabel("pixels (px)")
        ax.legend(loc="upper left")
    return fig


# --- vectors ---------------------------------------------------------------------------------


def grid(head: str, columns: int = 11, rows: int = 9) -> Array:
    """Return points spread over the image of a head, shape (n, 2), mm."""
    half = 0.95 * printed.corners(head)[0]
    x, y = np.linspace(-half[0], half[0], columns), np.linspace(-half[1], half[1], rows)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def vectors(head: str) -> Figure:
    """Draw the distortion of a head over its image: all of it, and the decentring part alone.

    Parameters
    ----------
    head : str
        One of the heads of Table 1.
    """
    lens = printed.interior(1, head)
    decentring = Interior(f=lens.f, xp=lens.xp, yp=lens.yp, p1=lens.p1, p2=lens.p2)
    with style.applied():
        fig, (left, right) = style.subplots(1, 2, figsize=(style.WIDTH, 3.2), sharey=True)
        _field(left, head, lens, times=80, colour=style.BLUE)
        _field(right, head, decentring, times=300, colour=style.PLUM)
        style.heading(left, f"{head}, as in the paper", "distortion, 80 times as long")
        style.heading(right, "decentring alone", "300 times as long; dashed: its axis")
        along = np.array([lens.p1, lens.p2]) / np.hypot(lens.p1, lens.p2)
        ends = np.outer([-20, 20], along)
        right.plot(ends[:, 0], ends[:, 1], color=style.INK, ls="--", lw=1.2)
        left.set_ylabel("y (mm)")
    return fig


def _field(ax: Axes, head: str, interior: Interior, *, times: float, colour: str) -> None:
    """Draw the distortion as arrows from the ideal to the measured point."""
    xy, half = grid(head), printed.corners(head)[0]
    d = times * distortion(interior, xy)
    ideal = xy - d
    ax.quiver(
        ideal[:, 0], ideal[:, 1], d[:, 0], d[:, 1],
        color=colour, width=0.006, angles="xy", scale_units="xy", scale=1,
    )  # fmt: skip
    ax.set(xlim=(-half[0], half[0]), ylim=(-half[1], half[1]), aspect="equal", xlabel="x (mm)")
    ax.grid(visible=False)


# --- the same rays, other numbers ------------------------------------------------------------


def balance(k1: float, far: float) -> float:
    """Return the change of scale that makes the largest distortion of a cubic smallest.

    The curve ``k1 r^3 - e r`` has its extremes equal for ``e = 3/4 k1 far^2``, as in
    Chebyshev's polynomial, and they are a quarter of ``k1 far^3``.

    Parameters
    ----------
    k1 : float
        mm^-2.
    far : float
        Largest radius, mm.
    """
    return 0.75 * k1 * far**2


def balanced(head: str) -> Figure:
    """Draw a head's distortion for the f of Table 1, and for the f that balances it."""
    lens, far = printed.interior(1, head), border(head)
    scale = balance(lens.k1, far)
    r = np.linspace(0, far, 120)
    change = _radial(lens, r)
    other = r - (1 + scale) * (r - change)
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 3.0))
        ax.axhline(0, color=style.SOFT, lw=0.8)
        ax.plot(r, UM * change, color=style.BLUE, label=f"f = {lens.f:.3f} mm")
        ax.plot(r, UM * other, color=style.ORANGE, label=f"f = {lens.f * (1 + scale):.3f} mm")
        ax.set(xlabel="radius (mm)", ylabel="radial distortion (µm)", xlim=(0, far))
        ax.legend(loc="upper left")
    return fig


LABELS = {
    "sign": "other sign",
    "direction": "at the ideal point",
    "direction, two terms": "at the ideal point, $k_2$ converted too",
}
"""Names of the mistakes in the figure."""


def directions(head: str) -> Figure:
    """Draw the errors of a k1 evaluated at the ideal point, for a head and a strong lens."""
    pixel, k1 = printed.pixel_mm(head), printed.interior(1, head).k1
    r = np.linspace(4, border(head), 100)
    colours = (style.BRICK, style.BLUE, style.TEAL)
    with style.applied():
        fig, panels = style.subplots(1, 2, figsize=(style.WIDTH, 3.5), sharey=True)
        for ax, times in zip(panels, (1, 10), strict=True):
            errors = _mistaken(times * k1, r)
            for (name, error), colour in zip(errors.items(), colours, strict=True):
                ax.semilogy(r, np.abs(error) / pixel, color=colour, label=LABELS[name])
            ax.axhline(0.1, color=style.INK, lw=0.8, ls=":")
            ax.set_xlabel("radius (mm)")
            ax.set_title(head if times == 1 else f"a lens {times} times as strong")
            ax.yaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        panels[0].set(ylabel="error (px)", ylim=(1e-4, 1e3))
        style.legend_below(fig, panels[0].get_legend_handles_labels()[0], ncols=3)
    return fig


def _mistaken(k1: float, r: Array) -> dict[str, Array]:
    """Return the errors of an image point where another program misreads a k1, mm."""
    measured = r.copy()
    for _ in range(50):
        measured = r + k1 * measured**3
    return {
        "sign": measured - (r - k1 * r**3),
        "direction": measured - (r + k1 * r**3),
        "direction, two terms": measured - (r + k1 * r**3 + 3 * k1**2 * r**5),
    }


def terms(method: str) -> Figure:
    """Draw the three radial terms of Table 3 and their sum over the synthetic image.

    Parameters
    ----------
    method : str
        A column of Table 3.
    """
    lens, far = printed.interior(3, method), border("SYN")
    r = np.linspace(0, far, 120)
    parts = {
        "$k_1 r^3$": lens.k1 * r**3,
        "$k_2 r^5$": lens.k2 * r**5,
        "$k_3 r^7$": lens.k3 * r**7,
    }
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 3.2))
        ax.axhline(0, color=style.SOFT, lw=0.8)
        for (name, values), colour in zip(parts.items(), style.PALETTE, strict=False):
            ax.plot(r, UM * values, color=colour, label=name)
        ax.plot(r, UM * _radial(lens, r), color=style.INK, lw=2.4, label="their sum")
        ax.set(xlabel="radius (mm)", ylabel="radial distortion (µm)", xlim=(0, far))
        ax.legend(loc="upper left", ncols=2)
    return fig
