"""Figures of matrices: correlations with their numbers, and patterns of nonzero elements."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import PathPatch
from matplotlib.path import Path
from matplotlib.ticker import MaxNLocator

from acx4book.typesetting import style
from acx4book.typesetting.myst import LABELS
from acx4lib.expected import Array, Mask
from acx4lib.geometry.camera import Camera
from acx4lib.georeferencing.budget import CALIBRATION, Format

LEVELS = 20
"""Shades of a colour, each a shape of the drawing."""


def correlation_matrix(correlations: pd.DataFrame) -> Figure:
    """Draw a correlation matrix, with numbers where they are 0.3 or more.

    Parameters
    ----------
    correlations : DataFrame
        Square; rows and columns are named ``parameter`` or ``camera/parameter``.
    """
    if correlations.empty:
        return style.nothing("The single step estimates no parameters together.")
    values, names = correlations.to_numpy(), [_label(str(n)) for n in correlations.index]
    n = len(names)
    with style.applied():
        width = min(style.WIDTH, 2.8 + 0.34 * n)
        fig, ax = style.subplots(figsize=(width, width - 0.6))
        signed_cells(ax, values)
        ax.set_xticks(np.arange(n) + 0.5, names, rotation=55, ha="right", rotation_mode="anchor")
        ax.set_yticks(np.arange(n) + 0.5, names)
        for i, j in zip(*np.nonzero(np.abs(values) >= 0.3), strict=True):
            if i != j:
                write(ax, i, j, values[i, j], f"{values[i, j]:+.2f}".replace("0.", "."))
        scale(fig, ax, shrink=0.6, aspect=28)
    return fig


def signed_cells(ax: Axes, values: Array, *, gap: float = 0.08) -> None:
    """Draw the cells of a matrix from -1 (orange) over zero (nothing) to 1 (blue).

    The colours are those of the page, by day and by night. Cell (i, j) is from j to j + 1 and from
    i to i + 1, downwards.

    Parameters
    ----------
    ax : Axes
    values : ndarray, shape (rows, columns)
    gap : float
        As in `cells`.
    """
    style.bare(ax)
    level = np.rint(LEVELS * np.abs(values)).astype(int)
    for colour, sign in ((style.BLUE, values > 0), (style.ORANGE, values < 0)):
        for shade in np.unique(level[sign & (level > 0)]):
            cells(ax, sign & (level == shade), colour, gap=gap, alpha=shade / LEVELS)
    rows, columns = values.shape
    ax.set(xlim=(0, columns), ylim=(rows, 0), aspect="equal")
    ax.tick_params(length=0)
    ax.grid(visible=False)


def write(ax: Axes, i: int, j: int, value: float, text: str) -> None:
    """Write into a cell of `signed_cells`, in a colour readable by day and night."""
    strong = style.PAPER if value > 0 else style.BLACK
    ax.text(
        *(j + 0.5, i + 0.5, text.replace("-", "\N{MINUS SIGN}")),
        ha="center",
        va="center",
        fontsize=style.SMALL,
        color=strong if abs(value) > 0.6 else style.INK,
        in_layout=False,  # inside their cells: measuring each takes half the time
    )


def scale(
    fig: Figure, axes: Axes | Sequence[Axes], *, location: str = "right", **sizes: float
) -> None:
    """Draw the scale of the colours of `signed_cells` beside axes, or below them.

    Parameters
    ----------
    fig : Figure
    axes : Axes or sequence of Axes
    location : str
        ``"right"`` or ``"bottom"``.
    sizes : float
        As of `Figure.colorbar`: shrink, aspect.
    """
    shown: Any = ScalarMappable(Normalize(-1, 1))
    bar = fig.colorbar(shown, ax=axes, location=location, **sizes)  # type: ignore[arg-type] # one or more
    if bar.solids is not None:
        bar.solids.remove()
    bar.set_label("correlation (no unit)")
    bar.outline.set_visible(False)
    span = bar.ax.axhspan if location == "right" else bar.ax.axvspan
    for k in range(-LEVELS, LEVELS):
        near = max(abs(k), abs(k + 1)) / LEVELS
        span(
            k / LEVELS, (k + 1) / LEVELS, fc=style.ORANGE if k < 0 else style.BLUE, alpha=near, lw=0
        )


def _label(name: str) -> str:
    """Return the label for readers of ``parameter`` or ``camera/parameter``."""
    camera, _, parameter = name.rpartition("/")
    if parameter not in LABELS:
        return style.plain(name)
    return f"{style.plain(camera)} {LABELS[parameter]}" if camera else LABELS[parameter]


def cells(ax: Axes, filled: Mask, colour: str, *, gap: float = 0.1, alpha: float = 1.0) -> None:
    """Draw cells of a matrix as one shape, so that drawings of thousands are small.

    Parameters
    ----------
    ax : Axes
        Row 0 is from 0 to 1, and so is column 0.
    filled : ndarray of bool, shape (rows, columns)
    colour : str
    gap : float
        Between two cells, in cells; without it, neighbours in a row are one bar.
    alpha : float
        How much of what is below they cover.
    """
    if gap:
        rows, left = np.nonzero(filled)
        right = left + 1
    else:
        ends = np.diff(np.pad(filled, ((0, 0), (1, 1))).astype(int), axis=1)
        (rows, left), (_, right) = np.nonzero(ends == 1), np.nonzero(ends == -1)
    x0, x1, y0, y1 = left + gap / 2, right - gap / 2, rows + gap / 2, rows + 1 - gap / 2
    corners = np.stack([x0, y0, x1, y0, x1, y1, x0, y1, x0, y0], axis=1).reshape(-1, 2)
    codes = np.tile([Path.MOVETO, *3 * [Path.LINETO], Path.CLOSEPOLY], len(rows))
    ax.add_patch(PathPatch(Path(corners, codes), fc=colour, lw=0, alpha=alpha))


# --- What varies over the image plane: mean residuals, and standard deviations on the ground


CELLS = 12
"""Number of cells along the longer side of an image."""

FAR = 3.44
"""Length of a vector of noise, in sigma, as improbable as 3 sigma of a single number."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Residuals:
    """Residuals of one camera's image points.

    Attributes
    ----------
    camera : Camera
    colrow : ndarray, shape (n, 2)
        Positions of the measurements, px.
    v : ndarray, shape (n, 2)
        Residuals, px.
    sigma_px : ndarray, shape (n,)
    """

    camera: Camera
    colrow: Array
    v: Array
    sigma_px: Array


