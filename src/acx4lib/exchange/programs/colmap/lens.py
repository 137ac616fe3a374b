"""COLMAP's lens models, from the ideal point to the measured one.

Focal lengths and principal point apply last. COLMAP counts pixels from the outer corner of the
top-left one. In a fisheye the length of a point is the angle, not its tangent.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from acx4lib.exchange import lens
from acx4lib.expected import Array

HALF = 0.5
"""The middle of the top-left pixel has the coordinates 0.5, 0.5 in COLMAP."""

ONE, TWO = ("f", "cx", "cy"), ("fx", "fy", "cx", "cy")

Distorted = Callable[[Array, Sequence[float]], Array]


@dataclass(frozen=True, kw_only=True)
class Model:
    """A lens model.

    Attributes
    ----------
    number : int
        In binary files.
    names : tuple of str
        Of its parameters, in COLMAP's order.
    distorted : callable, optional
        From points and the parameters after the principal point to distorted points.
    is_fisheye : bool
    """

    number: int
    names: tuple[str, ...]
    distorted: Distorted | None = None
    is_fisheye: bool = False

    @property
    def first(self) -> int:
        """Number of the parameters up to the principal point."""
        return 3 if self.names[0] == "f" else 4

    def hole(self, parameters: Sequence[float]) -> lens.Pinhole:
        """Return focal lengths and principal point in the library's pixels."""
        *focal, cx, cy = parameters[: self.first]
        return lens.Pinhole(fx=focal[0], fy=focal[-1], cx=cx - HALF, cy=cy - HALF)

    def points(self, ideal: Array, parameters: Sequence[float]) -> Array:
        """Return the distorted points of ideal ones, shape (n, 2)."""
        points = lens.on_fisheye(ideal) if self.is_fisheye else ideal
        if self.distorted is None:
            return points
        return self.distorted(points, parameters[self.first :])

    def ideal(self, colrow: Array, parameters: Sequence[float]) -> Array:
        """Return the ideal points of the library's pixels, shape (n, 2); NaN where none is."""
        points, rest = self.hole(parameters).points(colrow), parameters[self.first :]
        if (distorted := self.distorted) is not None:
            points = lens.inverse(lambda at: distorted(at, rest), points, points)
        return lens.off_fisheye(points) if self.is_fisheye else points

    def colrow(self, ideal: Array, parameters: Sequence[float]) -> Array:
        """Return the library's pixels of ideal points, shape (n, 2)."""
        return self.hole(parameters).colrow(self.points(ideal, parameters))


def _r2(points: Array) -> Array:
    return np.einsum("ni,ni->n", points, points)[:, None]


def _power(r2: Array, coefficients: Sequence[float]) -> Array:
    """Return c1 r² + c2 r⁴ + ..., shape (n, 1)."""
    total = np.zeros_like(r2)
    for c in reversed(coefficients):
        total = r2 * (c + total)
    return total


def _radial(points: Array, k: Sequence[float]) -> Array:
    return points * (1 + _power(_r2(points), k))


def _decentring(points: Array, p1: float, p2: float) -> Array:
    """Return what p1 and p2 add, as OpenCV has them."""
    u, v = points.T
    r2 = u * u + v * v
    du, dv = 2 * p1 * u * v + p2 * (r2 + 2 * u * u), 2 * p2 * u * v + p1 * (r2 + 2 * v * v)
    return np.stack([du, dv], axis=1)


def _opencv(points: Array, values: Sequence[float]) -> Array:
    k1, k2, p1, p2 = values
    return _radial(points, (k1, k2)) + _decentring(points, p1, p2)


def _full_opencv(points: Array, values: Sequence[float]) -> Array:
    k1, k2, p1, p2, k3, k4, k5, k6 = values
    r2 = _r2(points)
    ratio = (1 + _power(r2, (k1, k2, k3))) / (1 + _power(r2, (k4, k5, k6)))
    return points * ratio + _decentring(points, p1, p2)


