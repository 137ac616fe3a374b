"""Figures of the frames: mapping, body and camera frame; image plane and pixel axes.

Nothing is to scale.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon, Rectangle
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from acx4book.typesetting import style
from acx4book.typesetting.maps import BODY, CAMERA, MAPPING, RAY, arrow, note, triad, view
from acx4book.typesetting.style import EDGE, INK, LAND, LAND_EDGE, PAPER, SHEET, SOFT, TEAL
from acx4book.typesetting.svg import vector
from acx4files.results import whole_files

Vector = NDArray[np.floating]

# The scene, in metres of no particular size, in the mapping frame (east, north, up).
R_B_M = Rotation.from_euler("ZYX", [40, -4, 7], degrees=True)  # body to mapping
R_C_B = Rotation.from_euler("XYZ", [6, -4, 14], degrees=True)  # the boresight, exaggerated
BODY_AT = np.array([1.6, 5.0, 8.6])
LEVER_ARM = np.array([3.4, -4.6, -1.0])  # body axes
CAMERA_AT = BODY_AT + R_B_M.apply(LEVER_ARM)
FOCAL, HALF = 3.0, np.array([1.35, 1.0])
IMAGE_POINT = np.array([-0.75, -0.5, -FOCAL])  # camera axes

VIEW = view(24, 20)
"""From the south-south-east, 20 degrees above the horizon."""


def _seen(points: Vector) -> Vector:
    """Project points of the mapping frame on the paper: right and up."""
    return VIEW.apply(points)[..., :2]


def _from_camera(points: Vector) -> Vector:
    """Transform points of the camera frame to the mapping frame."""
    return CAMERA_AT + R_B_M.apply(R_C_B.apply(points))


def _on_ground(points: Vector) -> Vector:
    """Follow rays from the perspective centre through points in camera axes to the ground."""
    directions = _from_camera(points) - CAMERA_AT
    return CAMERA_AT - directions * (CAMERA_AT[2] / directions[..., 2:])


def _draw_ground(ax: Axes) -> None:
    """Draw the ground and the mapping frame on it."""
    corners = np.array([[-1.4, -2.4, 0], [12.2, -2.4, 0], [12.2, 8.4, 0], [-1.4, 8.4, 0]])
    ax.add_patch(Polygon(_seen(corners), fc=LAND, ec=LAND_EDGE, lw=1, zorder=0))
    triad(ax, VIEW, np.zeros(3), 2.2 * np.eye(3), ["east", "north", "up"], MAPPING)
    note(ax, _seen(np.zeros(3)), "mapping frame $m$", MAPPING, shift=(-2, -18))


def _draw_image_in_space(ax: Axes) -> None:
    """Draw the image below the perspective centre, its point a, and the ray to A."""
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    corners = np.column_stack([signs * HALF, np.full(4, -FOCAL)])
    footprint = _on_ground(corners)
    ax.add_patch(Polygon(_seen(footprint), fc=LAND, ec=TEAL, lw=0.8, zorder=1))
    for corner in footprint:
        ax.plot(*_seen(np.array([CAMERA_AT, corner])).T, color=EDGE, lw=0.7, zorder=1)
    ax.add_patch(Polygon(_seen(_from_camera(corners)), fc=SHEET, ec=CAMERA, lw=1.2, zorder=2))
    foot = _from_camera(np.array([0.0, 0.0, -FOCAL]))
    line = _seen(np.array([CAMERA_AT, foot]))
    ax.plot(*line.T, color=CAMERA, lw=1.2, ls=(0, (2, 1.5)), zorder=3)
    ax.plot(*_seen(foot), "+", color=CAMERA, ms=8, mew=1.4, zorder=5)
    note(ax, _seen(foot), "$p$", CAMERA, shift=(10, -3))
    note(ax, line.mean(axis=0), "$f$", CAMERA, shift=(8, 0))
    a, ground = _from_camera(IMAGE_POINT), _on_ground(IMAGE_POINT)
    ax.plot(*_seen(np.array([CAMERA_AT, ground])).T, color=RAY, lw=1.4, zorder=3)
    for point, name in ((a, "$a$"), (ground, "$A$")):
        ax.plot(*_seen(point), "o", color=RAY, ms=5, zorder=5)
        note(ax, _seen(point), name, RAY, shift=(-10, -4))
    corner = np.array([-HALF[0], HALF[1], -FOCAL])
    for step, name in (([1.2, 0, 0], "col"), ([0, -1.2, 0], "row")):
        tip = _seen(_from_camera(corner + np.array(step)))
        arrow(ax, _seen(_from_camera(corner)), tip, INK, width=1.2)
        note(ax, tip, name, INK, shift=(-6, 10) if name == "col" else (-13, -6))


def _draw_space(ax: Axes) -> None:
    """Draw the flight: frames, lever arm, boresight, image and ray."""
    _draw_ground(ax)
    body, camera = _seen(BODY_AT), _seen(CAMERA_AT)
    arrow(ax, _seen(np.zeros(3)), body, SOFT, width=1.2)
    note(ax, _seen(BODY_AT * 0.45), r"$r_b^m(t)$", SOFT, shift=(-20, 6))
    arrow(ax, body, camera, INK, width=2.4)
    note(ax, 0.6 * body + 0.4 * camera, "lever arm $r_c^b$", INK, shift=(-34, -16))
    body_axes = R_B_M.apply(2.4 * np.eye(3))
    triad(ax, VIEW, BODY_AT, body_axes, ["$x$ forward", "$y$ left", "$z$ up"], BODY)
    note(ax, body, "body frame $b$\n(IMU)", BODY, shift=(-46, -6))
    _draw_image_in_space(ax)
    camera_axes = R_B_M.apply(R_C_B.apply(2.2 * np.eye(3)))
    triad(ax, VIEW, CAMERA_AT, camera_axes, ["$x$", "$y$", "$z$"], CAMERA)
    for axis in R_B_M.apply(1.9 * np.eye(3)):
        ax.plot(*_seen(np.array([CAMERA_AT, CAMERA_AT + axis])).T, color=BODY, lw=1, ls="--")
    note(ax, camera, "camera frame $c$\nwith boresight $R_c^b$", CAMERA, shift=(104, -20))
    ax.set_aspect("equal")
    ax.set_xlim(-2.8, 14.6)
    ax.set_ylim(-3.0, 12.2)
    ax.axis("off")


def _draw_image_plane(ax: Axes) -> None:
    """Draw the image as displayed: x right and y up in mm, columns and rows in pixels."""
    width, height = 8, 6
    ax.add_patch(Rectangle((-width / 2, -height / 2), width, height, fc=SHEET, ec=CAMERA))
    for column in range(3):
        for row in range(2):
            corner = (-width / 2 + 0.8 * column, height / 2 - 0.8 * (row + 1))
            ax.add_patch(Rectangle(corner, 0.8, 0.8, fc=PAPER, ec=SOFT, lw=0.8))
    across, down = np.array([3.2, 0]), np.array([0, 2.6])
    pixel = np.array([-width / 2 + 0.4, height / 2 - 0.4])
    ax.plot(*pixel, "o", color=INK, ms=4, zorder=5)
    arrow(ax, pixel, pixel + across, INK)
    arrow(ax, pixel, pixel - down, INK)
    note(ax, pixel + across, "col", INK, shift=(14, 0))
    note(ax, pixel - down, "row", INK, shift=(0, -9))
    note(ax, pixel, "(0, 0): centre of the first pixel", INK, shift=(80, 24))
    arrow(ax, np.zeros(2), np.array([3.1, 0]), CAMERA)
    arrow(ax, np.zeros(2), np.array([0, 1.9]), CAMERA)
    note(ax, np.array([3.1, 0]), "$x$", CAMERA, shift=(10, 0))
    note(ax, np.array([0, 1.9]), "$y$", CAMERA, shift=(0, 9))
    principal = np.array([0.9, -0.7])
    ax.plot(*principal, "+", color=RAY, ms=10, mew=1.8)
    note(ax, principal, "principal point $(x_p, y_p)$", RAY, shift=(10, -13))
    note(ax, np.zeros(2), "centre of\nthe image", CAMERA, shift=(-34, -14))
    ax.set_aspect("equal")
    ax.set_xlim(-4.6, 4.6)
    ax.set_ylim(-3.4, 4.2)
    ax.axis("off")


def draw(folder: Path) -> None:
    """Write frames.svg and image-plane.svg; the same bytes every time."""
    for name, size, draw_axes in (
        ("frames", (style.WIDTH, 5.9), _draw_space),
        ("image-plane", (6.0, 4.9), _draw_image_plane),
    ):
        with style.applied():
            fig, ax = style.subplots(figsize=size)
            draw_axes(ax)
        whole_files.write(folder / f"{name}.svg", vector(fig))
