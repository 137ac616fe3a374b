"""Metashape's lenses: frame and fisheye, from the ideal point to the measured one.

The manual's formulas: x' = x (1 + k1 r² + k2 r⁴ + k3 r⁶ + k4 r⁸) + (p1 (r² + 2x²) + 2 p2 x y)
(1 + p3 r² + p4 r⁴), y' likewise with p1 and p2 exchanged; u = w/2 + cx + x' f + x' b1 + y' b2,
v = h/2 + cy + y' f. x and y are those of the ray; in a fisheye its length is the angle. u and v
count from the outer corner of the top-left pixel.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from acx4lib.exchange import lens
from acx4lib.expected import Array

NAMES = ("k1", "k2", "k3", "k4", "p1", "p2", "p3", "p4", "b1", "b2")
"""What a calibration may have beside f, cx, cy; absent is zero."""

TYPES = ("frame", "fisheye")
"""Types of calibrations that are read."""


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """A calibration of Metashape.

    Attributes
    ----------
    type : str
        One of `TYPES`.
    width_px, height_px : int
    f, cx, cy : float
        px; the principal point from the middle of the image, y down.
    others : mapping of str to float
        Those of `NAMES` that are not zero.
    """

    type: str
    width_px: int
    height_px: int
    f: float
    cx: float = 0.0
    cy: float = 0.0
    others: Mapping[str, float] = field(default_factory=dict)

    @property
    def hole(self) -> lens.Pinhole:
        """Focal lengths and principal point in the library's pixels."""
        return lens.Pinhole(
            fx=self.f + self.others.get("b1", 0.0),
            fy=self.f,
            cx=(self.width_px - 1) / 2 + self.cx,
            cy=(self.height_px - 1) / 2 + self.cy,
        )

    def colrow(self, ideal: Array) -> Array:
        """Return the library's pixels of ideal points, shape (n, 2)."""
        points = lens.on_fisheye(ideal) if self.type == "fisheye" else ideal
        return self._pixels(_distorted(self.others, points))

    def ideal(self, colrow: Array) -> Array:
        """Return the ideal points of the library's pixels, shape (n, 2); NaN where none is."""
        start = self.hole.points(colrow)
        start[:, 0] -= self.others.get("b2", 0.0) / self.hole.fx * start[:, 1]
        points = lens.inverse(lambda at: _distorted(self.others, at), start, start)
        return lens.off_fisheye(points) if self.type == "fisheye" else points

    def _pixels(self, distorted: Array) -> Array:
        colrow = self.hole.colrow(distorted)
        colrow[:, 0] += self.others.get("b2", 0.0) * distorted[:, 1]
        return colrow


def _distorted(others: Mapping[str, float], points: Array) -> Array:
    k1, k2, k3, k4, p1, p2, p3, p4 = (others.get(name, 0.0) for name in NAMES[:8])
    x, y = points.T
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * (k3 + r2 * k4)))
    more = 1 + r2 * (p3 + r2 * p4)
    dx = (p1 * (r2 + 2 * x * x) + 2 * p2 * x * y) * more
    dy = (p2 * (r2 + 2 * y * y) + 2 * p1 * x * y) * more
    return np.stack([x * radial + dx, y * radial + dy], axis=1)
