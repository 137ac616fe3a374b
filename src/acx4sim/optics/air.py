"""Rays through the air: the simulator's own refraction, by Snell's law in horizontal layers."""

import numpy as np

from acx4sim.earth import Array

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)  # enough, as the air is smooth
_STEEPEST = 10.0  # tangent of the largest angle from the vertical that is used
_STEPS = 3


def refractivity(height_m: Array) -> Array:
    """Compute n - 1 for green light in the ICAO standard atmosphere's troposphere.

    Dispersion by Barrell and Sears at 0 C and 1013.25 hPa, for 0.56 micrometres, converted by
    the gas law to the standard temperature and pressure at the height.
    """
    normal = (2876.04 + 16.288 / 0.56**2 + 0.136 / 0.56**4) * 1e-7
    kelvin = 288.15 - 0.0065 * height_m
    pressure = (kelvin / 288.15) ** 5.25588  # of 1013.25 hPa
    return np.asarray(normal * pressure * 273.15 / kelvin)


def bent(ray: Array, up: Array, ground_m: Array) -> Array:
    """Return the directions from which the light of points comes, given straight rays to them.

    n sin(angle from the vertical) is constant along a ray. The angle at the camera is found such
    that the path, integrated through the layers, ends at the point. Valid up to 84 degrees from
    the vertical; rays beyond that and rays upward do not change.

    Parameters
    ----------
    ray : ndarray, shape (..., 3)
        From camera to point, m.
    up : ndarray, shape (..., 3)
        The vertical at the point.
    ground_m : ndarray, shape (...)
        Ellipsoidal height of the point, m.

    Returns
    -------
    ndarray, shape (..., 3)
        With the same vertical component as the straight ray.
    """
    drop = -np.sum(ray * up, axis=-1)
    aside = ray + drop[..., None] * up
    distance = np.linalg.norm(aside, axis=-1)
    usable = (drop > 0) & (distance < _STEEPEST * drop) & (distance > 0)
    stretch = np.ones_like(distance)
    stretch[usable] = _stretch(
        distance[usable], drop[usable], np.broadcast_to(ground_m, drop.shape)[usable]
    )
    return np.asarray(stretch[..., None] * aside - drop[..., None] * up)


def _stretch(distance: Array, drop: Array, ground_m: Array) -> Array:
    """Compute how much farther from the camera's vertical a point appears to be, as a factor."""
    heights = ground_m[:, None] + drop[:, None] * (_NODES + 1) / 2
    at_camera = 1 + refractivity(ground_m + drop)
    ratio = at_camera[:, None] / (1 + refractivity(heights))
    tangent = distance / drop
    for _ in range(_STEPS):
        sine = ratio * (tangent / np.hypot(1, tangent))[:, None]
        path = drop * ((sine / np.sqrt(1 - sine**2)) @ (_WEIGHTS / 2))
        tangent += (distance - path) / drop
    return np.asarray(tangent * drop / distance)
