"""Figures of what the synthetic image costs: scatter over sigma, patterns, radial distortion."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from acx4book.chapters.beyond.synthetic_cost import geometry, study
from acx4book.chapters.beyond.synthetic_cost.study import RIG, SYNTHETIC, Study
from acx4book.paper import printed
from acx4book.typesetting import style
from acx4book.typesetting.labels import LABELS

TINTS = {SYNTHETIC: style.ORANGE, RIG: style.BLUE}
NAMES = {SYNTHETIC: "synthetic camera", RIG: "heads of the rig"}
DASHES = dict(zip(geometry.HEADS, ("-", "--"), strict=True))


def scatter_over_sigma(found: Study) -> Figure:
    """Draw, for every parameter, the scatter over flights over the stated sigma."""
    ways = {way: study.scatter(found, way) for way in (RIG, SYNTHETIC)}
    names = list(dict.fromkeys(ways[SYNTHETIC]["parameter"]))
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 3.3))
        for way, table in ways.items():
            known = table[table["parameter"].isin(names)]
            _draw_ratios(ax, known, names, TINTS[way])
        ax.axhline(1, color=style.INK, lw=0.7)
        ax.set_xticks(range(len(names)), [LABELS[n] for n in names], rotation=40, ha="right")
        ax.set(ylabel="scatter over stated σ (1)", xlim=(-0.6, len(names) - 0.4))
        ax.set_ylim(bottom=0)
        style.heading(ax, "What σ promises, and what flights keep", "one: σ is right; bars ±2σ")
        handles = [
            Line2D([], [], ls="", marker="o", color=TINTS[way], label=NAMES[way])
            for way in (SYNTHETIC, RIG)
        ]
        style.legend_below(fig, handles)
    return fig


def _draw_ratios(ax: Axes, table: pd.DataFrame, names: list[str], tint: str) -> None:
    """Draw ratios with bars; the cameras of a parameter stand beside each other."""
    cameras = list(dict.fromkeys(table["camera"]))
    for k, (_, own) in enumerate(table.groupby("camera", sort=False)):
        beside = 0.11 * (k - (len(cameras) - 1) / 2) + (0.0 if len(cameras) > 1 else -0.32)
        at = [names.index(name) + beside for name in own["parameter"]]
        bars = 2 * own["sigma_ratio"]
        ax.errorbar(at, own["ratio"], yerr=bars, color=tint, fmt="o", ms=4, lw=1.0, capsize=1.5)


def fingerprint(found: Study) -> Figure:
    """Draw the radial distortion of exact data over the focal length of head 1, beside Table 3."""
    with style.applied():
        fig, (left, right) = style.subplots(1, 2, figsize=(style.WIDTH, 3.4))
        for heads, differences in geometry.in_sigma(found).items():
            for i, (_, own) in enumerate(differences.items()):
                left.plot(own.index, own, DASHES[heads], color=style.colour(i), lw=1.3)
        left.axhspan(-2, 2, color=style.SOFT, alpha=0.15, lw=0)
        left.set(xlabel="$f$ of head 1 (mm)", ylabel="difference from Table 3 (its σ)")
        style.heading(left, "Coefficient by coefficient", "grey: within 2σ of the printed value")
        _draw_curves(right, found)
        handles = [
            *(
                Line2D([], [], color=style.colour(i), label=LABELS[n])
                for i, n in enumerate(geometry.RADIAL)
            ),
            *(Line2D([], [], color=style.INK, ls=d, label=f"heads {h}") for h, d in DASHES.items()),
        ]
        style.legend_below(fig, handles)
    return fig


def _draw_curves(ax: Axes, found: Study) -> None:
    """Draw radial distortion over the radius for squares of lens centres, and Table 3's."""
    r = geometry.radius_mm()
    squares = geometry.by_side(found)
    for i, (side, ks) in enumerate(zip(squares.index, squares.to_numpy(), strict=True)):
        curve = geometry.radial_um(ks, r)
        ax.plot(r, curve, color=style.colour(3 + i), lw=1.3)
        _name_curve(ax, f"{100 * side:.0f} cm", (r[-1], curve[-1]), "left")
    curve = geometry.radial_um(geometry.printed_with_sigma()[0], r)
    ax.plot(r, curve, color=style.PRINTED, lw=1.1, ls=":")
    _name_curve(ax, "Table 3", (r[-8], curve[-8]), "right")
    ax.set(xlabel="radius (mm)", ylabel="radial distortion (µm)", xlim=(0, 1.13 * r[-1]))
    style.heading(ax, "All three together", "by the side of the square of lens centres")


