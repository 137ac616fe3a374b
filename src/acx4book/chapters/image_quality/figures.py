"""The table and the figures of the quality of the synthetic image (section 4.1)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from acx4book.chapters.image_quality.deviations import (
    Deviations,
    residuals_px,
)
from acx4book.chapters.image_quality.examined import (
    Examined,
    largest_radial,
    rms_of_coordinates,
)
from acx4book.chapters.synthetic_image.tables import WAYS
from acx4book.paper import printed
from acx4book.typesetting import style
from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration.heads import RelativeOrientation, radial_profile
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera, colrow_from_xy
from acx4lib.synthetic_image.frame import (
    footprint,
)

NAMES: Mapping[str, str] = {"true": "true orientation", **WAYS}
"""Names for readers of the orientations of `examined.examine_all`."""

CELLS = 14
"""Cells along the longer side of the frame, in vector plots."""

LEAST = 4
"""Smallest number of points of a cell whose mean is drawn."""

TINTS = {
    "true": style.SOFT,
    "before": style.BRICK,
    "mean shift": style.ORANGE,
    "rotations": style.BLUE,
    "six": style.TEAL,
}
"""Colours of the orientations, by the names of `examined.examine_all`."""


# --- vectors over the frame ------------------------------------------------------------------


def deviation_fields(
    fields: Mapping[str, Deviations],
    synthetic: Camera,
    orientation: RelativeOrientation,
) -> Figure:
    """Draw mean deviations of the cells of a synthetic image, all panels to one scale.

    Parameters
    ----------
    fields : mapping of str to Deviations
        By the title of their panel, full-size px.
    synthetic : Camera
    orientation : RelativeOrientation
        For the heads' outlines.
    """
    means = {title: _cell_means(field, synthetic) for title, field in fields.items()}
    longest = max(float(np.hypot(*d.T).max(initial=0.0)) for _, d in means.values())
    key = style.round_length(max(longest, 1e-6))
    n_rows = -(-len(fields) // 3)
    with style.applied():
        fig, grid = style.subplots(
            n_rows, 3, figsize=(style.WIDTH, 3.15 * n_rows + 0.35), squeeze=False
        )
        for ax in grid.flat[len(fields) :]:
            ax.remove()
        for ax, (title, field) in zip(grid.flat, fields.items(), strict=False):
            _draw_outlines(ax, synthetic, orientation)
            _draw_vectors(ax, synthetic, means[title], key=key)
            rms = np.sqrt(np.mean(field.d_px**2))
            style.heading(ax, title, f"{len(field)} points, rms {rms:.2f} px")
        handles: list[Any] = [
            Line2D([], [], color=style.colour(k), lw=1, label=style.plain(head.name))
            for k, head in enumerate(orientation.heads)
        ]
        style.legend_below(fig, handles)
    return fig


def _cell_means(points: Deviations, camera: Camera) -> tuple[Array, Array]:
    """Return middles of cells and mean deviations, px."""
    size = max(camera.width_px, camera.height_px) / CELLS
    cells, idx, count = np.unique(
        np.floor((points.ideal + 0.5) / size), axis=0, return_inverse=True, return_counts=True
    )
    idx, enough = idx.ravel(), count >= min(LEAST, len(points))
    sums = [np.bincount(idx, column, minlength=len(cells)) for column in points.d_px.T]
    return (cells[enough] + 0.5) * size, np.stack(sums, axis=1)[enough] / count[enough, None]


def _draw_outlines(ax: Axes, synthetic: Camera, orientation: RelativeOrientation) -> None:
    for k in range(len(orientation.heads)):
        outline = colrow_from_xy(synthetic, footprint(orientation, k, per_side=30))
        ax.fill(*outline.T, fc="none", ec=style.colour(k), lw=0.8, alpha=0.55, zorder=2)


def _draw_vectors(ax: Axes, camera: Camera, field: tuple[Array, Array], *, key: float) -> None:
    middle, d = field
    cell = max(camera.width_px, camera.height_px) / CELLS
    scale = 1.25 * cell / key
    ax.quiver(
        *middle.T,
        *(scale * d.T),
        color=style.INK,
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.006,
        headwidth=3.4,
        headlength=4,
        headaxislength=3.6,
        minlength=0.5,
        zorder=3,
    )
    w, h = camera.width_px, camera.height_px
    ax.set(xlim=(-0.5, w - 0.5), ylim=(h - 0.5, -0.5), aspect="equal", xticks=[], yticks=[])
    ax.grid(visible=False)
    ax.spines[:].set_visible(True)
    bar = np.array([w - 0.5 * cell - scale * key, w - 0.5 * cell])
    low = h + 0.45 * cell
    ax.plot(bar, np.full(2, low), color=style.INK, lw=1.6, clip_on=False, zorder=5)
    ax.text(bar[0] - 0.25 * cell, low, f"{key:g} px", ha="right", va="center", fontsize=style.SMALL)


# --- distortion ------------------------------------------------------------------------------


def distortion_taken_up(fits: Mapping[str, Bundle]) -> Figure:
    """Draw the radial distortion that a self-calibration finds in synthetic images.

    Parameters
    ----------
    fits : mapping of str to Bundle
        Self-calibrations with the lens free, by the names of `NAMES`.
    """
    border = printed.statement("synthetic_border_distortion_px")
    with style.applied():
        fig, ax = style.subplots(figsize=(0.6 * style.WIDTH, 3.4))
        corner = 0.0
        for name, fit in fits.items():
            r, px, sigma = radial_profile(fit)
            corner = float(r[-1])
            ax.fill_between(r, px - sigma, px + sigma, color=TINTS[name], alpha=0.2, lw=0)
            ax.plot(r, px, color=TINTS[name], label=NAMES[name])
        ax.plot(
            [corner] * 2, [border, -border], "D", mfc=style.PAPER, mec=style.PRINTED, label="paper"
        )
        ax.axhline(0, color=style.INK, lw=0.7)
        ax.set(xlabel="radius (mm)", ylabel="radial distortion (px)", xlim=(0, 1.04 * corner))
        style.heading(ax, "One calibration, on pixels", "bands: one standard deviation")
        style.legend_below(fig, ax.get_legend_handles_labels()[0], ncols=2)
    return fig


# --- the table, and the fields of the first figure ---------------------------------------------


def way_table(
    examined: Mapping[str, Examined], geometry: Mapping[str, Mapping[str, float]]
) -> pd.DataFrame:
    """Return the errors of the image of every orientation, measured beside geometry.

    Parameters
    ----------
    examined : mapping of str to Examined
        By the names of `NAMES`.
    geometry : mapping of str to mapping
        As `examined.geometry_errors` returns it.

    Returns
    -------
    DataFrame
        RMS of a coordinate: of the deviations, of what an exterior orientation leaves, of what a
        lens leaves as well, each as ``measured`` and ``by geometry``; the largest radial
        distortion that is found. Full-size px.
    """
    steps = {"RMS": "rms_px", "Oriented": "oriented_px", "Calibrated": "calibrated_px"}
    rows = {}
    for name, image in examined.items():
        measured = {
            "RMS": rms_of_coordinates(image.found.d_px),
            "Oriented": _left_px(image, "oriented"),
            "Calibrated": _left_px(image, "calibrated"),
        }
        row = {}
        for title, key in steps.items():
            row[f"{title} (px)", "measured"] = measured[title]
            row[f"{title} (px)", "by geometry"] = geometry[name][key]
        row["Radial (px)", "measured"] = largest_radial(image.fits["calibrated"])
        rows[NAMES[name]] = row
    table = pd.DataFrame(rows).T
    table.index.name = "heads"
    table.attrs["formats"] = {", ".join(column): ".2f" for column in table.columns}
    return table


def _left_px(examined: Examined, step: str) -> float:
    """Return the RMS residual of a coordinate after a bundle of the image, px."""
    return rms_of_coordinates(residuals_px(examined.fits[step]))


def self_calibration_fields(examined: Mapping[str, Examined]) -> dict[str, Deviations]:
    """Return the residuals after each step, for the paper's refinement and for ours, by title."""
    shown = {"mean shift": ("Mean differences", "Mean"), "rotations": ("Three rotations", "Turned")}
    fields = {}
    for name, (title, short) in shown.items():
        image = examined[name]
        fields[title] = image.found
        for step, words in (("oriented", "then oriented"), ("calibrated", "and with a lens")):
            residuals = residuals_px(image.fits[step])
            fields[f"{short}, {words}"] = replace(image.found, d_px=residuals)
    return fields
