"""Figure of seams: the pixels where two heads meet, from as they were taken to blended."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from numpy.typing import NDArray

from acx4book.typesetting import style
from acx4book.typesetting.pictures import (
    ALL_LEVELS,
    NO_PICTURES,
    Window,
    border_distances,
    common_stretch,
    displayed,
    extent_mm,
    frameless,
    smaller,
    window_xy,
)
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Mask, Raster
from acx4lib.geometry.camera import Camera, xy_from_colrow
from acx4lib.stages.pictures import Pictures
from acx4lib.stages.synthetic import Refinement
from acx4lib.synthetic_image.frame import (
    footprint,
    head_from_synthetic,
    reduced_camera,
    reduced_heads,
    synthetic_from_head,
)
from acx4lib.synthetic_image.head_map import window_map
from acx4lib.synthetic_image.rendering import FEATHER_PX, RenderPlan, render
from acx4lib.synthetic_image.response import ResponseFit

SIDE_PX = 56
"""Of an enlarged part, synthetic pixels."""

SEARCH_PX = 700
"""Longer side of the reduced synthetic image in which places are chosen."""

LEAST_TEXTURE = 0.02
"""Of log grey values: less does not hide a step any better."""

COLUMNS = ("as taken", "heads refined", "and equalised", "and blended")


@dataclass(frozen=True, kw_only=True, eq=False)
class _Seams:
    """The reduced synthetic image, pixel by pixel.

    Attributes
    ----------
    xy : ndarray, shape (rows, cols, 2)
        mm.
    distance : ndarray, shape (n_heads, rows, cols)
        From the heads' borders, px.
    grey : ndarray, shape (rows, cols)
        Logarithm, equalised.
    step : ndarray, shape (rows, cols)
        How far a step of brightness would stand out from the ground.
    """

    xy: Array
    distance: Array
    grey: Array
    step: Array

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
    """Return where misfit is seen best, where unequal brightness is, and the middle."""
    found = _searched(images, heads[1], synthetic, response)
    on_seam = _on_seams(found)
    chosen = []
    for seen in (_jump(found, heads, synthetic), found.step):
        if on_seam.any():
            at = np.unravel_index(np.argmax(np.where(on_seam, seen, -1.0)), seen.shape)
            nearest = np.sort(np.argsort(found.distance[:, at[0], at[1]])[-2:])
            names = " | ".join(style.plain(heads[0].heads[k].name) for k in nearest)
            chosen.append((names, found.xy[at]))
            far = np.hypot(*np.moveaxis(found.xy - found.xy[at], -1, 0))
            on_seam &= far > 3 * SIDE_PX * synthetic.pixel_mm
    chosen.append(("the middle", _finer(found.xy[_meeting(found.distance)], heads[1])))
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
    less = [np.rint(smaller(image, k)).astype(image.dtype) for image in images]
    taken, equal = (
        np.log(np.maximum(_rendered(less, small_heads, small, whole, fit, 0.0), 1.0))
        for fit in (None, response)
    )
    xy = window_xy(small, whole)
    distance = border_distances(small_heads, xy.reshape(-1, 2)).reshape(-1, *xy.shape[:2])
    grey = equal.mean(axis=2)
    return _Seams(xy=xy, distance=distance, grey=grey, step=_step(taken - equal, grey))


def _step(response: Array, grey: Array) -> Array:
    """Return how far the log response changes within three pixels, over the ground's texture."""
    around = np.ones((3, 3), np.uint8)
    step = (cv2.dilate(response, around) - cv2.erode(response, around)).reshape(*grey.shape, -1)
    mean = cv2.blur(grey, (9, 9))
    texture = np.sqrt(np.maximum(cv2.blur(grey**2, (9, 9)) - mean**2, 0))
    bright = np.exp(mean - mean.max())  # a step in the dark is not seen
    out: Array = step.max(axis=2) * bright / (texture + LEAST_TEXTURE)
    return out


