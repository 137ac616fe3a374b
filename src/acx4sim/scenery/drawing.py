"""Coloured shapes on a canvas of red, green, blue and roughness.

Colours are those of a screen: DN are proportional to their square. Roughness, 128 for a meadow, is
the strength of the finest noise.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from acx4sim.earth import Array
from acx4sim.scenery.noise import GroundWindow

Canvas = NDArray[np.uint8]

_SHIFT = 4  # binary digits of a cell in OpenCV's coordinates
_LIMIT = 20_000.0  # cells; nothing is drawn beyond it, far outside any window
_BORDER, _LABEL_BORDER = 0.66, 0.45
"""Cells by which OpenCV, which draws borders too, enlarges a polygon, with smoothed edges or not.

They are taken off before, so that cells of every size show the same ground.
"""


@dataclass(frozen=True, kw_only=True, eq=False)
class Shapes:
    """Polygons, drawn one after the other.

    Attributes
    ----------
    origin : ndarray, shape (2,)
        East and north of the origin of their coordinates, m.
    outlines : ndarray of float32, shape (n, m, 2)
        Corners, east and north of the origin, m.
    colours : ndarray of uint8, shape (n, 4)
        Red, green, blue, roughness.
    width_m : float
        Width of narrow shapes. Where it is less than a cell, their colour is mixed with the one
        under them. Infinite for other shapes.
    under : tuple of int
        Colour under them.
    least : float
        Smallest size of a shape, in cells, that is drawn.
    """

    origin: Array
    outlines: NDArray[np.float32]
    colours: NDArray[np.uint8]
    width_m: float = np.inf
    under: tuple[int, int, int, int] = (0, 0, 0, 0)
    least: float = 0.7

    @cached_property
    def boxes(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Lowest and highest east and north of every polygon."""
        return self.outlines.min(axis=1), self.outlines.max(axis=1)

    @cached_property
    def reach(self) -> tuple[Array, Array]:
        """Lowest and highest east and north of all polygons, in map coordinates."""
        low, high = self.boxes
        return self.origin + low.min(axis=0), self.origin + high.max(axis=0)

    def touches(self, window: GroundWindow) -> bool:
        """Tell whether any polygon may touch a window."""
        if not len(self.outlines):
            return False
        (west, south), (east, north) = self.reach
        cell = window.cell_m
        return bool(
            east > (window.col - 1) * cell
            and west < (window.col + window.cols + 1) * cell
            and north > (window.row - 1) * cell
            and south < (window.row + window.rows + 1) * cell
        )


def thin(
    outlines: Array, colour: tuple[int, ...], width_m: float, under: tuple[int, int, int, int]
) -> Shapes:
    """Return narrow polygons as shapes."""
    return replace(shapes(outlines, colour), width_m=width_m, under=under)


def shapes(outlines: Array, colours: ArrayLike) -> Shapes:
    """Return polygons in map coordinates, (n, m, 2), as shapes; all may have the same colour."""
    origin = outlines.reshape(-1, 2).mean(axis=0) if outlines.size else np.zeros(2)
    clipped = np.clip(np.rint(np.asarray(colours, dtype=np.float64)), 0, 255)
    return Shapes(
        origin=origin,
        outlines=(outlines - origin).astype(np.float32),
        colours=np.broadcast_to(clipped, (len(outlines), 4)).astype(np.uint8),
    )


