"""Figures of the synthetic image: the heads in its frame, and tie points (Figure 1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from acx4book.chapters.synthetic_image.tables import WAYS
from acx4book.typesetting import style
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera, xy_from_colrow
from acx4lib.stages.synthetic import Refinement
from acx4lib.synthetic_image.frame import Coverage, coverage, footprint
from acx4lib.tie_points.ties import Overlap

COUNTS = ("#d9603f66", "#4a86c010", "#4a86c040", "#4a86c080", "#4a86c0c0")
"""Grounds of what no head sees, and of what one to four or more heads see; light shines through."""

SHOWN = {
    "before": WAYS["before"],
    "mean shift": f"less by {WAYS['mean shift']}",
    "rotations": f"less by {WAYS['rotations']}",
}
"""Panels of `refinements`: before all, and what two ways to refine take away."""

CELLS = 12
"""Cells along the longer side of the synthetic image in `refinements`."""


def footprints(
    orientations: Sequence[RelativeOrientation], synthetic: Camera, titles: Sequence[str]
) -> Figure:
    """Draw the heads in the frame of the synthetic image, and how many of them see each part.

    Parameters
    ----------
    orientations : sequence of RelativeOrientation
        One drawing each.
    synthetic : Camera
    titles : sequence of str

    Returns
    -------
    Figure
    """
    n = len(orientations)
    with style.applied():
        fig, axes = style.subplots(1, n, figsize=_size(synthetic, n), squeeze=False)
        most = 0
        for ax, orientation, title in zip(axes[0], orientations, titles, strict=True):
            found = coverage(orientation, synthetic)
            _draw_counts(ax, found)
            _draw_frame(ax, synthetic, [orientation])
            _draw_outlines(ax, orientation)
            style.heading(ax, title, f"{100 * found.share[0]:.1f} % seen by no head")
            most = max(most, int(found.seen.sum(axis=0).max()))
        first = orientations[0]
        handles: list[Any] = [
            Line2D([], [], color=style.colour(k), label=style.plain(head.name))
            for k, head in enumerate(first.heads)
        ]
        counts = range(min(most, len(COUNTS) - 1) + 1)
        handles += [_count_patch(count, len(first.heads)) for count in counts]
        style.legend_below(fig, handles, ncols=5)
    return fig


def _size(synthetic: Camera, n: int) -> tuple[float, float]:
    """Return the size of a figure of n frames beside each other."""
    tall = 0.95 * synthetic.height_px / synthetic.width_px
    width = style.WIDTH / n - 0.65
    return style.WIDTH, float(np.clip(width * tall, 1.5, 4.3)) + 1.2


def _count_patch(count: int, n_heads: int) -> Patch:
    label = ("no head", "1 head", "2 heads", "3 heads", "4 heads")[count]
    label += " or more" if count == len(COUNTS) - 1 < n_heads else ""
    return Patch(fc=COUNTS[count], ec=style.SOFT, lw=0.4, label=label)


def _draw_counts(ax: Axes, found: Coverage) -> None:
    count = np.minimum(found.seen.sum(axis=0), len(COUNTS) - 1)
    x, y = found.xy[0, :, 0], found.xy[:, 0, 1]
    ax.pcolormesh(
        *(x, y, count),
        cmap=ListedColormap(list(COUNTS)),
        norm=BoundaryNorm(np.arange(len(COUNTS) + 1) - 0.5, len(COUNTS)),
        shading="nearest",
        rasterized=True,
        zorder=1,
    )


def _draw_frame(ax: Axes, synthetic: Camera, orientations: Sequence[RelativeOrientation]) -> None:
    """Draw the border of the synthetic image and set the limits of the axes, mm."""
    w, h = synthetic.width_px, synthetic.height_px
    upper, lower = xy_from_colrow(synthetic, np.array([[-0.5, -0.5], [w - 0.5, h - 0.5]]))
    size = lower - upper
    ax.add_patch(Rectangle(tuple(upper), *size, fc="none", ec=style.INK, lw=1.4, zorder=5))
    shown = [footprint(o, k) for o in orientations for k in range(len(o.heads))]
    corners = np.concatenate([*shown, upper[None], lower[None]])
    corners = corners[np.isfinite(corners).all(axis=1)]
    low, high = style.padded(corners.min(axis=0), corners.max(axis=0), share=0.02)
    limit = 1.6 * np.abs(size)  # heads that are read wrongly may lie anywhere
    low, high = np.maximum(low, -limit / 2), np.minimum(high, limit / 2)
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", anchor="N")
    ax.set(xlabel="$x$ (mm)", ylabel="$y$ (mm)")


def _draw_outlines(ax: Axes, orientation: RelativeOrientation, *, faint: bool = False) -> None:
    for k, head in enumerate(orientation.heads):
        outline = footprint(orientation, k, per_side=30)
        width = 0.7 if faint else 1.4
        ax.plot(*outline.T, color=style.colour(k), lw=width, alpha=0.6 if faint else 1, zorder=4)
        if not faint:
            middle = outline[:-1].mean(axis=0)
            ax.annotate(
                *(style.plain(head.name), tuple(middle)),
                ha="center",
                va="center",
                color=style.colour(k),
                weight="bold",
                annotation_clip=True,
                zorder=6,
            )


def refinements(refined: Refinement, synthetic: Camera) -> Figure:
    """Draw the differences between heads at tie points, and what refinements take away of them.

    Parameters
    ----------
    refined : Refinement
    synthetic : Camera

    Returns
    -------
    Figure
        Those of `SHOWN` that there are: means of cells, in pixels of the synthetic image, with one
        scale; only a dot is seen where they are zero.
    """
    fields = {
        title: refined.overlaps(way) for way, title in SHOWN.items() if way in refined.orientations
    }
    if not any(fields.values()):
        return style.nothing("No two heads share a tie point at an exposure.")
    pixel = synthetic.pixel_mm
    size = max(synthetic.width_px, synthetic.height_px) * pixel / CELLS
    before = next(iter(fields.values()))
    drawn = {t: found if found is before else _taken(before, found) for t, found in fields.items()}
    means = {title: [_cell_means(o, size) for o in found] for title, found in drawn.items()}
    every = np.concatenate([d for field in means.values() for _, d in field])
    key = style.round_length(max(float(np.hypot(*every.T).max(initial=0.0)) / pixel, 1e-6))
    width, height = _size(synthetic, len(fields))
    key_at = 0.95, -25 / 72 / (height - 1.2)  # on the line of the axis label
    scale = size / (key * pixel)
    with style.applied():
        fig, axes = style.subplots(
            1, len(fields), figsize=(width, height), sharey=True, squeeze=False
        )
        for ax, (title, found) in zip(axes[0], fields.items(), strict=True):
            _draw_outlines(ax, refined.orientation, faint=True)
            _draw_frame(ax, synthetic, [refined.orientation])
            _draw_vectors(ax, means[title], scale=scale, key=key, pixel=pixel, key_at=key_at)
            d = np.concatenate([o.d for o in found]) / pixel
            style.heading(ax, title, f"{'' if found is before else 'left: '}{_rms_and_largest(d)}")
            ax.set_ylabel(ax.get_ylabel() if ax is axes[0, 0] else "")
        handles = [
            Line2D([], [], color=style.colour(k), lw=1, label=style.plain(head.name))
            for k, head in enumerate(refined.orientation.heads)
        ]
        style.legend_below(fig, handles)
    return fig


def _taken(before: Sequence[Overlap], after: Sequence[Overlap]) -> list[Overlap]:
    """Return the part of the differences that a refinement takes away."""
    pairs = zip(before, after, strict=True)
    return [replace(one, d=one.d - other.d) for one, other in pairs]


def _rms_and_largest(d: Array) -> str:
    """Say the root mean square in one coordinate and the longest difference, px."""
    rms, largest = float(np.sqrt((d**2).mean())), float(np.hypot(*d.T).max())
    digits = 3 if rms < 0.1 else 2
    return f"rms {rms:.{digits}f}, largest {largest:.2f} px"


def _cell_means(overlap: Overlap, size: float) -> tuple[Array, Array]:
    """Return mean places and mean differences of cells of at least five points, mm."""
    cell = np.floor(overlap.xy / size).astype(int)
    cells, idx, count = np.unique(cell, axis=0, return_inverse=True, return_counts=True)
    enough = count >= min(5, len(overlap.d))
    weights = np.column_stack([overlap.xy, overlap.d])
    sums = [np.bincount(idx.ravel(), column, minlength=len(cells)) for column in weights.T]
    means = np.stack(sums, axis=1)[enough] / count[enough, None]
    return means[:, :2], means[:, 2:]


def _draw_vectors(
    ax: Axes,
    field: Sequence[tuple[Array, Array]],
    *,
    scale: float,
    key: float,
    pixel: float,
    key_at: tuple[float, float],
) -> None:
    middle = np.concatenate([xy for xy, _ in field])
    d = np.concatenate([d for _, d in field])
    ax.plot(
        *middle.T, ".", ms=1.6, color=style.SOFT, zorder=6
    )  # where arrows are too short to be seen
    arrows = ax.quiver(
        *middle.T,
        *(scale * d.T),
        color=style.INK,
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.0055,
        pivot="mid",
        zorder=7,
    )
    label = f"{key:g} px"
    ax.quiverkey(
        arrows,
        *key_at,
        scale * key * pixel,
        label,
        labelpos="W",
        fontproperties=style.LETTERS,
    )