def _jump(found: _Seams, heads: Sequence[RelativeOrientation], synthetic: Camera) -> Array:
    """Return how far grey values jump at a seam because heads do not fit, shape (rows, cols).

    The gradient times the misfit; a hundredth of a pixel of misfit is always assumed, so that
    texture decides where heads fit.
    """
    off = np.zeros(found.xy.shape)
    order = np.argsort(found.distance, axis=0)[::-1]
    behind = np.take_along_axis(found.distance, order[1:2], axis=0)[0]
    near = (behind > 0) & (found.distance.max(axis=0) - behind < 10)  # a seam is on its way
    for used, sign in ((order[0], 1.0), (order[1], -1.0)):
        for k in range(len(heads[0].heads)):
            own = near & (used == k)
            colrow = head_from_synthetic(heads[1], k, found.xy[own])
            off[own] += sign * synthetic_from_head(heads[0], k, colrow)
    off += 0.01 * synthetic.pixel_mm
    down, right = np.gradient(cv2.GaussianBlur(found.grey, (0, 0), 1.0))
    jump = np.square(right * off[..., 0] - down * off[..., 1])
    out: Array = cv2.blur(jump, (9, 9))
    return out


def _on_seams(found: _Seams) -> Mask:
    """Tell which pixels lie on the seam of two heads, away from the frame and from others."""
    first = found.first
    near = cv2.dilate(first, np.ones((3, 3))) != cv2.erode(first, np.ones((3, 3)))
    margin = max(first.shape) // 12
    heads = np.arange(len(found.distance))[:, None, None] == first
    wide = np.ones((2 * margin + 1, 2 * margin + 1), np.uint8)
    n_near = sum(cv2.dilate(head.astype(np.uint8), wide) for head in heads)
    inner = np.zeros(first.shape, dtype=bool)
    inner[margin:-margin, margin:-margin] = True
    seen = cv2.erode((found.distance.max(axis=0) > 0).astype(np.uint8), wide) > 0
    out: Mask = near & inner & seen & (n_near == 2)
    return out


def _meeting(distance: Array) -> tuple[int, int]:
    """Return where three heads meet, or as many as there are."""
    nearest = np.sort(distance, axis=0)[::-1]
    for n in range(min(3, len(distance)), 0, -1):
        spread = np.where(nearest[n - 1] > 0, nearest[0] - nearest[n - 1], np.inf)
        if np.isfinite(spread).any():
            at = np.unravel_index(np.argmin(spread), spread.shape)
            return int(at[0]), int(at[1])
    return 0, 0


def _finer(xy: Array, heads: RelativeOrientation) -> Array:
    """Return the point near a coarse one where heads meet, mm."""
    steps = np.linspace(-1, 1, 81) * SIDE_PX * heads.heads[0].pixel_mm
    grid = xy + np.stack(np.meshgrid(steps, steps), axis=-1)
    distance = border_distances(heads, grid.reshape(-1, 2)).reshape(-1, *grid.shape[:2])
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
    """Draw at the margins of a crop where the head that is used changes."""
    xy = window_xy(synthetic, window)
    first = np.argmax(border_distances(heads, xy.reshape(-1, 2)), axis=0).reshape(xy.shape[:2])
    last = first.shape[0] - 0.5, first.shape[1] - 0.5
    dash: dict[str, Any] = {"color": style.BRICK, "lw": 1.1, "clip_on": False, "zorder": 6}
    out = 0.045 * first.shape[0]
    for row, start, way in ((0, -0.5, -1), (-1, last[0], 1)):
        for at in np.flatnonzero(np.diff(first[row])) + 0.5:
            ax.plot([at, at], [start, start + way * out], **dash)
    for col, start, way in ((0, -0.5, -1), (-1, last[1], 1)):
        for at in np.flatnonzero(np.diff(first[:, col])) + 0.5:
            ax.plot([start, start + way * out], [at, at], **dash)
    ax.set(xlim=(-0.5, last[1]), ylim=(last[0], -0.5))


def _draw_plan(
    ax: Axes, orientation: RelativeOrientation, synthetic: Camera, place: _Place
) -> None:
    """Draw where in the frame a place is."""
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
