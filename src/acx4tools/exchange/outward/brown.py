"""Brown's lens as most programs have it: from the ideal to the measured point, in pixels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import Camera, Interior
from acx4tools.exchange import lens
from acx4tools.exchange.lens import Left, Pinhole
from acx4tools.exchange.outward.calibrated import Calibrated

CORNER = 0.5
"""What is added to a pixel where (0, 0) is the outer corner of the top-left one."""


STEPS = (1e-4, 1e-4, 1e-4, 1e-9, 1e-12, 1e-15, 1e-9, 1e-9, 1e-6)
"""Smallest steps of interior parameters for differences, in their units."""


@dataclass(frozen=True, kw_only=True)
class Brown:
    """A lens that takes ideal points to pixels, y down.

    Attributes
    ----------
    hole : Pinhole
        Focal lengths and principal point; pixel (0, 0) is the centre of the top-left one.
    k1, k2, k3, p1, p2 : float
        As OpenCV has them, of points in units of the focal length.
    left : Left
        Distances of its pixels from the camera's.
    """

    hole: Pinhole
    k1: float
    k2: float
    k3: float
    p1: float
    p2: float
    left: Left


def brown(camera: Camera) -> Brown:
    """Return the lens that is nearest to a camera in the whole image, with two focal lengths."""
    coefficients, left = lens.brown_of(camera)
    return _of(lens.pinhole_of(camera), coefficients, left)


def one_focal_length(camera: Camera) -> Brown:
    """Return the nearest lens with square pixels: where b1 is not zero, all of it is refitted."""
    hole = lens.pinhole_of(camera)
    coefficients, _ = lens.brown_of(camera)
    if hole.fx == hole.fy:
        return brown(camera)
    start = np.array([0.5 * (hole.fx + hole.fy), hole.cx, hole.cy, *coefficients])
    values, left = lens.model_of(camera, lambda own, ideal: pixels([*own, 0.0], ideal), start)
    f, cx, cy = values[:3].tolist()
    return _of(Pinhole(fx=f, fy=f, cx=cx, cy=cy), values[3:], left)


def lenses(found: Mapping[str, Brown]) -> dict[str, Left]:
    """Return how far the lenses are from the cameras, by the names of these."""
    return {name: one.left for name, one in found.items()}


def of_all(calibrated: Calibrated) -> dict[str, Brown]:
    """Return the lenses of all cameras with two focal lengths, by their names."""
    return {camera.name: brown(camera) for camera in calibrated.cameras}


def _of(hole: Pinhole, coefficients: Array, left: Left) -> Brown:
    k1, k2, p1, p2, k3 = coefficients.tolist()
    return Brown(hole=hole, k1=k1, k2=k2, k3=k3, p1=p1, p2=p2, left=left)


def pixels(values: Array | list[float], ideal: Array) -> Array:
    """Return the pixels of ideal points, shape (n, 2), by one focal length and b1.

    Parameters
    ----------
    values : ndarray, shape (9,)
        f, cx, cy in px; k1, k2, p1, p2, k3; b1, which stretches the ideal x and not its distortion.
    ideal : ndarray, shape (n, 2)
        y down.
    """
    f, cx, cy, *coefficients, b1 = values
    measured = ideal + lens.effects(ideal, dict(zip(lens.BROWN, coefficients, strict=True)))
    measured[:, 0] += b1 * ideal[:, 0]
    return f * measured + [cx, cy]


def derivatives(camera: Camera, columns: Index, n_columns: int) -> Array:
    """Return d(fx, fy, cx, cy, k1, k2, k3, p1, p2) / d(columns of a calibration), by differences.

    Parameters
    ----------
    camera : Camera
    columns : ndarray, shape (9,)
        Of its interior parameters; -1 for those that are held.
    n_columns : int

    Returns
    -------
    ndarray, shape (9, n_columns)
    """
    J, values = np.zeros((9, n_columns)), camera.interior.to_array()
    for j in np.flatnonzero(columns >= 0):
        step = np.eye(len(values))[j] * max(1e-6 * abs(values[j]), STEPS[j])
        ends = [_values(camera, values + sign * step) for sign in (1, -1)]
        J[:, columns[j]] = (ends[0] - ends[1]) / (2 * step[j])
    return J


def _values(camera: Camera, interior: Array) -> Array:
    one = brown(camera.with_interior(Interior.from_array(interior)))
    hole = one.hole
    return np.array([hole.fx, hole.fy, hole.cx, hole.cy, one.k1, one.k2, one.k3, one.p1, one.p2])
