"""Figures of the surround-view rig: its photographs, the ground in one image, the overlaps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle

from acx4book.reference.surround.cameras import (
    FRAME_PX,
    FisheyeCamera,
    fisheye_from_undistorted,
    place,
)
from acx4book.reference.surround.corners import Corners, corner_misfits, rms
from acx4book.reference.surround.target_fit import TARGET_PX
from acx4book.reference.surround.views import View, blended
from acx4book.typesetting import style
from acx4lib.expected import Array, Raster

FEATHER_PX = 60.0
"""Width of the transition between views, cm on the ground."""

NOTHING = (224, 232, 240)
"""Colour of ground that no camera shows."""

SHOWN_PX = 484
"""Width of a picture that fills half of a figure, in the figure's pixels."""

LEVEL = 8
"""Step of the displayed grey values: smaller steps are not visible and need larger files."""

CROP_PX = 150
"""Side of an enlarged piece of ground, cm."""


def surround_photographs(cameras: Sequence[FisheyeCamera], images: Sequence[Raster]) -> Figure:
    """Draw the original images, and the parts that show the ground of the frame.

    Parameters
    ----------
    cameras : sequence of FisheyeCamera
    images : sequence of ndarray, shape (rows, cols, 3)

    Returns
    -------
    Figure
        Outline: the calibrated part. Cross: the principal point.
    """
    with style.applied():
        fig, axes = style.subplots(2, 2, figsize=(style.WIDTH, 4.95))
        for k, (ax, camera, image) in enumerate(zip(axes.flat, cameras, images, strict=True)):
            ax.imshow(_smaller(image, SHOWN_PX), extent=_extent(image), interpolation="nearest")
            ax.plot(*_calibrated(camera).T, color=style.ORANGE, lw=1.3)
            ax.plot(*camera.K[:2, 2], "+", color=style.ORANGE, ms=7, mew=1.2)
            ax.set(xlim=(-0.5, camera.width_px - 0.5), ylim=(camera.height_px - 0.5, -0.5))
            ax.set(xticks=[], yticks=[])
            ax.set_title(camera.name, color=style.colour(k))
            style.bare(ax)
    return fig


def _calibrated(camera: FisheyeCamera) -> Array:
    """Return the border of the undistorted image in the original image, px, shape (n, 2)."""
    right, bottom = camera.width_px - 1, camera.height_px - 1
    corners = np.array([[0, 0], [right, 0], [right, bottom], [0, bottom], [0, 0]], dtype=float)
    steps = np.linspace(0, 1, 100)[:, None]
    sides = [a + steps * (b - a) for a, b in pairwise(corners)]
    return fisheye_from_undistorted(camera, np.concatenate(sides))


def surround_ground(
    cameras: Sequence[FisheyeCamera], taken: Sequence[View], equalised: Sequence[View]
) -> Figure:
    """Draw the ground around the car: the original views side by side, and one image.

    Parameters
    ----------
    cameras : sequence of FisheyeCamera
        Cameras whose positions are drawn.
    taken, equalised : sequence of View
        The first are drawn with hard seams, the second blended.

    Returns
    -------
    Figure
    """
    panels = (
        ("as taken", "hard seams", taken, 0.0),
        (
            "one image",
            f"equalised, fitted, feathered over {FEATHER_PX:.0f} cm",
            equalised,
            FEATHER_PX,
        ),
    )
    with style.applied():
        fig, axes = style.subplots(1, 2, figsize=(style.WIDTH, 5.0))
        for ax, (title, subtitle, views, feather_px) in zip(axes, panels, strict=True):
            _draw_ground(ax, views, feather_px)
            style.heading(ax, title, subtitle)
            for k, camera in enumerate(cameras):
                col, row, _ = place(camera).centre_cm
                ax.plot(col, row, "o", color=style.colour(k), mec="white", mew=0.8, ms=6, zorder=5)
        _draw_bar(axes[0])
        handles: list[Any] = [
            Line2D([], [], marker="o", ls="", color=style.colour(k), label=f"{camera.name} camera")
            for k, camera in enumerate(cameras)
        ]
        handles.append(Patch(fc=np.array(NOTHING) / 255, label="no camera sees it (the car)"))
        style.legend_below(fig, handles)
    return fig


def _draw_ground(ax: Axes, views: Sequence[View], feather_px: float) -> None:
    image = _without_holes(blended(views, feather_px=feather_px), views)
    ax.imshow(_smaller(image, SHOWN_PX), extent=_extent(image), interpolation="nearest")
    ax.set(xlim=(-0.5, FRAME_PX[0] - 0.5), ylim=(FRAME_PX[1] - 0.5, -0.5), xticks=[], yticks=[])
    style.bare(ax)


def _draw_bar(ax: Axes) -> None:
    """Draw a bar of one metre under the car, where there is no picture."""
    middle, row = FRAME_PX[0] / 2, 770
    ax.plot([middle - 50, middle + 50], [row, row], color=style.INK, lw=2, solid_capstyle="butt")
    ax.text(middle, row - 12, "1 m", ha="center", va="bottom", fontsize=style.SMALL)


