"""One exposure in space: the heads, the ground that each of them sees, the synthetic image."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from acx4book.typesetting import style
from acx4book.typesetting.plain_text import shown
from acx4book.typesetting.sketch import blank, note
from acx4lib.expected import Array
from acx4lib.flight import design
from acx4lib.flight.block import Block
from acx4lib.flight.reader import Flight

PANE = 0.36
"""Where on the rays the images are drawn, as a share of the way to the ground."""

ALT = (
    "An aeroplane over a field, drawn in space. From it the rays of every camera head widen to "
    "the ground, each in a colour of its own. Half-way they pass through the images, coloured "
    "panes that overlap; a thick frame around them is the synthetic image. On the ground the "
    "same panes are large areas that overlap along their inner borders, with the same thick "
    "frame. The frames of the other exposures of the strip lie one over the other, and triangles "
    "mark surveyed points."
)
"""What is seen."""

AEROPLANE = np.array(
    [
        *((1.1, 0.0), (0.9, 0.1), (0.35, 0.12), (0.2, 1.3), (-0.1, 1.3), (-0.2, 0.12)),
        *((-0.8, 0.07), (-0.9, 0.45), (-1.1, 0.45), (-1.05, 0.0)),
    ]
)
"""Outline of the right half of an aeroplane, from the nose to the tail, in half spans."""


@dataclass(frozen=True, eq=False)
class Scene:
    """An exposure in metres, in axes along the flight, to its left, and up from the ground.

    Attributes
    ----------
    places : ndarray, shape (n, 3)
        Of all exposures of the strip.
    middle : int
        The exposure that is drawn.
    images : ndarray, shape (n_cameras, 4, 3)
        Footprints of its images.
    synthetic : ndarray, shape (n, 4, 3)
        Footprints of the strip's synthetic images, or of its images where it has no others.
    control : ndarray, shape (n, 3)
        The surveyed points, on the ground.
    names : tuple of str
        Of the cameras.
    """

    places: Array
    middle: int
    images: Array
    synthetic: Array
    control: Array
    names: tuple[str, ...]

    @property
    def centre(self) -> Array:
        """Where the exposure was taken, shape (3,)."""
        return np.array(self.places[self.middle])


def scene(flight: Flight) -> Scene | None:
    """Return the middle exposure of the lowest strip; None where the ground is not known.

    Of the calibration block, or of the first block where there is none.

    Parameters
    ----------
    flight : Flight
    """
    name = "calibration" if flight.calibration is not None else next(iter(flight.blocks))
    block, mounted = flight.block(name), flight.mounted(name)
    lowest = design.levels(block)[-1]
    strip_of = np.array(design.strip_of_exposure(block), dtype=object)
    strip = lowest.strips[len(lowest.strips) // 2]
    own = np.flatnonzero(strip_of == strip)
    middle = own[len(own) // 2]
    to_strip = _along(block, middle)
    images = to_strip(design.footprints(block)[block.images.exposure_idx == middle])
    frames = to_strip(design.footprints(mounted)[np.isin(mounted.images.exposure_idx, own)])
    if not (np.isfinite(images).all() and np.isfinite(frames).all()):
        return None
    surveyed = to_strip(np.concatenate([block.control.x_m, block.check.x_m]))
    return Scene(
        places=to_strip(block.trajectory.T_m_b.r[own]),
        middle=len(own) // 2,
        images=images,
        synthetic=frames,
        control=surveyed * [1.0, 1.0, 0.0],
        names=tuple(camera.name for camera in block.cameras),
    )


def _along(block: Block, exposure: int) -> Callable[[Array], Array]:
    """Return the map from the mapping frame into the axes of a scene."""
    ahead = design.directions(block)[exposure]
    axes = np.array([[*ahead, 0.0], [-ahead[1], ahead[0], 0.0], [0.0, 0.0, 1.0]])
    foot = block.trajectory.T_m_b.r[exposure] * [1.0, 1.0, 0.0]
    foot[2] = design.ground_height(block)
    return lambda x_m: (x_m - foot) @ axes.T


# --- the picture -----------------------------------------------------------------------------


def exposure(flight: Flight) -> Figure:
    """Draw one exposure as one sees it who flies beside it.

    Parameters
    ----------
    flight : Flight
        With ground control, which says where the ground is.
    """
    found = scene(flight)
    if found is None:
        return style.nothing("No surveyed point tells where the ground is.")
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 5.0))
        look = Look.at(found)
        _draw_ground(ax, found, look)
        _draw_rays(ax, found, look)
        _draw_aeroplane(ax, found, look)
        _label(ax, found, look)
        blank(fig)
    return fig


def caption(flight: Flight) -> str:
    """Say what the drawing shows, with the numbers of the flight."""
    found = scene(flight)
    if found is None:
        return ""
    n, each = len(found.images), np.ptp(found.synthetic[found.middle], axis=0)[:2]
    cameras = f"{n} heads take {n} images at once" if n > 1 else "One camera takes one image"
    thick = "the synthetic image that is made of them" if n > 1 else "its frame"
    return (
        f"{cameras}, {found.centre[2]:.0f} m above the ground, drawn from the trajectory and the "
        f"cameras of the flight {shown(flight.name)}. Thick: {thick}, {each[0]:.0f} × "
        f"{each[1]:.0f} m on the ground. Thin: the other exposures of the strip."
    )


@dataclass(frozen=True, eq=False)
class Look:
    """A central projection of a scene.

    Attributes
    ----------
    eye : ndarray, shape (3,)
    axes : ndarray, shape (3, 3)
        Rows to the right, up and towards the viewer.
    """

    eye: Array
    axes: Array

    @classmethod
    def at(cls, found: Scene) -> Look:
        """Look at a scene from its right, from behind and from above."""
        height = found.centre[2]
        eye = np.array([-1.3, -3.2, 1.75]) * height
        towards = eye - np.array([0.1, 0.0, 0.38]) * height
        towards /= np.linalg.norm(towards)
        right = np.cross([0.0, 0.0, 1.0], towards)
        right /= np.linalg.norm(right)
        return cls(eye=eye, axes=np.stack([right, np.cross(towards, right), towards]))

    def __call__(self, points: Array) -> Array:
        """Return points on the picture, shape (..., 2), in the unit of the scene."""
        seen = (points - self.eye) @ self.axes.T
        picture: Array = -seen[..., :2] / seen[..., 2:] * np.linalg.norm(self.eye)
        return picture


def _draw_ground(ax: Axes, found: Scene, look: Look) -> None:
    """Draw the frames of the whole strip and the surveyed points under it."""
    for frame in found.synthetic:
        ax.add_patch(_area(look(frame), style.SOFT, alpha=0.06))
        ax.add_patch(_outline(look(frame), style.SOFT, lw=0.5))
    low, high = (f(found.synthetic.reshape(-1, 3), axis=0) for f in (np.min, np.max))
    margin = 0.12 * (high - low)
    near = np.all((found.control >= low - margin) & (found.control <= high + margin), axis=1)
    ax.plot(*look(found.control[near]).T, "^", color=style.INK, ms=3.2)


def _draw_rays(ax: Axes, found: Scene, look: Look) -> None:
    """Draw what every camera sees, from the lens through its image to the ground."""
    centre = found.centre
    far_first = np.argsort(-found.images.mean(axis=1) @ (look.eye - centre))[::-1]
    for i in far_first:
        corners, colour = found.images[i], style.colour(int(i))
        ax.add_patch(_area(look(corners), colour, alpha=0.3))
        ax.add_patch(_outline(look(corners), colour, lw=1.1))
        for pair in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            ax.add_patch(_area(look(np.array([centre, *pair])), colour, alpha=0.05))
        for corner in corners:
            ax.plot(*look(np.array([centre, corner])).T, color=colour, lw=0.5, alpha=0.7)
    frame = found.synthetic[found.middle]
    ax.add_patch(_outline(look(frame), style.INK, lw=2.2))
    for i in far_first:
        pane = look(centre + PANE * (found.images[i] - centre))
        ax.add_patch(_area(pane, style.colour(int(i)), alpha=0.6))
    ax.add_patch(_outline(look(centre + PANE * (frame - centre)), style.INK, lw=2.2))


def _draw_aeroplane(ax: Axes, found: Scene, look: Look) -> None:
    """Draw the line of flight, its exposures, and an aeroplane that is much too large."""
    ax.plot(*look(found.places).T, "-", color=style.SOFT, lw=0.8)
    ax.plot(*look(found.places).T, "o", color=style.SOFT, ms=3)
    outline = np.concatenate([AEROPLANE, AEROPLANE[::-1] * [1.0, -1.0]])
    flat = np.column_stack([outline * 0.13 * found.centre[2], np.zeros(len(outline))])
    ax.add_patch(_area(look(found.centre + flat), style.INK, alpha=1.0))


def _label(ax: Axes, found: Scene, look: Look) -> None:
    """Write what is seen beside it."""
    centre, frame = found.centre, found.synthetic[found.middle]
    for name, corners in zip(found.names, found.images, strict=True):
        outermost = corners[np.argmax(np.hypot(*corners.T[:2]))]
        at = look(0.8 * corners.mean(axis=0) + 0.2 * outermost)
        ax.annotate(
            style.plain(name),
            (at[0], at[1]),
            color=style.INK,
            ha="center",
            va="center",
            weight="bold",
        )  # colours of the palette are too light for letters
    pane = centre + PANE * (frame - centre)
    right = max(look(pane), key=lambda at: float(at[0]))
    left = min(look(pane), key=lambda at: float(at[0]))
    what = "one synthetic image" if len(found.images) > 1 else "one image"
    note(ax, right, f"{what}\n(thick frame)", style.INK, shift=(66, 6))
    if len(found.images) > 1:
        note(
            ax,
            left,
            f"{len(found.images)} images\nof {len(found.images)} heads",
            style.INK,
            shift=(-42, 8),
        )
    last = look(found.places)[np.argmax(look(found.places)[:, 0])]
    note(ax, last, f"exposures, {centre[2]:.0f} m\nabove the ground", style.SOFT, shift=(10, -18))
    points = look(found.control)
    note(ax, points[np.argmin(points[:, 1])], "surveyed points", style.SOFT, shift=(54, 0))


def _area(corners: Array, colour: str, *, alpha: float) -> Polygon:
    return Polygon(corners, facecolor=colour, alpha=alpha, lw=0, zorder=2)


def _outline(corners: Array, colour: str, *, lw: float) -> Polygon:
    return Polygon(corners, facecolor="none", edgecolor=colour, lw=lw, zorder=3)
