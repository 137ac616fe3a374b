"""Figures of chapter 3: the mounting image by image, the lever arm, and where a block is weak."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from acx4book.typesetting import maps, style
from acx4book.typesetting.moving import Layer, Scene
from acx4book.typesetting.plain_text import shown
from acx4book.typesetting.style import round_length
from acx4lib import design
from acx4lib.attempts import Failed
from acx4lib.bundle.adjust import Bundle
from acx4lib.bundle.reliability import reliability
from acx4lib.calibration.mounting import Mounting
from acx4lib.expected import Array, Index, Mask
from acx4lib.geometry.camera import Camera
from acx4lib.geometry.collinearity import Measurement, directions
from acx4lib.geometry.frames import Pose, log

WEAK_COLOURS = style.SHADES.reversed()
"""Colours of redundancy numbers: weak ones are blue, strong ones as the ground."""

RANGE_PX = (2.0, 20.0)
"""Detectable errors at the ends of the colours; some errors are without bound."""

CELLS = 16
"""Cells along the longer side of an image."""

FEW = 3
"""Measurements below which a cell has no mean."""


# --- image by image --------------------------------------------------------------------------


def mounting_per_image(mounting: Mounting | Failed) -> Figure:
    """Draw boresight and lever arm of every single image, eqs (12) and (13), less their mean.

    The band is one standard deviation of the trajectory's attitude.

    Parameters
    ----------
    mounting : Mounting or Failed
        Of a two-step method.

    Raises
    ------
    ValueError
        For a method that has no mounting per image.
    """
    if isinstance(mounting, Failed):
        return style.nothing(f"The method was left out: {mounting.reason}")
    if mounting.per_image is None or mounting.averaged is None:
        msg = f"{mounting.method} has no mounting per image"
        raise ValueError(msg)
    trajectory = mounting.bundle.network.block.trajectory
    sigma_deg = np.degrees(np.median(trajectory.sigma_attitude, axis=0))
    with style.applied():
        fig, axes = style.subplots(2, 3, figsize=(style.WIDTH, 3.9), sharex=True, sharey="row")
        _draw_per_image(axes, mounting, mounting.per_image, mounting.averaged)
        for axis, name in enumerate(("x", "y", "z")):
            axes[0, axis].set_title(f"about and along {name}")
            if np.isfinite(s := float(sigma_deg[axis])):
                axes[0, axis].axhspan(-s, s, color=style.SOFT, alpha=0.12, lw=0, zorder=0)
            for ax in axes[:, axis]:
                ax.axhline(0, color=style.INK, lw=0.7)
            axes[1, axis].set_xlabel("image number")
            axes[1, axis].xaxis.set_major_locator(MaxNLocator(5, integer=True))
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
        images = np.flatnonzero(averaged & (block.images.camera_idx == k))
        poses = T_b_c[images]
        turn = np.degrees(log(poses.R @ camera.T_b_c.R.T))
        shift = poses.r - poses.r.mean(axis=0)
        strips = [block.images.strips[i] for i in images]
        for axis in range(3):
            _by_strip(axes[0, axis], images, turn[:, axis], strips)
            _by_strip(axes[1, axis], images, shift[:, axis], strips)


def _by_strip(ax: Axes, number: Index, values: Array, strips: list[str]) -> None:
    """Draw values over image numbers, a colour for every strip."""
    for i, strip in enumerate(dict.fromkeys(strips)):
        in_strip = np.array([s == strip for s in strips])
        ax.plot(
            *(number[in_strip] + 1, values[in_strip], "o"),
            ms=2.8,
            color=style.colour(i),
            label=f"strip {style.plain(strip)}" if strip else "",
        )


# --- in plan ---------------------------------------------------------------------------------


def weak_places(mounting: Mounting) -> Figure:
    """Draw a block in plan with the largest detectable error of every point and exposure.

    Returns
    -------
    Figure
        Left, the largest detectable error in any image measurement of a point; of very many points
        the weakest in every cell. Right, that of any coordinate of a control point or a position.
    """
    bundle = mounting.bundle
    measured = np.unique(bundle.network.image_points.point_idx)
    shown = _km(bundle, np.concatenate([bundle.state.x_m[measured], bundle.state.T_m_b.r]))
    with style.applied():
        size = np.ptp(shown, axis=0)
        height = float(np.clip(0.45 * style.WIDTH * size[1] / max(size[0], 1e-9), 2.0, 5.4)) + 1.5
        fig, axes = style.subplots(1, 2, figsize=(style.WIDTH, height))
        _draw_rays(fig, axes[0], bundle, measured)
        handles = _draw_observed(fig, axes[1], bundle)
        for ax in axes:
            maps.finish_map(ax, shown, room=(0.05, 0.08))
        axes[1].set_ylabel("")
        if handles:
            style.legend_below(fig, handles)
    return fig


def _draw_rays(fig: Figure, ax: Axes, bundle: Bundle, measured: Index) -> None:
    """Draw the points, the weakest on top, with the largest detectable error of their rays."""
    tests = reliability(bundle.solution.group("image_point"))
    of_point = np.zeros(bundle.network.n_points)
    np.maximum.at(of_point, bundle.network.image_points.point_idx, tests.detectable.max(axis=1))
    places = _km(bundle, bundle.state.x_m[measured])
    some = style.largest_in_cells(places, of_point[measured])
    low, high = RANGE_PX
    east, north = places[some].T
    marks = ax.scatter(
        east,
        north,
        c=np.clip(of_point[measured[some]], low, high),
        norm=LogNorm(low, high),
        cmap=style.SEQUENCE,
        s=11,
        lw=0.5,
        edgecolor=style.INK,
        zorder=3,
    )
    _bar(fig, ax, marks, "largest detectable error of a ray (px)", [2, 3, 5, 10, 20])
    over = int(np.sum(of_point[measured] > high))
    subtitle = f"{len(measured)} points, {over} of them above {high:g} px"
    if len(some) < len(measured):
        subtitle += f"\ndrawn: {len(some)}, the weakest of every cell"
    style.heading(ax, "Object points", subtitle)


def _draw_observed(fig: Figure, ax: Axes, bundle: Bundle) -> list[Line2D]:
    """Draw control points and positions, and return the legend's handles."""
    network, state = bundle.network, bundle.state
    control = network.control[~network.held_control]
    places = {"gnss": state.T_m_b.r, "control_point": state.x_m[control.point_idx]}
    detectable = {kind: _worst(bundle, kind) for kind in places}
    style.heading(ax, "Control and trajectory", "the weakest coordinate of each")
    every = np.concatenate(list(detectable.values()))
    known = every[np.isfinite(every)]
    if len(known) == 0:
        return []
    norm = LogNorm(known.min(), max(known.max(), 1.01 * known.min()), clip=True)
    handles = []
    for kind, marker, name in (
        ("gnss", "o", "GNSS positions"),
        ("control_point", "^", "control points"),
    ):
        east, north = _km(bundle, places[kind]).T
        look: dict[str, Any] = {
            "marker": marker,
            "s": 26,
            "lw": 0.5,
            "edgecolor": style.INK,
            "zorder": 3,
        }
        marks = ax.scatter(east, north, c=detectable[kind], norm=norm, cmap=style.SEQUENCE, **look)
        handles.append(
            Line2D([], [], ls="", marker=marker, mfc=style.PAPER, mec=style.INK, label=name)
        )
    steps = np.outer(10.0 ** np.arange(-3, 3), [1, 2, 5]).ravel()
    ticks = [float(t) for t in steps if norm.vmin <= t <= norm.vmax]
    _bar(fig, ax, marks, "largest detectable error (m)", ticks)
    return handles