def surround_misfits(
    refinements: Mapping[str, Sequence[FisheyeCamera]],
    corners: Sequence[Corners],
    *,
    exaggeration: float = 8.0,
) -> Figure:
    """Draw the distances between the corners of the target in neighbouring cameras.

    Parameters
    ----------
    refinements : mapping of str to sequence of FisheyeCamera
        One panel for each.
    corners : sequence of Corners
    exaggeration : float
        Exaggeration of the vectors.

    Returns
    -------
    Figure
    """
    with style.applied():
        fig, axes = style.subplots(
            1, len(refinements), figsize=(style.WIDTH, 2.9), sharex=True, sharey=True, squeeze=False
        )
        for ax, (name, cameras) in zip(axes.flat, refinements.items(), strict=True):
            _draw_target(ax, cameras)
            found = [corner_misfits(cameras, c) for c in corners]
            at, d = (np.concatenate(part) for part in zip(*found, strict=True))
            arrows = ax.quiver(
                *(*at.T, *(exaggeration * d.T)),
                color=style.INK,
                angles="xy",
                scale_units="xy",
                scale=1,
                width=0.008,
                zorder=6,
            )
            ax.quiverkey(
                *(arrows, 0.5, 0.56, 10 * exaggeration, "10 cm"),
                labelpos="S",
                labelsep=0.04,
                fontproperties=style.LETTERS,
            )
            style.heading(ax, name, f"rms {rms(d):.1f} cm")
    return fig


def _draw_target(ax: Axes, cameras: Sequence[FisheyeCamera]) -> None:
    (left, top), (right, bottom) = TARGET_PX
    ax.add_patch(
        Rectangle((left, top), right - left, bottom - top, fc="none", ec=style.SOFT, lw=0.8)
    )
    for k, camera in enumerate(cameras):
        col, row, _ = place(camera).centre_cm
        ax.plot(col, row, "o", color=style.colour(k), ms=5, zorder=5)
    ax.set(xlim=(left - 60, right + 60), ylim=(bottom + 60, top - 60), aspect="equal")
    ax.set(xticks=[], yticks=[])
    style.bare(ax)


def surround_enlarged(
    cameras: Sequence[FisheyeCamera],
    corners: Sequence[Corners],
    stages: Mapping[str, Sequence[View]],
) -> Figure:
    """Draw a part of every overlap, from each camera alone and from both together.

    Parameters
    ----------
    cameras : sequence of FisheyeCamera
    corners : sequence of Corners
        One per overlap; the part is drawn around their middle.
    stages : mapping of str to sequence of View
        Views that are blended in a column, by its name. The first are also shown one by one.

    Returns
    -------
    Figure
    """
    alone = next(iter(stages.values()))
    with style.applied():
        n_columns = 2 + len(stages)
        fig, axes = style.subplots(
            len(corners),
            n_columns,
            figsize=(style.WIDTH, style.WIDTH * len(corners) / n_columns + 0.3),
        )
        mixed = [blended(views, feather_px=FEATHER_PX) for views in stages.values()]
        for row, c in zip(axes, corners, strict=True):
            middle = np.rint(corner_misfits(cameras, c)[0].mean(axis=0)).astype(int)
            singles = [_without_holes(v.image, [v]) for v in (alone[c.camera_a], alone[c.camera_b])]
            pictures = [*singles, *mixed]
            for ax, picture in zip(row, pictures, strict=True):
                ax.imshow(_smaller(_square(picture, middle), 200), interpolation="nearest")
                ax.set(xticks=[], yticks=[])
                style.bare(ax)
            for ax, k in zip(row, (c.camera_a, c.camera_b), strict=False):
                ax.set_title(f"{cameras[k].name} camera", color=style.colour(k))
            for ax, name in zip(row[2:], stages, strict=True):
                ax.set_title(name)
    return fig


# --- pictures --------------------------------------------------------------------------------


def _without_holes(image: Raster, views: Sequence[View]) -> Raster:
    """Return an image of the ground with a light grey where no camera sees it."""
    seen = np.any([v.seen for v in views], axis=0)
    return np.where(seen[:, :, None], image, np.array(NOTHING, dtype=np.uint8))


def _smaller(image: Raster, width: int) -> Raster:
    height = round(image.shape[0] * width / image.shape[1])
    small = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA).astype(float)
    return np.clip(LEVEL * np.rint(small / LEVEL), 0, 255).astype(np.uint8)


def _extent(image: Raster) -> tuple[float, float, float, float]:
    """Return the outer edges of an image in pixels: left, right, bottom, top."""
    return -0.5, image.shape[1] - 0.5, image.shape[0] - 0.5, -0.5


def _square(image: Raster, middle: Array) -> Raster:
    half = CROP_PX // 2
    col, row = middle
    return image[row - half : row + half, col - half : col + half]
