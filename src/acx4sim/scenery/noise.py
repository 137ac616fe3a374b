"""Random numbers of a position on the ground, the same in every picture of it."""

from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from acx4sim.earth import Array

FloatImage = NDArray[np.float32]
_HALO = 2  # of the cubic that doubles a grid


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
