"""Brown's lens as most programs have it: from the ideal to the measured point, in pixels."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from acx4files.exchange import lens
from acx4files.exchange.lens import Left, Pinhole
from acx4files.exchange.outward.content import Calibrated
from acx4lib.expected import Array, Index
from acx4lib.geometry.camera import Camera, Interior, correct, xy_from_colrow

CORNER = 0.5
"""Offset of pixels in programs where (0, 0) is the outer corner of the top-left pixel."""


STEPS_BACK, NEAR_PX, SAME_PX = 20, 1e-5, 1e-3
"""Largest number of iterations to the lens whose refit is a camera; changes at which they end, and
largest distance of the refit from the camera."""

STEPS = (1e-4, 1e-4, 1e-4, 1e-9, 1e-12, 1e-15, 1e-9, 1e-9, 1e-6, 1e-6)
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
    """Return the lens that is nearest to a camera in the whole image, with skew."""
    coefficients, left = lens.brown_of(camera)
    return _of(lens.pinhole_of(camera), coefficients, left)


def skewed(calibrated: Calibrated) -> dict[str, Brown]:
    """Return the lenses of all cameras with two focal lengths and skew, by their names.

    A camera without estimated interior parameters goes back as it came: by the lens that an import
    refits as this camera.
    """
    return _of_cameras(calibrated, brown, lambda change: change)


def of_all(calibrated: Calibrated) -> dict[str, Brown]:
    """Return the lenses of all cameras with two focal lengths, as `skewed`."""
    return _of_cameras(
        calibrated,
        lambda camera: _of(*lens.without_skew(camera)),
        lambda change: np.concatenate([change[:4], [0.0], change[5:]]),
    )


def square(calibrated: Calibrated) -> dict[str, Brown]:
    """Return the lenses of all cameras with one focal length, as `skewed`."""
    return _of_cameras(
        calibrated,
        _one_focal_length,
        lambda change: np.concatenate([2 * [change[:2].mean()], change[2:4], [0.0], change[5:]]),
    )


def _of_cameras(
    calibrated: Calibrated, nearest: Callable[[Camera], Brown], kept: Callable[[Array], Array]
) -> dict[str, Brown]:
    interior, by_camera = calibrated.calibration.layout.interior, {}
    for camera, columns in zip(calibrated.cameras, interior, strict=True):
        model = nearest(camera)
        back = None if (columns >= 0).any() else _as_it_came(camera, model, kept)
        by_camera[camera.name] = back or model
    return by_camera


def _as_it_came(camera: Camera, start: Brown, kept: Callable[[Array], Array]) -> Brown | None:
    """Return the lens whose refit is a camera; None where there is none with such pixels."""
    wanted, values = _values_of(brown(camera)), _values_of(start)
    for _ in range(STEPS_BACK):
        try:
            refit, left = _refit(values, camera)
        except ValueError:
            return None
        apart = kept(wanted - _values_of(brown(refit)))
        values = values + apart
        if np.abs(apart[:5]).max() < NEAR_PX and np.abs(apart[5:]).max() * values[1] < NEAR_PX:
            break
    xy = xy_from_colrow(camera, lens.nodes(camera.width_px, camera.height_px))
    rays = [correct(either.interior, xy) / either.interior.f for either in (refit, camera)]
    if not np.abs(rays[0] - rays[1]).max() * values[1] < SAME_PX:
        return None
    returned = Left(largest_px=left.largest_px, rms_px=left.rms_px, returned=True)
    return _of(_pinhole(values), values[5:], returned)


def _refit(values: Array, camera: Camera) -> tuple[Camera, Left]:
    """Return the camera that an import would make of a lens."""
    hole, by_role = _pinhole(values), dict(zip(lens.BROWN, values[5:].tolist(), strict=True))

    def ideal(colrow: Array) -> Array:
        measured = hole.points(colrow)
        return lens.inverse(
            lambda points: points + lens.effects(points, by_role), measured, measured
        )

    size = {"width_px": camera.width_px, "height_px": camera.height_px}
    return lens.camera_of(ideal, hole, name=camera.name, pixel_mm=camera.pixel_mm, **size)


def _values_of(model: Brown) -> Array:
    """Return fx, fy, cx, cy, skew, then OpenCV's k1, k2, p1, p2, k3."""
    hole = (model.hole.fx, model.hole.fy, model.hole.cx, model.hole.cy, model.hole.skew)
    return np.array([*hole, model.k1, model.k2, model.p1, model.p2, model.k3], dtype=float)


def _pinhole(values: Array) -> Pinhole:
    fx, fy, cx, cy, skew = values[:5].tolist()
    return Pinhole(fx=fx, fy=fy, cx=cx, cy=cy, skew=skew)


def _one_focal_length(camera: Camera) -> Brown:
    """Return the nearest lens with square pixels: where b1 or b2 is not zero, all is refitted."""
    hole = lens.pinhole_of(camera)
    if hole.fx == hole.fy and not hole.skew:
        return brown(camera)

    def pixels(values: Array, ideal: Array) -> Array:
        f, cx, cy, *coefficients = values
        by_role = dict(zip(lens.BROWN, coefficients, strict=True))
        return np.asarray(f * (ideal + lens.effects(ideal, by_role)) + [cx, cy])

    coefficients, _ = lens.brown_of(camera)
    start = np.array([0.5 * (hole.fx + hole.fy), hole.cx, hole.cy, *coefficients])
    values, left = lens.model_of(camera, pixels, start)
    f, cx, cy = values[:3].tolist()
    return _of(Pinhole(fx=f, fy=f, cx=cx, cy=cy), values[3:], left)


def lenses(found: Mapping[str, Brown]) -> dict[str, Left]:
    """Return how far the lenses are from the cameras, by the names of these."""
    return {name: model.left for name, model in found.items()}


def _of(hole: Pinhole, coefficients: Array, left: Left) -> Brown:
    k1, k2, p1, p2, k3 = coefficients.tolist()
    return Brown(hole=hole, k1=k1, k2=k2, k3=k3, p1=p1, p2=p2, left=left)


def derivatives(camera: Camera, columns: Index, n_columns: int) -> Array:
    """Return d(fx, fy, cx, cy, skew, k1, k2, p1, p2, k3) / d(columns of a calibration).

    By differences.

    Parameters
    ----------
    camera : Camera
    columns : ndarray, shape (10,)
        Of its interior parameters; -1 for those that are held.
    n_columns : int

    Returns
    -------
    ndarray, shape (10, n_columns)
    """
    J, values = np.zeros((10, n_columns)), camera.interior.to_array()
    for j in np.flatnonzero(columns >= 0):
        step = np.eye(len(values))[j] * max(1e-6 * abs(values[j]), STEPS[j])
        ends = [
            _values_of(brown(camera.with_interior(Interior.from_array(values + sign * step))))
            for sign in (1, -1)
        ]
        J[:, columns[j]] = (ends[0] - ends[1]) / (2 * step[j])
    return J
