"""Figure of an overlap: tie points over its picture, coloured by what differs (Figure 1)."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from acx4book.typesetting import style
from acx4book.typesetting.pictures import (
    NO_PICTURES,
    Window,
    common_stretch,
    displayed,
    extent_mm,
    factor_for,
    frameless,
    greyed,
    in_mm,
    middle_xy,
    smaller,
)
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Raster
from acx4lib.geometry.camera import Camera
from acx4lib.stages.pictures import Exposed, Pictures
from acx4lib.stages.synthetic import Refinement
from acx4lib.synthetic_image.frame import footprint, reduced_camera, reduced_heads
from acx4lib.synthetic_image.rendering import resample
from acx4lib.tie_points.overlaps import SharedWindow, shared_windows
from acx4lib.tie_points.ties import overlaps

NO_TIES = "No tie point was found between two heads of this exposure."

LENGTHS = LinearSegmentedColormap.from_list(
    "acx4 lengths", ["#1d9a78", "#b9cf54", "#f0b429", "#e5701f", "#a3142f"]
)
"""From short (green) to long (red), all of them seen over a grey picture."""


def overlap_ties(
    pictures: Pictures | None,
    orientation: RelativeOrientation,
    refined: Refinement,
    *,
    pair: tuple[int, int] | None = None,
) -> Figure:
    """Draw tie points over the picture of an overlap, coloured by what differs there.

    Parameters
    ----------
    pictures : Pictures or None
        The exposure in the middle is drawn.
    orientation : RelativeOrientation
        Of the full-size heads; the picture is drawn by it.
    refined : Refinement
        Its orientation has the differences that are drawn: what is left.
    pair : tuple of int, optional
        Two heads; those with most tie points unless given.

    Returns
    -------
    Figure
        Lengths of the differences in pixels of the synthetic image of the pictures' size; a
        sentence where there is nothing to draw.

    Notes
    -----
    The dashed line is what the tie points' predicted standard deviations promise: lengths of
    differences that are normal, independent and equal in both coordinates. Differences are longer
    where the heads do not fit each other.
    """
    if pictures is None:
        return style.nothing(NO_PICTURES)
    one = pictures.middle
    own = refined.kept[refined.kept.exposure_idx == one.exposure_idx]
    found = {(o.head_a, o.head_b): o for o in overlaps(own, refined.orientation)}
    if pair is None:
        pair = max(found, key=lambda heads: len(found[heads].d), default=(-1, -1))
    if pair not in found:
        return style.nothing(NO_TIES)
    overlap = found[pair]
    sigma = own.sigma_px[(own.head_a == pair[0]) & (own.head_b == pair[1])]
    pixel = pictures.synthetic.pixel_mm
    lengths = np.hypot(*overlap.d.T) / pixel
    last = _last_length(lengths)
    shared = next(
        s
        for s in shared_windows(reduced_heads(orientation, pictures.reduction), pictures.synthetic)
        if (s.head_a, s.head_b) == pair
    )
    with style.applied():
        fig, (picture, plan, histogram) = _overlap_axes(shared.window)
        _draw_overlap(picture, one, orientation, pictures, shared)
        _draw_ties(picture, overlap.xy, lengths, last, size=_mark_size(shared, len(lengths)))
        names = " and ".join(style.plain(orientation.heads[k].name) for k in pair)
        style.heading(
            picture,
            names,
            f"{len(lengths)} tie points, pixels of {1000 * pixel:g} µm",
        )
        _draw_plan(plan, orientation, pictures.synthetic, shared)
        expected = np.sqrt(2) * sigma * orientation.heads[pair[0]].pixel_mm / pixel
        _draw_lengths(histogram, lengths, last, expected)
    return fig


def _last_length(lengths: Array) -> float:
    """Return a round length that nearly all are shorter than."""
    most = max(float(np.quantile(lengths, 0.99)), 1e-6)
    step = 10.0 ** np.floor(np.log10(most)) / 2
    return float(np.ceil(most / step) * step)


def _overlap_axes(window: Window) -> tuple[Figure, tuple[Axes, Axes, Axes]]:
    """Return axes for the picture of a window, for a plan and for a histogram."""
    aspect = (window[1] - window[0]) / (window[3] - window[2])
    if aspect < 0.8:
        tall = (style.WIDTH - 0.3) * aspect + 0.45
        fig = style.figure(figsize=(style.WIDTH, tall + 2.1))
        grid = fig.add_gridspec(2, 2, height_ratios=[tall, 2.1], width_ratios=[1, 3.4])
        places = grid[0, :], grid[1, 0], grid[1, 1]
    else:
        tall = float(np.clip(3.4 * aspect, 3.6, 5.6))
        wide = tall / aspect + 0.2
        fig = style.figure(figsize=(style.WIDTH, tall + 0.5))
        ratios = [wide, style.WIDTH - wide - 0.4]
        grid = fig.add_gridspec(2, 2, width_ratios=ratios, height_ratios=[1.2, 1])
        places = grid[:, 0], grid[0, 1], grid[1, 1]
    picture, plan, histogram = (fig.add_subplot(place) for place in places)
    return fig, (picture, plan, histogram)


def _draw_overlap(
    ax: Axes,
    one: Exposed,
    orientation: RelativeOrientation,
    pictures: Pictures,
    shared: SharedWindow,
) -> None:
    """Draw what the first head of a pair sees of an overlap, grey and light, and nothing else."""
    rows, cols = (
        shared.window[1] - shared.window[0],
        shared.window[3] - shared.window[2],
    )
    k = factor_for(max(rows, cols), style.WIDTH - 0.5)
    synthetic = reduced_camera(pictures.synthetic, k)
    heads = reduced_heads(orientation, pictures.reduction * k)
    first, last, left, right = (n // k for n in shared.window)
    window = (first, max(last, first + 2), left, max(right, left + 2))
    head = shared.head_a
    image, seen = resample(
        _whole(smaller(one.images[head], k), one.images[head]), heads, head, synthetic, window
    )
    grey = greyed(image)
    stretch = common_stretch([grey])
    light = 0.42 + 0.5 * displayed(grey, stretch)
    in_mm(ax, np.dstack([light, seen]), synthetic, window)  # nothing, by day and by night
    frameless(ax)


def _whole(means: Array, like: Raster) -> Raster:
    """Return means in the type of the image that they are of."""
    out: Raster = np.rint(means).astype(like.dtype)
    return out


def _mark_size(shared: SharedWindow, n: int) -> float:
    """Return the area of a mark, points squared, so that marks cover a quarter of an overlap."""
    longer_px = max(shared.window[1] - shared.window[0], shared.window[3] - shared.window[2])
    area = shared.area_px * (72 * (style.WIDTH - 1.2) / longer_px) ** 2
    return float(np.clip(0.25 * area / n, 1.6, 12.0))


def _draw_ties(ax: Axes, xy: Array, lengths: Array, last: float, *, size: float) -> None:
    order = np.argsort(lengths, kind="stable")  # long ones on top
    x, y = xy[order].T
    ax.scatter(
        x,
        y,
        c=lengths[order],
        cmap=LENGTHS,
        norm=BoundaryNorm(_bins(last), LENGTHS.N, extend="max"),
        s=size,
        lw=0,
        zorder=4,
        rasterized=True,
    )


def _bins(last: float) -> Array:
    return np.linspace(0, last, 21)


def _draw_plan(
    ax: Axes, orientation: RelativeOrientation, synthetic: Camera, shared: SharedWindow
) -> None:
    """Draw which part of the frame an overlap is."""
    left, right, bottom, top = extent_mm(synthetic)
    ax.add_patch(
        Rectangle((left, bottom), right - left, top - bottom, fc=style.PAPER, ec=style.INK, lw=1)
    )
    for k in range(len(orientation.heads)):
        mine = k in (shared.head_a, shared.head_b)
        ax.fill(
            *footprint(orientation, k, per_side=20).T,
            fc=(style.colour(k), 0.28 if mine else 0.0),
            ec=(style.colour(k), 1.0 if mine else 0.35),
            lw=0.9,
        )
        if mine:
            ax.annotate(
                orientation.heads[k].name,
                tuple(middle_xy(orientation, k)),
                ha="center",
                va="center",
                color=style.colour(k),
                weight="bold",
                fontsize=style.SMALL,
            )
    ax.autoscale_view()
    ax.set_aspect("equal")
    style.bare(ax)
    ax.set(xticks=[], yticks=[])


def _draw_lengths(ax: Axes, lengths: Array, last: float, sigma: Array) -> None:
    """Draw how many differences are how long, and how many should be by their sigma."""
    bins = _bins(last)
    count, _ = np.histogram(lengths, bins)
    middle = (bins[1:] + bins[:-1]) / 2
    width = bins[1] - bins[0]
    ax.bar(middle, count, width=0.92 * width, color=LENGTHS(middle / last), lw=0)
    known = sigma[np.isfinite(sigma) & (sigma > 0)]
    if len(known):
        beyond = np.exp(-0.5 * (bins[:, None] / known) ** 2).mean(axis=1)
        expected = len(lengths) * -np.diff(beyond)
        ax.plot(
            middle, expected, color=style.INK, ls="--", lw=1.1, label="matching alone, predicted"
        )
        ax.legend(loc="upper right")
    rms = float(np.sqrt(np.mean(lengths**2) / 2))
    below = 100 * float(np.mean(lengths < 0.1))
    style.heading(
        ax,
        "differences between the heads",
        f"rms {rms:.3f} px in one coordinate, {below:.1f} % below 0.1 px",
    )
    ax.annotate(
        f"{np.sum(lengths > last)} longer",
        xy=(1, 0),
        xytext=(0, 5),
        xycoords="axes fraction",
        textcoords="offset points",
        ha="right",
        fontsize=style.SMALL,
        color=style.SOFT,
    )
    ax.set(xlim=(0, last), xlabel="length of the difference (px)", ylabel="tie points (1)")
    ax.grid(visible=False, axis="x")