def in_cells(
    of: Shapes, window: GroundWindow, border: float = _BORDER
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Return the polygons that touch a window, and their corners in OpenCV's coordinates.

    Without the border that is drawn around them, in cells.
    """
    if not of.touches(window):
        return np.empty(0, np.int64), np.empty((0, 0, 2), np.int32)
    cell = window.cell_m
    start = of.origin / cell - 0.5 - [window.col, window.row]
    low, high = (box / cell + start for box in of.boxes)
    worth = np.all(high - low > of.least, axis=1)
    touches = worth & np.all((high >= -1) & (low <= [window.cols + 1, window.rows + 1]), axis=1)
    near = np.flatnonzero(touches)
    corners = np.clip(
        shrunk(of.outlines[near].astype(float) / cell, border) + start, -_LIMIT, _LIMIT
    )
    return near, np.rint(corners * 2**_SHIFT).astype(np.int32)


def shrunk(outlines: Array, by: float) -> Array:
    """Return polygons, shape (n, m, 2), with every edge moved inwards; narrow ones to a line."""
    after = np.roll(outlines, -1, axis=1)
    edges = after - outlines
    lengths = np.linalg.norm(edges, axis=-1)
    areas = np.sum(outlines[..., 0] * after[..., 1] - outlines[..., 1] * after[..., 0], axis=1) / 2
    inwards = np.stack([-edges[..., 1], edges[..., 0]], axis=-1)
    inwards *= (np.sign(areas)[:, None] / np.maximum(lengths, 1e-9))[..., None]
    before = np.roll(inwards, 1, axis=1)
    cosine = np.sum(before * inwards, axis=-1)
    corner = (before + inwards) / np.maximum(1 + cosine, 0.2)[..., None]
    half_widths = np.abs(areas) / np.maximum(lengths.sum(axis=1), 1e-9)  # of a long rectangle
    return outlines + np.minimum(half_widths, by)[:, None, None] * corner


def draw(canvas: Canvas, window: GroundWindow, of: Shapes) -> None:
    """Draw convex polygons on a canvas of the window, with smoothed edges."""
    near, corners = in_cells(of, window)
    share = min(1.0, of.width_m / window.cell_m / (2 * _BORDER))
    colours = of.under + share * (of.colours[near] - np.array(of.under, np.float64))
    for outline, colour in zip(corners, colours.tolist(), strict=True):
        cv2.fillConvexPoly(canvas, outline, colour, cv2.LINE_AA, _SHIFT)


def draw_labels(labels: NDArray[np.int16], window: GroundWindow, of: Shapes, first: int) -> None:
    """Write a number for each polygon, from `first` on, into the cells that it covers."""
    near, corners = in_cells(of, window, _LABEL_BORDER)
    for i, outline in zip(near.tolist(), corners, strict=True):
        cv2.fillPoly(labels, [outline], first + i, cv2.LINE_8, _SHIFT)


def draw_any(canvas: Canvas, window: GroundWindow, of: Shapes) -> None:
    """Draw polygons that need not be convex."""
    near, corners = in_cells(of, window)
    for outline, colour in zip(corners, of.colours[near].tolist(), strict=True):
        cv2.fillPoly(canvas, [outline], colour, cv2.LINE_AA, _SHIFT)


def rectangles(middle: Array, length_m: ArrayLike, width_m: ArrayLike, angle: ArrayLike) -> Array:
    """Return the corners of rectangles, (n, 4, 2); `angle` is that of the length from east, rad."""
    half = np.stack(np.broadcast_arrays(length_m, width_m), axis=-1)[..., None, :] / 2
    corners = np.broadcast_to(half * [[-1, -1], [1, -1], [1, 1], [-1, 1]], (len(middle), 4, 2))
    return middle[:, None] + turned(corners, np.broadcast_to(angle, len(middle)))


def turned(x: Array, angle: Array) -> Array:
    """Turn vectors (n, m, 2) by n angles."""
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return np.stack([c * x[..., 0] - s * x[..., 1], s * x[..., 0] + c * x[..., 1]], axis=-1)


def ribbons(line: Array, from_m: float, to_m: float, overlap_m: float = 0.5) -> Array:
    """Return the quadrangles of a band along a line, shape (n - 1, 4, 2).

    Parameters
    ----------
    line : ndarray, shape (n, 2)
        Corners of the line.
    from_m, to_m : float
        Edges of the band, to the left of the line.
    overlap_m : float
        Length by which each reaches beyond its ends, so that no seam is seen.
    """
    along = np.gradient(line, axis=0)
    left = np.column_stack([-along[:, 1], along[:, 0]])
    left /= np.linalg.norm(left, axis=1, keepdims=True)
    a, b = line + from_m * left, line + to_m * left
    reach = np.diff(line, axis=0)
    reach *= overlap_m / np.linalg.norm(reach, axis=1, keepdims=True)
    return np.stack([a[:-1] - reach, a[1:] + reach, b[1:] + reach, b[:-1] - reach], axis=1)
