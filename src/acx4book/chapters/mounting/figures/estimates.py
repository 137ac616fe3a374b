"""Figures of the mounting calibration: eqs (12)-(13) by image, and the lever arm."""

from __future__ import annotations

from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from acx4book.typesetting import style
from acx4lib.calibration.mounting import Mounting, Mountings
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.frames import Pose, log


def mounting_per_image(
    mountings: Mountings, method: str, *, boresight_sigma_deg: Array | None = None
) -> Figure:
    """Draw what every image says of boresight and lever arm, eqs (12) and (13), less their mean.

    Parameters
    ----------
    mountings : Mountings
    method : str
        One of the two-step methods.
    boresight_sigma_deg : ndarray, shape (3,), optional
        Of the trajectory's attitude, drawn as a band.

    Raises
    ------
    ValueError
        For a method that has no mounting per image.
    """
    if method not in mountings.methods:
        return style.nothing(f"{method} was left out: {mountings.failures.get(method, '')}")
    mounting = mountings[method]
    if mounting.per_image is None or mounting.averaged is None:
        msg = f"{method} has no mounting per image"
        raise ValueError(msg)
    with style.applied():
        fig, axes = style.subplots(2, 3, figsize=(style.WIDTH, 3.9), sharex=True, sharey="row")
        _draw_per_image(axes, mounting, mounting.per_image, mounting.averaged)
        for axis, name in enumerate(("x", "y", "z")):
            axes[0, axis].set_title(f"about and along {name}")
            if boresight_sigma_deg is not None:
                s = float(boresight_sigma_deg[axis])
                axes[0, axis].axhspan(-s, s, color=style.SOFT, alpha=0.12, lw=0, zorder=0)
            for ax in axes[:, axis]:
                ax.axhline(0, color=style.INK, lw=0.7)
            axes[1, axis].set_xlabel("image number")
        axes[0, 0].set_ylabel("boresight less mean (°)")
        axes[1, 0].set_ylabel("lever arm less mean (m)")
        handles, labels = axes[0, 0].get_legend_handles_labels()
        if any(labels):
            style.legend_below(fig, handles, ncols=6)
    return fig


def _draw_per_image(axes: Any, mounting: Mounting, T_b_c: Pose, averaged: Mask) -> None:
    """Draw the boresights and lever arms of every camera's images, less their mean."""
    block = mounting.bundle.network.block
    for k, camera in enumerate(mounting.calibration.cameras):
        own = np.flatnonzero(averaged & (block.images.camera_idx == k))
        seen = T_b_c[own]
        turn = np.degrees(log(seen.R @ camera.T_b_c.R.T))
        shift = seen.r - seen.r.mean(axis=0)
        strips = [block.images.strips[i] for i in own]
        for axis in range(3):
            _by_strip(axes[0, axis], own, turn[:, axis], strips)
            _by_strip(axes[1, axis], own, shift[:, axis], strips)


def _by_strip(ax: Axes, number: Index, values: Array, strips: list[str]) -> None:
    """Draw values over image numbers, a colour for every strip."""
    for i, strip in enumerate(dict.fromkeys(strips)):
        own = np.array([s == strip for s in strips])
        ax.plot(
            *(number[own] + 1, values[own], "o"),
            ms=2.8,
            color=style.colour(i),
            label=f"strip {style.plain(strip)}" if strip else "",
        )


def lever_arm_seen(table: pd.DataFrame) -> Figure:
    """Draw the lever arm that the two-step interior orientation took up beside the true one.

    Parameters
    ----------
    table : DataFrame
        As `absorbed.lever_arm_seen` returns it.
    """
    if table.empty:
        return style.nothing("The two methods cannot be compared here.")
    labels = {
        "xp": "$x$: from the shift of $x_p$",
        "yp": "$y$: from the shift of $y_p$",
        "f": "$z$: from the shift of $f$",
    }
    several = len(set(table["camera"])) > 1
    names = [
        f"{style.plain(camera)} {labels[str(key)]}" if several else labels[str(key)]
        for camera, key in zip(table["camera"], table["parameter"], strict=True)
    ]
    rows = np.arange(len(table))
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 1.1 + 0.4 * len(table)))
        for offset, value, mark, name, tint in (
            (-0.2, "at_mean_height_m", "x", "from the mean flying height", style.SOFT),
            (0.0, "lever_seen_m", "o", "by least squares", style.ORANGE),
        ):
            ax.plot(table[value], rows + offset, mark, color=tint, ms=6, label=name)
        ax.errorbar(
            *(table["lever_estimated_m"], rows + 0.2),
            xerr=2 * table["sigma_estimated_m"],
            fmt="o",
            color=style.BLUE,
            capsize=2.5,
            lw=1.2,
            ms=5,
            label="estimated by the single step, ±2σ",
        )
        ax.axvline(0, color=style.INK, lw=0.7)
        ax.set_yticks(rows, names)
        ax.set_ylim(len(rows) - 0.5, -0.5)
        ax.set_xlabel("lever arm, axes of the camera (m)")
        style.legend_below(fig, ax.get_legend_handles_labels()[0], ncols=3)
    return fig
