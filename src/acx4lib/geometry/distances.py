"""Measured distances between points: scale bars, tapes, total stations."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from acx4lib import expected
from acx4lib.expected import Array, Index, Mask


@dataclass(frozen=True, kw_only=True, eq=False)
class Distances:
    """Spatial distances between pairs of points.

    Attributes
    ----------
    point_idx : ndarray, shape (n, 2)
        The two ends, indices of points.
    distance_m : ndarray, shape (n,)
        As a tape measures it: straight, in metres that no map projection has changed.
    sigma_m : ndarray, shape (n,)
        Positive; infinite where a distance is not used.

    Raises
    ------
    ValueError
        Where a part has another shape, a distance or a sigma is not positive, or both ends are
        the same point.
    """

    point_idx: Index = field(default_factory=lambda: np.zeros((0, 2), dtype=np.intp))
    distance_m: Array = field(default_factory=lambda: np.zeros(0))
    sigma_m: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        expected.whole_numbers("point_idx", self.point_idx, ("n", 2))
        n = len(self.point_idx)
        for name in ("distance_m", "sigma_m"):
            expected.shape(name, getattr(self, name), (n,))
            expected.positive(name, getattr(self, name))
        expected.finite("distance_m", self.distance_m)
        if np.any(equal_ends := self.point_idx[:, 0] == self.point_idx[:, 1]):
            row = int(np.flatnonzero(equal_ends)[0])
            msg = f"point_idx: expected two points, got point {self.point_idx[row, 0]} twice"
            raise ValueError(f"{msg} in row {row}")

    def __len__(self) -> int:
        """Count the distances."""
        return len(self.point_idx)

    def __getitem__(self, keep: Index | Mask) -> Distances:
        """Select distances."""
        return expected.part_of(self, keep)


def lengths(x_m: Array, point_idx: Index) -> tuple[Array, Array]:
    """Return distances between points, and unit vectors along them.

    Parameters
    ----------
    x_m : ndarray, shape (n_points, 3)
        m.
    point_idx : ndarray, shape (n, 2)

    Returns
    -------
    length : ndarray, shape (n,)
        m.
    along : ndarray, shape (n, 3)
        From the first end to the second, the derivative by the second; zero where both coincide.
    """
    d = x_m[point_idx[:, 1]] - x_m[point_idx[:, 0]]
    length = np.linalg.norm(d, axis=1)
    return length, d / np.maximum(length, 1e-300)[:, None]
