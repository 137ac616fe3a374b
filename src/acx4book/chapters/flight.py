"""Chapter 0, the flight as it is read (section 3.2).

Its blocks beside the paper's, and a figure for the front page.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon
from scipy.spatial import ConvexHull

from acx4book.paper import printed
from acx4book.typesetting import style
from acx4book.typesetting.maps import BODY, arrow, blank, note, triad, view
from acx4book.typesetting.plain_text import shown
from acx4files.flight.reader import Flight
from acx4lib import design
from acx4lib.block import Block
from acx4lib.design import levels
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera

# --- the system ------------------------------------------------------------------------------

VIEW = view(-28, 30)
"""View from the left, behind and a little above; x of the body is forward."""

ASIDE, LENS, RADIUS = 1.15, 0.6, 0.2
"""Distance of a head from the middle, and length and radius of its lens."""

IMU_AT = np.array([0.0, 0.0, 0.45])
ANTENNA_AT = np.array([-1.9, 0.6, 1.5])


def system(flight: Flight) -> Figure:
    """Draw the cameras of a flight on their mount, with the IMU and the GNSS antenna."""
    cameras = _heads(flight)
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 4.4))
        _draw_mount(ax)
        down = [camera.T_b_c.R @ [0.0, 0.0, -1.0] for camera in cameras]
        places = _places(down)
        for i in np.argsort([float(VIEW.apply(place)[2]) for place in places]):
            _draw_head(ax, places[i], down[i], style.colour(int(i)), cameras[i].name)
        _draw_imu(ax)
        _label(ax, flight, cameras)
        blank(fig)
    return fig


def _heads(flight: Flight) -> tuple[Camera, ...]:
    names = flight.synthetic.heads if flight.synthetic else tuple(flight.cameras)
    return tuple(flight.cameras[name] for name in names)


def _places(ways: Sequence[Array]) -> list[Array]:
    """Return the heads' places on the mount; heads that share a place stand in a ring around it."""
    places = [_aside(way) for way in ways]
    of_place: dict[tuple[float, ...], list[int]] = {}
    for i, place in enumerate(places):
        of_place.setdefault(tuple(place.round(1) + 0.0), []).append(i)
    for together in of_place.values():
        angle = np.pi / 4 + 2 * np.pi * np.arange(len(together)) / len(together)
        if len(together) > 1:
            for i, a in zip(together, angle, strict=True):
                places[i] = places[i] + 0.7 * ASIDE * np.array([np.cos(a), np.sin(a), 0.0])
    return places


def _aside(way: Array) -> Array:
    """Return the place of a head on the mount: off the middle, in its direction of view."""
    flat = way * [1.0, 1.0, 0.0]
    length = float(np.hypot(*flat[:2]))
    place: Array = ASIDE * flat / length if length > 0.05 else np.zeros(3)
    return place


def _draw_mount(ax: Axes) -> None:
    corners = 1.75 * np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]], dtype=float)
    slab = np.concatenate([corners, corners - np.array([0.0, 0.0, 0.12])])
    _solid(ax, slab, style.SOFT, alpha=0.3, zorder=3)


def _draw_head(ax: Axes, place: Array, way: Array, colour: str, name: str) -> None:
    """Draw a lens below the mount, the camera above it, and the axis along which it looks."""
    tip = place + LENS * way
    _solid(ax, np.concatenate([_ring(place, way, RADIUS), _ring(tip, way, 1.2 * RADIUS)]), colour)
    back = _ring(place, way, 1.5 * RADIUS)
    _solid(ax, np.concatenate([back, back - 0.4 * way]), colour, zorder=4)
    arrow(ax, VIEW.apply(tip)[:2], VIEW.apply(place + 1.35 * way)[:2], colour, width=1.4)
    note(ax, VIEW.apply(place + 1.5 * way)[:2], style.plain(name), style.INK, shift=(0, -3))


def _ring(centre: Array, way: Array, radius: float) -> Array:
    """Return points of a circle around a direction, shape (24, 3)."""
    across = np.linalg.svd(way[None])[2][1:]
    angle = np.linspace(0, 2 * np.pi, 24, endpoint=False)
    circle: Array = centre + radius * np.column_stack([np.cos(angle), np.sin(angle)]) @ across
    return circle


