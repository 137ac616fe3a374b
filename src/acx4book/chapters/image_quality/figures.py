"""Figures of the quality of the synthetic image: deviations, seams, distortion (section 4.1)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import PercentFormatter

from acx4book.chapters.image_quality.deviations import (
    Deviations,
    KnownExposure,
    border_depth,
    render_known,
)
from acx4book.chapters.image_quality.examined import TargetErrors
from acx4book.paper import printed
from acx4book.typesetting import style
from acx4lib.bundle.adjust import Bundle
from acx4lib.calibration.heads import RelativeOrientation, radial_profile
from acx4lib.expected import Array, Raster
from acx4lib.geometry.camera import Camera, colrow_from_xy, xy_from_colrow
from acx4lib.synthetic_image.frame import (
    footprint,
    head_from_synthetic,
    reduced_camera,
    reduced_heads,
)
from acx4lib.synthetic_image.rendering import FEATHER_PX, resample
from acx4lib.synthetic_image.response import Response, log_response

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
"""Colours of the orientations, by the names of `deviations.every_refinement`."""


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


# --- seams -----------------------------------------------------------------------------------


def seam_profiles(profile: SeamProfile) -> Figure:
    """Draw grey values along a line across a seam: as taken, equalised, and blended."""
    thousand = 1000.0
    titles = (
        ("As the heads took them", _disagreement(profile.taken)),
        ("Equalised", _disagreement(profile.equalised)),
        ("Blended", "beside the ideal camera's, brought to the same mean"),
    )
    with style.applied():
        fig, axes = style.subplots(3, 1, figsize=(style.WIDTH, 5.2), sharex=True, sharey=True)
        for ax, (title, subtitle) in zip(axes, titles, strict=True):
            ax.axvspan(-FEATHER_PX / 2, FEATHER_PX / 2, color=style.SKY, alpha=0.22, lw=0, zorder=0)
            ax.axvline(0, color=style.SOFT, lw=0.7, ls=":", zorder=1)
            style.heading(ax, title, subtitle)
            ax.set_ylabel("grey value (1000 DN)")
        for ax, values in zip(axes, (profile.taken, profile.equalised), strict=False):
            for tint, name, line in zip(
                (style.BLUE, style.ORANGE), profile.names, values, strict=True
            ):
                ax.plot(profile.x_px, line / thousand, color=tint, lw=1.2, label=name)
        level = profile.blended.mean() / profile.ideal.mean()
        axes[2].plot(
            profile.x_px, level * profile.ideal / thousand, color=style.TEAL, lw=2.6, alpha=0.45,
            label="ideal camera",
        )  # fmt: skip
        axes[2].plot(
            profile.x_px,
            profile.blended / thousand,
            color=style.INK,
            lw=0.9,
            label="synthetic image",
        )
        axes[2].set_xlabel("from the seam, across it (px)")
        axes[2].set_xlim(profile.x_px[0], profile.x_px[-1])
        handles = [*axes[0].get_legend_handles_labels()[0], *axes[2].get_legend_handles_labels()[0]]
        handles.append(Line2D([], [], color=style.SKY, lw=6, alpha=0.5, label="width of the blend"))
        style.legend_below(fig, handles)
    return fig


def _disagreement(values: Array) -> str:
    ratio = np.log(values[1] / values[0])
    return f"ratio of the two heads off one by {100 * np.sqrt(np.nanmean(ratio**2)):.1f} % (rms)"


def overlap_differences(picture: OverlapPicture) -> Figure:
    """Draw a part of an overlap, and the differences of two heads there after each step."""
    limit = 0.15
    steps = tuple(picture.differences.items())
    with style.applied():
        fig, grid = style.subplots(2, 2, figsize=(style.WIDTH, 6.3))
        axes = list(grid.flat)
        low, high = np.nanpercentile(picture.grey, (1, 99))
        axes[0].imshow(picture.grey, cmap="gray", vmin=low, vmax=high, interpolation="nearest")
        style.heading(axes[0], "The ground", f"seen by {style.plain(picture.names[0])}")
        for ax, (title, d) in zip(axes[1:], steps, strict=True):
            shown = ax.imshow(
                d, cmap=style.DIVERGING, vmin=-limit, vmax=limit, interpolation="nearest"
            )
            rms = np.sqrt(np.nanmean(d**2))
            style.heading(
                ax, title[0].upper() + title[1:], f"rms {100 * rms:.1f} % of the grey value"
            )
        for ax in axes:
            style.bare(ax)
            ax.set(xticks=[], yticks=[])
        bar = fig.colorbar(
            shown, ax=axes, orientation="horizontal", fraction=0.03, aspect=60, pad=0.03
        )
        bar.ax.xaxis.set_major_formatter(PercentFormatter(1.0, decimals=0))
        first, second = (style.plain(name) for name in picture.names)
        bar.set_label(f"{second} less {first}, of the grey value")
        bar.outline.set_visible(False)
    return fig


# --- distortion ------------------------------------------------------------------------------


def distortion_taken_up(
    fits: Mapping[str, Bundle], names: Mapping[str, str], draws: pd.DataFrame, targets: TargetErrors
) -> Figure:
    """Draw the radial distortion that a self-calibration finds in synthetic images.

    Parameters
    ----------
    fits : mapping of str to Bundle
        Self-calibrations with the lens free, by the names of `deviations.every_refinement`.
    names : mapping of str to str
        Their names for readers.
    draws : DataFrame
        As `examined.drawn_errors` returns it.
    targets : TargetErrors
    """
    border = printed.statement("synthetic_border_distortion_px")
    with style.applied():
        fig, (left, right) = style.subplots(
            1, 2, figsize=(style.WIDTH, 3.6), width_ratios=(1.25, 1)
        )
        corner = 0.0
        for name, fit in fits.items():
            r, px, sigma = radial_profile(fit)
            corner = float(r[-1])
            left.fill_between(r, px - sigma, px + sigma, color=TINTS[name], alpha=0.2, lw=0)
            left.plot(r, px, color=TINTS[name], label=names[name])
        for sign in (1, -1):
            left.plot(
                [corner], [sign * border], "D", mfc=style.PAPER, mec=style.PRINTED, ms=5, zorder=5
            )
        left.axhline(0, color=style.INK, lw=0.7)
        left.set(xlabel="radius (mm)", ylabel="radial distortion (px)", xlim=(0, 1.04 * corner))
        style.heading(left, "One calibration, on pixels", "bands: one standard deviation")
        _draw_draws(right, draws, targets, names)
        handles: list[Any] = left.get_legend_handles_labels()[0]
        handles.append(
            Line2D(
                [],
                [],
                color=style.PRINTED,
                ls="--",
                marker="D",
                mfc=style.PAPER,
                ms=5,
                label="paper",
            )
        )
        style.legend_below(fig, handles, ncols=3)
    return fig


def _draw_draws(
    ax: Axes, draws: pd.DataFrame, targets: TargetErrors, names: Mapping[str, str]
) -> None:
    border = printed.statement("synthetic_border_distortion_px")
    refined = draws[draws["refinement"] != "before"]
    groups: list[tuple[str, str, Array]] = [
        (names[str(name)], TINTS[str(name)], group["radial_px"].to_numpy())
        for name, group in refined.groupby("refinement", sort=False)
    ]
    groups.append(
        (f"{targets.n_targets} targets\nin a perfect image", style.SOFT, targets.radial_px)
    )
    for row, (_, tint, values) in enumerate(groups):
        spread = 0.32 * (np.argsort(np.argsort(values * 7919 % 1)) / len(values) - 0.5)
        ax.plot(values, row + spread, "o", color=tint, ms=2.4, alpha=0.45, mew=0)
        ax.plot([np.median(values)] * 2, [row - 0.3, row + 0.3], color=style.INK, lw=1.6)
    ax.axvline(border, color=style.PRINTED, ls="--", lw=1.0, zorder=1)
    ax.set_yticks(range(len(groups)), [name for name, _, _ in groups])
    ax.set(xscale="log", ylim=(len(groups) - 0.5, -0.5), xlabel="largest radial distortion (px)")
    ax.grid(axis="y", visible=False)
    style.heading(ax, "Many, by geometry", "dots: draws; bars: their medians")


# --- Where two heads meet: grey values across a seam, and differences in an overlap


BAND = 1
"""Index of the green band."""

ROW_SHARE = 0.75
"""Place where the line crosses the seam, as a share of the frame's height."""

