"""Figures of chapter 3: differences in the image and on the ground, and effects of a camera."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from acx4book.foundations import example
from acx4book.typesetting import style
from acx4lib.expected import Array

STRIPS = {"A": style.BLUE, "B": style.ORANGE}
"""The colour of each strip."""

NAMES = {"A": "strip A, flown east", "B": "strip B, flown west"}

KINDS = {"turn": style.BLUE, "shift": style.TEAL, "focal": style.PLUM}
"""The colour of each kind of change."""

DEGREES, METRES, FOCAL_MM = 0.1, 1.0, 0.1
"""Turn (°) and shift (m) of the camera, and change of f (mm), in the figure of effects."""

LOOK_ALIKE_MM = 0.02
"""Length drawn as one millimetre of the image in the figure of look-alikes, mm."""


# --- differences -----------------------------------------------------------------------------


def differences(d_xy: Array, R_m_c: Array) -> Figure:
    """Draw the differences of the eight measured points in the image, and on the ground.

    Parameters
    ----------
    d_xy : ndarray, shape (4, 2, 2)
        Measured minus computed, mm: image, point, x and y.
    R_m_c : ndarray, shape (4, 3, 3)
    """
    height = example.positions()[:, None, 2] - example.points()[:, 2]
    in_camera = np.concatenate([d_xy, np.zeros((4, 2, 1))], axis=-1)
    d_m = np.einsum("nij,npj->npi", R_m_c, in_camera)[..., :2] * height[..., None] / example.F_MM
    with style.applied():
        fig, (image, ground) = style.subplots(1, 2, figsize=(style.WIDTH, 3.9))
        for i, strip in enumerate("AABB"):
            look = {"color": STRIPS[strip], "width": 0.008, "angles": "xy", "scale_units": "xy"}
            image.quiver(*example.measured()[i].T, *d_xy[i].T, scale=1 / 16, **look)
            ground.quiver(*example.points()[:, :2].T, *d_m[i].T, scale=1 / 16, **look)
        _sensor(image)
        image.set(xlabel="x (mm)", ylabel="y (mm)")
        ground.set(xlim=(-110, 110), ylim=(-165, 165), aspect="equal")
        ground.set(xlabel="east (m)", ylabel="north (m)")
        for name, place in zip(example.CONTROL["point"], example.points(), strict=True):
            ground.annotate(
                name, place[:2], (-13, 5), textcoords="offset points", fontsize=10, weight="bold"
            )
        style.heading(image, "In the image", "measured minus computed, 16 times as long")
        style.heading(ground, "On the ground", "the same, projected down; 16 times as long")
        handles = [Line2D([], [], color=STRIPS[s], lw=2, label=NAMES[s]) for s in STRIPS]
        style.legend_below(fig, handles)
    return fig


def _sensor(ax: Axes) -> None:
    """Give axes the format of the example's camera."""
    half = 0.5 * example.PIXEL_MM * np.array([example.WIDTH_PX, example.HEIGHT_PX])
    ax.set(xlim=(-half[0], half[0]), ylim=(-half[1], half[1]), aspect="equal")


# --- effects of the camera on the image -------------------------------------------------------


def grid(columns: int = 9, rows: int = 7) -> Array:
    """Return points spread over the example's image, shape (n, 2), mm."""
    half = 0.45 * example.PIXEL_MM * np.array([example.WIDTH_PX, example.HEIGHT_PX])
    x, y = np.linspace(-half[0], half[0], columns), np.linspace(-half[1], half[1], rows)
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)


def by_turn(xy: Array) -> Array:
    """Return the derivatives of image points by a turn about the camera's axes.

    Parameters
    ----------
    xy : ndarray, shape (n, 2)
        mm from the principal point.

    Returns
    -------
    ndarray, shape (n, 2, 3)
        mm per radian.
    """
    f, (x, y) = example.F_MM, xy.T
    rows = [[-x * y / f, f + x * x / f, y], [-(f + y * y / f), x * y / f, -x]]
    return np.moveaxis(np.array(rows), -1, 0)


def effects(xy: Array, height_m: float) -> dict[str, Array]:
    """Return the effects of small changes of a camera on image points, each (n, 2), mm, by name."""
    turn = np.radians(DEGREES) * by_turn(xy)
    shift = METRES * _by_shift(xy, height_m)
    return {
        "turn about y": turn[:, :, 1],
        "turn about x": turn[:, :, 0],
        "focal length": FOCAL_MM * xy / example.F_MM,
        "turn about z": turn[:, :, 2],
        "shift along −x": -shift[:, :, 0],
        "shift along y": shift[:, :, 1],
        "shift along −z": -shift[:, :, 2],
    }


def _by_shift(xy: Array, height_m: float) -> Array:
    """Return the derivatives by a shift along the camera's axes, over flat ground."""
    f, (x, y) = example.F_MM, xy.T
    rows = [[f + 0 * x, 0 * x, x], [0 * y, f + 0 * y, y]]
    return -np.moveaxis(np.array(rows), -1, 0) / height_m


def columns(height_m: float) -> Figure:
    """Draw the columns of the Jacobian as arrows over the image, look-alikes below each other."""
    xy = grid()
    fields: Mapping[str, Array] = effects(xy, height_m)
    with style.applied():
        fig, panels = style.subplots(2, 4, figsize=(style.WIDTH, 3.3), sharex=True, sharey=True)
        for ax, (name, d) in zip(panels.flat, fields.items(), strict=False):
            longest = np.hypot(*d.T).max()
            _field(ax, xy, d * 5.5 / longest, KINDS[name.split()[0]])
            style.heading(ax, name, f"longest {1000 * longest:.0f} µm")
        panels[1, 3].set_visible(False)
    return fig


def _field(ax: Axes, xy: Array, d: Array, colour: str) -> None:
    """Draw arrows of lengths in mm over the image."""
    ax.quiver(
        xy[:, 0], xy[:, 1], d[:, 0], d[:, 1],
        color=colour, width=0.011, angles="xy", scale_units="xy", scale=1,
    )  # fmt: skip
    _sensor(ax)
    ax.set(xticks=[], yticks=[])
    ax.grid(visible=False)


def look_alike(height_m: float) -> Figure:
    """Draw a turn about y, the most similar shift along -x, and their difference."""
    xy = grid()
    fields = effects(xy, height_m)
    turn, shift = fields["turn about y"], fields["shift along −x"]
    factor = float(np.sum(turn * shift) / np.sum(shift * shift))
    residual = turn - factor * shift
    drawn = (
        (f"{DEGREES}° about y", turn, 1, KINDS["turn"]),
        (f"{factor * METRES:.2f} m along −x", factor * shift, 1, KINDS["shift"]),
        ("what is left", residual, 5, style.BRICK),
    )
    with style.applied():
        fig, panels = style.subplots(1, 3, figsize=(style.WIDTH, 2.4))
        for ax, (name, d, times, colour) in zip(panels, drawn, strict=True):
            _field(ax, xy, times * d / LOOK_ALIKE_MM, colour)
            rms = 1000 * np.sqrt(np.mean(np.sum(d * d, axis=1)))
            longer = f", drawn {times} times longer" if times > 1 else ""
            style.heading(ax, name, f"RMS {rms:.0f} µm{longer}")
    return fig
