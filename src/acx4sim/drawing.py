"""Coloured shapes on a canvas of red, green, blue and roughness.

Colours are those of a screen: DN are proportional to their square. Roughness, 128 for a meadow, is
the strength of the finest noise.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from acx4sim.earth import Array

Canvas = NDArray[np.uint8]

_SHIFT = 4  # binary digits of a cell in OpenCV's coordinates
_LIMIT = 20_000.0  # cells; nothing is drawn beyond it, far outside any window
_BORDER, _LABEL_BORDER = 0.66, 0.45
"""Cells by which OpenCV, which draws borders too, enlarges a polygon, with smoothed edges or not.

They are taken off before, so that cells of every size show the same ground.
"""


@dataclass(frozen=True, kw_only=True)
class GroundWindow:
    """A part of the plane in square cells of 2**level / 16 m; rows go north, columns east.

    Attributes
    ----------
    level : int
        Size of the cells.
    row, col : int
        The first cell; cell i extends from i to i + 1 cells.
    rows, cols : int
        Numbers of rows and columns.
    """

    level: int
    row: int
    col: int
    rows: int
    cols: int

    @property
    def cell_m(self) -> float:
        """Size of a cell, m."""
        return cell_m(self.level)

    def coarser(self) -> "GroundWindow":
        """Return the window of cells of twice the size that contains this one and a border."""
        row, col = self.row // 2 - _HALO, self.col // 2 - _HALO
        return GroundWindow(
            level=self.level + 1,
            row=row,
            col=col,
            rows=(self.row + self.rows - 1) // 2 + 1 + _HALO - row,
            cols=(self.col + self.cols - 1) // 2 + 1 + _HALO - col,
        )

    def en(self) -> tuple[Array, Array]:
        """Return the east and north of the cells' middles, shapes (cols,) and (rows,), m."""
        east = (self.col + np.arange(self.cols) + 0.5) * self.cell_m
        north = (self.row + np.arange(self.rows) + 0.5) * self.cell_m
        return np.asarray(east, np.float64), np.asarray(north, np.float64)


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
        """Lowest and highest east and north of every polygon, shapes (2, n)."""
        corners = np.ascontiguousarray(self.outlines.transpose(1, 2, 0))
        return corners.min(axis=0), corners.max(axis=0)

    @cached_property
    def reach(self) -> tuple[Array, Array]:
        """Lowest and highest east and north of all polygons, in map coordinates."""
        low, high = self.boxes
        return self.origin + low.min(axis=1), self.origin + high.max(axis=1)

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


def shapes(outlines: Array, colours: ArrayLike) -> Shapes:
    """Return polygons in map coordinates, (n, m, 2), as shapes; all may have the same colour."""
    origin = outlines.reshape(-1, 2).mean(axis=0) if outlines.size else np.zeros(2)
    clipped = np.clip(np.rint(np.asarray(colours, dtype=np.float64)), 0, 255)
    return Shapes(
        origin=origin,
        outlines=(outlines - origin).astype(np.float32),
        colours=np.broadcast_to(clipped, (len(outlines), 4)).astype(np.uint8),
    )