AVERAGED_ROWS = 8
"""Rows of the picture at hand whose mean is drawn."""

Window = tuple[int, int, int, int]
"""First row, row behind the last, first column, column behind the last."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SeamProfile:
    """Grey values of a band along a line across the seam of two heads.

    Attributes
    ----------
    names : tuple of str
        The two heads.
    x_px : ndarray, shape (n,)
        From the seam, px of the full-size synthetic image.
    taken, equalised : ndarray, shape (2, n)
        Of both heads, as they are and divided by their response; NaN where one does not see.
    blended, ideal : ndarray, shape (n,)
        Of the synthetic image, and of the ideal camera's.
    """

    names: tuple[str, str]
    x_px: Array
    taken: Array
    equalised: Array
    blended: Array
    ideal: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class OverlapPicture:
    """A part of an overlap in the images of two heads.

    Attributes
    ----------
    names : tuple of str
        The two heads.
    grey : ndarray, shape (rows, cols)
        In the image of the first head.
    differences : dict of str to ndarray, shape (rows, cols)
        Second less first, as a share of their mean, by the steps of correction.
    """

    names: tuple[str, str]
    grey: Array
    differences: dict[str, Array]


PAIR = (0, 3)
"""The left and the right one of the lower heads."""


def seam_profile(
    known: KnownExposure,
    orientation: RelativeOrientation,
    response: Response,
) -> SeamProfile:
    """Return grey values across the seam of two heads that stand beside each other.

    Parameters
    ----------
    known : KnownExposure
    orientation : RelativeOrientation
        Full size.
    response : Response
    """
    row, col = _seam(known, orientation)
    half = int(2.5 * FEATHER_PX / known.reduce)
    window = (row, row + AVERAGED_ROWS, col - half, col + half)
    taken = [_seen(known, orientation, k, window, None)[..., BAND].mean(axis=0) for k in PAIR]
    equal = [_seen(known, orientation, k, window, response)[..., BAND].mean(axis=0) for k in PAIR]
    blended = _mean_rows(render_known(known, orientation, response), window)
    return SeamProfile(
        names=_names(known),
        x_px=known.reduce * (np.arange(-half, half) + 0.5),
        taken=np.stack(taken),
        equalised=np.stack(equal),
        blended=blended,
        ideal=_mean_rows(known.ideal, window),
    )


def overlap_picture(
    known: KnownExposure,
    orientations: tuple[RelativeOrientation, RelativeOrientation],
    response: Response,
    *,
    size_px: tuple[int, int] = (130, 174),
) -> OverlapPicture:
    """Return a part of an overlap, and the differences of its heads before and after.

    Parameters
    ----------
    known : KnownExposure
    orientations : tuple of RelativeOrientation
        As calibrated and refined, full size.
    response : Response
    size_px : tuple of int
        Rows and columns, of the picture at hand.
    """
    row, col = _seam(known, orientations[1])
    rows, cols = size_px
    window = (row - rows // 2, row + rows // 2, col - cols // 2, col + cols // 2)
    calibrated, refined = orientations
    return OverlapPicture(
        names=_names(known),
        grey=_seen(known, refined, PAIR[0], window, None).mean(axis=2),
        differences={
            "as taken": _difference(known, calibrated, window, None),
            "equalised": _difference(known, calibrated, window, response),
            "equalised and refined": _difference(known, refined, window, response),
        },
    )


def _names(known: KnownExposure) -> tuple[str, str]:
    first, second = (known.orientation.heads[k].name for k in PAIR)
    return first, second


def _seam(known: KnownExposure, orientation: RelativeOrientation) -> tuple[int, int]:
    """Return the row and column where the borders of both heads are equally far."""
    small = reduced_camera(known.synthetic, known.reduce)
    row = int(ROW_SHARE * small.height_px)
    cols = np.arange(small.width_px, dtype=float)
    xy = xy_from_colrow(small, np.column_stack([cols, np.full(len(cols), row)]))
    left, right = (
        border_depth(orientation.heads[k], head_from_synthetic(orientation, k, xy)) for k in PAIR
    )
    shared = np.flatnonzero((left > 0) & (right > 0))
    return row, int(shared[np.argmin(np.abs(left - right)[shared])])


def _seen(
    known: KnownExposure,
    orientation: RelativeOrientation,
    k: int,
    window: Window,
    response: Response | None,
) -> Array:
    """Return a head's grey values in a window, equalised if its response is given."""
    small = reduced_camera(known.synthetic, known.reduce)
    heads = reduced_heads(orientation, known.reduce)
    grey, seen = resample(known.images[k], heads, k, small, window)
    out = np.where(seen[..., None], grey, np.nan)
    if response is None:
        return out
    rows, cols = np.arange(window[0], window[1]), np.arange(window[2], window[3])
    places = np.stack(np.meshgrid(cols, rows), axis=-1).reshape(-1, 2).astype(float)
    colrow = head_from_synthetic(heads, k, xy_from_colrow(small, places))
    factor = np.exp(log_response(response, k, colrow, heads.heads[k]))
    return out / factor.reshape(out.shape)


def _difference(
    known: KnownExposure,
    orientation: RelativeOrientation,
    window: Window,
    response: Response | None,
) -> Array:
    a, b = (_seen(known, orientation, k, window, response).mean(axis=2) for k in PAIR)
    return 2 * (b - a) / (a + b)


def _mean_rows(image: Raster, window: Window) -> Array:
    part = image[window[0] : window[1], window[2] : window[3], BAND]
    mean: Array = part.mean(axis=0, dtype=float)
    return mean
