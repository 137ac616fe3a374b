"""Figures of what trajectory errors do to a calibration and to what it says of itself."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from acx4book.chapters.beyond.weights.study import MODELLED
from acx4book.paper import printed as paper
from acx4book.typesetting import style
from acx4book.typesetting.labels import LABELS

TINTS = {"white": style.BLUE, "slow": style.ORANGE, MODELLED: style.TEAL}
NAMES = {
    "white": "independent errors",
    "slow": "slowly changing errors, as large",
    MODELLED: "the same, correlation in the weights",
}


def trajectory_errors(heights: pd.DataFrame, scatter: pd.DataFrame) -> Figure:
    """Draw slow and white errors of a trajectory, and what both do to calibrations.

    Parameters
    ----------
    heights : DataFrame
        As `study.height_errors` returns it.
    scatter : DataFrame
        As `study.scatter` returns it.
    """
    shown = [name for name in dict.fromkeys(scatter["parameter"]) if name in LABELS]
    shown = [name for name in shown if name[0] not in "kp"]  # distortion is the images' alone
    with style.applied():
        fig, (left, right) = style.subplots(
            1, 2, figsize=(style.WIDTH, 3.5), width_ratios=(1, 1.15)
        )
        for kind, own in heights.groupby("kind", sort=False):
            _draw_by_strip(left, own, TINTS[str(kind)])
        left.axhline(0, color=style.INK, lw=0.7)
        left.set(xlabel="exposure number", ylabel="error in height (cm)")
        style.heading(left, "The same size, another course", "one flight; lines join a strip")
        rows = np.arange(len(shown))
        for offset, (kind, own) in zip(
            (-0.22, 0.0, 0.22), scatter.groupby("kind", sort=False), strict=True
        ):
            ratio = own.set_index("parameter").loc[shown]
            right.errorbar(
                *(ratio["ratio"], rows + offset),
                xerr=2 * ratio["sigma_ratio"],
                fmt="o",
                capsize=2.5,
                lw=1.2,
                ms=5,
                color=TINTS[str(kind)],
                label=NAMES[str(kind)],
            )
        right.axvline(1, color=style.INK, lw=0.7)
        right.set_yticks(rows, [LABELS[name] for name in shown])
        right.set(ylim=(len(rows) - 0.5, -0.5), xlabel="RMS of the error over stated σ (1)")
        right.set_xlim(left=0)
        style.heading(right, "What σ then says", "one: σ is right; bars ±2σ of the ratio")
        style.legend_below(fig, right.get_legend_handles_labels()[0], ncols=2)
    return fig


def _draw_by_strip(ax: Axes, errors: pd.DataFrame, tint: str) -> None:
    for _, strip in errors.groupby("strip", sort=False):
        ax.plot(strip["exposure"], 100 * strip["error_m"], "o-", color=tint, ms=2.6, lw=1.0)


def height_noise(table: pd.DataFrame, *, beside_print: bool) -> Figure:
    """Draw the sigma of f and of the lever arm's z over the noise of GNSS heights.

    Parameters
    ----------
    table : DataFrame
        As `tables.height_noise` returns it.
    beside_print : bool
        Whether the printed ones are of the same camera.
    """
    noise_cm = 100 * table["gnss_height_m"]
    drawn = [
        (name, *scaled)
        for name, scaled in {"f_mm": (1000.0, "µm"), "lever_z_m": (100.0, "cm")}.items()
        if table[f"sigma_{name}"].notna().any()
    ]
    if not drawn:
        return style.nothing("Focal length and lever arm are held.")
    with style.applied():
        fig, axes = style.subplots(
            1, len(drawn), figsize=(style.WIDTH, 2.7), sharex=True, squeeze=False
        )
        for ax, (name, scale, unit) in zip(axes[0], drawn, strict=True):
            ax.plot(noise_cm, scale * table[f"sigma_{name}"], "o-", color=style.BLUE)
            if beside_print:
                _draw_printed(ax, scale * paper.sigma(3, name, "single_step"))
            ax.set(xlabel="white noise of GNSS heights (cm)", ylabel=f"σ ({unit})")
            ax.set_title(LABELS[name])
            ax.set_ylim(bottom=0)
            ax.set_xlim(left=0)
    return fig


def _draw_printed(ax: Axes, sigma: float) -> None:
    ax.axhline(sigma, color=style.PRINTED, lw=1.0, ls="--")
    ax.annotate(
        "printed in the paper",
        xy=(1.0, sigma),
        xytext=(0, 3),
        xycoords=("axes fraction", "data"),
        textcoords="offset points",
        ha="right",
        fontsize=style.SMALL,
        color=style.SOFT,
    )
