"""Figures of chapter 0: the system in space, and a signalised point, after the paper's 2 and 4b."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from scipy.spatial import ConvexHull

from acx4book.paper import printed
from acx4book.typesetting import style
from acx4book.typesetting.sketch import BODY, arrow, blank, note, triad, view
from acx4lib.expected import Array
from acx4lib.flight.design import levels
from acx4lib.flight.reader import Flight
from acx4lib.geometry.camera import Camera

# --- the system ------------------------------------------------------------------------------

VIEW = view(-28, 30)
"""From the left and behind, a little above; x of the body is forward."""

ASIDE, LENS, RADIUS = 1.15, 0.6, 0.2
"""Distance of a head from the middle, and length and radius of its lens."""

IMU_AT = np.array([0.0, 0.0, 0.45])
ANTENNA_AT = np.array([-1.9, 0.6, 1.5])


def system(flight: Flight) -> Figure:
    """Draw the cameras of a flight on their mount, with the IMU and the GNSS antenna.

    Parameters
    ----------
    flight : Flight
    """
    cameras = _heads(flight)
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 4.4))
        _draw_mount(ax)
        down = [camera.T_b_c.R @ [0.0, 0.0, -1.0] for camera in cameras]
        places = _places(down)
        for i in np.argsort([_depth(at) for at in places]):
            _draw_head(ax, places[i], down[i], style.colour(int(i)), cameras[i].name)
        _draw_imu(ax)
        _label(ax, flight, cameras)
        blank(fig)
    return fig


def _heads(flight: Flight) -> tuple[Camera, ...]:
    names = flight.synthetic.heads if flight.synthetic else tuple(flight.cameras)
    return tuple(flight.cameras[name] for name in names)


def _depth(at: Array) -> float:
    """Return how near to the viewer a head is."""
    return float(VIEW.apply(at)[2])


def _places(ways: Sequence[Array]) -> list[Array]:
    """Return where heads are on the mount; those that look one way stand around its middle."""
    at = [aside(way) for way in ways]
    of_place: dict[tuple[float, ...], list[int]] = {}
    for i, place in enumerate(at):
        of_place.setdefault(tuple(place.round(1) + 0.0), []).append(i)
    for together in of_place.values():
        angle = np.pi / 4 + 2 * np.pi * np.arange(len(together)) / len(together)
        if len(together) > 1:
            for i, a in zip(together, angle, strict=True):
                at[i] = at[i] + 0.7 * ASIDE * np.array([np.cos(a), np.sin(a), 0.0])
    return at


def aside(way: Array) -> Array:
    """Return where a head is on the mount: aside to where it looks."""
    flat = way * [1.0, 1.0, 0.0]
    length = float(np.hypot(*flat[:2]))
    place: Array = ASIDE * flat / length if length > 0.05 else np.zeros(3)
    return place


def _draw_mount(ax: Axes) -> None:
    corners = 1.75 * np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]], dtype=float)
    slab = np.concatenate([corners, corners - np.array([0.0, 0.0, 0.12])])
    _solid(ax, slab, style.SOFT, alpha=0.3, zorder=3)


def _draw_head(ax: Axes, at: Array, way: Array, colour: str, name: str) -> None:
    """Draw a lens below the mount, the camera above it, and the axis along which it looks."""
    tip = at + LENS * way
    _solid(ax, np.concatenate([ring(at, way, RADIUS), ring(tip, way, 1.2 * RADIUS)]), colour)
    back = ring(at, way, 1.5 * RADIUS)
    _solid(ax, np.concatenate([back, back - 0.4 * way]), colour, zorder=4)
    arrow(ax, VIEW.apply(tip)[:2], VIEW.apply(at + 1.35 * way)[:2], colour, width=1.4)
    note(ax, VIEW.apply(at + 1.5 * way)[:2], style.plain(name), style.INK, shift=(0, -3))


def ring(centre: Array, way: Array, radius: float) -> Array:
    """Return points of a circle around a direction, shape (24, 3)."""
    across = np.linalg.svd(way[None])[2][1:]
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    circle: Array = centre + radius * np.column_stack([np.cos(angle), np.sin(angle)]) @ across
    return circle


def _solid(ax: Axes, points: Array, colour: str, *, alpha: float = 0.85, zorder: int = 2) -> None:
    """Draw the outline of a convex body and fill it."""
    seen = VIEW.apply(points)[:, :2]
    outline = seen[ConvexHull(seen).vertices]
    ax.add_patch(Polygon(outline, fc=colour, ec=style.INK, lw=0.7, alpha=alpha, zorder=zorder))


def _draw_imu(ax: Axes) -> None:
    """Draw the IMU with the axes of the body, and the antenna above it."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    _solid(ax, IMU_AT + signs * np.array([0.3, 0.3, 0.22]), BODY, zorder=5)
    triad(ax, VIEW, IMU_AT, 1.3 * np.eye(3), ["$x$ forward", "$y$ left", "$z$ up"], BODY)
    rim = ring(ANTENNA_AT, np.array([0.0, 0.0, 1.0]), 0.28)
    _solid(ax, np.concatenate([rim, rim + np.array([0.0, 0.0, 0.1])]), style.SOFT, zorder=5)
    line = VIEW.apply(np.stack([IMU_AT, ANTENNA_AT]))[:, :2]
    ax.plot(*line.T, color=style.SOFT, lw=1.0, ls=(0, (3, 2)), zorder=3)


def _label(ax: Axes, flight: Flight, cameras: Sequence[Camera]) -> None:
    """Write what the parts are."""
    imu = "IMU (LN-200)\nof the POS-AV510" if printed.applies(flight) else "IMU"
    first, n = cameras[0], len(cameras)
    what = f"{n} heads of" if n > 1 else "one camera of"
    camera = (
        f"{what}\n{first.width_px} × {first.height_px} px,\n{1000 * first.pixel_mm:g} µm,\n"
        f"focal length {first.interior.f:g} mm"
    )
    for at, text in (
        (np.array([2.3, 0.9, 1.0]), imu),
        (ANTENNA_AT + np.array([-0.9, 0.6, 0.3]), "GNSS antenna\non the aeroplane"),
        (np.array([-2.3, 0.3, -0.3]), "common mount"),
        (np.array([2.6, -2.3, -0.5]), camera),
    ):
        note(ax, VIEW.apply(at)[:2], text, style.INK, shift=(0, 0))
    ax.set(xlim=(-3.6, 4.3), ylim=(-2.3, 2.5))


# --- a signalised point -----------------------------------------------------------------------

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
        fig, ((*axes,),) = style.subplots(
            1, 1 + len(found), figsize=(style.WIDTH, 2.1), squeeze=False
        )
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
    """Return known heights and ground pixels of the blocks over the field, the lowest first."""
    blocks = [flight.mounted(name) for name in ("heads", "calibration") if name in flight.blocks]
    found = [(level.height_m, level.gsd_m) for block in blocks for level in levels(block)]
    return sorted(one for one in found if np.isfinite(one[0]))


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
