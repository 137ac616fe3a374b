"""OPF's lenses: perspective and fisheye, from the ideal point to the measured one.

Perspective is OpenCV's model with R1, R2, R3 for k1, k2, k3 and T1, T2 for p1, p2. In a fisheye
the angle from the axis counts in right angles, t = 2/pi * angle; a point lies in its direction at
the distance p0 + p1 t + p2 t² + ..., and the affine matrix (c d; e f) takes it to pixels. Pixels
count from the outer corner of the top-left one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib.exchange import lens
from acx4lib.exchange.safe.json_tree import Node
from acx4lib.expected import Array
from acx4lib.flight.problems import Range, quoted

HALF = 0.5
"""The middle of the top-left pixel has the coordinates 0.5, 0.5 in OPF."""

TYPES = ("perspective", "fisheye")
"""Types of internals that are read."""

POSITIVE = Range(1e-9, 1e9, "must be positive")


@dataclass(frozen=True, kw_only=True)
class Internals:
    """A lens of OPF.

    Attributes
    ----------
    hole : Pinhole
        In the library's pixels; a fisheye's focal length is that in the middle of its image.
    radial, tangential : tuple of float
        Of a perspective lens.
    polynomial : tuple of float
        Of a fisheye, divided by its second value; empty for a perspective lens.
    skew : tuple of float
        The affine matrix's d and e in the units of c and f.
    """

    hole: lens.Pinhole
    radial: tuple[float, ...] = (0.0, 0.0, 0.0)
    tangential: tuple[float, ...] = (0.0, 0.0)
    polynomial: tuple[float, ...] = ()
    skew: tuple[float, float] = (0.0, 0.0)

    def ideal(self, colrow: Array) -> Array:
        """Return the ideal points of the library's pixels, shape (n, 2); NaN where none is."""
        points = self.hole.points(colrow)
        if not self.polynomial:
            return lens.inverse(self._distorted, points, points)
        affine = np.array([[1.0, self.skew[0]], [self.skew[1], 1.0]])
        straight = np.linalg.solve(affine, points.T).T
        return lens.off_fisheye(lens.inverse(self._bent, straight, straight))

    def colrow(self, ideal: Array) -> Array:
        """Return the library's pixels of ideal points, shape (n, 2)."""
        if not self.polynomial:
            return self.hole.colrow(self._distorted(ideal))
        affine = np.array([[1.0, self.skew[0]], [self.skew[1], 1.0]])
        return self.hole.colrow(self._bent(lens.on_fisheye(ideal)) @ affine.T)

    def _distorted(self, points: Array) -> Array:
        (k1, k2, k3), (p1, p2) = self.radial, self.tangential
        x, y = points.T
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        dx = 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
        dy = 2 * p2 * x * y + p1 * (r2 + 2 * y * y)
        return np.stack([x * radial + dx, y * radial + dy], axis=1)

    def _bent(self, points: Array) -> Array:
        """Return points at the polynomial's distance instead of the angle, in units of it."""
        angle = np.hypot(*points.T)[:, None]
        t = 2 / np.pi * angle
        factor = np.zeros_like(t)
        for p in reversed(self.polynomial[1:]):  # p0 is zero: without it the factor is smooth
            factor = p + t * factor
        return points * factor


def internals(node: Node) -> Internals:
    """Return the lens that a node ``internals`` describes."""
    kind = node.one("type").text()
    if kind not in TYPES:
        raise node.one("type").wrong(quoted(kind), f"must be one of {', '.join(TYPES)}")
    cx, cy = node.one("principal_point_px").numbers(2) - HALF
    if kind == "perspective":
        f = node.one("focal_length_px").number(POSITIVE)
        return Internals(
            hole=lens.Pinhole(fx=f, fy=f, cx=float(cx), cy=float(cy)),
            radial=_floats(node, "radial_distortion", 3),
            tangential=_floats(node, "tangential_distortion", 2),
        )
    return _fisheye(node, float(cx), float(cy))


def _fisheye(node: Node, cx: float, cy: float) -> Internals:
    c, d, e, f = _floats(node, "affine", 4)
    polynomial = _floats(node, "polynomial", -1)
    if len(polynomial) < 2 or polynomial[0] != 0 or polynomial[1] <= 0:
        found = quoted(list(polynomial))
        raise node.one("polynomial").wrong(found, "must be 0, a positive number, and others")
    if c <= 0 or f <= 0 or c * f - d * e <= 0:
        found = quoted([c, d, e, f])
        raise node.one("affine").wrong(found, "must be c d; e f with positive c and f")
    slope = 2 / np.pi * polynomial[1]
    return Internals(
        hole=lens.Pinhole(fx=c * slope, fy=f * slope, cx=cx, cy=cy),
        polynomial=tuple(p / polynomial[1] for p in polynomial),
        skew=(d / c, e / f),
    )


def _floats(node: Node, key: str, n: int) -> tuple[float, ...]:
    values: Sequence[float] = node.one(key).numbers(n).tolist()
    return tuple(values)
