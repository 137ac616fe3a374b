"""Figures of the rig: the heads together beside the heads one by one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle

from acx4book.chapters.beyond.rig.deformations import Deformation
from acx4book.typesetting import matrix, style
from acx4book.typesetting.labels import LABELS
from acx4book.typesetting.plain_text import Markup
from acx4lib.attempts import Failed
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import Camera, xy_from_colrow
from acx4lib.least_squares.covariance import correlation
from acx4lib.results.files.schemas import RELATIVE

NO_OTHERS = "The heads are oriented in no other way."
FACTORS = (1, 2, 3, 5, 10, 20, 30, 50, 100, 200, 500)


def gains(before: RelativeOrientation, after: RelativeOrientation) -> Array:
    """Return how many times smaller the standard deviations become, shape (n_heads, 6).

    NaN where one of them is zero: Zc of the first head, where its focal length is held.
    """
    fixed = (before.sigma == 0) | (after.sigma == 0)
    return np.where(fixed, np.nan, before.sigma / np.where(fixed, 1.0, after.sigma))


def median_gains(
    before: RelativeOrientation | Failed, after: RelativeOrientation
) -> dict[Markup, float]:
    """Return the medians of gains by kinds of parameters; empty for a way that failed."""
    if isinstance(before, Failed):
        return {}
    found = gains(before, after)
    parts = {"$X_c$ and $Y_c$": slice(0, 2), "$Z_c$": slice(2, 3), "the angles": slice(3, 6)}
    return {Markup(name): float(np.nanmedian(found[:, part])) for name, part in parts.items()}


def rig_gains(
    others: Mapping[str, RelativeOrientation | Failed], rig: RelativeOrientation
) -> Figure:
    """Draw how many times smaller the rig's standard deviations are, parameter by parameter.

    Parameters
    ----------
    others : mapping of str to RelativeOrientation or Failed
        Other ways to orient the heads, by their titles; a way that failed is left out.
    rig : RelativeOrientation
    """
    found = {title: one for title, one in others.items() if not isinstance(one, Failed)}
    if not found:
        return style.nothing(NO_OTHERS)
    with style.applied():
        fig, axes = style.subplots(
            1, len(found), figsize=(style.WIDTH, 3.1), sharey=True, squeeze=False
        )
        for ax, (title, one) in zip(axes[0], found.items(), strict=True):
            _draw_gains(ax, gains(one, rig))
            ax.set_title(title)
        axes[0, 0].set_ylabel("σ over that of the rig (1)")
        handles = [
            Line2D([], [], ls="", marker="o", color=style.colour(k), label=style.plain(head.name))
            for k, head in enumerate(rig.heads)
        ]
        style.legend_below(fig, handles)
    return fig


def _draw_gains(ax: Axes, found: Array) -> None:
    """Draw a row of dots for each parameter, one per head, on a logarithmic axis."""
    ax.axhline(1.0, color=style.SOFT, lw=0.9, zorder=1)
    spread = 0.09 * (np.arange(len(found)) - (len(found) - 1) / 2)
    for k, ratios in enumerate(found):
        ax.plot(np.arange(len(RELATIVE)) + spread[k], ratios, "o", color=style.colour(k), ms=4.5)
    ax.set_xticks(range(len(RELATIVE)), [LABELS[name] for name in RELATIVE])
    known = found[np.isfinite(found)]
    highest = 1.3 * known.max(initial=2.0)
    low, high = ax.get_ylim() if ax.get_yscale() == "log" else (0.8, highest)
    ax.set_yscale("log")
    ax.set_ylim(min(low, 0.8 * known.min(initial=1.0)), max(high, highest))
    ax.set_yticks([n for n in FACTORS if n < ax.get_ylim()[1]])
    ax.yaxis.set_major_formatter("{x:g}")
    ax.minorticks_off()
    ax.grid(visible=False, axis="x")
    ax.set_xlim(-0.6, len(RELATIVE) - 0.4)


def rig_correlations(ways: Mapping[str, RelativeOrientation | Failed]) -> Figure:
    """Draw the correlations of relative orientations.

    Parameters
    ----------
    ways : mapping of str to RelativeOrientation or Failed
        By their titles; a way that failed is left out.
    """
    found = {title: one for title, one in ways.items() if not isinstance(one, Failed)}
    if not found:
        return style.nothing(NO_OTHERS)
    with style.applied():
        fig, axes = style.subplots(1, len(found), figsize=(style.WIDTH, 2.55), squeeze=False)
        for ax, (title, one) in zip(axes[0], found.items(), strict=True):
            _draw_correlations(ax, one, title)
        matrix.scale(fig, axes[0].tolist(), shrink=0.75, aspect=28)
    return fig


def _draw_correlations(ax: Axes, orientation: RelativeOrientation, title: str) -> None:
    values, n = correlation(orientation.cov), len(RELATIVE)
    matrix.signed_cells(ax, values, gap=0.0)
    names = [style.plain(head.name) for head in orientation.heads]
    middle = n * np.arange(len(names)) + n / 2
    ax.set_xticks(middle, names, size=7)
    ax.set_yticks(middle, names, size=7, rotation=90, va="center")
    for edge in range(n, n * len(names), n):
        ax.axhline(edge, color=style.INK, lw=0.6)
        ax.axvline(edge, color=style.INK, lw=0.6)
    off = np.abs(values - np.diag(np.diag(values)))
    style.heading(ax, title, f"largest {off.max():.2f}")


def rig_deformations(synthetic: Camera, found: Mapping[str, Deformation]) -> Figure:
    """Draw the predicted errors of synthetic images over their frame, and the true ones.

    Parameters
    ----------
    synthetic : Camera
    found : mapping of str to Deformation
        By the titles of the panels; one at least.

    Returns
    -------
    Figure
        Ground: the standard deviation, the largest of the heads at a node. Arrows: the true
        errors of a simulated flight.
    """
    pixel = synthetic.pixel_mm
    most = max(one.sigma.max() for one in found.values()) / pixel
    lengths = [np.hypot(*one.d.T) for one in found.values()]
    longest = max(float(np.nanmax(d, initial=0.0)) for d in lengths) / pixel
    key = style.round_length(longest) if longest > 0 else 0.0
    with style.applied():
        fig, axes = style.subplots(
            1, len(found), figsize=(style.WIDTH, 4.9), sharey=True, squeeze=False
        )
        for ax, (title, one) in zip(axes[0], found.items(), strict=True):
            marks = _draw_sigma(ax, one, synthetic, most)
            if key > 0:
                _draw_errors(ax, one, key=key, pixel=pixel)
            style.heading(ax, title, f"overlaps misfit by {one.gap_sigma_mm / pixel:.2f} px")
            ax.set_xlabel("$x$ (mm)")
        axes[0, 0].set_ylabel("$y$ (mm)")
        bar = fig.colorbar(marks, ax=axes[0].tolist(), location="bottom", shrink=0.5, aspect=40)
        bar.set_label("standard deviation (px)")
        bar.outline.set_visible(False)
    return fig


def _draw_sigma(ax: Axes, one: Deformation, synthetic: Camera, most: float) -> QuadMesh:
    """Draw the standard deviation over the frame, the largest of the heads at a node."""
    (x, column), (y, row) = (_places(one, i) for i in (0, 1))
    largest = np.full((len(y), len(x)), np.nan)
    np.fmax.at(largest, (row, column), one.sigma / synthetic.pixel_mm)
    shading: Any = "gouraud" if np.isfinite(largest).all() else "nearest"
    mesh = ax.pcolormesh(
        x, y, largest, cmap=style.SHADES, vmin=0, vmax=most, shading=shading, rasterized=True
    )
    w, h = synthetic.width_px, synthetic.height_px
    upper, lower = xy_from_colrow(synthetic, np.array([[-0.5, -0.5], [w - 0.5, h - 0.5]]))
    ax.add_patch(Rectangle(tuple(upper), *(lower - upper), fc="none", ec=style.INK, lw=1.2))
    ax.set(aspect="equal")
    ax.margins(0.07)
    ax.grid(visible=False)
    return mesh


def _places(one: Deformation, axis: int) -> tuple[Array, Index]:
    """Return the places of the nodes along an axis, and which of them each row has."""
    places, idx = np.unique(one.xy[:, axis].round(6), return_inverse=True)
    return places, idx


def _draw_errors(ax: Axes, one: Deformation, *, key: float, pixel: float) -> None:
    """Draw the true errors of every other node, in the colours of the heads."""
    (x, column), (_, row) = (_places(one, i) for i in (0, 1))
    some = (column % 2 == 1) & (row % 2 == 1)
    gap = 2 * float(np.min(np.diff(x)))
    arrows = ax.quiver(
        *one.xy[some].T,
        *(one.d[some].T * gap / (key * pixel)),
        color=[style.colour(k) for k in one.head[some]],
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.006,
    )
    label, place = f"{key:g} px", (0.86, 1.03)
    ax.quiverkey(
        arrows, *place, gap, label, labelpos="W", color=style.INK, fontproperties=style.LETTERS
    )
