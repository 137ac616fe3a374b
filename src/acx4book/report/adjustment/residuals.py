"""Residuals of image points, drawn over the image plane and by strip."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from acx4book.typesetting import style
from acx4book.typesetting.field import Residuals, field_figure
from acx4lib.bundle.gross_errors.rejections import CRITICAL
from acx4lib.geometry.camera import Camera
from acx4lib.georeferencing.accuracy import rms_limits

COMPONENTS = {"col": "columns", "row": "rows"}

PROBABILITY = 0.999
"""Of the limits by chance that are drawn, for each strip by itself."""


def residual_plane(tables: Mapping[str, pd.DataFrame], cameras: Mapping[str, Camera]) -> Figure:
    """Draw the mean residual vectors over the image plane, a panel per adjustment and camera.

    Parameters
    ----------
    tables : mapping of str to DataFrame
        As `material.image_residuals` returns it, by the title of the adjustment.
    cameras : mapping of str to Camera
    """
    fields = {
        _panel(title, own["camera"], name): _of_camera(own[own["camera"] == name], cameras[name])
        for title, own in tables.items()
        for name in own["camera"].unique()
    }
    if not fields:
        return style.nothing("There are no residuals of image points.")
    return field_figure(fields)


def _panel(title: str, cameras: pd.Series, name: str) -> str:
    """Return the title of a camera's panel: with only one camera, that of the adjustment."""
    several = cameras.iloc[0] != cameras.iloc[-1]
    return f"{title}, {name}" if several else title


def _of_camera(rows: pd.DataFrame, camera: Camera) -> Residuals:
    return Residuals(
        camera=camera,
        colrow=rows[["col_px", "row_px"]].to_numpy(),
        v=rows[["v_col", "v_row"]].to_numpy(),
        sigma_px=rows["sigma"].to_numpy(),
    )


def residuals_by_strip(tables: Mapping[str, pd.DataFrame]) -> Figure:
    """Draw the size of the image residuals of every strip, and the largest one.

    Parameters
    ----------
    tables : mapping of str to DataFrame
        As for `residual_plane`.

    Returns
    -------
    Figure
        Above: the size of the residuals divided by the size expected from the weights, with 99.9 %
        limits about one. Below: the largest normalised residual and the critical value of w.
    """
    strips = list(dict.fromkeys(name for t in tables.values() for name in t["strip"].unique()))
    if not strips:
        return style.nothing("There are no residuals of image points.")
    with style.applied():
        fig, axes = style.subplots(2, 2, figsize=(style.WIDTH, 3.3), sharex=True, sharey="row")
        for i, (title, table) in enumerate(tables.items()):
            shift = 0.16 * (i - (len(tables) - 1) / 2)
            for column, component in enumerate(COMPONENTS):
                _draw_strips(
                    axes[:, column], table, component, strips, shift=shift, label=style.plain(title)
                )
        for column, name in enumerate(COMPONENTS.values()):
            axes[0, column].set_title(name)
            axes[0, column].axhline(1, color=style.INK, lw=0.7)
            axes[1, column].axhline(CRITICAL, color=style.INK, lw=0.9, ls="--")
            axes[1, column].set_xticks(
                range(len(strips)), [style.plain(s) or "none" for s in strips]
            )
            axes[1, column].set_xlabel("strip")
            axes[1, column].tick_params(axis="x", rotation=90 if len(strips) > 14 else 0)
        axes[0, 0].set_ylabel("ratio of σ (1)")
        axes[1, 0].set_ylabel("largest |w| (1)")
        axes[1, 0].set_ylim(0, 1.08 * axes[1, 0].get_ylim()[1])
        if len(tables) > 1:
            style.legend_below(fig, axes[0, 0].get_legend_handles_labels()[0])
    return fig


def _draw_strips(
    axes: Sequence[Axes],
    table: pd.DataFrame,
    component: str,
    strips: Sequence[str],
    *,
    shift: float,
    label: str,
) -> None:
    groups = list(table.groupby("strip", sort=False))
    at = np.array([strips.index(str(strip)) + shift for strip, _ in groups])
    weighted = [float(np.sum((own[f"v_{component}"] / own["sigma"]) ** 2)) for _, own in groups]
    total = np.array([own[f"redundancy_{component}"].sum() for _, own in groups])
    nothing = (np.nan, np.nan)
    limits = [rms_limits(r, probability=PROBABILITY) if r > 0 else nothing for r in total]
    low, high = np.transpose(limits)
    axes[0].vlines(at, low, high, color=style.SOFT, alpha=0.35, lw=4.5)
    axes[0].plot(at, np.sqrt(weighted / total), "o", ms=3.8, label=label)
    axes[1].plot(at, [own[f"w_{component}"].abs().max() for _, own in groups], "o", ms=3.8)