def _solid(ax: Axes, points: Array, colour: str, *, alpha: float = 0.85, zorder: int = 2) -> None:
    """Draw the outline of a convex body and fill it."""
    projected = VIEW.apply(points)[:, :2]
    outline = projected[ConvexHull(projected).vertices]
    ax.add_patch(Polygon(outline, fc=colour, ec=style.INK, lw=0.7, alpha=alpha, zorder=zorder))


def _draw_imu(ax: Axes) -> None:
    """Draw the IMU with the axes of the body, and the antenna above it."""
    signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)
    _solid(ax, IMU_AT + signs * np.array([0.3, 0.3, 0.22]), BODY, zorder=5)
    triad(ax, VIEW, IMU_AT, 1.3 * np.eye(3), ["$x$ forward", "$y$ left", "$z$ up"], BODY)
    rim = _ring(ANTENNA_AT, np.array([0.0, 0.0, 1.0]), 0.28)
    _solid(ax, np.concatenate([rim, rim + np.array([0.0, 0.0, 0.1])]), style.SOFT, zorder=5)
    line = VIEW.apply(np.stack([IMU_AT, ANTENNA_AT]))[:, :2]
    ax.plot(*line.T, color=style.SOFT, lw=1.0, ls=(0, (3, 2)), zorder=3)


def _label(ax: Axes, flight: Flight, cameras: Sequence[Camera]) -> None:
    """Label the parts."""
    of_paper = printed.applies(flight)
    imu = "IMU (LN-200)\nof the POS-AV510" if of_paper else "IMU"
    antenna = "GNSS antenna\non the aeroplane" if of_paper else "GNSS antenna"
    first, n = cameras[0], len(cameras)
    subject = f"{n} heads of" if n > 1 else "one camera of"
    camera = (
        f"{subject}\n{first.width_px} × {first.height_px} px,\n{1000 * first.pixel_mm:g} µm,\n"
        f"focal length {first.interior.f:.4g} mm"
    )
    for place, text in (
        (np.array([2.3, 0.9, 1.0]), imu),
        (ANTENNA_AT + np.array([-0.9, 0.6, 0.3]), antenna),
        (np.array([-2.3, 0.3, -0.3]), "common mount" if n > 1 else "mount"),
        (np.array([2.6, -2.3, -0.5]), camera),
    ):
        note(ax, VIEW.apply(place)[:2], text, style.INK, shift=(0, 0))
    to_imu = VIEW.apply(np.stack([IMU_AT + np.array([0.3, -0.3, 0.22]), [2.05, 0.9, 0.85]]))[:, :2]
    ax.plot(*to_imu.T, color=style.SOFT, lw=0.6, zorder=3)
    ax.set(xlim=(-3.6, 4.3), ylim=(-2.3, 2.5))


# --- a signalised point -----------------------------------------------------------------------

SIDE_M = 1.6
"""Side of the drawn square of ground."""

OFF = np.array([0.23, -0.17])
"""Middle of the target, in pixels from the middle of a pixel."""

SAMPLES = 20
"""Points along each side of a pixel from which its grey value is computed."""


def target(flight: Flight) -> Figure | None:
    """Draw the target of the paper, and its image from each flying height over the field.

    Returns
    -------
    Figure or None
        None for a flight of other cameras: its files do not describe its targets.
    """
    if not printed.applies(flight):
        return None
    diameter = printed.statement("target_diameter_m")
    flown = _levels(flight)
    with style.applied():
        fig, ((*axes,),) = style.subplots(
            1, 1 + len(flown), figsize=(style.WIDTH, 2.1), squeeze=False
        )
        _draw_target(axes[0], diameter)
        for ax, (height, gsd) in zip(axes[1:], flown, strict=True):
            grey = _pixels(diameter / gsd, OFF, half=int(np.ceil(SIDE_M / gsd / 2)))
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
    flown = [(level.height_m, level.gsd_m) for block in blocks for level in levels(block)]
    return sorted(pair for pair in flown if np.isfinite(pair[0]))


