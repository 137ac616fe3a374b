"""Figures of the failure clinic: one panel for each mistake, all in the same scale and layout."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from acx4book.chapters.beyond.failures.examined import GROUPS, Examined, of_group, standardised
from acx4book.typesetting import style

COLUMNS = 3
SEEN, LARGEST = 2.0, 3000.0
"""RMS of standardised residuals from which a group is marked; end of the axis."""

ARROW_KM = 0.3
"""Length in the map of the longest arrow of a panel."""

REFUSED = "refused when it is read:\nno adjustment"

Draw = Callable[[Axes, Examined], object]


def fingerprints(found: Mapping[str, Examined]) -> Figure:
    """Draw the standardised residuals of every group of observations, mistake by mistake.

    Parameters
    ----------
    found : mapping of str to Examined
    """
    with style.applied():
        fig, axes = _panels(found, _draw_fingerprint, height=1.75, sharex=True, sharey=True)
        first = axes[0, 0]
        first.set(xscale="log", xlim=(0.3, LARGEST))
        first.set_yticks(range(len(GROUPS)), [*GROUPS])
        first.invert_yaxis()
        for ax in axes[-1]:
            ax.set_xlabel("RMS of $w$ (1)")
    return fig


def _draw_fingerprint(ax: Axes, one: Examined) -> None:
    rms = standardised(one)
    colours = [style.BRICK if value > SEEN else style.BLUE for value in rms]
    ax.barh(np.arange(len(rms)), rms - 0.3, left=0.3, color=colours, height=0.68)
    ax.axvline(1.0, color=style.INK, lw=0.8)
    ax.grid(axis="y", visible=False)


def maps(found: Mapping[str, Examined]) -> Figure:
    """Draw where residuals are: of positions in plan as arrows, of attitudes as colours.

    Parameters
    ----------
    found : mapping of str to Examined
    """
    with style.applied():
        fig, axes = _panels(found, _draw_map, height=2.2)
        reach = 1.35 * max(float(one.places_km.abs().to_numpy().max()) for one in found.values())
        for ax in axes.flat:
            ax.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal", xticks=[], yticks=[])
        marks = axes[0, 0].collections[0]
        label = "residual of the attitude, RMS of $w$ (1)"
        fig.colorbar(
            marks, ax=axes, location="bottom", shrink=0.5, aspect=40, pad=0.02, label=label
        )
    return fig


def _draw_map(ax: Axes, one: Examined) -> None:
    names = one.places_km.index
    at = one.places_km.to_numpy()
    turned = np.sqrt(
        _by_exposure(one, "roll, pitch", names) ** 2 + _by_exposure(one, "heading", names) ** 2
    )
    east, north = at.T
    ax.scatter(
        east,
        north,
        c=turned,
        s=16,
        cmap=style.SHADES,
        norm=LogNorm(0.5, 500.0),
        zorder=3,
        edgecolor=style.SOFT,
        lw=0.4,
    )
    v = of_group(one, "GNSS, plan").pivot_table(
        index="image_or_exposure", columns="component", values="v"
    )
    moved = v.reindex(names)[["east_m", "north_m"]].to_numpy()
    longest = float(np.nanmax(np.hypot(*moved.T)))
    arrows: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "width": 0.008, "zorder": 4}
    ax.quiver(*at.T, *moved.T, scale=longest / ARROW_KM, color=style.ORANGE, **arrows)
    ax.annotate(
        f"longest arrow {_length(longest)}", (0.02, 0.03), xycoords="axes fraction", fontsize=7.5
    )


def _by_exposure(one: Examined, group: str, names: pd.Index) -> np.ndarray:
    """Return the RMS of the standardised residuals of a group, by exposure."""
    own = of_group(one, group)
    mean = own.assign(square=own["w"] ** 2).groupby("image_or_exposure")["square"].mean()
    out: np.ndarray = np.sqrt(mean.reindex(names).to_numpy())
    return out


def _length(metres: float) -> str:
    return f"{metres:.1f} m" if metres >= 1 else f"{100 * metres:.0f} cm"


def _panels(
    found: Mapping[str, Examined], draw: Draw, *, height: float, **shared: bool
) -> tuple[Figure, Any]:
    """Return a figure with a panel for every mistake; what was refused says so."""
    n_rows = -(-len(found) // COLUMNS)
    fig, axes = style.subplots(
        n_rows, COLUMNS, figsize=(style.WIDTH, height * n_rows + 0.5), squeeze=False, **shared
    )
    for ax in axes.flat[len(found) :]:
        ax.axis("off")
    for ax, (name, one) in zip(axes.flat, found.items(), strict=False):
        ax.set_title(name)
        if len(one.residuals):
            draw(ax, one)
        else:
            ax.text(
                *(0.5, 0.5, REFUSED), ha="center", va="center", color=style.SOFT,
                transform=ax.transAxes,
            )  # fmt: skip
    return fig, axes
