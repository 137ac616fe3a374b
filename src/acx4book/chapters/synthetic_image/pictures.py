"""Figures of pixels: the heads' pictures, their tie points, and the synthetic image."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, LinearSegmentedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from acx4book.typesetting import style
from acx4book.typesetting.pictures import (
    ALL_LEVELS,
    DPI,
    HALO,
    NO_PICTURES,
    OUTLINED,
    Stretch,
    Window,
    common_stretch,
    displayed,
    extent_mm,
    frameless,
    middle_xy,
    middles_apart,
    smaller,
)
from acx4files.stages.pictures import Exposed, Pictures
from acx4files.stages.synthetic import Refinement
from acx4lib.calibration.heads import RelativeOrientation
from acx4lib.expected import Array, Index, Raster
from acx4lib.geometry.camera import Camera, inside
from acx4lib.synthetic_image.frame import (
    footprint,
    head_from_synthetic,
    reduced_camera,
    reduced_heads,
)
from acx4lib.synthetic_image.rendering import resample
from acx4lib.tie_points.matching import SharedWindow, shared_windows
from acx4lib.tie_points.ties import overlaps

FRAMES_WIDTH = 5.1
"""Width of the heads' pictures beside each other, inches; limited by the size of the file."""

IMAGE_WIDTH = 3.5
"""Width of the synthetic image, inches."""

CROP_PX = 170
"""Side of the enlarged parts of `synthetic_picture`, pixels."""

STACK_PX = 64
"""Side of the enlarged parts of `stack`, pixels: a tenth of one is still a visible fringe."""

COLOURS = ("red", "green", "blue")

SEEN = 0.9
"""Share of every column of an enlarged part in which all bands have data, at least."""

EDGE_PX = 5
"""Side of the means, px, by which a town's edges stand out from a field's fine pattern."""


# --- as they were taken ----------------------------------------------------------------------


def head_pictures(pictures: Pictures | None, orientation: RelativeOrientation) -> Figure:
    """Draw the images of all heads as they were taken, where each lies in the synthetic image.

    All heads and bands have one stretch, so that differences of gain and falloff are visible.

    Parameters
    ----------
    pictures : Pictures or None
        The exposure in the middle is drawn.
    orientation : RelativeOrientation
        Of the full-size heads; gives the direction of flight, and the middle of the synthetic
        image.

    Returns
    -------
    Figure
        A sentence where there are no pictures.
    """
    if pictures is None:
        return style.nothing(NO_PICTURES)
    exposure = pictures.middle
    grid = _places(orientation)
    n_rows, n_cols = grid.shape
    wide = FRAMES_WIDTH / n_cols - 0.2
    small = [smaller(image, _factor_for(image.shape[1], wide)) for image in exposure.images]
    stretch = common_stretch(small)
    first = orientation.heads[0]
    tall = n_rows * (wide * first.height_px / first.width_px + 0.3) + 0.1
    with style.applied():
        fig = style.figure(figsize=(style.WIDTH, tall))
        ratios = [FRAMES_WIDTH / n_cols] * n_cols + [style.WIDTH - FRAMES_WIDTH]
        cells = fig.add_gridspec(n_rows, n_cols + 1, width_ratios=ratios)
        for k, image in enumerate(small):
            row, col = np.argwhere(grid == k)[0]
            ax = fig.add_subplot(cells[row, col])
            _draw_head(ax, displayed(image, stretch), orientation, k)
            _draw_directions(ax, orientation, k, pictures.synthetic)
        _draw_scheme(fig.add_subplot(cells[:, -1]), orientation, pictures.synthetic)
    return fig


def _factor_for(size_px: int, inches: float) -> int:
    """Return the factor of reduction with which an image has about the pixels of a figure."""
    return max(1, round(size_px / (DPI * inches)))


