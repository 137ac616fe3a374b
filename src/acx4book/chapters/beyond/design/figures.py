"""Figures of the chapter: curves of standard deviations, and flights in plan."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from acx4book.typesetting import style
from acx4lib.expected import Array
from acx4lib.planning import ground
from acx4lib.planning.choosing.target import BLOCK
from acx4lib.planning.plan import Plan, Strip, image_length_m

PANELS = {
    "interior (µm)": (1000.0, {"f_mm": "f", "xp_mm": "$x_p$", "yp_mm": "$y_p$"}),
    "lever arm (cm)": (100.0, {"lever_z_m": "z", "lever_x_m": "x", "lever_y_m": "y"}),
    "boresight (0.001°)": (
        1000.0,
        {
            "boresight_kappa_deg": "κ",
            "boresight_omega_deg": "ω",
            "boresight_phi_deg": "φ",
        },
    ),
}
"""Panels with their unit: the factor to it, and curves by the parameter's name in results."""

LEAST_RANGE = 4.0
"""Smallest ratio of the ends of a logarithmic axis."""

COLOURS = (style.BLUE, style.ORANGE, style.TEAL)


def curves(table: pd.DataFrame, label: str, *, beside: pd.DataFrame | None = None) -> Figure:
    """Draw standard deviations along a change, on logarithmic axes.

    Parameters
    ----------
    table : DataFrame
        As `curves` makes it: a row for every parameter, columns are what changes.
    label : str
        What changes.
    beside : DataFrame, optional
        Drawn dashed in the same colours.
    """
    with style.applied():
        fig, axes = style.subplots(1, len(PANELS), figsize=(style.WIDTH, 2.9), sharex=True)
        for ax, (title, (factor, names)) in zip(axes, PANELS.items(), strict=True):
            for (name, short), colour in zip(names.items(), COLOURS, strict=True):
                ax.plot(table.columns, factor * table.loc[name], "o-", color=colour, label=short)
                if beside is not None:
                    ax.plot(
                        beside.columns, factor * beside.loc[name], "o--", color=colour, mfc="none"
                    )
            ax.set(title=title, yscale="log", xlabel=label)
            ax.xaxis.set_major_locator(MaxNLocator(5, integer=table.columns.dtype.kind == "i"))
            _ticked(ax)
            ax.legend(loc="best")
        axes[0].set_ylabel("σ")
    return fig


def _ticked(ax: Axes) -> None:
    """Write plain numbers on a logarithmic axis of at least a factor of four.

    A smaller axis would make a slope of what is nearly constant.
    """
    low, high = ax.get_ylim()
    wider = max(1.0, LEAST_RANGE * low / high) ** 0.5
    low, high = low / wider, high * wider
    digits = (1, 2, 5) if high / low > 10 else (1, 1.5, 2, 3, 5, 7)
    ticks = [d * 10.0**k for k in range(-3, 4) for d in digits if low <= d * 10.0**k <= high]
    ax.set_ylim(low, high)
    ax.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    ax.set_yticks([], minor=True)


def maps(flights: Mapping[str, Plan]) -> Figure:
    """Draw flights in plan: strips, the footprints of their middle images, control points."""
    with style.applied():
        fig, axes = style.subplots(
            1, len(flights), figsize=(style.WIDTH, 2.7), sharex=True, sharey=True
        )
        for ax, (name, plan) in zip(axes, flights.items(), strict=True):
            style.bare(ax)
            ax.set(title=name, aspect="equal", xticks=[], yticks=[])
            _map(ax, plan)
        style.scale_bar(axes[0], per_axis_unit=1.0, unit="km", at=(0.04, 0.05))
    return fig


def _map(ax: Axes, plan: Plan) -> None:
    block = plan.blocks[BLOCK]
    lowest = min(one.flying_height_m for one in block.strips.values())
    for one in block.strips.values():
        high = one.flying_height_m > 1.01 * lowest
        colour = style.ORANGE if high else style.BLUE
        ends, corners = _placed(plan, one)
        arrow = {"arrowstyle": "-|>", "color": colour, "lw": 1.4, "shrinkA": 0, "shrinkB": 0}
        ax.annotate("", xy=tuple(ends[1]), xytext=tuple(ends[0]), arrowprops=arrow)
        ax.plot(*corners.T, color=colour, lw=0.6)
    at = ground.on_map(block.area, ground.places(block.points)) - _middle(plan)
    ax.plot(*at.T / 1000.0, "D", color=style.INK, mfc="none", ms=2)


def _middle(plan: Plan) -> Array:
    area = plan.blocks[BLOCK].area
    return np.array([area.east_m, area.north_m])


def _placed(plan: Plan, one: Strip) -> tuple[Array, Array]:
    """Return a strip's ends and its middle footprint in km from the field's middle.

    Strips are drawn a little to the right, so that opposite ones do not coincide.
    """
    camera, area = plan.cameras(BLOCK)[0], plan.blocks[BLOCK].area
    course = np.radians(one.course_deg)
    forward = np.array([np.sin(course), np.cos(course)])
    right = np.array([forward[1], -forward[0]])
    local = np.array([[one.forward_m, one.left_m]])
    middle = ground.on_map(area, local)[0] - _middle(plan)
    half = 0.5 * one.base_m * (one.n_exposures - 1)
    aside = 60.0 * right
    ends = middle + aside + np.outer([-half, half], forward)
    x = 0.5 * image_length_m(camera, one.flying_height_m)
    y = 0.5 * image_length_m(camera, one.flying_height_m, across=True)
    square = np.array([[x, y], [-x, y], [-x, -y], [x, -y], [x, y]])
    return ends / 1000.0, (middle + square @ np.array([forward, right])) / 1000.0
