"""Brown's lens as most programs have it: from the ideal to the measured point, in pixels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.optimize import least_squares

from acx4files.exchange import lens
from acx4files.exchange.lens import FLIP, Left, Pinhole
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera, correct, reduced, xy_from_colrow

CORNER = 0.5
"""Offset of pixels in programs where (0, 0) is the outer corner of the top-left pixel."""

Holes = Literal["skewed", "plain", "square"]
"""Pinholes that a program can have: two focal lengths with or without skew, or one."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Brown:
    """A lens that takes ideal points to pixels, y down.

    Attributes
    ----------
    hole : Pinhole
        Focal lengths and principal point; pixel (0, 0) is the centre of the top-left one.
    coefficients : ndarray, shape (5,)
        k1, k2, p1, p2, k3 as OpenCV has them, of points in units of the focal length.
    left : Left
        Distances of its pixels from the camera's.
    """

    hole: Pinhole
    coefficients: Array
    left: Left


def nearest(camera: Camera, holes: Holes = "skewed") -> Brown:
    """Return the lens that is nearest to a camera, over the whole image.

    The two polynomials are no inverses of each other, so something is left. Pinhole and
    coefficients are fitted together where the camera's own pinhole is none that there can be.
    """
    colrow, hole = lens.nodes(camera.width_px, camera.height_px), pinhole_of(camera)
    xy = xy_from_colrow(camera, colrow)
    f_px = camera.interior.f / camera.pixel_mm
    ideal = FLIP * correct(camera.interior, xy) / camera.interior.f
    off = FLIP * reduced(camera.interior, xy) / camera.interior.f - ideal
    coefficients, left = lens.brown(ideal, off, f_px)
    if holes == "skewed" or not (hole.skew or (holes == "square" and hole.fx != hole.fy)):
        return Brown(hole=hole, coefficients=coefficients, left=left)

    def apart(values: Array) -> Array:
        by_role = dict(zip(lens.BROWN, values[-5:].tolist(), strict=True))
        seen = _without_skew(values).colrow(ideal + lens.effects(ideal, by_role))
        return (seen - colrow).T.ravel()

    focal = [hole.fx, hole.fy] if holes == "plain" else [0.5 * (hole.fx + hole.fy)]
    start = [*focal, hole.cx, hole.cy, *coefficients]
    fit = least_squares(apart, start, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return Brown(hole=_without_skew(fit.x), coefficients=fit.x[-5:], left=Left.of(fit.fun))


def pinhole_of(camera: Camera) -> Pinhole:
    """Return focal lengths and principal point of a camera, px."""
    interior = camera.interior
    f_px, scale = interior.f / camera.pixel_mm, 1 + interior.b1
    offset = np.array([(interior.xp - interior.b2 * interior.yp) / scale, interior.yp])
    middle = 0.5 * np.array([camera.width_px - 1, camera.height_px - 1])
    cx, cy = (middle + FLIP * offset / camera.pixel_mm).tolist()
    return Pinhole(fx=f_px / scale, fy=f_px, cx=cx, cy=cy, skew=interior.b2 * f_px / scale)


def _without_skew(values: Array) -> Pinhole:
    """Return the pinhole of one focal length or two, a principal point, and five coefficients."""
    *focal, cx, cy = values[:-5].tolist()
    return Pinhole(fx=focal[0], fy=focal[-1], cx=cx, cy=cy)


def all_nearest(cameras: Sequence[Camera], holes: Holes) -> dict[str, Brown]:
    """Return the nearest lenses of cameras by their names."""
    return {camera.name: nearest(camera, holes) for camera in cameras}


def left_of(lenses: Mapping[str, Brown]) -> dict[str, Left]:
    """Return how far the lenses are from the cameras, by the names of these."""
    return {name: lens.left for name, lens in lenses.items()}