def _places(orientation: RelativeOrientation) -> Index:
    """Return the heads in rows and columns as they lie in the synthetic image, -1 for none.

    Heads that lie in one place are in their order.
    """
    middle = np.array([middle_xy(orientation, k) for k in range(len(orientation.heads))])
    n = len(middle)
    n_cols = int(np.ceil(np.sqrt(n)))
    grid = np.full((-(-n // n_cols), n_cols), -1)
    if not middles_apart(orientation):
        grid.flat[:n] = np.arange(n)
        return grid
    downwards = np.argsort(-middle[:, 1], kind="stable")
    for row, start in enumerate(range(0, n, n_cols)):
        heads = downwards[start : start + n_cols]
        grid[row, : len(heads)] = heads[np.argsort(middle[heads, 0], kind="stable")]
    return grid


def _draw_head(ax: Axes, image: Array, orientation: RelativeOrientation, k: int) -> None:
    """Draw a head's picture in full-size pixels, rows down."""
    camera = orientation.heads[k]
    w, h = camera.width_px, camera.height_px
    extent: Any = (-0.5, w - 0.5, h - 0.5, -0.5)
    ax.imshow(image, extent=extent, interpolation="nearest")
    frameless(ax)
    ax.set_title(style.plain(camera.name), color=style.colour(k), pad=4)


def _draw_directions(ax: Axes, orientation: RelativeOrientation, k: int, synthetic: Camera) -> None:
    """Draw the direction of flight, and the middle of the synthetic image."""
    camera = orientation.heads[k]
    ends = _flight_arrow(synthetic, 0.13 * camera.width_px * camera.pixel_mm)
    tail, tip = head_from_synthetic(orientation, k, middle_xy(orientation, k) + ends)
    arrow = {"arrowstyle": "->", "color": "white", "lw": 1.6, "mutation_scale": 11}
    style_of = arrow | {"path_effects": OUTLINED}
    ax.annotate("", xy=tuple(tip), xytext=tuple(tail), arrowprops=style_of)
    middle = head_from_synthetic(orientation, k, np.zeros((1, 2)))[0]
    if inside(camera, middle):
        ax.plot(*middle, "o", ms=6, mfc="none", mec="white", mew=1.5, path_effects=OUTLINED)


def _flight_arrow(synthetic: Camera, length: float) -> Array:
    """Return tail and tip of an arrow in the direction of flight, shape (2, 2), mm."""
    forward = synthetic.T_b_c.R.T[:2, 0]
    return length * np.array([-0.5, 0.5])[:, None] * forward


def _draw_scheme(ax: Axes, orientation: RelativeOrientation, synthetic: Camera) -> None:
    """Draw the heads in the frame of the synthetic image, with the marks of the pictures."""
    left, right, bottom, top = extent_mm(synthetic)
    ax.add_patch(
        Rectangle((left, bottom), right - left, top - bottom, fc=style.PAPER, ec=style.INK, lw=1)
    )
    named = middles_apart(orientation)
    outlines = [footprint(orientation, k, per_side=20) for k in range(len(orientation.heads))]
    low = min(bottom, *(float(np.nanmin(outline[:, 1])) for outline in outlines))
    for k, camera in enumerate(orientation.heads):
        ax.plot(*outlines[k].T, color=style.colour(k), lw=0.8)
        if named:
            ax.annotate(
                style.plain(camera.name),
                tuple(middle_xy(orientation, k)),
                ha="center",
                va="center",
                color=style.colour(k),
                weight="bold",
                fontsize=style.SMALL,
            )
    ax.plot(0, 0, "o", ms=6, mfc="none", mec=style.INK, mew=1.3)
    ends = _flight_arrow(synthetic, 0.4 * (right - left))
    tail, tip = ends + np.array([0, 1.15 * low - ends[:, 1].max()])
    arrow = {"arrowstyle": "->", "color": style.INK, "lw": 1.4, "mutation_scale": 11}
    ax.annotate("", xy=tuple(tip), xytext=tuple(tail), arrowprops=arrow)
    font: dict[str, Any] = {
        "ha": "center",
        "va": "top",
        "fontsize": style.SMALL,
        "color": style.SOFT,
    }
    under = min(tail[1], tip[1]) + 0.07 * bottom
    ax.text(0, under, "arrow: flight\nring: middle of the image", **font)
    style.bare(ax)
    reach = max(float(np.nanmax(np.abs(outline[:, 0]))) for outline in outlines)
    wide = min(max(1.35 * right, 1.03 * reach), 2 * right)
    ax.set(xticks=[], yticks=[], xlim=(-wide, wide), aspect="equal")
    ax.set_ylim(under + 0.25 * bottom, max(1.25 * top, -low))
    style.heading(ax, "where they lie", "in the synthetic image")


# --- put together ----------------------------------------------------------------------------


def synthetic_picture(
    image: Raster | None,
    pictures: Pictures | None,
    orientation: RelativeOrientation,
    *,
    height_m: float | None = None,
) -> Figure:
    """Draw the synthetic image, the outlines of its heads, and two places of it enlarged.

    Parameters
    ----------
    image : ndarray or None, shape (rows, cols, bands)
    pictures : Pictures or None
        From which the image was rendered.
    orientation : RelativeOrientation
    height_m : float, optional
        Flying height over ground; the scale bar is one on the ground then, in the image else.

    Returns
    -------
    Figure
        A sentence where there is no image.
    """
    if image is None or pictures is None:
        return style.nothing(NO_PICTURES)
    synthetic, wide = pictures.synthetic, IMAGE_WIDTH
    k = _factor_for(image.shape[1], wide)
    small = smaller(image, k)
    stretch = common_stretch([small])
    places = _busiest(image)
    tall = wide * synthetic.height_px / synthetic.width_px
    with style.applied():
        fig = style.figure(figsize=(style.WIDTH, tall + 0.45))
        grid = fig.add_gridspec(len(places), 2, width_ratios=[wide, tall / len(places)])
        ax = fig.add_subplot(grid[:, 0])
        _in_mm(ax, displayed(small, stretch), reduced_camera(synthetic, k))
        _draw_heads(ax, orientation, synthetic)
        left, right, bottom, top = extent_mm(synthetic)
        ax.set(xlim=(left, right), ylim=(bottom, top))
        _draw_scale(ax, synthetic, height_m)
        for number, window in enumerate(places):
            _mark(ax, synthetic, window, "AB"[number])
            _draw_crop(fig.add_subplot(grid[number, 1]), image, stretch, window, "AB"[number])
        frameless(ax)
        size = (
            f"{synthetic.width_px} × {synthetic.height_px} px of {1000 * synthetic.pixel_mm:g} µm"
        )
        style.heading(ax, "synthetic image", size)
    return fig


def _in_mm(ax: Axes, image: Array, synthetic: Camera, window: Window | None = None) -> Any:
    """Draw a displayed part of the synthetic image at its position, mm."""
    extent: Any = extent_mm(synthetic, window)
    return ax.imshow(image, extent=extent, origin="upper", interpolation="nearest", zorder=1)


def stack(pictures: Pictures | None, refined: Refinement) -> Figure:
    """Draw the images of three heads over each other as red, green and blue.

    Parameters
    ----------
    pictures : Pictures or None
        The exposure in the middle is drawn, of the first three heads: the third is red, as heads
        are mostly in the order of their wavelengths. Every band has a stretch of its own.
    refined : Refinement

    Returns
    -------
    Figure
        Two places of it are enlarged, with the heads as they were calibrated and as refined; a
        sentence where there are no pictures.
    """
    if pictures is None:
        return style.nothing(NO_PICTURES)
    synthetic, images = pictures.synthetic, pictures.middle.images[:3]
    before, after = (
        reduced_heads(heads, pictures.reduction) for heads in (refined.before, refined.orientation)
    )
    whole = _stacked(images, after, synthetic, (0, synthetic.height_px, 0, synthetic.width_px))
    stretches = [common_stretch([whole[..., [band]]]) for band in range(whole.shape[2])]
    k = _factor_for(whole.shape[1], IMAGE_WIDTH)
    places = _busiest(whole, side=STACK_PX)
    tall = IMAGE_WIDTH * synthetic.height_px / synthetic.width_px
    with style.applied():
        fig = style.figure(figsize=(style.WIDTH, max(tall + 0.45, 3.5)))
        side = (style.WIDTH - IMAGE_WIDTH) / 2
        grid = fig.add_gridspec(len(places), 3, width_ratios=[IMAGE_WIDTH, side, side])
        ax = fig.add_subplot(grid[:, 0])
        _in_mm(ax, _coloured(smaller(whole, k), stretches), reduced_camera(synthetic, k))
        names = [style.plain(head.name) for head in after.heads[:3]]
        shown = ", ".join(
            f"{name} as {colour}" for name, colour in zip(names[::-1], COLOURS, strict=False)
        )
        for row, window in enumerate(places):
            _mark(ax, synthetic, window, "AB"[row])
            for column, (title, heads) in enumerate(
                (("as calibrated", before), ("refined", after)), 1
            ):
                crop = fig.add_subplot(grid[row, column])
                part = _stacked(images, heads, synthetic, window)
                crop.imshow(_coloured(part, stretches), interpolation="nearest")
                frameless(crop)
                crop.set_title(f"{'AB'[row]}, {title}")
        frameless(ax)
        style.heading(ax, "heads over each other", shown)
    return fig


def _stacked(
    images: Sequence[Raster], heads: RelativeOrientation, synthetic: Camera, window: Window
) -> Array:
    """Return a part of the synthetic image with a band for every head."""
    bands = [
        _greyed(resample(image, heads, k, synthetic, window)) for k, image in enumerate(images)
    ]
    return np.concatenate(bands, axis=-1)


def _greyed(image: Raster) -> Array:
    """Return the mean of the bands, shape (rows, cols, 1)."""
    return np.asarray(image[..., :3].mean(axis=-1, keepdims=True))


def _coloured(bands: Array, stretches: Sequence[Stretch]) -> Array:
    """Return bands for a screen: the last is red; of two, the first is both green and blue."""
    shown = [
        displayed(bands[..., [band]], stretch, levels=ALL_LEVELS)[..., 0]
        for band, stretch in enumerate(stretches)
    ]
    return np.stack([*shown[::-1], *shown[:1] * (3 - len(shown))], axis=-1)


def _draw_heads(ax: Axes, orientation: RelativeOrientation, synthetic: Camera) -> None:
    """Draw outlines, and names at the border of the image."""
    left, right, bottom, top = extent_mm(synthetic)
    border = np.array([right - left, top - bottom]) / 2
    for k in range(len(orientation.heads)):
        outline = footprint(orientation, k, per_side=30)
        ax.plot(*outline.T, color="white", lw=1.6, alpha=0.35, zorder=3)
        ax.plot(*outline.T, color=style.colour(k), lw=0.8, alpha=0.9, zorder=4)
        side = np.sign(np.round(middle_xy(orientation, k), 3))
        ax.annotate(
            orientation.heads[k].name,
            tuple(side * (border - 0.02 * border.min())),
            ha=("left", "center", "right")[int(side[0]) + 1],
            va=("bottom", "center", "top")[int(side[1]) + 1],
            color=style.colour(k),
            weight="bold",
            path_effects=HALO,
            zorder=6,
        )


def _draw_scale(ax: Axes, synthetic: Camera, height_m: float | None) -> None:
    """Draw a scale bar under the picture."""
    f = synthetic.interior.f
    per_mm, unit = (1.0, "mm") if height_m is None else (height_m / f, "m")
    style.scale_bar(ax, per_axis_unit=per_mm, unit=unit, at=(0.0, -0.055))


def _busiest(image: Raster | Array, *, side: int = CROP_PX) -> list[Window]:
    """Return the two windows with most edges, at least a third of the image apart.

    One window where no other has pixels.
    """
    side = min(side, *image.shape[:2])
    rows, cols = image.shape[0] // side, image.shape[1] // side
    score = np.zeros((rows, cols))
    for i in range(rows):
        line = np.sqrt(smaller(image[i * side : (i + 1) * side], min(EDGE_PX, side)))
        edges = np.abs(np.diff(line, axis=1)).mean(axis=(0, 2))
        parts = np.array_split(edges, cols)
        filled = np.array_split(image[i * side : (i + 1) * side].all(axis=2).mean(axis=0), cols)
        score[i] = [
            part.mean() if part.size and share.min() > SEEN else 0.0
            for part, share in zip(parts, filled, strict=True)
        ]
    inner = score[1:-1, 1:-1] if min(rows, cols) > 4 else score  # names stand at the border
    offset = (rows - inner.shape[0]) // 2
    place = np.moveaxis(np.indices(inner.shape), 0, -1)
    first = place[np.unravel_index(np.argmax(inner), inner.shape)]
    far = np.hypot(*np.moveaxis(place - first, -1, 0)) >= max(rows, cols) / 3
    second = place[np.unravel_index(np.argmax(np.where(far, inner, -1)), inner.shape)]
    chosen = (first, second) if inner[tuple(second)] > 0 else (first,)
    cells = sorted({(int(i) + offset, int(j) + offset) for i, j in chosen})
    return [(i * side, (i + 1) * side, j * side, (j + 1) * side) for i, j in cells]


def _mark(ax: Axes, synthetic: Camera, window: Window, letter: str) -> None:
    """Draw the frame of an enlarged part."""
    left, right, bottom, top = extent_mm(synthetic, window)
    for width, ink in ((2.4, style.BLACK), (1.2, "white")):
        ax.add_patch(
            Rectangle((left, bottom), right - left, top - bottom, fc="none", ec=ink, lw=width)
        ).set_zorder(7)
    ax.annotate(
        letter,
        (right, top),
        xytext=(3, 0),
        textcoords="offset points",
        va="top",
        weight="bold",
        path_effects=HALO,
        zorder=8,
    )


def _draw_crop(ax: Axes, image: Raster, stretch: Stretch, window: Window, letter: str) -> None:
    """Draw pixels as squares."""
    top, bottom, left, right = window
    part = displayed(image[top:bottom, left:right], stretch, levels=ALL_LEVELS)
    ax.imshow(part, interpolation="nearest")
    frameless(ax)
    style.heading(ax, letter, f"{right - left} × {bottom - top} px at column {left}, row {top}")


# --- tie points over an overlap --------------------------------------------------------------

NO_TIES = "No tie point was found between two heads of this exposure."

LENGTHS = LinearSegmentedColormap.from_list(
    "acx4 lengths", ["#1d9a78", "#b9cf54", "#f0b429", "#e5701f", "#a3142f"]
)
"""Colours from short (green) to long (red), all visible over a grey picture."""


def overlap_ties(
    pictures: Pictures | None,
    orientation: RelativeOrientation,
    refined: Refinement,
    *,
    pair: tuple[int, int] | None = None,
) -> Figure:
    """Draw tie points over the picture of an overlap, coloured by the heads' differences.

    Parameters
    ----------
    pictures : Pictures or None
        The exposure in the middle is drawn.
    orientation : RelativeOrientation
        Of the full-size heads; the picture is drawn by it.
    refined : Refinement
        The differences by its orientation are drawn.
    pair : tuple of int, optional
        Two heads; those with most tie points unless given.

    Returns
    -------
    Figure
        Lengths of the differences in pixels of the synthetic image of the pictures' size; a
        sentence where there is nothing to draw.

    Notes
    -----
    The dashed line is predicted from the tie points' standard deviations: lengths of
    differences that are normal, independent and equal in both coordinates. Differences are longer
    where the heads do not fit each other.
    """
    if pictures is None:
        return style.nothing(NO_PICTURES)
    exposure = pictures.middle
    ties = refined.kept[refined.kept.exposure_idx == exposure.exposure_idx]
    by_pair = {(o.head_a, o.head_b): o for o in overlaps(ties, refined.orientation)}
    if pair is None:
        pair = max(by_pair, key=lambda heads: len(by_pair[heads].d), default=(-1, -1))
    if pair not in by_pair:
        return style.nothing(NO_TIES)
    overlap = by_pair[pair]
    sigma = ties.sigma_px[(ties.head_a == pair[0]) & (ties.head_b == pair[1])]
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
        _draw_overlap(picture, exposure, orientation, pictures, shared)
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
    """Return a round length above nearly all lengths."""
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
    exposure: Exposed,
    orientation: RelativeOrientation,
    pictures: Pictures,
    shared: SharedWindow,
) -> None:
    """Draw an overlap in the image of the pair's first head, in light grey."""
    rows, cols = (
        shared.window[1] - shared.window[0],
        shared.window[3] - shared.window[2],
    )
    k = _factor_for(max(rows, cols), style.WIDTH - 0.5)
    synthetic = reduced_camera(pictures.synthetic, k)
    heads = reduced_heads(orientation, pictures.reduction * k)
    first, last, left, right = (n // k for n in shared.window)
    window = (first, max(last, first + 2), left, max(right, left + 2))
    head = shared.head_a
    small = np.rint(smaller(exposure.images[head], k)).astype(exposure.images[head].dtype)
    grey = _greyed(resample(small, heads, head, synthetic, window))
    stretch = common_stretch([grey])
    light = 0.42 + 0.5 * displayed(grey, stretch)
    _in_mm(ax, np.dstack([light, grey > 0]), synthetic, window)  # nothing, by day and by night
    frameless(ax)


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
    """Draw the part of the frame that an overlap covers."""
    left, right, bottom, top = extent_mm(synthetic)
    ax.add_patch(
        Rectangle((left, bottom), right - left, top - bottom, fc=style.PAPER, ec=style.INK, lw=1)
    )
    named = middles_apart(orientation)
    for k in range(len(orientation.heads)):
        mine = k in (shared.head_a, shared.head_b)
        ax.fill(
            *footprint(orientation, k, per_side=20).T,
            fc=(style.colour(k), 0.28 if mine else 0.0),
            ec=(style.colour(k), 1.0 if mine else 0.35),
            lw=0.9,
        )
        if mine and named:
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
    """Draw the histogram of the differences' lengths, and the one that their sigma predict."""
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