def _pixels(diameter_px: float, centre_px: Array, *, half: int) -> Array:
    """Return the share of each pixel that a disc covers."""
    n = 2 * half + 1
    positions = (np.arange(n * SAMPLES) + 0.5) / SAMPLES - n / 2
    col, row = np.meshgrid(positions - centre_px[0], positions - centre_px[1])
    inside = np.hypot(col, row) <= diameter_px / 2
    shares: Array = inside.reshape(n, SAMPLES, n, SAMPLES).mean(axis=(1, 3))
    return shares


def _draw_target(ax: Axes, diameter: float) -> None:
    """Draw the disc with its measure."""
    ax.set_facecolor("#5c6166")
    ax.add_patch(Circle((0, 0), diameter / 2, fc="white", ec="none"))
    arrow_style = {"arrowstyle": "<->", "color": style.BLACK, "lw": 1.0, "shrinkA": 0, "shrinkB": 0}
    ax.annotate("", (-diameter / 2, 0), (diameter / 2, 0), arrowprops=arrow_style)
    ax.text(0, 0.04, f"{100 * diameter:.0f} cm", ha="center", va="bottom", color=style.BLACK)
    ax.set_title("on the ground")
    ax.set_xlabel("a disc")


# --- One exposure in space: the heads, their footprints on the ground, the synthetic image


PANE = 0.36
"""Place of the drawn images on the rays, as a share of the way to the ground."""

ALT = (
    "An aeroplane over a field, drawn in space. From it the rays of every camera head widen to "
    "the ground, each in a colour of its own. Half-way they pass through the images, coloured "
    "panes that overlap; a thick frame around them is the synthetic image. On the ground the "
    "same panes are large areas that overlap along their inner borders, with the same thick "
    "frame. The frames of the other exposures of the strip lie one over the other, and triangles "
    "mark surveyed points."
)
"""Alternative text of the figure."""

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
        """Place of the exposure, shape (3,), m."""
        return np.array(self.places[self.middle])


