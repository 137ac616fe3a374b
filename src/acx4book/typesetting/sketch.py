"""Parts of drawings in space: arrows, labels and frames of axes, seen along parallel rays."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from acx4book.typesetting import style
from acx4lib.expected import Array

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

MAPPING, BODY, CAMERA, RAY = style.TEAL, style.BRICK, style.BLUE, style.PLUM
"""The colour of each frame, and of what light does, in every drawing."""


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
