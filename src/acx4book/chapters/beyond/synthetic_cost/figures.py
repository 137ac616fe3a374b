"""Figures of what the synthetic image costs: scatter over sigma, and the focal length of head 1."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from acx4book.chapters.beyond.synthetic_cost import radial, study
from acx4book.chapters.beyond.synthetic_cost.study import RIG, SYNTHETIC, Study
from acx4book.paper import printed
from acx4book.typesetting import style
from acx4book.typesetting.labels import LABELS

TINTS = {SYNTHETIC: style.ORANGE, RIG: style.BLUE}
NAMES = {SYNTHETIC: "synthetic camera", RIG: "heads of the rig"}
DASHES = dict(zip(radial.HEADS, ("-", "--"), strict=True))


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
        for heads, differences in radial.in_sigma(found).items():
            for i, (_, own) in enumerate(differences.items()):
                left.plot(own.index, own, DASHES[heads], color=style.colour(i), lw=1.3)
        left.axhspan(-2, 2, color=style.SOFT, alpha=0.15, lw=0)
        left.set(xlabel="$f$ of head 1 (mm)", ylabel="difference from Table 3 (its σ)")
        style.heading(left, "Coefficient by coefficient", "grey: within 2σ of the printed value")
        _draw_curves(right, found)
        handles = [
            *(
                Line2D([], [], color=style.colour(i), label=LABELS[n])
                for i, n in enumerate(radial.RADIAL)
            ),
            *(Line2D([], [], color=style.INK, ls=d, label=f"heads {h}") for h, d in DASHES.items()),
        ]
        style.legend_below(fig, handles)
    return fig


def _draw_curves(ax: Axes, found: Study) -> None:
    """Draw radial distortion over the radius for squares of lens centres, and Table 3's."""
    r = radial.radius_mm()
    squares = radial.squares(found)
    for i, (side, ks) in enumerate(zip(squares.index, squares.to_numpy(), strict=True)):
        curve = radial.radial_um(ks, r)
        ax.plot(r, curve, color=style.colour(3 + i), lw=1.3)
        _name_curve(ax, f"{100 * side:.0f} cm", (r[-1], curve[-1]), "left")
    curve = radial.radial_um(radial.printed_with_sigma()[0], r)
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