def scene(flight: Flight) -> Scene | None:
    """Return the middle exposure of the lowest strip; None where the ground is not known.

    Of the calibration block, or of the first block where there is none.
    """
    name = "calibration" if flight.calibration is not None else next(iter(flight.blocks))
    block, mounted = flight.block(name), flight.mounted(name)
    lowest = design.levels(block)[-1]
    strip_of = np.array(design.strip_of_exposure(block), dtype=object)
    strip = lowest.strips[len(lowest.strips) // 2]
    exposures = np.flatnonzero(strip_of == strip)
    middle = exposures[len(exposures) // 2]
    to_strip = _along(block, middle)
    images = to_strip(design.footprints(block)[block.images.exposure_idx == middle])
    frames = to_strip(design.footprints(mounted)[np.isin(mounted.images.exposure_idx, exposures)])
    if not (np.isfinite(images).all() and np.isfinite(frames).all()):
        return None
    surveyed = to_strip(np.concatenate([block.control.x_m, block.check.x_m]))
    return Scene(
        places=to_strip(block.trajectory.T_m_b.r[exposures]),
        middle=len(exposures) // 2,
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
    """Draw one exposure as seen from behind, beside and above the aeroplane.

    Parameters
    ----------
    flight : Flight
        With ground control, which gives the height of the ground.
    """
    strip = scene(flight)
    if strip is None:
        return style.nothing("No surveyed point tells where the ground is.")
    with style.applied():
        fig, ax = style.subplots(figsize=(style.WIDTH, 5.0))
        look = Look.at(strip)
        _draw_ground(ax, strip, look)
        _draw_rays(ax, strip, look)
        _draw_aeroplane(ax, strip, look)
        _exposure_label(ax, strip, look)
        blank(fig)
    return fig


def caption(flight: Flight) -> str:
    """Describe the drawing, with the numbers of the flight."""
    strip = scene(flight)
    if strip is None:
        return ""
    n, each = len(strip.images), np.ptp(strip.synthetic[strip.middle], axis=0)[:2]
    cameras = f"{n} heads take {n} images at once" if n > 1 else "One camera takes one image"
    thick = "the synthetic image that is made of them" if n > 1 else "its frame"
    return (
        f"{cameras}, {strip.centre[2]:.0f} m above the ground, drawn from the trajectory and the "
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
        x_eye = (points - self.eye) @ self.axes.T
        picture: Array = -x_eye[..., :2] / x_eye[..., 2:] * np.linalg.norm(self.eye)
        return picture


def _draw_ground(ax: Axes, strip: Scene, look: Look) -> None:
    """Draw the frames of the whole strip and the surveyed points under it."""
    for frame in strip.synthetic:
        ax.add_patch(_area(look(frame), style.SOFT, alpha=0.06))
        ax.add_patch(_outline(look(frame), style.SOFT, lw=0.5))
    low, high = (f(strip.synthetic.reshape(-1, 3), axis=0) for f in (np.min, np.max))
    margin = 0.12 * (high - low)
    near = np.all((strip.control >= low - margin) & (strip.control <= high + margin), axis=1)
    ax.plot(*look(strip.control[near]).T, "^", color=style.INK, ms=3.2)


def _draw_rays(ax: Axes, strip: Scene, look: Look) -> None:
    """Draw the rays of every camera, from the lens through its image to the ground."""
    centre = strip.centre
    far_first = np.argsort(-strip.images.mean(axis=1) @ (look.eye - centre))[::-1]
    for i in far_first:
        corners, colour = strip.images[i], style.colour(int(i))
        ax.add_patch(_area(look(corners), colour, alpha=0.3))
        ax.add_patch(_outline(look(corners), colour, lw=1.1))
        for pair in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            ax.add_patch(_area(look(np.array([centre, *pair])), colour, alpha=0.05))
        for corner in corners:
            ax.plot(*look(np.array([centre, corner])).T, color=colour, lw=0.5, alpha=0.7)
    frame = strip.synthetic[strip.middle]
    ax.add_patch(_outline(look(frame), style.INK, lw=2.2))
    for i in far_first:
        pane = look(centre + PANE * (strip.images[i] - centre))
        ax.add_patch(_area(pane, style.colour(int(i)), alpha=0.6))
    ax.add_patch(_outline(look(centre + PANE * (frame - centre)), style.INK, lw=2.2))


def _draw_aeroplane(ax: Axes, strip: Scene, look: Look) -> None:
    """Draw the line of flight, its exposures, and a much enlarged aeroplane."""
    ax.plot(*look(strip.places).T, "-", color=style.SOFT, lw=0.8)
    ax.plot(*look(strip.places).T, "o", color=style.SOFT, ms=3)
    outline = np.concatenate([AEROPLANE, AEROPLANE[::-1] * [1.0, -1.0]])
    flat = np.column_stack([outline * 0.13 * strip.centre[2], np.zeros(len(outline))])
    ax.add_patch(_area(look(strip.centre + flat), style.INK, alpha=1.0))


def _exposure_label(ax: Axes, strip: Scene, look: Look) -> None:
    """Label the parts of the drawing."""
    centre, frame = strip.centre, strip.synthetic[strip.middle]
    for name, corners in zip(strip.names, strip.images, strict=True):
        outermost = corners[np.argmax(np.hypot(*corners.T[:2]))]
        place = look(0.8 * corners.mean(axis=0) + 0.2 * outermost)
        ax.annotate(
            style.plain(name),
            (place[0], place[1]),
            color=style.INK,
            ha="center",
            va="center",
            weight="bold",
        )  # colours of the palette are too light for letters
    pane = centre + PANE * (frame - centre)
    right = max(look(pane), key=lambda place: float(place[0]))
    left = min(look(pane), key=lambda place: float(place[0]))
    subject = "one synthetic image" if len(strip.images) > 1 else "one image"
    note(ax, right, f"{subject}\n(thick frame)", style.INK, shift=(66, 6))
    if len(strip.images) > 1:
        note(
            ax,
            left,
            f"{len(strip.images)} images\nof {len(strip.images)} heads",
            style.INK,
            shift=(-42, 8),
        )
    last = look(strip.places)[np.argmax(look(strip.places)[:, 0])]
    note(ax, last, f"exposures, {centre[2]:.0f} m\nabove the ground", style.SOFT, shift=(10, -18))
    points = look(strip.control)
    note(ax, points[np.argmin(points[:, 1])], "surveyed points", style.SOFT, shift=(54, 0))


def _area(corners: Array, colour: str, *, alpha: float) -> Polygon:
    return Polygon(corners, facecolor=colour, alpha=alpha, lw=0, zorder=2)


def _outline(corners: Array, colour: str, *, lw: float) -> Polygon:
    return Polygon(corners, facecolor="none", edgecolor=colour, lw=lw, zorder=3)


# --- The paper's statements on its flight (section 3), in the form of a flight's tables


PRINTED: dict[tuple[str, int], dict[str, str]] = {
    ("heads", 0): {
        "strips": "block_1_high_strips",
        "images": "block_1_high_images",
        "height": "block_1_high_m",
        "gsd": "block_1_high_gsd_m",
        "forward": "block_1_forward_overlap",
    },
    ("heads", 1): {
        "strips": "block_1_low_strips",
        "images": "block_1_low_images",
        "height": "block_1_low_m",
        "gsd": "block_1_low_gsd_m",
        "forward": "block_1_forward_overlap",
        "side": "block_1_side_overlap",
        "directions": "block_1_low_directions",
    },
    ("calibration", 0): {
        "strips": "block_2_high_strips",
        "images": "block_2_high_images",
        "height": "block_2_high_m",
        "gsd": "block_2_high_gsd_m",
        "forward": "block_2_forward_overlap",
        "side": "block_2_high_side_overlap",
    },
    ("calibration", 1): {
        "strips": "block_2_low_strips",
        "images": "block_2_low_images",
        "height": "block_2_low_m",
        "gsd": "block_2_low_gsd_m",
        "forward": "block_2_forward_overlap",
        "side": "block_2_low_side_overlap",
    },
    ("validation", 0): {
        "strips": "block_3_strips",
        "height": "block_3_m",
        "gsd": "block_3_gsd_m",
        "forward": "block_3_forward_overlap",
    },
}
"""The paper's statements on a block and its levels, the highest first."""

PRINTED_IMAGES = {
    "heads": "block_1_images",
    "calibration": "block_2_images",
    "validation": "block_3_images",
}
PRINTED_POINTS = {
    "heads": "field_points",
    "calibration": "field_points",
    "validation": "check_points",
}

COLUMNS = {
    "height above ground (m)": ("height", 1),
    "ground pixel (cm)": ("gsd", 100),
    "strips": ("strips", 1),
    "directions": ("directions", 1),
    "images per strip": ("images", 1),
    "forward overlap (%)": ("forward", 1),
    "side overlap (%)": ("side", 1),
}
"""Columns of `design.level_table`: their names in `PRINTED`, and the factor to their unit."""


def beside_paper(flown: pd.DataFrame, flight: Flight) -> pd.DataFrame:
    """Return the levels of blocks, each above the paper's level of the same block.

    Parameters
    ----------
    flown : DataFrame
        By ``block`` and ``level``, as `design.level_table` has them.
    flight : Flight
        Without the paper's cameras nothing is added.
    """
    table = flown.copy()
    if printed.applies(flight):
        of_paper = pd.DataFrame([_said(*key) for key in flown.index], index=flown.index)
        of_paper = of_paper.dropna(how="all")
        joined = pd.concat({"this book": flown, "paper": of_paper}, names=["of"])
        order = [
            (source, *key)
            for key in flown.index
            for source in ("this book", "paper")
            if source == "this book" or key in of_paper.index
        ]
        table = joined.loc[order].reorder_levels(["block", "level", "of"])
    table.attrs["formats"] = {
        **dict.fromkeys(table, ".0f"),
        "ground pixel (cm)": ".1f",
        "images per strip": ".3g",
    }
    return table


def _said(block: str, level: int) -> dict[str, float]:
    names = PRINTED.get((block, level - 1), {})
    return {
        column: factor * printed.statement(names[key]) if key in names else np.nan
        for column, (key, factor) in COLUMNS.items()
    }


def printed_contents(flight: Flight) -> pd.DataFrame:
    """Return the paper's numbers of images and of surveyed points, to be joined by the block."""
    names = list(flight.blocks) if printed.applies(flight) else []
    columns = {
        "paper: images each": {n: printed.statement(PRINTED_IMAGES[n]) for n in names},
        "paper: surveyed": {n: printed.statement(PRINTED_POINTS[n]) for n in names},
    }
    table = pd.DataFrame(columns, index=pd.Index(names, name="block", dtype=object))
    return table.astype(int) if names else table[[]]