def field_figure(fields: Mapping[str, Residuals]) -> Figure:
    """Draw the mean residual vectors of the cells of every camera's image.

    Parameters
    ----------
    fields : mapping of str to Residuals
        By the title of the panel; at least one.
    """
    means = {name: _cell_means(field) for name, field in fields.items()}
    longest = max(float(np.hypot(*d.T).max(initial=0.0)) for _, d, _ in means.values())
    key = style.round_length(max(longest, 1e-6))
    n_columns = min(2, len(fields))
    n_rows = -(-len(fields) // n_columns)
    height = 2.95 * n_rows + 0.5 if n_columns == 2 else 4.2
    with style.applied():
        fig, grid = style.subplots(n_rows, n_columns, figsize=(style.WIDTH, height), squeeze=False)
        for ax in grid.flat[len(fields) :]:
            ax.remove()
        for ax, (name, field) in zip(grid.flat, fields.items(), strict=False):
            _draw_field(ax, field.camera, means[name], key=key)
            rms = np.sqrt(np.mean(field.v**2))
            style.heading(
                ax,
                style.plain(name, longest=2 * style.LONGEST),
                f"{len(field.v)} points, rms {rms:.2f} px",
            )
        handles = [
            Line2D([], [], color=style.INK, label=r"mean of a cell, within 3$\sigma$"),
            Line2D([], [], color=style.ORANGE, lw=2, label=r"beyond 3$\sigma$"),
        ]
        style.legend_below(fig, handles)
    return fig


def _cell_means(field: Residuals) -> tuple[Array, Array, Array]:
    """Return middles of cells (px), mean residuals (px), and their lengths in sigma."""
    camera, v, sigma = field.camera, field.v, field.sigma_px
    size = max(camera.width_px, camera.height_px) / CELLS
    n_cols, n_rows = int(np.ceil(camera.width_px / size)), int(np.ceil(camera.height_px / size))
    upper = np.array([n_cols, n_rows]) - 1
    cell = np.clip((field.colrow // size).astype(int), 0, upper)
    idx = cell[:, 1] * n_cols + cell[:, 0]
    n = n_cols * n_rows
    count = np.bincount(idx, minlength=n)
    enough = count >= 3
    sums = np.stack([np.bincount(idx, v[:, j], minlength=n) for j in range(2)], axis=1)
    mean = sums[enough] / count[enough, None]
    sigma_mean = np.sqrt(np.bincount(idx, sigma**2, minlength=n)[enough]) / count[enough]
    row, col = np.divmod(np.flatnonzero(enough), n_cols)
    middle = (np.column_stack([col, row]) + 0.5) * size
    return middle, mean, np.hypot(*mean.T) / sigma_mean


def _draw_field(ax: Axes, camera: Camera, field: tuple[Array, Array, Array], *, key: float) -> None:
    middle, d, in_sigma = field
    scale = max(camera.width_px, camera.height_px) / CELLS / key  # the key is as long as a cell
    arrows = ax.quiver(
        *middle.T,
        *(scale * d.T),
        color=list(np.where(in_sigma > FAR, style.ORANGE, style.INK)),
        angles="xy",
        scale_units="xy",
        scale=1,
        width=0.004,
        zorder=3,
    )
    tall = camera.height_px > camera.width_px  # beside it there is room, above it not
    x, y, side = (1.12, 0.97, "E") if tall else (0.87, 1.06, "W")
    label = f"{key:g} px"
    place, look = (x, y, scale * key), {"color": style.INK, "fontproperties": style.LETTERS}
    ax.quiverkey(arrows, *place, label, labelpos=side, **look)
    ax.set(xlim=(0, camera.width_px), ylim=(camera.height_px, 0), aspect="equal")
    ax.set(xlabel="column (px)", ylabel="row (px)")
    ax.locator_params(nbins=5)
    ax.locator_params(axis="x", nbins=3 if tall else 5)


def sigma_figure(shown: Format) -> Figure:
    """Draw standard deviations of ground points over the image format.

    In plan, in height, and the calibration's share of the height; NaN is left white.
    """
    variance = shown.variance
    total, calibrated = variance.sum(axis=-1), variance[..., -len(CALIBRATION) :].sum(axis=-1)
    panels = {
        "plan": total[..., :2].sum(axis=-1),
        "height": total[..., 2],
        "height, calibration": np.maximum(calibrated[..., 2], 0.0),
    }
    last = shown.colrow[-1, -1]
    height = min(0.8 * style.WIDTH / len(panels) * float(last[1] / last[0]) + 1.35, 5.2)
    with style.applied():
        fig, axes = style.subplots(1, len(panels), figsize=(style.WIDTH, height))
        for ax, (title, square) in zip(axes, panels.items(), strict=True):
            _draw_sigma(fig, ax, shown.colrow, 100 * np.sqrt(square))
            ax.set_title(title)
        axes[0].set_ylabel("row (px)")
    return fig


def _draw_sigma(fig: Figure, ax: Axes, colrow: Array, sigma_cm: Array) -> None:
    col, row = colrow[0, :, 0], colrow[:, 0, 1]
    half = (col[1] - col[0]) / 2, (row[1] - row[0]) / 2
    extent = (col[0] - half[0], col[-1] + half[0], row[-1] + half[1], row[0] - half[1])
    shown = ax.imshow(sigma_cm, extent=extent, cmap=style.SHADES, vmin=0.0, interpolation="nearest")
    ax.grid(visible=False)
    ax.set(xlim=(col[0], col[-1]), ylim=(row[-1], row[0]), xlabel="column (px)")
    ax.locator_params(nbins=3)
    bar = fig.colorbar(shown, ax=ax, location="bottom", aspect=18, pad=0.03)
    bar.set_label("σ (cm)")
    bar.locator = MaxNLocator(5)
    bar.outline.set_visible(False)
