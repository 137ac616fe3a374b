"""What varies over the image plane: mean residuals, and standard deviations on the ground."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from acx4book.typesetting import style
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera
from acx4lib.georeferencing.budget import CALIBRATION
from acx4lib.georeferencing.mapping_flight import Format

CELLS = 12
"""Number of cells along the longer side of an image."""

FAR = 3.44
"""Length in sigma that a vector of pure noise exceeds as rarely as a single number exceeds 3."""


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
    means = {name: cell_means(field) for name, field in fields.items()}
    longest = max(float(np.hypot(*d.T).max(initial=0.0)) for _, d, _ in means.values())
    key = style.round_length(max(longest, 1e-6))
    n_columns = min(2, len(fields))
    n_rows = -(-len(fields) // n_columns)
    height = 2.75 * n_rows + 0.5 if n_columns == 2 else 4.2
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


def cell_means(field: Residuals) -> tuple[Array, Array, Array]:
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
    ax.quiverkey(arrows, x, y, scale * key, label, labelpos=side, fontproperties=style.LETTERS)
    ax.set(xlim=(0, camera.width_px), ylim=(camera.height_px, 0), aspect="equal")
    ax.set(xlabel="column (px)", ylabel="row (px)")
    ax.locator_params(nbins=5)
    ax.locator_params(axis="x", nbins=3 if tall else 5)


def sigma_figure(shown: Format) -> Figure:
    """Draw standard deviations of ground points over the format of the image that shows them.

    In plan, in height, and what the calibration makes of the height; NaN is left white.

    Parameters
    ----------
    shown : Format
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