def _in_cells(
    of: Shapes, window: GroundWindow, border: float = _BORDER
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Return the polygons that touch a window, and their corners in OpenCV's coordinates.

    Without the border that is drawn around them, in cells.
    """
    if not of.touches(window):
        return np.empty(0, np.int64), np.empty((0, 0, 2), np.int32)
    cell = window.cell_m
    start = of.origin / cell - 0.5 - [window.col, window.row]
    low, high = of.boxes
    west, south = (cell * (-1 - start)).tolist()
    east, north = (cell * ([window.cols + 1, window.rows + 1] - start)).tolist()
    touches = (high[0] >= west) & (low[0] <= east) & (high[1] >= south) & (low[1] <= north)
    near = np.flatnonzero(touches)
    sizes = np.subtract(high[:, near], low[:, near], dtype=np.float64)
    near = near[np.all(sizes > of.least * cell, axis=0)]
    outlines = np.ascontiguousarray(of.outlines[near].transpose(2, 1, 0), np.float64) / cell
    corners = _shrunk(outlines, border) + start[:, None, None]
    corners = np.rint(np.clip(corners, -_LIMIT, _LIMIT) * 2**_SHIFT)
    return near, np.ascontiguousarray(corners.transpose(2, 1, 0), np.int32)


def _shrunk(outlines: Array, by: float) -> Array:
    """Return polygons, shape (2, m, n), with every edge moved inwards; narrow ones to a line."""
    after = np.roll(outlines, -1, axis=1)
    edges = after - outlines
    lengths = np.linalg.norm(edges, axis=0)
    areas = np.sum(outlines[0] * after[1] - outlines[1] * after[0], axis=0) / 2
    inwards = np.stack([-edges[1], edges[0]])
    inwards *= np.sign(areas) / np.maximum(lengths, 1e-9)
    before = np.roll(inwards, 1, axis=1)
    cosine = np.sum(before * inwards, axis=0)
    corner = (before + inwards) / np.maximum(1 + cosine, 0.2)
    half_widths = np.abs(areas) / np.maximum(lengths.sum(axis=0), 1e-9)  # of a long rectangle
    return outlines + np.minimum(half_widths, by) * corner


def draw(canvas: Canvas, window: GroundWindow, of: Shapes) -> None:
    """Draw convex polygons on a canvas of the window, with smoothed edges."""
    near, corners = _in_cells(of, window)
    share = min(1.0, of.width_m / window.cell_m / (2 * _BORDER))
    colours = of.under + share * (of.colours[near] - np.array(of.under, np.float64))
    for outline, colour in zip(corners, colours.tolist(), strict=True):
        cv2.fillConvexPoly(canvas, outline, colour, cv2.LINE_AA, _SHIFT)


def draw_labels(labels: NDArray[np.int16], window: GroundWindow, of: Shapes, first: int) -> None:
    """Write a number for each polygon, from `first` on, into the cells that it covers."""
    near, corners = _in_cells(of, window, _LABEL_BORDER)
    for i, outline in zip(near.tolist(), corners, strict=True):
        cv2.fillPoly(labels, [outline], first + i, cv2.LINE_8, _SHIFT)


def draw_any(canvas: Canvas, window: GroundWindow, of: Shapes) -> None:
    """Draw polygons that need not be convex."""
    near, corners = _in_cells(of, window)
    for outline, colour in zip(corners, of.colours[near].tolist(), strict=True):
        cv2.fillPoly(canvas, [outline], colour, cv2.LINE_AA, _SHIFT)


def rectangles(middle: Array, length_m: ArrayLike, width_m: ArrayLike, angle: ArrayLike) -> Array:
    """Return the corners of rectangles, (n, 4, 2); `angle` is that of the length from east, rad."""
    half = np.stack(np.broadcast_arrays(length_m, width_m), axis=-1)[..., None, :] / 2
    corners = np.broadcast_to(half * [[-1, -1], [1, -1], [1, 1], [-1, 1]], (len(middle), 4, 2))
    return middle[:, None] + _turned(corners, np.broadcast_to(angle, len(middle)))


def _turned(x: Array, angle: Array) -> Array:
    """Turn vectors (n, m, 2) by n angles."""
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return np.stack([c * x[..., 0] - s * x[..., 1], s * x[..., 0] + c * x[..., 1]], axis=-1)


# --- Random numbers of a position on the ground, the same in every picture of it


FloatImage = NDArray[np.float32]
_HALO = 2  # of the cubic that doubles a grid


def cell_m(level: int) -> float:
    """Return the size of a level's cells, m."""
    return 2.0**level / 16


def scattered(rows: NDArray[np.int64], cols: NDArray[np.int64], salt: int) -> NDArray[np.uint32]:
    """Return hashes of cells; `rows` and `cols` are broadcast against each other."""
    h = (rows * 0x9E3779B1 + salt * 0x632BE5AB).astype(np.uint32) ^ (
        cols * 0x85EBCA77 + salt * 0x27D4EB2F
    ).astype(np.uint32)
    with np.errstate(over="ignore"):  # scalars warn of overflow, arrays do not
        h ^= h >> np.uint32(15)
        h *= np.uint32(0x2C1B3C6D)
        h ^= h >> np.uint32(12)
        h *= np.uint32(0x297A2D39)
        h ^= h >> np.uint32(15)
    return h


def white(window: GroundWindow, salt: int) -> FloatImage:
    """Return independent numbers of zero mean and unit variance, shape (rows, cols)."""
    rows = window.row + np.arange(window.rows, dtype=np.int64)[:, None]
    cols = window.col + np.arange(window.cols, dtype=np.int64)
    values = scattered(rows, cols, salt * 64 + window.level).astype(np.float32)
    values *= np.float32(2 * np.sqrt(3) / 2**32)
    values -= np.float32(np.sqrt(3))
    return values


def doubled(
    coarse: FloatImage, of: GroundWindow, window: GroundWindow, interpolation: int = cv2.INTER_CUBIC
) -> FloatImage:
    """Interpolate from cells of twice the size."""
    fine = cv2.resize(coarse, None, fx=2, fy=2, interpolation=interpolation)
    row, col = window.row - 2 * of.row, window.col - 2 * of.col
    return np.asarray(fine[row : row + window.rows, col : col + window.cols])


def fractal(window: GroundWindow, amplitudes: Mapping[int, float], salt: int) -> FloatImage:
    """Return noise with a given amplitude at every size of cells.

    Parameters
    ----------
    window : GroundWindow
        Window of the noise.
    amplitudes : mapping of int to float
        By level; levels finer than that of the window are not used.
    salt : int
        Another number gives different noise.
    """
    top = max(amplitudes)
    if window.level > top:
        return np.zeros((window.rows, window.cols), dtype=np.float32)
    here = amplitudes.get(window.level, 0.0)
    noise = white(window, salt) * np.float32(here) if here else None
    if window.level == top:
        return np.zeros((window.rows, window.cols), np.float32) if noise is None else noise
    coarser = window.coarser()
    rest = doubled(fractal(coarser, amplitudes, salt), coarser, window)
    return np.ascontiguousarray(rest) if noise is None else rest + noise
