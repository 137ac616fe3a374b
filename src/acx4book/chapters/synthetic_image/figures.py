"""Figures of the synthetic image's geometry and of the heads' responses (Figure 1, Table 2)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from matplotlib.ticker import FuncFormatter, NullFormatter
from numpy.typing import NDArray

from acx4book.chapters.synthetic_image.tables import WAYS
from acx4book.typesetting import pictures, style
from acx4book.typesetting.pictures import (
    ALL_LEVELS,
    NO_PICTURES,
    Window,
    common_stretch,
    displayed,
    extent_mm,
    frameless,
    smaller,
)
from acx4files.stages.pictures import Pictures
from acx4files.stages.synthetic import Refinement
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Mask, Raster
from acx4lib.geometry.camera import Camera, xy_from_colrow
from acx4lib.synthetic_image.frame import (
    Coverage,
    coverage,
    footprint,
    head_from_synthetic,
    reduced_camera,
    reduced_heads,
    synthetic_from_head,
)
from acx4lib.synthetic_image.head_map import window_map
from acx4lib.synthetic_image.rendering import FEATHER_PX, RenderPlan, render
from acx4lib.synthetic_image.response import OverlapResponse, ResponseFit
from acx4lib.tie_points.ties import Overlap

COUNTS = ("#d9603f66", "#4a86c010", "#4a86c040", "#4a86c080", "#4a86c0c0")
"""Fills of parts seen by no head, and by one to four or more heads; transparent."""

SHOWN = {
    "before": WAYS["before"],
    "mean shift": f"less by {WAYS['mean shift']}",
    "rotations": f"less by {WAYS['rotations']}",
}
"""Panels of `refinements`: the differences before, and the parts that two ways remove."""

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
    """
    n = len(orientations)
    with style.applied():
        fig, axes = style.subplots(1, n, figsize=_size(synthetic, n), squeeze=False)
        most = 0
        for ax, orientation, title in zip(axes[0], orientations, titles, strict=True):
            cover = coverage(orientation, synthetic)
            _draw_counts(ax, cover)
            _draw_frame(ax, synthetic, [orientation])
            _draw_outlines(ax, orientation)
            style.heading(ax, title, f"{100 * cover.share[0]:.1f} % seen by no head")
            most = max(most, int(cover.count.max()))
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


