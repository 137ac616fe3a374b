"""What a wrong mounting does on the ground, in strips of four directions."""

from __future__ import annotations

import numpy as np

from acx4book.foundations import example
from acx4book.typesetting.moving.explorer import Column, Explorer, Linear, Mark, Panel, Slider
from acx4book.typesetting.moving.plane import Plane
from acx4lib.expected import Array
from acx4lib.geometry.camera import colrow_from_xy
from acx4lib.geometry.collinearity import (
    Measurement,
    image_derivatives,
    mounted_jacobian,
    rays,
)
from acx4lib.geometry.frames import Pose, rotation_from_opk

SLIDERS = (
    *(Slider(name=f"boresight {o}", unit="°", low=-0.1, high=0.1, step=0.005) for o in "ωφκ"),
    *(Slider(name=f"lever arm {x}", unit="m", low=-1.0, high=1.0, step=0.01) for x in "xyz"),
)
"""Errors of the mounting; the axes of the lever arm are forward, left and up."""

UNITS = np.array([*np.full(3, np.pi / 180), 1.0, 1.0, 1.0])
"""One unit of each slider in rad and m."""

STRIPS = {
    "east": (90.0, "blue"),
    "west": (270.0, "orange"),
    "north": (0.0, "teal"),
    "south": (180.0, "plum"),
}
"""Directions of flight: azimuth in degrees, and colour."""

HEIGHT_M, HIGHER_M = 500.0, 1000.0
"""Heights over flat ground; only the lower one is drawn."""

HALF_MM = example.PIXEL_MM * np.array([example.WIDTH_PX, example.HEIGHT_PX]) / 2
"""Half of the image."""

AROUND = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
"""Corners, in halves of the image."""

POINTS_MM = HALF_MM * np.array(
    [[x, y] for y in (-0.8, -0.27, 0.27, 0.8) for x in (-0.8, -0.4, 0, 0.4, 0.8)]
)
"""Points of the image that have an arrow."""

EXAGGERATED = 80.0
"""How many times too long displacements are drawn."""


def on_ground(azimuth_deg: float, height_m: float, xy_mm: Array, mounting: Array) -> Array:
    """Return where image points are on flat ground, computed with a wrong mounting, eq. (14).

    Parameters
    ----------
    azimuth_deg, height_m : float
        Of a level flight; the IMU is above the origin.
    xy_mm : ndarray, shape (n, 2)
        Image points.
    mounting : ndarray, shape (6,)
        Errors in the units of `SLIDERS`, in their order; the true mounting is zero.

    Returns
    -------
    ndarray, shape (n, 2)
        East and north, m.
    """
    opk, lever = (UNITS * mounting)[:3], (UNITS * mounting)[3:]
    T_m_c = _body(azimuth_deg, height_m) @ Pose(R=rotation_from_opk(opk[None]), r=lever[None])
    camera = example.camera()
    ray = rays(camera, T_m_c, colrow_from_xy(camera, xy_mm))
    down = T_m_c.r[:, 2:] / -ray[:, 2:]
    met: Array = (T_m_c.r + down * ray)[:, :2]
    return met


def derivatives(azimuth_deg: float, height_m: float, xy_mm: Array) -> Array:
    """Return the derivatives of `on_ground` at the true mounting, m per unit of each slider.

    The image point is fixed. So its derivatives by the ground point and by the mounting, of the
    library's collinearity equations, must cancel.

    Returns
    -------
    ndarray, shape (n, 2, 6)
    """
    n = len(xy_mm)
    T_m_b = _body(azimuth_deg, height_m)[np.zeros(n, dtype=np.intp)]
    level = Pose(R=np.tile(np.eye(3), (n, 1, 1)), r=np.zeros((n, 3)))
    x_m = np.column_stack([on_ground(azimuth_deg, height_m, xy_mm, np.zeros(6)), np.zeros(n)])
    camera = example.camera()
    seen = Measurement(
        cameras=(camera,),
        camera_idx=np.zeros(n, dtype=np.intp),
        T_m_c=T_m_b @ level,
        colrow=colrow_from_xy(camera, xy_mm),
    )
    _, _, by_pose, by_point = image_derivatives(seen, x_m)
    by_lever_and_turn = by_pose @ mounted_jacobian(T_m_b, level)[1]
    moved: Array = -np.linalg.solve(by_point[:, :, :2], by_lever_and_turn)
    return moved[:, :, [3, 4, 5, 0, 1, 2]] * UNITS


def explorer() -> Explorer:
    """Return the explorer."""
    middle = np.zeros((1, 2))
    rows = {
        f"flown {name}": [
            Linear(matrix=100 * derivatives(azimuth, height, middle)[0, [axis]])
            for height in (HEIGHT_M, HIGHER_M)
            for axis in (0, 1)
        ]
        for name, (azimuth, _) in STRIPS.items()
    }
    return Explorer(
        name="explorer-boresight",
        caption=(
            "What a wrong mounting does to points on flat ground, in strips of four directions "
            f"(north is up). Each rectangle is the footprint of an image from {HEIGHT_M:.0f} m; "
            "arrows go from the true points to the computed ones, "
            f"{EXAGGERATED:.0f} times too long. The table has the error in the middle "
            "of the image, in centimetres, from two heights."
        ),
        sliders=SLIDERS,
        presets={
            "only φ": [0, 0.05, 0, 0, 0, 0],
            "only lever arm x": [0, 0, 0, 0.44, 0, 0],
            f"both cancel at {HEIGHT_M:.0f} m": [0, 0.05, 0, 0.44, 0, 0],
            "only κ": [0, 0, 0.1, 0, 0, 0],
        },
        panels=[_panel(name, azimuth, colour) for name, (azimuth, colour) in STRIPS.items()],
        columns=[
            Column(title=f"{height:.0f} m: {axis}", digits=0)
            for height in (HEIGHT_M, HIGHER_M)
            for axis in ("east", "north")
        ],
        rows=rows,
    )


def _panel(name: str, azimuth_deg: float, colour: str) -> Panel:
    size = (172.0, 172.0)
    plane = Plane(x=(-260.0, 260.0), y=(-260.0, 260.0), size=size)
    scale = EXAGGERATED * plane.scale[0], EXAGGERATED * plane.scale[1]
    at, outline = (
        on_ground(azimuth_deg, HEIGHT_M, xy, np.zeros(6)) for xy in (POINTS_MM, HALF_MM * AROUND)
    )
    azimuth = np.radians(azimuth_deg)
    forward = np.array([np.sin(azimuth), np.cos(azimuth)])
    moved = derivatives(azimuth_deg, HEIGHT_M, POINTS_MM).reshape(-1, len(SLIDERS))
    arrows = Mark(
        kind="arrows",
        colour=colour,
        at=plane.at(at),
        scale=scale,
        response=Linear(matrix=moved),
    )
    return Panel(
        title=f"flown {name}",
        alt=f"The footprint of an image flown {name}; its points move against the flight.",
        size=size,
        fixed=plane.line(outline) + plane.arrow(205 * forward, 250 * forward),
        marks=[arrows],
    )


def _body(azimuth_deg: float, height_m: float) -> Pose:
    kappa = np.radians(90.0 - azimuth_deg)
    return Pose(
        R=rotation_from_opk(np.array([[0.0, 0.0, kappa]])), r=np.array([[0.0, 0.0, height_m]])
    )
