"""A mapping frame that lies on no map: Cartesian coordinates of a test field or a laboratory."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from acx4lib import expected
from acx4lib.expected import Array
from acx4lib.geometry.geodesy import GridSystem, MappingFrame


@dataclass(frozen=True, kw_only=True)
class LocalGrid(GridSystem):
    """Cartesian coordinates in the place of a CRS: no convergence and no undulation."""

    crs: str = "local"

    def __post_init__(self) -> None:
        """Ask PROJ nothing."""

    def undulation(self, lonlat: Array) -> Array:
        """Return zeros, shape (n,)."""
        return np.zeros(len(lonlat))

    def convergence(self, lonlat: Array) -> Array:
        """Return zeros, shape (n,)."""
        return np.zeros(len(lonlat))


@dataclass(frozen=True, kw_only=True, eq=False)
class LocalFrame(MappingFrame):
    """A frame whose axes are those of the coordinates, any x and y with z up, m.

    East, north and height of results are x, y and z. There is no longitude and no latitude.
    """

    grid: GridSystem = field(default_factory=LocalGrid)
    origin: Array = field(default_factory=lambda: np.full(2, np.nan))

    def __post_init__(self) -> None:
        """Ask PROJ nothing."""

    def from_grid(self, enh: Array) -> Array:
        """Return x, y, z as they are, shape (n, 3)."""
        return expected.numbers("enh", enh, ("n", 3))

    def to_grid(self, x_m: Array) -> Array:
        """Return x, y, z as they are, shape (n, 3)."""
        return expected.numbers("x_m", x_m, ("n", 3))

    def to_geographic(self, x_m: Array) -> Array:
        """Return longitude and latitude, which are NaN, and z, shape (n, 3)."""
        x_m = expected.numbers("x_m", x_m, ("n", 3))
        return np.column_stack([np.full((len(x_m), 2), np.nan), x_m[:, 2]])

    def from_geographic(self, lonlath: Array) -> Array:
        """Raise a ValueError: longitude and latitude mean nothing here."""
        n = len(lonlath)
        msg = f"a local frame lies on no map: give x, y, z of the {n} points instead"
        raise ValueError(msg)

    def grid_axes(self, x_m: Array) -> Array:
        """Return the identity for every point, shape (n, 3, 3)."""
        return np.tile(np.eye(3), (len(x_m), 1, 1))
