"""Figures of chapter 4: distortion of Table 1's lenses, and errors where programs misread it."""

from __future__ import annotations

from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter

from acx4book.paper import printed
from acx4book.typesetting import style
from acx4lib.expected import Array
from acx4lib.geometry.camera import Interior, distortion

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
