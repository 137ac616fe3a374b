"""The calibrated lens: its distortion along a radius, and the focal length that balances it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from acx4book.report.material import Material
from acx4lib.expected import Array
from acx4lib.geometry.camera import INTERIOR, Camera, Interior
from acx4lib.geometry.parameters import REPORTED
from acx4lib.results import folder

F = INTERIOR.index("f")
RADIAL = tuple(INTERIOR.index(key) for key in ("k1", "k2", "k3"))
POWERS = np.array([3, 5, 7])
"""Powers of the radius that belong to k1, k2, k3: eqs (10)-(11) along a radius."""

HALVINGS = 60
"""Of the interval with the slope, which then is known to the last digit."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Lens:
    """A camera with the interior orientation of the results.

    Attributes
    ----------
    camera : Camera
    cov : ndarray, shape (9, 9)
        A posteriori covariance in the order and the units of `INTERIOR`; zero where held.
    """

    camera: Camera
    cov: Array

    @property
    def interior(self) -> Interior:
        """The interior orientation of the results."""
        return self.camera.interior

    @property
    def radius(self) -> float:
        """Distance of the farthest corner of the image from the principal point, mm."""
        pixels = np.array([self.camera.width_px, self.camera.height_px])
        half = 0.5 * self.camera.pixel_mm * pixels
        return float(np.hypot(*(half + np.abs([self.interior.xp, self.interior.yp]))))


@dataclass(frozen=True, kw_only=True)
class Balanced:
    """The focal length that balances the radial distortion.

    Attributes
    ----------
    f, sigma : float
        mm.
    slope : float
        1 - f / c, for the calibrated focal length f and the balanced one c.
    largest : float
        Largest distortion with respect to c, mm; its negative is the smallest.
    """

    f: float
    sigma: float
    slope: float
    largest: float


def lenses(material: Material, stage_method: str) -> list[Lens]:
    """Return the lenses of a method's cameras, as the results have them."""
    cov = folder.covariance(material.found, stage_method)
    return [
        _lens(material, stage_method, name, cov)
        for name in folder.cameras(material.found, stage_method)
    ]


def _lens(material: Material, stage_method: str, name: str, cov: object) -> Lens:
    rows = folder.parameters(material.found, stage_method, name)
    labels = [REPORTED[key][0] for key in INTERIOR]
    given = {
        key: float(rows["value"][label])
        for key, label in zip(INTERIOR, labels, strict=True)
        if label in rows.index
    }
    whole = cov.reindex(index=[f"{name}/{label}" for label in labels])  # type: ignore[attr-defined]
    camera = material.flight.cameras[name]
    return Lens(
        camera=camera.with_interior(replace(camera.interior, **given)),
        cov=whole.reindex(columns=whole.index).fillna(0.0).to_numpy(),
    )


def radial(interior: Interior, radius: Array) -> Array:
    """Return the radial distortion, mm, at distances from the principal point, mm, shape (n,).

    Positive outwards; it is subtracted from the measured distance, eqs (10)-(11).
    """
    return _powers(radius) @ _coefficients(interior)


def radial_sigma(lens: Lens, radius: Array) -> Array:
    """Return the standard deviation of the radial distortion, mm, shape (n,)."""
    J = _powers(radius)
    cov = lens.cov[np.ix_(RADIAL, RADIAL)]
    return np.sqrt(np.maximum(np.sum((J @ cov) * J, axis=1), 0.0))


def decentring(interior: Interior, radius: Array) -> Array:
    """Return the profile of the decentring distortion, mm, shape (n,): the tangential part.

    At right angles to this direction the decentring distortion is radial, and three times as large.
    """
    return np.hypot(interior.p1, interior.p2) * radius**2


def _powers(radius: Array) -> Array:
    return np.asarray(radius, dtype=float)[:, None] ** POWERS


def _coefficients(interior: Interior) -> Array:
    return np.array([interior.k1, interior.k2, interior.k3])


def balanced(lens: Lens) -> Balanced:
    """Return the focal length whose largest and smallest radial distortion have the same size.

    Notes
    -----
    A point at the ideal distance f tan(t), measured at r = f tan(t) + d(r), has the distortion
    r - c tan(t) = (c / f) (d(r) - s r) with respect to the focal length c, where s = 1 - f / c.
    The sum of the largest and the smallest value of d(r) - s r from the principal point to the
    farthest corner decreases with s, and is zero for the balanced c = f / (1 - s). Both extremes
    are stationary or at the corner, so that s depends on a coefficient of d by
    (r1^n + r2^n) / (r1 + r2), where r1 and r2 are the places of the extremes. For d = k1 r^3 alone
    s is 3/4 k1 R^2: the difference is a Chebyshev polynomial.
    """
    R, interior = lens.radius, lens.interior
    slope = _balanced_slope(_coefficients(interior) * R ** (POWERS - 1))
    c = interior.f / (1 - slope)
    at, values = _extremes(_coefficients(interior) * R ** (POWERS - 1), slope)
    ends = R * np.array([at[np.argmax(values)], at[np.argmin(values)]])
    by_k = np.sum(ends[:, None] ** POWERS, axis=0) / max(float(ends.sum()), R * 1e-12)
    J = np.concatenate([[c / interior.f], c**2 / interior.f * by_k])
    cov = lens.cov[np.ix_((F, *RADIAL), (F, *RADIAL))]
    return Balanced(
        f=c,
        sigma=float(np.sqrt(max(J @ cov @ J, 0.0))),
        slope=slope,
        largest=float(c / interior.f * R * values.max()),
    )


def _balanced_slope(k: Array) -> float:
    """Return the slope that balances the distortion of a radius of one."""
    low, high = -float(np.abs(k).sum()), float(np.abs(k).sum())
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        _, values = _extremes(k, middle)
        if values.max() + values.min() > 0:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _extremes(k: Array, slope: float) -> tuple[Array, Array]:
    """Return the places where d(r) - s r may be extreme for r from 0 to 1, and its values there."""
    squares = np.roots([*(POWERS * k)[::-1], -slope])
    real = squares[np.abs(squares.imag) < 1e-9].real
    inner = np.sqrt(real[(real > 0) & (real < 1)])
    at = np.concatenate([[0.0, 1.0], inner])
    return at, at[:, None] ** POWERS @ k - slope * at
