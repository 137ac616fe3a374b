"""Figures of the validation: where the check points are off, and whether the sigma is honest."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.figure import Figure
from scipy import special

from acx4book.typesetting import style
from acx4lib.expected import Array
from acx4lib.geometry.parameters import AXES
from acx4lib.georeferencing.validation import Validation


def difference_map(validation: Validation) -> Figure:
    """Draw the differences of all check points, from all rays: arrows in plan, colours in height.

    Parameters
    ----------
    validation : Validation
    """
    block, points = validation.block, validation.points
    enh = block.frame.to_grid(block.check.x_m[points.point_idx])
    cameras = block.frame.to_grid(block.T_m_b_images.r)
    km = 1e-3
    limit = max(float(np.abs(points.d[:, 2]).max(initial=0.0)), 1e-3)
    with style.applied():
        fig, ax = style.subplots(figsize=(5.6, 5.2))
        ax.plot(
            *(km * cameras[:, :2].T), ".", ms=1.6, color=style.SOFT, alpha=0.6, label="exposures"
        )
        east, north = km * enh[:, :2].T
        dots = ax.scatter(
            east,
            north,
            s=34,
            c=points.d[:, 2],
            cmap=style.DIVERGING,
            vmin=-limit,
            vmax=limit,
            zorder=3,
            edgecolors=style.INK,
            linewidths=0.5,
        )
        arrows = ax.quiver(
            *(km * enh[:, :2].T),
            *points.d[:, :2].T,
            angles="xy",
            color=style.INK,
            width=0.0028,
            zorder=4,
        )
        longest = float(np.hypot(*points.d[:, :2].T).max(initial=0.01))
        text = f"{longest:.2f} m in plan"
        ax.quiverkey(arrows, 0.98, 0.04, longest, text, labelpos="W", coordinates="axes")
        ax.set_aspect("equal")
        ax.set(xlabel="grid east (km)", ylabel="grid north (km)")
        ax.ticklabel_format(useOffset=False)
        bar = fig.colorbar(dots, ax=ax, shrink=0.7, aspect=28)
        bar.set_label("difference in height (m)")
        bar.outline.set_visible(False)
        style.north_arrow(ax, at=(0.03, 0.98))
        style.scale_bar(ax, per_axis_unit=1.0, unit="km", at=(0.04, 0.03))
    return fig


def normalised_differences(validations: Mapping[str, Validation]) -> Figure:
    """Draw the points' differences over their predicted sigma against the normal distribution.

    Parameters
    ----------
    validations : mapping of str to Validation
        By their titles.
    """
    with style.applied():
        fig, axes = style.subplots(1, 3, figsize=(style.WIDTH, 2.7), sharey=True)
        for i, (title, validation) in enumerate(validations.items()):
            z = np.sort(validation.points.d / validation.points.sigma, axis=0)
            expected = special.ndtri((np.arange(len(z)) + 0.5) / max(len(z), 1))
            for axis, ax in enumerate(axes):
                ax.plot(
                    *(expected, z[:, axis], "o"),
                    ms=3,
                    color=style.colour(i),
                    alpha=0.8,
                    label=title,
                )
        for name, ax in zip(AXES, axes, strict=True):
            ax.axline((0, 0), slope=1, color=style.INK, lw=0.8)
            ax.set_title(name)
            ax.set_xlabel("expected, normal (σ)")
        axes[0].set_ylabel("difference / predicted σ")
        style.legend_below(fig, axes[0].get_legend_handles_labels()[0])
    return fig


def pair_histograms(validation: Validation) -> Figure:
    """Draw the differences of all pairs with the distribution that their sigma predict.

    Parameters
    ----------
    validation : Validation
    """
    pairs = validation.pairs
    limit = 3.2 * float(np.quantile(pairs.sigma, 0.9)) if len(pairs) else 1.0
    grid = np.linspace(-limit, limit, 201)
    with style.applied():
        fig, axes = style.subplots(1, 3, figsize=(style.WIDTH, 2.5), sharey=True)
        for axis, ax in enumerate(axes):
            bins = np.linspace(-limit, limit, 41)
            ax.hist(
                pairs.d[:, axis],
                bins,
                color=style.BLUE,
                alpha=0.75,
                density=True,
                label="pairs found",
            )
            ax.plot(
                *(grid, _density(grid, pairs.sigma[:, axis])),
                color=style.ORANGE,
                label="predicted by their σ",
            )
            ax.set_title(AXES[axis])
            ax.set_xlabel("estimated less surveyed (m)")
        axes[0].set_ylabel("density (1/m)")
        style.legend_below(fig, axes[0].get_legend_handles_labels()[0])
    return fig


def _density(at: Array, sigma: Array) -> Array:
    """Return the mean of the densities of normal distributions about zero, shape (n,)."""
    highest = 1 / (np.sqrt(2 * np.pi) * sigma)
    return np.array([np.mean(highest * np.exp(-0.5 * (x / sigma) ** 2)) for x in at])


def mistakes(validations: Mapping[str, Validation]) -> Figure:
    """Draw the RMS of the check points' differences, three bars for each validation.

    Parameters
    ----------
    validations : mapping of str to Validation
        By what was forgotten.
    """
    rows = np.arange(len(validations))
    rms = np.array([_rms(found.points.d) for found in validations.values()]).reshape(-1, 3)
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 0.9 + 0.36 * len(rows)))
        for axis, name in enumerate(AXES):
            ax.barh(
                *(rows + 0.26 * (axis - 1), rms[:, axis]),
                height=0.24,
                color=style.colour(axis),
                label=name,
            )
        ax.set_xscale("log")
        ax.set_yticks(rows, [*validations])
        ax.invert_yaxis()
        ax.set_xlabel("RMS of the check points' differences (m, logarithmic)")
        style.legend_below(fig, ax.get_legend_handles_labels()[0])
    return fig


def _rms(d: Array) -> Array:
    """Return the RMS along every axis, NaN without differences: a mistake may leave none."""
    rms: Array = np.sqrt(np.mean(d**2, axis=0)) if len(d) else np.full(3, np.nan)
    return rms
