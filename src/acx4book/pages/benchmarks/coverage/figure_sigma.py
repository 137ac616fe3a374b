"""Figures of errors over their standard deviations, from many flights."""

from __future__ import annotations

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import stats

from acx4book.typesetting import style
from acx4book.typesetting.labels import LABELS
from acx4lib.expected import Array
from acx4lib.geometry.parameters import AXES

COLUMNS = 6
LIMIT = 4.0

MINT = "#a9dccb"


def normalised_errors(parameters: pd.DataFrame, points: pd.DataFrame) -> Figure:
    """Draw how errors over sigma are distributed, beside what theory says.

    Parameters
    ----------
    parameters : DataFrame
        Of one method: seed, parameter, error, sigma, decorrelated.
    points : DataFrame
        Of the same method: d_east_m, sigma_east_m, and so on.
    """
    names = list(dict.fromkeys(parameters["parameter"]))
    n_rows = -(-(len(names) + 1 + len(AXES)) // COLUMNS)
    with style.applied():
        fig, grid = style.subplots(n_rows, COLUMNS, figsize=(style.WIDTH, 1.45 * n_rows))
        axes = list(grid.ravel())
        for name in names:
            own = parameters[parameters["parameter"] == name]
            _against_normal(
                axes.pop(0), own["error"] / own["sigma"], LABELS[name], (style.SKY, style.BLUE)
            )
        squares = (parameters["decorrelated"] ** 2).groupby(parameters["seed"]).sum()
        _against_chi_square(axes.pop(0), squares.to_numpy(), len(names))
        for axis in AXES:
            z = points[f"d_{axis}_m"] / points[f"sigma_{axis}_m"]
            _against_normal(axes.pop(0), z, f"validation, {axis}", (MINT, style.TEAL))
        for ax in axes:
            ax.set_visible(False)
        fig.supxlabel("error over its standard deviation (1)", fontsize=8.5, color=style.INK)
    return fig


def _against_normal(ax: Axes, z: pd.Series, title: str, tints: tuple[str, str]) -> None:
    bins = np.linspace(-LIMIT, LIMIT, 17)
    x = np.linspace(-LIMIT, LIMIT, 200)
    _histogram(ax, np.clip(z.to_numpy(), -LIMIT, LIMIT), bins, tints)
    ax.plot(x, stats.norm.pdf(x), color=style.INK, lw=1.1)
    ax.set(xlim=(-LIMIT, LIMIT), ylim=(0, 0.62), xticks=[-3, 0, 3])
    _titled(ax, title, f"{z.mean():+.2f} ± {z.std():.2f}".replace("-", "−"))


def _against_chi_square(ax: Axes, squares: Array, dof: int) -> None:
    top = float(stats.chi2.ppf(0.9999, dof))
    x = np.linspace(0, top, 200)
    _histogram(ax, np.clip(squares, 0, top), np.linspace(0, top, 17), (style.SKY, style.BLUE))
    density = stats.chi2.pdf(x, dof)
    ax.plot(x, density, color=style.INK, lw=1.1)
    ax.set(xlim=(0, top), ylim=(0, 1.55 * density.max()), xticks=[0, dof, 2 * dof])
    _titled(ax, f"all {dof}: χ²", f"mean {squares.mean():.1f}")


def _histogram(ax: Axes, values: Array, bins: Array, tints: tuple[str, str]) -> None:
    fill, edge = tints
    ax.hist(values, bins.tolist(), density=True, color=fill, alpha=0.75)
    ax.hist(values, bins.tolist(), density=True, histtype="step", color=edge, lw=0.8)
    ax.set_yticks([])
    ax.spines["left"].set_visible(False)
    ax.grid(visible=False)


def _titled(ax: Axes, title: str, note: str) -> None:
    ax.set_title(title, loc="center", fontsize=style.SMALL, fontweight="normal", pad=3)
    ax.annotate(
        note,
        xy=(0.5, 1),
        xytext=(0, -2),
        xycoords="axes fraction",
        textcoords="offset points",
        ha="center",
        va="top",
        fontsize=style.SMALL,
        color=style.SOFT,
    )
