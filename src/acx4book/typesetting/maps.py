"""Maps of a flight: the paper's Figures 3, 4 and 6."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator
from matplotlib.tri import Triangulation

from acx4book.typesetting import style
from acx4lib import design
from acx4lib.block import Block, SurveyedPoints
from acx4lib.expected import Array
from acx4lib.shown import count

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation


SLIMMEST = 0.4
"""Smallest ratio of a map's sides; narrower maps get free ground at their sides."""

NARROW = 0.05
"""Smallest extent of surveyed points for a map of their own, as a share of the flying height."""

LEVEL_COLOURS = (style.BLUE, style.ORANGE)
"""Colours of the flying heights, from the highest down; repeated if there are more heights."""


def block_maps(*blocks: Block | None) -> Figure:
    """Draw blocks as maps beside each other: strips, footprints, control and check points.

    Parameters
    ----------
    *blocks : Block or None
        None stands for a block that the flight does not have.

    Returns
    -------
    Figure
        The ground in images is tinted, more strongly where more images overlap. At every flying
        height the footprints of one exposure are outlined.
    """
    present = [block for block in blocks if block is not None]
    if not present:
        return style.nothing("The flight has no such block.")
    with style.applied():
        fig, axes = _maps([_extent(block) for block in present])
        handles: dict[str, Any] = {}
        for ax, block in zip(axes, present, strict=True):
            handles |= _draw_block(ax, block)
        style.legend_below(fig, list(handles.values()))
    return fig


def control_maps(*blocks: Block | None) -> Figure:
    """Draw the surveyed points of blocks: their names, heights and numbers of images.

    Parameters
    ----------
    *blocks : Block or None
        Blocks with the same points share one map; None stands for a block that the flight does
        not have.
    """
    fields = _fields([block for block in blocks if block is not None])
    if not fields:
        return style.nothing("No surveyed point is measured in any image.")
    with style.applied():
        fig, axes = _maps([_around(block) for block in fields.values()])
        for ax, (title, block) in zip(axes, fields.items(), strict=True):
            _draw_points(fig, ax, title, block)
    return fig


def _limits(shown: Array) -> tuple[Array, Array]:
    """Return the limits of positions, shape (..., 2), at least `SLIMMEST` times as wide as long."""
    low, high = np.nanmin(shown, axis=0), np.nanmax(shown, axis=0)
    missing = np.maximum(SLIMMEST * (high - low).max() - (high - low), 0) / 2
    return low - missing, high + missing


def _maps(extents: Sequence[Array]) -> tuple[Figure, list[Axes]]:
    """Return axes for maps beside each other, with heights that fit their content."""
    size = np.array([np.subtract(*_limits(extent)[::-1]) for extent in extents])
    tallest = float(np.max(size[:, 1] / np.maximum(size[:, 0], 1e-9)))
    width = style.WIDTH / len(extents) - 0.7
    height = float(np.clip(width * tallest * 1.1, 2.0, 5.4)) + 0.9
    fig, axes = style.subplots(1, len(extents), figsize=(style.WIDTH, height), squeeze=False)
    return fig, list(axes[0])


def _extent(block: Block) -> Array:
    """Return the positions to be shown on the map of a block, km."""
    corners = design.footprints(block).reshape(-1, 3)
    on_ground = corners[np.isfinite(corners).all(axis=1)]
    return _km(block, np.concatenate([block.trajectory.T_m_b.r, on_ground]))


def _km(block: Block, x_m: Array) -> Array:
    """Return grid east and north of mapping coordinates, km, any leading shape."""
    en = block.frame.to_grid(x_m.reshape(-1, 3))[:, :2] / 1000.0
    return en.reshape(*x_m.shape[:-1], 2)


def _draw_block(ax: Axes, block: Block) -> dict[str, Any]:
    """Draw one map and return legend handles by their labels."""
    levels = design.levels(block)
    corners = design.footprints(block)
    positions = _km(block, block.trajectory.T_m_b.r)
    outlines = _km(block, corners[np.isfinite(corners).all(axis=(1, 2))])
    ax.add_collection(
        PolyCollection(list(outlines), facecolor=style.SOFT, alpha=_tint(outlines), lw=0)
    )
    handles: dict[str, Any] = {}
    for i, level in enumerate(levels):
        colour = LEVEL_COLOURS[i % len(LEVEL_COLOURS)]
        _draw_level(ax, block, level, positions, colour=colour)
        words = ("higher strips", "lower strips") if len(levels) == 2 else ("strips",)
        name = words[min(i, len(words) - 1)] if any(level.strips) else "exposures"
        handles[name] = Line2D([], [], color=colour, marker="o", ms=2.5, lw=1, label=name)
    handles |= _draw_surveyed(ax, block)
    finish_map(ax, _extent(block), room=(0.05, 0.08))
    heights = " and ".join(f"{level.height_m:.0f}" for level in levels)
    known = np.isfinite(design.ground_height(block))
    above = f" from {heights} m above ground" if known else ""
    style.heading(ax, block.name, f"{count(len(block.images), 'image')}{above}")
    return handles