def _draw_counts(ax: Axes, cover: Coverage) -> None:
    x, y = cover.xy[0, :, 0], cover.xy[:, 0, 1]
    ax.pcolormesh(
        *(x, y, np.minimum(cover.count, len(COUNTS) - 1)),
        cmap=ListedColormap(list(COUNTS)),
        norm=BoundaryNorm(np.arange(len(COUNTS) + 1) - 0.5, len(COUNTS)),
        shading="flat",
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
    named = not faint and pictures.middles_apart(orientation)
    for k, head in enumerate(orientation.heads):
        outline = footprint(orientation, k, per_side=30)
        width = 0.7 if faint else 1.4
        ax.plot(*outline.T, color=style.colour(k), lw=width, alpha=0.6 if faint else 1, zorder=4)
        if named:
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
    """Draw the differences between heads at tie points, and the part that refinements remove.

    Returns
    -------
    Figure
        The available ways of `SHOWN`: means of cells, in pixels of the synthetic image, with one
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
    drawn = {t: pairs if pairs is before else _taken(before, pairs) for t, pairs in fields.items()}
    means = {title: [_cell_means(o, size) for o in pairs] for title, pairs in drawn.items()}
    every = np.concatenate([d for field in means.values() for _, d in field])
    key = style.round_length(max(float(np.hypot(*every.T).max(initial=0.0)) / pixel, 1e-6))
    width, height = _size(synthetic, len(fields))
    key_at = 0.95, -25 / 72 / (height - 1.2)  # on the line of the axis label
    scale = size / (key * pixel)
    with style.applied():
        fig, axes = style.subplots(
            1, len(fields), figsize=(width, height), sharey=True, squeeze=False
        )
        for ax, (title, pairs) in zip(axes[0], fields.items(), strict=True):
            _draw_outlines(ax, refined.orientation, faint=True)
            _draw_frame(ax, synthetic, [refined.orientation])
            _draw_vectors(ax, means[title], scale=scale, key=key, pixel=pixel, key_at=key_at)
            d = np.concatenate([o.d for o in pairs]) / pixel
            style.heading(ax, title, f"{'' if pairs is before else 'left: '}{_rms_and_largest(d)}")
            ax.set_ylabel(ax.get_ylabel() if ax is axes[0, 0] else "")
        handles = [
            Line2D([], [], color=style.colour(k), lw=1, label=style.plain(head.name))
            for k, head in enumerate(refined.orientation.heads)
        ]
        style.legend_below(fig, handles)
    return fig


def _taken(before: Sequence[Overlap], after: Sequence[Overlap]) -> list[Overlap]:
    """Return the part of the differences that a refinement removes."""
    pairs = zip(before, after, strict=True)
    return [replace(earlier, d=earlier.d - later.d) for earlier, later in pairs]


def _rms_and_largest(d: Array) -> str:
    """Write the root mean square in one coordinate and the longest difference, px."""
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


BANDS = {
    1: ("grey",),
    3: ("red", "green", "blue"),
    4: ("red", "green", "blue", "near infrared"),
}
"""Usual order of bands by their number."""


def response_curves(fit: ResponseFit | None, orientation: RelativeOrientation) -> Figure:
    """Draw every head's response from the middle to the corner, and the overlaps' disagreement.

    Parameters
    ----------
    fit : ResponseFit or None
    orientation : RelativeOrientation
        Names the heads.

    Returns
    -------
    Figure
        Upper panels: per band, relative to the mean of the heads in the middle, with one standard
        deviation. Lower panel: robust rms of the log ratio of two heads, band by band.

    Notes
    -----
    The standard deviation at a distance is that of the coefficients as if they were independent;
    the overlaps know the sum of the radial terms better than each.
    """
    if fit is None or not fit.overlaps:
        return style.nothing("No two heads overlap in pixels, so nothing tells their responses.")
    n_bands = fit.response.coefficients.shape[1]
    names = [style.plain(head.name) for head in orientation.heads]
    with style.applied():
        fig = style.figure(figsize=(style.WIDTH, 3.35 + 0.26 * len(fit.overlaps)))
        parts: Any = fig.subfigures(2, 1, height_ratios=[2.35, 0.75 + 0.26 * len(fit.overlaps)])
        upper, lower = parts
        axes = upper.subplots(1, n_bands, sharey=True, squeeze=False)[0]
        for band, ax in enumerate(axes):
            _draw_band(ax, fit, band)
            ax.set_title(BANDS[n_bands][band] if n_bands in BANDS else f"band {band + 1}")
        axes[0].set_ylabel("response (%)")
        _draw_overlaps(lower.subplots(), fit.overlaps, names)
        style.legend_below(fig, _handles(names), ncols=len(names) + 3)
    return fig


def _draw_band(ax: Axes, fit: ResponseFit, band: int) -> None:
    """Draw the response of all heads in one band over the distance from the middle."""
    r = np.linspace(0, 1, 61)
    powers = np.stack([np.ones_like(r), r**2, r**4], axis=1)
    for k, head in enumerate(fit.response.coefficients[:, band]):
        log = powers @ head
        sigma = np.sqrt(powers**2 @ fit.sigma[k, band] ** 2)
        ax.fill_between(
            *(r, 100 * np.exp(log - sigma), 100 * np.exp(log + sigma)),
            color=style.colour(k),
            alpha=0.16,
            lw=0,
        )
        ax.plot(r, 100 * np.exp(log), color=style.colour(k))
    ax.set(xlim=(0, 1), xlabel="distance over the corner's (1)")


def _draw_overlaps(ax: Axes, overlaps: Sequence[OverlapResponse], names: Sequence[str]) -> None:
    """Draw the disagreement of every pair of heads and band, before and after."""
    n_bands = len(overlaps[0].before)
    offset = 0.17 * (np.arange(n_bands) - (n_bands - 1) / 2)
    for line, overlap in enumerate(overlaps):
        y = line + offset
        before, after = (100 * np.expm1(v) for v in (overlap.before, overlap.after))
        ax.hlines(y, after, before, color=style.SOFT, lw=0.8, alpha=0.7)
        ax.plot(before, y, "o", ms=4.5, mfc=style.PAPER, mec=style.INK, mew=1.0)
        ax.plot(after, y, "o", ms=4.5, color=style.INK)
    labels = [f"{names[o.head_a]}, {names[o.head_b]}" for o in overlaps]
    ax.set(xscale="log", yticks=range(len(overlaps)), yticklabels=labels)
    ax.set(ylim=(len(overlaps) - 0.5, -0.5), xlabel="disagreement, robust rms (%)")
    _percent_axis(ax, overlaps)
    every = [np.concatenate([getattr(o, name) for o in overlaps]) for name in ("before", "after")]
    worst = [100 * float(np.expm1(v).max()) for v in every]
    style.heading(
        ax,
        "the same ground in two heads",
        f"at most {worst[0]:.1f} % as taken and {worst[1]:.2f} % after; one dot per band",
    )


def _percent_axis(ax: Axes, overlaps: Sequence[OverlapResponse]) -> None:
    """Set limits and round numbers of a logarithmic axis in per cent."""
    values = np.concatenate([np.concatenate([o.before, o.after]) for o in overlaps])
    percent = 100 * np.expm1(values[values > 0]) if (values > 0).any() else np.array([1.0])
    low, high = float(percent.min()) / 1.4, float(percent.max()) * 1.4
    rounds = np.array([m * 10.0**e for e in range(-4, 3) for m in (1, 2, 5)])
    ax.set(xlim=(low, high), xticks=rounds[(rounds >= low) & (rounds <= high)])
    ax.xaxis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.tick_params(axis="x", which="minor", length=0)
    ax.grid(visible=False, axis="y")


def _handles(names: Sequence[str]) -> list[Any]:
    heads = [Line2D([], [], color=style.colour(k), label=name) for k, name in enumerate(names)]
    dot: dict[str, Any] = {"color": "none", "marker": "o", "ms": 4.5, "markeredgecolor": style.INK}
    return [
        *heads,
        Line2D([], [], mfc=style.PAPER, label="as taken", **dot),
        Line2D([], [], mfc=style.INK, label="equalised", **dot),
    ]


# --- Figure of seams: the pixels where two heads meet, from as they were taken to blended


SIDE_PX = 56
"""Side of an enlarged part, synthetic pixels."""

SEARCH_PX = 700
"""Longer side of the reduced synthetic image in which places are chosen."""

LEAST_TEXTURE = 0.02
"""Added to the texture, of log grey values: a smaller one does not show a step any better."""

COLUMNS = ("as taken", "heads refined", "and equalised", "and blended")


@dataclass(frozen=True, kw_only=True, eq=False)
class _Seams:
    """The reduced synthetic image, pixel by pixel."""

    xy: Array  # mm
    distance: Array  # of every head's borders, px
    grey: Array  # logarithm, equalised
    step: Array  # how far a step of brightness would stand out from the ground

    @property
    def first(self) -> NDArray[np.uint8]:
        """Head that is used."""
        return np.argmax(self.distance, axis=0).astype(np.uint8)


@dataclass(frozen=True, kw_only=True)
class _Place:
    name: str
    window: Window


def seams(
    pictures: Pictures | None,
    refined: Refinement,
    response: ResponseFit | None,
    *,
    feather_px: float = FEATHER_PX,
) -> Figure:
    """Draw places on the seams enlarged, with the heads as they came, refined, equalised, blended.

    Places are where three heads meet in the middle, where the heads' misfit before the refinement
    and the ground's edges do most to a seam, and where unequal brightness is seen best.

    Parameters
    ----------
    pictures : Pictures or None
        The exposure in the middle is drawn.
    refined : Refinement
    response : ResponseFit or None
        None leaves grey values as they were taken.
    feather_px : float
        Width of the blend, pixels at full size; all columns but the last have a hard seam.

    Returns
    -------
    Figure
        One row per place, with one stretch; a sentence where there are no pictures.
    """
    if pictures is None:
        return style.nothing(NO_PICTURES)
    images, k = pictures.middle.images, pictures.reduction
    before, after = refined.before, refined.orientation
    heads = [reduced_heads(orientation, k) for orientation in (before, after)]
    places = _places(images, heads, pictures.synthetic, response)
    plans = ((0, None, 0.0), (1, None, 0.0), (1, response, 0.0), (1, response, feather_px / k))
    with style.applied():
        fig, axes = style.subplots(
            *(len(places), 1 + len(plans)),
            figsize=(style.WIDTH, 1.55 * len(places) + 0.2),
            width_ratios=[0.72] + [1.0] * len(plans),
            squeeze=False,
        )
        for line, place in zip(axes, places, strict=True):
            _draw_plan(line[0], after, pictures.synthetic, place)
            crops = [
                _rendered(images, heads[i], pictures.synthetic, place.window, fit, feather)
                for i, fit, feather in plans
            ]
            stretch = common_stretch(crops)
            for ax, crop, (i, _, feather) in zip(line[1:], crops, plans, strict=True):
                ax.imshow(displayed(crop, stretch, levels=ALL_LEVELS), interpolation="nearest")
                frameless(ax)
                if feather == 0:
                    _mark_seam(ax, heads[i], pictures.synthetic, place.window)
        for ax, title in zip(axes[0, 1:], COLUMNS, strict=True):
            ax.set_title(title, pad=8)
    return fig


def _rendered(
    images: Sequence[Raster],
    heads: RelativeOrientation,
    synthetic: Camera,
    window: Window,
    response: ResponseFit | None,
    feather_px: float,
) -> Raster:
    """Render a part of the synthetic image."""
    maps = tuple(window_map(heads, k, synthetic, window) for k in range(len(heads.heads)))
    plan = RenderPlan(
        maps=maps,
        width_px=window[3] - window[2],
        height_px=window[1] - window[0],
        response=None if response is None else response.response,
        feather_px=feather_px,
    )
    out: Raster = render(plan, images)
    return out


# --- where -----------------------------------------------------------------------------------


def _places(
    images: Sequence[Raster],
    heads: Sequence[RelativeOrientation],
    synthetic: Camera,
    response: ResponseFit | None,
) -> list[_Place]:
    """Return the places of the clearest misfit, the clearest step of brightness, and the middle."""
    searched = _searched(images, heads[1], synthetic, response)
    on_seam = _on_seams(searched)
    chosen = []
    for score in (_jump(searched, heads, synthetic), searched.step):
        if on_seam.any():
            place = np.unravel_index(np.argmax(np.where(on_seam, score, -1.0)), score.shape)
            nearest = np.sort(np.argsort(searched.distance[:, place[0], place[1]])[-2:])
            names = " | ".join(style.plain(heads[0].heads[k].name) for k in nearest)
            chosen.append((names, searched.xy[place]))
            far = np.hypot(*np.moveaxis(searched.xy - searched.xy[place], -1, 0))
            on_seam &= far > 3 * SIDE_PX * synthetic.pixel_mm
    chosen.append(("the middle", _finer(searched.xy[_meeting(searched.distance)], heads[1])))
    return [_Place(name=name, window=_window(xy, synthetic)) for name, xy in chosen]


def _searched(
    images: Sequence[Raster],
    heads: RelativeOrientation,
    synthetic: Camera,
    response: ResponseFit | None,
) -> _Seams:
    """Return the synthetic image reduced, with hard seams."""
    k = max(1, round(max(synthetic.width_px, synthetic.height_px) / SEARCH_PX))
    small, small_heads = reduced_camera(synthetic, k), reduced_heads(heads, k)
    whole = (0, small.height_px, 0, small.width_px)
    reduced = [np.rint(smaller(image, k)).astype(image.dtype) for image in images]
    taken, equal = (
        np.log(np.maximum(_rendered(reduced, small_heads, small, whole, fit, 0.0), 1.0))
        for fit in (None, response)
    )
    xy = _window_xy(small, whole)
    distance = _border_distances(small_heads, xy.reshape(-1, 2)).reshape(-1, *xy.shape[:2])
    grey = equal.mean(axis=2)
    return _Seams(xy=xy, distance=distance, grey=grey, step=_step(taken - equal, grey))


def _window_xy(synthetic: Camera, window: Window) -> Array:
    """Return the positions of a synthetic image part's pixels, shape (rows, cols, 2), mm."""
    cols, rows = np.arange(window[2], window[3]), np.arange(window[0], window[1])
    return xy_from_colrow(synthetic, np.stack(np.meshgrid(cols, rows), axis=-1).astype(float))


def _border_distances(orientation: RelativeOrientation, xy: Array) -> Array:
    """Return the distances of points from the borders of the heads, shape (n_heads, n), px."""
    out = np.empty((len(orientation.heads), len(xy)))
    for k, camera in enumerate(orientation.heads):
        colrow = head_from_synthetic(orientation, k, xy) + 0.5
        size = np.array([camera.width_px, camera.height_px])
        out[k] = np.minimum(colrow, size - colrow).min(axis=1)
    return np.nan_to_num(out, nan=-np.inf)


def _step(response: Array, grey: Array) -> Array:
    """Return the change of the log response within three pixels, over the ground's texture."""
    around = np.ones((3, 3), np.uint8)
    step = (cv2.dilate(response, around) - cv2.erode(response, around)).reshape(*grey.shape, -1)
    mean = cv2.blur(grey, (9, 9))
    texture = np.sqrt(np.maximum(cv2.blur(grey**2, (9, 9)) - mean**2, 0))
    bright = np.exp(mean - mean.max())  # a step in the dark is not seen
    out: Array = step.max(axis=2) * bright / (texture + LEAST_TEXTURE)
    return out


def _jump(searched: _Seams, heads: Sequence[RelativeOrientation], synthetic: Camera) -> Array:
    """Return the jump of grey values at a seam where heads do not fit, shape (rows, cols).

    The gradient times the misfit; a hundredth of a pixel of misfit is always assumed, so that
    texture decides where heads fit.
    """
    off = np.zeros(searched.xy.shape)
    order = np.argsort(searched.distance, axis=0)[::-1]
    behind = np.take_along_axis(searched.distance, order[1:2], axis=0)[0]
    near = (behind > 0) & (searched.distance.max(axis=0) - behind < 10)  # a seam is on its way
    for used, sign in ((order[0], 1.0), (order[1], -1.0)):
        for k in range(len(heads[0].heads)):
            in_head = near & (used == k)
            colrow = head_from_synthetic(heads[1], k, searched.xy[in_head])
            off[in_head] += sign * synthetic_from_head(heads[0], k, colrow)
    off += 0.01 * synthetic.pixel_mm
    down, right = np.gradient(cv2.GaussianBlur(searched.grey, (0, 0), 1.0))
    jump = np.square(right * off[..., 0] - down * off[..., 1])
    out: Array = cv2.blur(jump, (9, 9))
    return out


def _on_seams(searched: _Seams) -> Mask:
    """Mark the pixels on the seam of two heads, away from the frame and from other seams."""
    first = searched.first
    near = cv2.dilate(first, np.ones((3, 3))) != cv2.erode(first, np.ones((3, 3)))
    margin = max(first.shape) // 12
    heads = np.arange(len(searched.distance))[:, None, None] == first
    wide = np.ones((2 * margin + 1, 2 * margin + 1), np.uint8)
    n_near = sum(cv2.dilate(head.astype(np.uint8), wide) for head in heads)
    inner = np.zeros(first.shape, dtype=bool)
    inner[margin:-margin, margin:-margin] = True
    seen = cv2.erode((searched.distance.max(axis=0) > 0).astype(np.uint8), wide) > 0
    out: Mask = near & inner & seen & (n_near == 2)
    return out


def _meeting(distance: Array) -> tuple[int, int]:
    """Return the pixel where three heads meet, or all heads if there are fewer."""
    nearest = np.sort(distance, axis=0)[::-1]
    for n in range(min(3, len(distance)), 0, -1):
        spread = np.where(nearest[n - 1] > 0, nearest[0] - nearest[n - 1], np.inf)
        if np.isfinite(spread).any():
            place = np.unravel_index(np.argmin(spread), spread.shape)
            return int(place[0]), int(place[1])
    return 0, 0


def _finer(xy: Array, heads: RelativeOrientation) -> Array:
    """Return the point near a coarse one where heads meet, mm."""
    steps = np.linspace(-1, 1, 81) * SIDE_PX * heads.heads[0].pixel_mm
    grid = xy + np.stack(np.meshgrid(steps, steps), axis=-1)
    distance = _border_distances(heads, grid.reshape(-1, 2)).reshape(-1, *grid.shape[:2])
    out: Array = grid[_meeting(distance)]
    return out


def _window(xy: Array, synthetic: Camera) -> Window:
    """Return the pixels around a point, inside the image."""
    h, w = synthetic.height_px, synthetic.width_px
    side = min(SIDE_PX, h, w)
    upper_left = xy_from_colrow(synthetic, np.zeros((1, 2)))[0]
    col, row = np.rint((xy - upper_left) * [1, -1] / synthetic.pixel_mm).astype(int) - side // 2
    top, left = int(np.clip(row, 0, h - side)), int(np.clip(col, 0, w - side))
    return top, top + side, left, left + side


# --- drawn -----------------------------------------------------------------------------------


def _mark_seam(ax: Axes, heads: RelativeOrientation, synthetic: Camera, window: Window) -> None:
    """Mark the seams at the margins of a crop."""
    xy = _window_xy(synthetic, window)
    first = np.argmax(_border_distances(heads, xy.reshape(-1, 2)), axis=0).reshape(xy.shape[:2])
    last = first.shape[0] - 0.5, first.shape[1] - 0.5
    dash: dict[str, Any] = {"color": style.BRICK, "lw": 1.1, "clip_on": False, "zorder": 6}
    out = 0.045 * first.shape[0]
    for row, start, way in ((0, -0.5, -1), (-1, last[0], 1)):
        for seam in np.flatnonzero(np.diff(first[row])) + 0.5:
            ax.plot([seam, seam], [start, start + way * out], **dash)
    for col, start, way in ((0, -0.5, -1), (-1, last[1], 1)):
        for seam in np.flatnonzero(np.diff(first[:, col])) + 0.5:
            ax.plot([start, start + way * out], [seam, seam], **dash)
    ax.set(xlim=(-0.5, last[1]), ylim=(last[0], -0.5))


def _draw_plan(
    ax: Axes, orientation: RelativeOrientation, synthetic: Camera, place: _Place
) -> None:
    """Draw the place in the frame."""
    left, right, bottom, top = extent_mm(synthetic)
    ax.add_patch(
        Rectangle((left, bottom), right - left, top - bottom, fc=style.PAPER, ec=style.SOFT, lw=0.8)
    )
    for k in range(len(orientation.heads)):
        ax.plot(
            *footprint(orientation, k, per_side=20).T, color=style.colour(k), lw=0.7, alpha=0.75
        )
    x0, x1, y0, y1 = extent_mm(synthetic, place.window)
    ax.plot((x0 + x1) / 2, (y0 + y1) / 2, "s", ms=6, mfc="none", mec=style.INK, mew=1.3, zorder=6)
    style.bare(ax)
    ax.set(xlim=(1.18 * left, 1.18 * right), ylim=(1.18 * bottom, 1.18 * top), aspect="equal")
    ax.set(xticks=[], yticks=[])
    ax.set_title(place.name, fontsize=style.SMALL, pad=3)
