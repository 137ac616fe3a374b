"""Brown's lens as most programs have it: from the ideal to the measured point, in pixels."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import Camera, Interior, correct, xy_from_colrow
from acx4tools.exchange import lens
from acx4tools.exchange.lens import Left, Pinhole
from acx4tools.exchange.outward.calibrated import Calibrated

CORNER = 0.5
"""What is added to a pixel where (0, 0) is the outer corner of the top-left one."""


STEPS_BACK, NEAR_PX, SAME_PX = 20, 1e-5, 1e-3
"""Iterations at most to the lens of which a camera is the refit; changes at which they end, and
distances to the camera at which it is that lens."""

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


def of_all(calibrated: Calibrated) -> dict[str, Brown]:
    """Return the lenses of all cameras with two focal lengths, by their names.

    A camera of which no interior parameter is estimated goes back as it came: its lens is that of
    which it is the refit.
    """
    return _of_cameras(calibrated, brown, is_square=False)


def square(calibrated: Calibrated) -> dict[str, Brown]:
    """Return the lenses of all cameras with one focal length, as `of_all`."""
    return _of_cameras(calibrated, one_focal_length, is_square=True)


def _of_cameras(
    calibrated: Calibrated, nearest: Callable[[Camera], Brown], *, is_square: bool
) -> dict[str, Brown]:
    interior, found = calibrated.calibration.layout.interior, {}
    for camera, columns in zip(calibrated.cameras, interior, strict=True):
        one = nearest(camera)
        back = None if (columns >= 0).any() else _as_it_came(camera, one, is_square=is_square)
        found[camera.name] = back or one
    return found


def _as_it_came(camera: Camera, start: Brown, *, is_square: bool) -> Brown | None:
    """Return the lens whose refit is a camera; None where there is none with such pixels."""
    wanted, values = _values_of(brown(camera)), _values_of(start)
    for _ in range(STEPS_BACK):
        try:
            refit, left = _refit(values, camera)
        except ValueError:
            return None
        apart = wanted - _values_of(brown(refit))
        if is_square:
            apart[:2] = apart[:2].mean()
        values = values + apart
        if np.abs(apart[:4]).max() < NEAR_PX and np.abs(apart[4:]).max() * values[1] < NEAR_PX:
            break
    xy = xy_from_colrow(camera, lens.nodes(camera.width_px, camera.height_px))
    rays = [correct(one.interior, xy) / one.interior.f for one in (refit, camera)]
    if not np.abs(rays[0] - rays[1]).max() * values[1] < SAME_PX:
        return None
    fx, fy, cx, cy = values[:4].tolist()
    returned = Left(largest_px=left.largest_px, rms_px=left.rms_px, returned=True)
    return _of(Pinhole(fx=fx, fy=fy, cx=cx, cy=cy), values[4:], returned)


def _refit(values: Array, camera: Camera) -> tuple[Camera, Left]:
    """Return a camera that is made of a lens as an import makes it."""
    fx, fy, cx, cy, *coefficients = values.tolist()
    hole = Pinhole(fx=fx, fy=fy, cx=cx, cy=cy)
    by_role = dict(zip(lens.BROWN, coefficients, strict=True))

    def ideal(colrow: Array) -> Array:
        at = hole.points(colrow)
        return lens.inverse(lambda points: points + lens.effects(points, by_role), at, at)

    size = {"width_px": camera.width_px, "height_px": camera.height_px}
    return lens.camera_of(ideal, hole, name=camera.name, pixel_mm=camera.pixel_mm, **size)


def _values_of(one: Brown) -> Array:
    hole = one.hole
    return np.array(
        [hole.fx, hole.fy, hole.cx, hole.cy, one.k1, one.k2, one.p1, one.p2, one.k3], dtype=float
    )


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