def _tint(outlines: Array) -> float:
    """Return the opacity of footprints that makes their mean overlap light grey."""
    if not len(outlines):
        return 0.0
    corners = outlines.reshape(-1, 2)
    hull = corners[Triangulation(*corners.T).triangles]
    return float(np.clip(0.28 * _areas(hull).sum() / _areas(outlines).sum(), 0.006, 0.15))


def _areas(polygons: Array) -> Array:
    """Return the areas of polygons, shape (n, corners, 2)."""
    x, y = polygons[..., 0], polygons[..., 1]
    twice = np.sum(x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1), axis=1)
    areas: Array = np.abs(twice) / 2
    return areas


def _draw_level(
    ax: Axes, block: Block, level: design.Level, positions: Array, *, colour: str
) -> None:
    """Draw the strips of one flying height with directions, and the footprints of one exposure."""
    towards = design.directions(block)
    strip_of = np.array(design.strip_of_exposure(block), dtype=object)
    for strip in level.strips:
        idx = np.flatnonzero(strip_of == strip)
        ax.plot(
            *positions[idx].T, "o" if not strip else "o-", color=colour, lw=0.9, ms=1.9, zorder=4
        )
        if strip and len(idx) > 1:
            reach = 0.9 * np.linalg.norm(positions[idx[-1]] - positions[idx[0]]) / (len(idx) - 1)
            ax.annotate(
                "",
                xy=positions[idx[-1]] + reach * towards[idx[-1]],
                xytext=positions[idx[-1]],
                arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 0.9, "shrinkA": 0},
                zorder=4,
            )
    of_strip = np.flatnonzero(strip_of == level.strips[len(level.strips) // 2])
    middle = of_strip[len(of_strip) // 2]
    corners = design.footprints(block)[block.images.exposure_idx == middle]
    outlines = PolyCollection(
        list(_km(block, corners)), facecolor="none", edgecolor=colour, lw=1.1, zorder=3
    )
    ax.add_collection(outlines)


def _draw_surveyed(ax: Axes, block: Block) -> dict[str, Any]:
    handles = {}
    for name, points, marker, fill in (
        ("control points", block.control, "^", style.BRICK),
        ("check points", block.check, "o", style.PAPER),
    ):
        if len(points):
            marks: dict[str, Any] = {"marker": marker, "mfc": fill, "mec": style.INK, "mew": 0.5}
            ax.plot(*_km(block, points.x_m).T, ls="", ms=3.0, zorder=5, **marks)
            handles[name] = Line2D([], [], ls="", ms=4.5, label=name, **marks)
    return handles


def finish_map(ax: Axes, shown: Array, *, room: tuple[float, float]) -> None:
    """Set limits, labels, scale bar and north arrow of a map in km.

    Parameters
    ----------
    ax : Axes
    shown : ndarray, shape (..., 2)
        Grid east and north of what it must show, km; NaN shows nothing.
    room : tuple of float
        For the north arrow on the left and the scale bar below, as shares of the map.
    """
    low, high = style.padded(*_limits(shown))
    low -= room * (high - low)
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal", anchor="N")
    ax.set(xlabel="grid east (km)", ylabel="grid north (km)")
    ax.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
    ax.yaxis.set_major_locator(MaxNLocator(5, steps=[1, 2, 5, 10]))
    unit = ("km", 1.0) if high[0] - low[0] > 4 else ("m", 1000.0)
    style.scale_bar(ax, per_axis_unit=unit[1], unit=unit[0], at=(0.05, 0.04))
    style.north_arrow(ax, at=(0.04, 0.98))


# --- surveyed points -------------------------------------------------------------------------


def _fields(blocks: Sequence[Block]) -> dict[str, Block]:
    """Return blocks with different sets of surveyed points, by the titles of their maps."""
    fields: dict[frozenset[str], list[Block]] = {}
    for block in blocks:
        names = frozenset(block.points[i] for i in _surveyed(block).point_idx)
        if names:
            key = next((known for known in fields if known & names), names)
            fields.setdefault(key, []).append(block)
    return {
        " and ".join(block.name for block in group): max(group, key=lambda b: len(_surveyed(b)))
        for group in fields.values()
    }


def _surveyed(block: Block) -> SurveyedPoints:
    control, check = block.control, block.check
    return SurveyedPoints(
        point_idx=np.concatenate([control.point_idx, check.point_idx]),
        x_m=np.concatenate([control.x_m, check.x_m]),
        R_g_m=np.concatenate([control.R_g_m, check.R_g_m]),
        sigma_m=np.concatenate([control.sigma_m, check.sigma_m]),
    )


def _around(block: Block) -> Array:
    """Return the positions to be shown on a map of surveyed points, km.

    Exposures are added if the points are too near to each other to fill a map, as a single point.
    """
    points, flown = _km(block, _surveyed(block).x_m), _km(block, block.trajectory.T_m_b.r)
    above_km = float(np.median(design.flying_heights(block))) / 1000.0
    wide = np.ptp(points, axis=0).max() > NARROW * above_km
    return points if wide else np.concatenate([points, flown])


def _draw_points(fig: Figure, ax: Axes, title: str, block: Block) -> None:
    """Draw points; their colour shows the height, their size the number of images."""
    points = _surveyed(block)
    positions = _km(block, points.x_m)
    height = block.frame.to_grid(points.x_m)[:, 2]
    n_images = block.rays[points.point_idx]
    area = 8 + 70 * n_images / n_images.max()
    x, y = positions.T
    marks = ax.scatter(
        x, y, c=height, s=area, cmap=style.SEQUENCE, edgecolor=style.INK, lw=0.5, zorder=3
    )
    finish_map(ax, _around(block), room=(0.1, 0.16))
    _draw_names(ax, positions, [style.plain(block.points[i]) for i in points.point_idx], area)
    few, many = int(n_images.min()), int(n_images.max())
    images = f"{few} to {many} images (size)" if few < many else count(few, "image")
    each = ", each" if len(points) > 1 else ""
    style.heading(ax, title, f"{count(len(points), 'point')}{each} in {images}")
    fig.colorbar(
        marks, ax=ax, label="height (m)", location="bottom", shrink=0.7, aspect=35, pad=0.02
    )


def _draw_names(ax: Axes, positions: Array, names: Sequence[str], area: Array) -> None:
    """Write the name of every point at a free place: below, above or beside it, else nowhere."""
    marks = (
        72 * ax.transData.transform(positions) / ax.figure.dpi
    )  # points, approximately: axes may still move
    taken: list[Array] = []
    for place, mark, name, size in zip(positions, marks, names, area, strict=True):
        half = np.array([0.32 * style.SMALL * len(name), 0.55 * style.SMALL])
        far = 0.55 * np.sqrt(size)
        shifts = ((0.0, -4.5 - far), (0.0, 4.5 + far), (half[0] + far, 0.0), (-half[0] - far, 0.0))
        for shift in shifts:
            box = np.stack([mark + shift - half, mark + shift + half])
            if not any(np.all((box[0] < other[1]) & (other[0] < box[1])) for other in taken):
                taken.append(box)
                ax.annotate(
                    name,
                    xy=tuple(place),
                    xytext=shift,
                    textcoords="offset points",
                    fontsize=style.SMALL,
                    color=style.SOFT,
                    ha="center",
                    va="center",
                )
                break


# --- Parts of drawings in space: arrows, labels and frames of axes, seen along parallel rays


MAPPING, BODY, CAMERA, RAY = style.TEAL, style.BRICK, style.BLUE, style.PLUM
"""The colours of the frames and of rays in all drawings."""


def view(from_deg: float, above_deg: float) -> Rotation:
    """Return the view on a scene (east, north, up): the first two coordinates are the paper's.

    Parameters
    ----------
    from_deg : float
        Where one looks from: 0 south, 90 east.
    above_deg : float
        How far above the horizon: 90 is the map.
    """
    from scipy.spatial.transform import Rotation  # noqa: PLC0415 a report draws arrows without it

    return Rotation.from_euler("zx", [-from_deg, above_deg - 90.0], degrees=True)


def arrow(ax: Axes, tail: Array, tip: Array, colour: str, *, width: float = 1.8) -> None:
    """Draw an arrow between two points on the paper."""
    how = {"arrowstyle": "-|>", "color": colour, "lw": width, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", xy=(tip[0], tip[1]), xytext=(tail[0], tail[1]), arrowprops=how, zorder=4)


def note(ax: Axes, at: Array, text: str, colour: str, *, shift: tuple[float, float]) -> None:
    """Write a label beside a point on the paper, `shift` in points."""
    ax.annotate(
        text, xy=(at[0], at[1]), xytext=shift, textcoords="offset points",
        color=style.WRITTEN.get(colour, colour),
        ha="center", va="center", fontsize=10, zorder=6,
    )  # fmt: skip


def triad(
    ax: Axes, seen: Rotation, origin: Array, axes: Array, names: Sequence[str], colour: str
) -> None:
    """Draw the axes of a frame in space, rows of `axes`, with their names at the tips."""
    start = seen.apply(origin)[:2]
    for axis, name in zip(axes, names, strict=True):
        tip = seen.apply(origin + axis)[:2]
        arrow(ax, start, tip, colour)
        reach = 6 + 2.8 * len(name)  # points: half of the name's width
        outwards = (tip - start) / max(float(np.hypot(*(tip - start))), 1e-9)
        note(ax, tip, name, colour, shift=(reach * outwards[0], 11 * outwards[1]))
    ax.plot(*start, "o", color=colour, ms=4, zorder=5)


def blank(fig: Figure) -> None:
    """Make all axes of a figure the ground of a drawing: no frame, equal scales."""
    for ax in fig.axes:
        ax.set_aspect("equal")
        ax.axis("off")


def scene(ax: Axes, x: tuple[float, float], y: tuple[float, float]) -> None:
    """Make axes the ground of a drawing with these limits: no frame, equal scales."""
    ax.set(xlim=x, ylim=y, aspect="equal")
    ax.axis("off")