def _fov(points: Array, values: Sequence[float]) -> Array:
    (omega,) = values
    if abs(omega) < 1e-6:
        return points
    r = np.maximum(np.sqrt(_r2(points)), 1e-9)
    scaled: Array = points * np.arctan(2 * r * np.tan(omega / 2)) / (r * omega)
    return scaled


def _thin_prism(points: Array, values: Sequence[float]) -> Array:
    k1, k2, p1, p2, k3, k4, sx, sy = values
    prism = _r2(points) * [sx, sy]
    return _radial(points, (k1, k2, k3, k4)) + _decentring(points, p1, p2) + prism


def _rad_tan_thin_prism(points: Array, values: Sequence[float]) -> Array:
    k, p, (s0, s1, s2, s3) = values[:6], np.array(values[6:8]), values[8:]
    at = _radial(points, k)
    r2 = _r2(at)
    prism = np.concatenate([s0 * r2 + s1 * r2**2, s2 * r2 + s3 * r2**2], axis=1)
    along = 2 * (at @ p)[:, None]
    return np.asarray(at + along * at + r2 * p + prism)


def _division(points: Array, values: Sequence[float]) -> Array:
    """Return the smaller root of r_ideal (1 + k r²) = r, as a factor of ideal points."""
    (k,) = values
    root = np.sqrt(np.where(1 - 4 * k * _r2(points) >= 0, 1 - 4 * k * _r2(points), np.nan))
    return points * 2 / (1 + root)


def _eucm(points: Array, values: Sequence[float]) -> Array:
    alpha, beta = values
    return points / (alpha * np.sqrt(beta * _r2(points) + 1) + 1 - alpha)


MODELS = {
    "SIMPLE_PINHOLE": Model(number=0, names=ONE),
    "PINHOLE": Model(number=1, names=TWO),
    "SIMPLE_RADIAL": Model(number=2, names=(*ONE, "k"), distorted=_radial),
    "RADIAL": Model(number=3, names=(*ONE, "k1", "k2"), distorted=_radial),
    "OPENCV": Model(number=4, names=(*TWO, "k1", "k2", "p1", "p2"), distorted=_opencv),
    "OPENCV_FISHEYE": Model(
        number=5, names=(*TWO, "k1", "k2", "k3", "k4"), distorted=_radial, is_fisheye=True
    ),
    "FULL_OPENCV": Model(
        number=6,
        names=(*TWO, "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
        distorted=_full_opencv,
    ),
    "FOV": Model(number=7, names=(*TWO, "omega"), distorted=_fov),
    "SIMPLE_RADIAL_FISHEYE": Model(number=8, names=(*ONE, "k"), distorted=_radial, is_fisheye=True),
    "RADIAL_FISHEYE": Model(number=9, names=(*ONE, "k1", "k2"), distorted=_radial, is_fisheye=True),
    "THIN_PRISM_FISHEYE": Model(
        number=10,
        names=(*TWO, "k1", "k2", "p1", "p2", "k3", "k4", "sx1", "sy1"),
        distorted=_thin_prism,
        is_fisheye=True,
    ),
    "RAD_TAN_THIN_PRISM_FISHEYE": Model(
        number=11,
        names=(*TWO, *(f"k{i}" for i in range(6)), "p0", "p1", "s0", "s1", "s2", "s3"),
        distorted=_rad_tan_thin_prism,
        is_fisheye=True,
    ),
    "SIMPLE_DIVISION": Model(number=12, names=(*ONE, "k"), distorted=_division),
    "DIVISION": Model(number=13, names=(*TWO, "k"), distorted=_division),
    "SIMPLE_FISHEYE": Model(number=14, names=ONE, is_fisheye=True),
    "FISHEYE": Model(number=15, names=TWO, is_fisheye=True),
    "EUCM": Model(number=16, names=(*TWO, "alpha", "beta"), distorted=_eucm),
}
"""COLMAP's models by their names in text files; EQUIRECTANGULAR has no focal length."""

NUMBERS = {model.number: name for name, model in MODELS.items()}
"""Their names by their numbers in binary files."""
