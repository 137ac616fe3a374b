"""A signalised point, after the paper's Figure 4b, and what images make of it."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle

from acx4book.paper import printed
from acx4book.typesetting import style
from acx4lib.expected import Array
from acx4lib.flight.design import levels
from acx4lib.flight.reader import Flight

SIDE_M = 1.6
"""Side of the square of ground that is drawn."""

OFF = np.array([0.23, -0.17])
"""Where the middle of the target is, in pixels from the middle of a pixel."""

SAMPLES = 20
"""Points along each side of a pixel by which its grey value is found."""


def target(flight: Flight) -> Figure:
    """Draw the target of the paper, and its image from each flying height over the field.

    Parameters
    ----------
    flight : Flight
    """
    if not printed.applies(flight):
        return style.nothing("The targets of this flight are not described in its files.")
    diameter = printed.statement("target_diameter_m")
    found = _levels(flight)
    with style.applied():
        fig, axes = style.subplots(1, 1 + len(found), figsize=(style.WIDTH, 2.1))
        _draw_target(axes[0], diameter)
        for ax, (height, gsd) in zip(axes[1:], found, strict=True):
            grey = pixels(diameter / gsd, OFF, half=int(np.ceil(SIDE_M / gsd / 2)))
            reach = gsd * len(grey) / 2
            ax.imshow(grey, cmap="gray", vmin=-0.25, vmax=1, extent=(-reach, reach, -reach, reach))
            ax.set_title(f"from {height:.0f} m")
            ax.set_xlabel(f"{100 * gsd:.1f} cm a pixel:\n{diameter / gsd:.1f} px across")
        for ax in axes:
            half = SIDE_M / 2
            ax.set(xlim=(-half, half), ylim=(-half, half), aspect="equal", xticks=[], yticks=[])
            ax.grid(visible=False)
    return fig


def _levels(flight: Flight) -> list[tuple[float, float]]:
    """Return heights and ground pixels of the blocks over the field, the lowest first."""
    blocks = [flight.mounted(name) for name in ("heads", "calibration") if name in flight.blocks]
    return sorted((level.height_m, level.gsd_m) for block in blocks for level in levels(block))


def pixels(diameter_px: float, centre_px: Array, *, half: int) -> Array:
    """Return how much of each pixel a disc covers.

    Parameters
    ----------
    diameter_px : float
    centre_px : ndarray, shape (2,)
        Of the disc, from the middle of the middle pixel.
    half : int
        Pixels on each side of the middle one.

    Returns
    -------
    ndarray, shape (2 half + 1, 2 half + 1)
        From zero to one.
    """
    n = 2 * half + 1
    at = (np.arange(n * SAMPLES) + 0.5) / SAMPLES - n / 2
    col, row = np.meshgrid(at - centre_px[0], at - centre_px[1])
    inside = np.hypot(col, row) <= diameter_px / 2
    shares: Array = inside.reshape(n, SAMPLES, n, SAMPLES).mean(axis=(1, 3))
    return shares


def _draw_target(ax: Axes, diameter: float) -> None:
    """Draw the disc with its measure."""
    ax.set_facecolor("#5c6166")
    ax.add_patch(Circle((0, 0), diameter / 2, fc="white", ec="none"))
    how = {"arrowstyle": "<->", "color": style.BLACK, "lw": 1.0, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", (-diameter / 2, 0), (diameter / 2, 0), arrowprops=how)
    ax.text(0, 0.04, f"{100 * diameter:.0f} cm", ha="center", va="bottom", color=style.BLACK)
    ax.set_title("on the ground")
    ax.set_xlabel("a disc")
