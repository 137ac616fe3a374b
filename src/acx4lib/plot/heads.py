"""Figures of the heads: residuals in the image, distortion, correlations (section 4.1)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from acx4lib._typing import Array
from acx4lib.bundle import Bundle
from acx4lib.calibration import from_bundle, reported_covariance
from acx4lib.camera import INTERIOR
from acx4lib.correlations import EXTERIOR, interior_exterior
from acx4lib.experiments import HeldFocalLength
from acx4lib.plot._style import (
    BRICK,
    INK,
    ORANGE,
    PRINTED,
    SEQUENCE,
    SOFT,
    WIDTH,
    bare,
    colour,
    heading,
    legend_below,
    nothing,
    round_length,
    style,
)

SYMBOLS = {
    "f_mm": "$f$",
    "xp_mm": "$x_p$",
    "yp_mm": "$y_p$",
    "east_m": "$X_0$",
    "north_m": "$Y_0$",
    "height_m": "$Z_0$",
    "omega_deg": r"$\omega$",
    "phi_deg": r"$\varphi$",
    "kappa_deg": r"$\kappa$",
    **{name: f"${name[0]}_{name[1]}$" for name in ("k1", "k2", "k3", "p1", "p2", "b1")},
}
"""The paper's symbols of parameters by their names in results."""

NO_HEADS = "No head could be adjusted."
CELLS = 12
"""Cells along the longer side of an image in `mean_residuals`."""


# --- residuals -------------------------------------------------------------------------------


def mean_residuals(fits: Mapping[str, Bundle]) -> Figure:
    """Draw the mean residual vectors of the cells of every head's image.

    Parameters
    ----------
    fits : mapping of str to Bundle

    Returns
    -------
    Figure
        Vectors longer than three of their standard deviations stand out in colour: such are
        distortion that the model does not have.
    """
    if not fits:
        return nothing(NO_HEADS)
    fields = {name: _cell_means(fit) for name, fit in fits.items()}
    longest = max(float(np.hypot(*d.T).max(initial=0.0)) for _, d, _ in fields.values())
    key = round_length(max(longest, 1e-6))
    with style():
        n_rows = -(-len(fields) // 2)
        size = (WIDTH, 2.75 * n_rows + 0.5)
        fig, grid = plt.subplots(n_rows, 2, figsize=size, squeeze=False)
        for ax in grid.flat[len(fields) :]:
            ax.remove()
        for ax, (name, field) in zip(grid.flat, fields.items(), strict=False):
            _draw_field(ax, fits[name], field, key=key)
            rms = np.sqrt(np.mean(fits[name].solution.group("image_point").v ** 2))
            heading(ax, name, f"{len(fits[name].network.image_points)} points, rms {rms:.2f} px")
        handles = [
            Line2D([], [], color=INK, label=r"mean of a cell, within 3$\sigma$"),
            Line2D([], [], color=ORANGE, lw=2, label=r"beyond 3$\sigma$"),
        ]
        legend_below(fig, handles)
    return fig


def _cell_means(fit: Bundle) -> tuple[Array, Array, Array]:
    """Return middles of cells (px), mean residuals (px), and their lengths in sigma."""
    points, camera = fit.network.image_points, fit.network.block.cameras[0]
    v, sigma = fit.solution.group("image_point").v, points.sigma_px
    size = max(camera.width_px, camera.height_px) / CELLS
    n_cols, n_rows = int(np.ceil(camera.width_px / size)), int(np.ceil(camera.height_px / size))
    upper = np.array([n_cols, n_rows]) - 1
    cell = np.clip((points.colrow // size).astype(int), 0, upper)
    idx = cell[:, 1] * n_cols + cell[:, 0]
    n = n_cols * n_rows
    count = np.bincount(idx, minlength=n)
    enough = count >= 3
    sums = np.stack([np.bincount(idx, v[:, j], minlength=n) for j in range(2)], axis=1)
    mean = sums[enough] / count[enough, None]
    sigma_mean = np.sqrt(np.bincount(idx, sigma**2, minlength=n)[enough]) / count[enough]
    row, col = np.divmod(np.flatnonzero(enough), n_cols)
    middle = (np.column_stack([col, row]) + 0.5) * size
    # of a two-dimensional normal vector, so that 3 means what it means in one dimension
    return middle, mean, np.hypot(*mean.T) / sigma_mean / np.sqrt(1.31)


def _draw_field(ax: Axes, fit: Bundle, field: tuple[Array, Array, Array], *, key: float) -> None:
    camera = fit.network.block.cameras[0]
    middle, d, in_sigma = field
    scale = max(camera.width_px, camera.height_px) / CELLS / key
    for far, tint, width in ((False, INK, 0.0035), (True, ORANGE, 0.006)):
        own = (in_sigma > 3) == far
        x, y = middle[own].T
        ax.quiver(
            *(x, y, scale * d[own, 0], scale * d[own, 1]),
            angles="xy",
            scale_units="xy",
            scale=1,
            color=tint,
            width=width,
            zorder=3,
        )
    ax.plot([0, scale * key], [1.055, 1.055], color=INK, lw=1.6, transform=_below(ax))
    ax.set(xlim=(0, camera.width_px), ylim=(camera.height_px, 0), aspect="equal")
    ax.set(xlabel=f"column (px); bar: {key:g} px", ylabel="row (px)")
    ax.locator_params(nbins=5)