def _name_curve(
    ax: Axes, name: str, at: tuple[float, float], align: Literal["left", "right"]
) -> None:
    """Write the name of a curve beside a place on it."""
    ax.annotate(
        name,
        xy=at,
        xytext=(4 if align == "left" else -4, 0),
        textcoords="offset points",
        ha=align,
        va="center",
        fontsize=style.SMALL,
        color=style.SOFT,
    )


def centres(found: Study) -> Figure:
    """Draw how far X_c and Y_c of exact data lie from Table 1, over the focal length of head 1."""
    misfit = centre_misfit(found)
    with style.applied():
        fig, ax = style.subplots(figsize=(0.6 * style.WIDTH, 2.9))
        for i, (name, own) in enumerate(misfit.items()):
            tint = style.colour(i)
            ax.plot(own.index, own, "o-", color=tint, ms=3, label=LABELS[str(name)])
        ax.set(xlabel="$f$ of head 1 (mm)", ylabel="RMS over heads (mm)")
        ax.set_ylim(bottom=0)
        style.heading(ax, "Lens centres beside Table 1's", "differences from the printed values")
        style.legend_below(fig, ax.get_legend_handles_labels()[0])
    return fig


def centre_misfit(found: Study) -> pd.DataFrame:
    """Return the RMS over heads of X_c and Y_c less Table 1, mm: rows are focal lengths."""
    names = ("Xc_mm", "Yc_mm")
    return pd.DataFrame({name: np.sqrt(_squares_from_print(found, name)) for name in names})


def _squares_from_print(found: Study, name: str) -> pd.Series:
    each = [
        (study.exact(found.sweep, head, name)["calibrated"] - printed.value(1, name, head)) ** 2
        for head in printed.HEADS
    ]
    return sum(each[1:], each[0]) / len(each)


# --- the pattern of residuals -----------------------------------------------------------------

EVERY = 2
"""Of so many nodes in a row or column, one has an arrow."""


def pattern(found: Study) -> Figure:
    """Draw what a single step of exact data leaves over the synthetic image."""
    width, height = (printed.value(2, name, "SYN") for name in ("width_px", "height_px"))
    flown = np.unique(found.pattern["height_m"])
    fields = {h: found.pattern[found.pattern["height_m"] == h] for h in flown}
    key = style.round_length(max(map(geometry.largest_px, fields.values())))
    names = sorted(found.pattern["head"].unique())
    with style.applied():
        fig, axes = style.subplots(1, len(fields), figsize=(style.WIDTH, 4.9), sharey=True)
        for ax, (height_m, own) in zip(np.atleast_1d(axes), fields.items(), strict=True):
            _draw_vectors(ax, own, names, key)
            _draw_seams(ax, own, names)
            ax.set(xlim=(0, width), ylim=(height, 0), aspect="equal")
            ax.set(xlabel="column (px)")
            ax.locator_params(nbins=5)
            rms = geometry.rms_px(own)
            style.heading(ax, f"From {height_m:.0f} m", f"RMS {rms:.2f} px")
        np.atleast_1d(axes)[0].set_ylabel("row (px)")
        handles = [Line2D([], [], color=style.colour(k), label=n) for k, n in enumerate(names)]
        style.legend_below(fig, handles)
    return fig


def _draw_vectors(ax: Axes, own: pd.DataFrame, names: list[str], key: float) -> None:
    """Draw the vectors of every `EVERY`-th node, in the colours of the heads."""
    places = [np.unique(own[name], return_inverse=True)[1] for name in geometry.AT]
    some = own[(places[0] % EVERY == 0) & (places[1] % EVERY == 0)]
    gap = EVERY * float(np.min(np.diff(np.unique(own["col_px"]))))
    arrows = ax.quiver(
        *(some["col_px"], some["row_px"]),
        *(gap / key * some[name] for name in geometry.D),
        color=[style.colour(names.index(head)) for head in some["head"]],
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.005,
        zorder=3,
    )
    label, place = f"{key:g} px", (0.86, 1.03)
    ax.quiverkey(
        arrows, *place, gap, label, labelpos="W", color=style.INK, fontproperties=style.LETTERS
    )


def _draw_seams(ax: Axes, own: pd.DataFrame, names: list[str]) -> None:
    """Draw where the head changes from which a pixel is taken."""
    head = geometry.grid(own, "head")
    rows, cols = (np.unique(own[name]) for name in geometry.AT)
    for name in names:
        inside = (head == name).astype(float)
        ax.contour(cols, rows, inside, levels=[0.5], colors=style.SOFT, linewidths=0.9)