def _worst(bundle: Bundle, kind: str) -> Array:
    """Return the largest detectable error of every row of a group, NaN where none takes part."""
    detectable = reliability(bundle.solution.group(kind)).detectable
    return np.where(
        np.isnan(detectable).all(axis=1),
        np.nan,
        np.nan_to_num(detectable, posinf=np.inf).max(axis=1),
    )


def _bar(fig: Figure, ax: Axes, marks: Any, label: str, ticks: list[float]) -> None:
    bar = fig.colorbar(marks, ax=ax, location="bottom", shrink=0.8, aspect=32, pad=0.02)
    bar.set_label(label)
    bar.minorticks_off()
    bar.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    bar.outline.set_visible(False)


def _km(bundle: Bundle, x_m: Array) -> Array:
    """Return grid east and north of mapping coordinates, km."""
    return bundle.network.block.frame.to_grid(x_m)[:, :2] / 1000.0


# --- in the image ----------------------------------------------------------------------------


def image_redundancy(mounting: Mounting) -> Figure:
    """Draw the mean redundancy numbers of measurements over the image plane.

    Returns
    -------
    Figure
        A row for each camera: along columns and along rows.
    """
    network = mounting.bundle.network
    cameras, points = network.block.cameras, network.image_points
    r = mounting.bundle.solution.group("image_point").redundancy
    camera_idx = network.block.images.camera_idx[points.image_idx]
    with style.applied():
        sensor = max(c.height_px / c.width_px for c in cameras)
        height = float(np.clip(0.43 * style.WIDTH * sensor, 1.6, 4.2)) + 0.7
        fig, axes = style.subplots(
            len(cameras),
            2,
            figsize=(style.WIDTH, height * len(cameras)),
            squeeze=False,
            sharey="row",
        )
        for k, (row, camera) in enumerate(zip(axes, cameras, strict=True)):
            in_camera = camera_idx == k
            for d, (ax, name) in enumerate(zip(row, ("columns", "rows"), strict=True)):
                image = _draw_cells(ax, camera, points.colrow[in_camera], r[in_camera, d])
                mean = float(np.nanmean(r[in_camera, d])) if in_camera.any() else np.nan
                style.heading(
                    ax, f"{style.plain(camera.name)}, along {name}", f"mean of all {mean:.2f}"
                )
            row[0].set_ylabel("row (px)")
        limits = _limits(axes)
        for ax in axes.ravel():
            ax.images[0].set_clim(*limits)
        bar = fig.colorbar(image, ax=axes, shrink=0.7, aspect=28)
        bar.set_label("mean redundancy number (no unit)")
        bar.outline.set_visible(False)
    return fig


