"""Refraction in the standard atmosphere: where points seem to be."""

from __future__ import annotations

import numpy as np

from acx4lib import expected
from acx4lib.expected import Array

LAPSE, DENSITY = 0.0065 / 288.15, 4.2559
"""Standard atmosphere: relative decrease of temperature with height, 1/m; exponent of density."""

REFRACTION = ("none", "standard")
"""Models of refraction: straight rays, or rays bent by the standard atmosphere."""

REFRACTIVITY = 2.78e-4
"""n - 1 of visible light in air at sea level, 15 degrees Celsius and 1013.25 hPa."""


def refraction_lift(r_m_c: Array, x_m: Array) -> Array:
    """Return the height by which refraction makes points appear too high, m.

    In horizontal layers of air a ray at the angle theta from the vertical is bent by
    K tan(theta). K is the mean refractive index between point and camera minus that at the
    camera. The straight ray meets the point if it is raised by K (Z_c - Z) / cos^2(theta).

    Parameters
    ----------
    r_m_c, x_m : ndarray, shape (n, 3)
        Cameras and points, m; heights are counted from the ellipsoid, up to 11 km.

    Returns
    -------
    ndarray, shape (n,)

    Notes
    -----
    In the ICAO standard atmosphere the density is (1 - LAPSE h)^DENSITY times its value at sea
    level; n - 1 is proportional to the density.
    """
    camera, ground = 1 - LAPSE * r_m_c[:, 2], 1 - LAPSE * x_m[:, 2]
    down = x_m - r_m_c
    integral = (ground ** (DENSITY + 1) - camera ** (DENSITY + 1)) / (LAPSE * (DENSITY + 1))
    K = REFRACTIVITY * (integral / -down[:, 2] - camera**DENSITY)
    return -K * np.sum(down * down, axis=1) / down[:, 2]


def as_seen(r_m_c: Array, x_m: Array, *, refraction: str) -> Array:
    """Return the apparent positions of points, to which rays are straight, m.

    Parameters
    ----------
    r_m_c, x_m : ndarray, shape (n, 3)
        Cameras and points, m.
    refraction : str
        ``"none"``, or ``"standard"`` for `refraction_lift`.

    Returns
    -------
    ndarray, shape (n, 3)

    Raises
    ------
    ValueError
        For another kind of refraction.
    """
    expected.one_of("refraction", refraction, REFRACTION)
    if refraction == "none":
        return x_m
    return x_m + refraction_lift(r_m_c, x_m)[:, None] * np.array([0.0, 0.0, 1.0])