def _limits(axes: Any) -> tuple[float, float]:
    """Return the range of the drawn values, widened to tenths."""
    shown = np.concatenate([np.asarray(ax.images[0].get_array()).ravel() for ax in axes.ravel()])
    known = shown[np.isfinite(shown)]
    if len(known) == 0:
        return 0.0, 1.0
    return float(np.floor(10 * known.min()) / 10), float(np.ceil(10 * known.max()) / 10)


def _draw_cells(ax: Axes, camera: Camera, colrow: Array, r: Array) -> Any:
    """Draw the mean of values in square cells of a sensor; cells with few values stay empty."""
    sides = np.array([camera.width_px, camera.height_px])
    size = sides.max() / CELLS
    n_cols, n_rows = np.ceil(sides / size).astype(int)
    col, row = np.clip((colrow // size).astype(int), 0, [n_cols - 1, n_rows - 1]).T
    cell = row * n_cols + col
    count = np.bincount(cell, minlength=n_cols * n_rows)
    total = np.bincount(cell, r, minlength=n_cols * n_rows)
    mean = np.where(count >= FEW, total / np.maximum(count, 1), np.nan)
    extent = (0.0, n_cols * size, n_rows * size, 0.0)
    image = ax.imshow(mean.reshape(n_rows, n_cols), cmap=WEAK_COLOURS, extent=extent)
    ax.set(xlim=(0, camera.width_px), ylim=(camera.height_px, 0), xlabel="column (px)")
    ax.grid(visible=False)
    ax.locator_params(nbins=5)
    return image


# --- The adjusted block in space: strips, images, points, rays, and how well points are known


MOST_IMAGES, MOST_POINTS, MOST_ELLIPSOIDS, MOST_LABELS = 400, 1500, 60, 100
"""Limits above which every n-th is drawn, and only the first control points have names."""

COLOURS = ("blue", "orange")
"""Colours of flying heights, from the highest down, as in the maps."""

DEEP = 0.22
"""Distance from a perspective centre to the drawn image, as a share of the height."""

LARGE = 0.03
"""Largest half axis of a median ellipsoid, as a share of the block."""


def view(mounting: Mounting) -> Scene:
    """Return the block of the single step as the reader turns it."""
    bundle = mounting.bundle
    layers, ties = [_ground(bundle), *_images(bundle)], _tie_points(bundle)
    if len(ties):
        layers += [_ties(bundle, ties), _rays(bundle, ties), _ellipsoids(bundle, ties)]
    layers.append(_control(bundle))
    return Scene(
        name="block-in-space",
        alt=(
            "Strips of cameras at their heights over a grid on the ground, with control "
            "points, tie points, the rays of one point, and crosses of the axes of ellipsoids, "
            "which are long at the rim and point to the cameras."
        ),
        caption=(
            "The block of the single step, with its adjusted positions and attitudes. Each "
            "pyramid is a camera with its image, far larger than they are. The crosses are the "
            "axes of error ellipsoids of one standard deviation, a priori. The longest axes point "
            "towards the cameras, since the distance along the rays is known least, and are "
            "longer at the rim of the block, where the rays come from one side only."
        ),
        layers=[layer for layer in layers if len(layer.at)],
    )


def _tie_points(bundle: Bundle) -> Index:
    """Return the tie points of a bundle that have a covariance, shape (n,)."""
    measured = np.unique(bundle.network.image_points.point_idx)
    ties = np.setdiff1d(measured, bundle.network.control.point_idx)
    known = np.trace(bundle.solution.cov_points[ties], axis1=1, axis2=2)
    tie_points: Index = ties[np.isfinite(known) & (known > 0)]
    return tie_points


# --- layers ----------------------------------------------------------------------------------


def _ground(bundle: Bundle) -> Layer:
    """Return a grid of squares of a round length at the mean height of the points."""
    centres = bundle.T_m_c.r[:, :2]
    low, high = centres.min(axis=0), centres.max(axis=0)
    step = round_length(float((high - low).max()) / 4)
    height = float(bundle.state.x_m[bundle.network.image_points.point_idx, 2].mean())
    first, last = np.floor(low / step) * step, np.ceil(high / step) * step
    lines = []
    for axis in (0, 1):
        for line in np.arange(first[axis], last[axis] + step / 2, step):
            ends = np.array([[*first, height], [*last, height]])
            ends[:, axis] = line
            lines.append(ends)
    return Layer(
        name=f"ground, squares of {step:g} m", kind="lines", colour="soft", at=np.concatenate(lines)
    )


def _images(bundle: Bundle) -> Iterator[Layer]:
    """Yield the strips and the cameras of each flying height."""
    block, centres = bundle.network.block, bundle.T_m_c.r
    strips = np.array(block.images.strips, dtype=object)
    for level, colour in zip(design.levels(block), COLOURS * 9, strict=False):
        images = np.flatnonzero(np.isin(block.images.exposure_idx, level.exposure_idx))
        name = f"from {level.height_m:.0f} m"
        lines = [centres[images[strips[images] == strip]] for strip in level.strips]
        pairs = [np.repeat(line, 2, axis=0)[1:-1] for line in lines if len(line) > 1]
        yield Layer(name=f"strips {name}", kind="lines", colour=colour, at=_joined(pairs))
        chosen = _thinned(images, MOST_IMAGES)
        deep = (
            DEEP * level.height_m if np.isfinite(level.height_m) else DEEP * float(np.ptp(centres))
        )
        pyramids = [_pyramid(bundle, image, deep) for image in chosen]
        yield Layer(name=f"cameras {name}", kind="lines", colour=colour, at=_joined(pyramids))


def _pyramid(bundle: Bundle, image: int, deep: float) -> Array:
    """Return the ends of the eight edges from a perspective centre to the image and around it."""
    k = bundle.network.block.images.camera_idx[image]
    camera = bundle.cameras[k]
    width, height = camera.width_px - 1.0, camera.height_px - 1.0
    measurement = Measurement(
        cameras=bundle.cameras,
        camera_idx=np.full(4, k),
        T_m_c=bundle.T_m_c[np.full(4, image)],
        colrow=np.array([[0, 0], [width, 0], [width, height], [0, height]]),
    )
    centre = bundle.T_m_c.r[image]
    corners = centre + deep * directions(measurement)
    around = np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)
    edges = np.stack([np.tile(centre, (4, 1)), corners], axis=1)
    return np.concatenate([edges, around]).reshape(-1, 3)


def _control(bundle: Bundle) -> Layer:
    control = bundle.network.control
    names = bundle.network.block.points
    return Layer(
        name="control points",
        kind="points",
        colour="ink",
        size=7.0,
        at=bundle.state.x_m[control.point_idx],
        labels=[shown(names[k], "terminal") for k in control.point_idx[:MOST_LABELS]],
    )


def _ties(bundle: Bundle, ties: Index) -> Layer:
    places = bundle.state.x_m[_thinned(ties, MOST_POINTS)]
    return Layer(name="tie points", kind="points", colour="teal", at=places)


def _rays(bundle: Bundle, ties: Index) -> Layer:
    """Return the rays of the tie point with most rays; of several, the first."""
    image_points = bundle.network.image_points
    n_rays = np.bincount(image_points.point_idx, minlength=len(bundle.state.x_m))
    point = ties[np.argmax(n_rays[ties])]
    name = bundle.network.block.points[point]
    starts = bundle.T_m_c.r[image_points.image_idx[image_points.point_idx == point]]
    target = np.broadcast_to(bundle.state.x_m[point], starts.shape)
    return Layer(
        name=f"the {len(starts)} rays of point {shown(name, 'terminal')}",
        kind="lines",
        colour="plum",
        at=np.stack([starts, target], axis=1).reshape(-1, 3),
    )


def _ellipsoids(bundle: Bundle, ties: Index) -> Layer:
    """Return both halves of the three axes of each ellipsoid, as one line."""
    chosen = _thinned(ties, MOST_ELLIPSOIDS)
    values, vectors = np.linalg.eigh(bundle.solution.cov_points[chosen])
    largest = np.sqrt(np.linalg.eigvalsh(bundle.solution.cov_points[ties])[:, -1])
    extent = float(np.ptp(bundle.T_m_c.r, axis=0).max())
    times = round_length(LARGE * extent / float(np.median(largest)))
    axes = times * np.swapaxes(vectors * np.sqrt(values)[:, None], 1, 2)
    middle = bundle.state.x_m[chosen][:, None]
    return Layer(
        name=f"axes of error ellipsoids, {times:g} times",
        kind="lines",
        colour="brick",
        at=np.stack([middle - axes, middle + axes], axis=2).reshape(-1, 3),
    )


def _thinned(numbers: Index, most: int) -> Index:
    """Return all indices, or every n-th of more than `most`."""
    return numbers[:: -(-len(numbers) // most)] if len(numbers) else numbers


def _joined(parts: list[Array]) -> Array:
    return np.concatenate(parts) if parts else np.zeros((0, 3))
