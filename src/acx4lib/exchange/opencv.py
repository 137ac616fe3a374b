"""OpenCV's cameras: matrix and forward distortion, from the ideal point to the measured one.

OpenCV's camera axes have y down and z ahead; the library's are turned by 180 degrees about x.
Pixels are the same: (0, 0) is the centre of the top-left one.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from acx4lib import expected
from acx4lib.expected import Array
from acx4lib.geometry.camera import (
    Camera,
    Interior,
    correct,
    reduced,
    xy_from_colrow,
)

FLIP = np.array([1.0, -1.0])
"""From the library's image axes to OpenCV's."""

NODES = (61, 46)
"""Points along and across the image through which a lens is fitted."""


@dataclass(frozen=True, kw_only=True, eq=False)
class OpenCvCamera:
    """A camera as OpenCV's functions take it.

    Attributes
    ----------
    matrix : ndarray, shape (3, 3)
        Focal lengths and principal point, px.
    distortion : ndarray, shape (5,)
        k1, k2, p1, p2, k3 of OpenCV.
    largest_px : float
        Largest distance, anywhere in the image, of its measured points from the library's.
    """

    matrix: Array
    distortion: Array
    largest_px: float


def to_opencv(camera: Camera) -> OpenCvCamera:
    """Return the OpenCV camera that is nearest to a camera, in the whole image.

    The two polynomials are no inverses of each other, so something is left: `largest_px`.

    Parameters
    ----------
    camera : Camera

    Raises
    ------
    ValueError
        If `camera` is no Camera.
    """
    expected.instance("camera", camera, Camera)
    lens, scale = camera.interior, 1 + camera.interior.b1
    xy = xy_from_colrow(camera, _nodes(camera.width_px, camera.height_px))
    ideal = FLIP * correct(lens, xy) / lens.f
    off = FLIP * reduced(lens, xy) / lens.f - ideal
    coefficients, left = _fitted(ideal, off)
    f_px = lens.f / camera.pixel_mm
    middle = 0.5 * np.array([camera.width_px - 1, camera.height_px - 1])
    cx, cy = middle + FLIP * np.array([lens.xp / scale, lens.yp]) / camera.pixel_mm
    return OpenCvCamera(
        matrix=np.array([[f_px / scale, 0.0, cx], [0.0, f_px, cy], [0.0, 0.0, 1.0]]),
        distortion=coefficients,
        largest_px=f_px * left,
    )


def from_opencv(
    matrix: Array, distortion: Array, *, name: str, width_px: int, height_px: int, pixel_mm: float
) -> tuple[Camera, float]:
    """Return the camera that is nearest to one of OpenCV, in the whole image.

    Parameters
    ----------
    matrix : ndarray, shape (3, 3)
        Without skew, px.
    distortion : ndarray, shape (4,), (5,), (8,), (12,) or (14,)
        Coefficients in OpenCV's order.
    name, width_px, height_px, pixel_mm
        As `Camera` has them.

    Returns
    -------
    camera : Camera
    largest_px : float
        Largest distance of its ideal points from OpenCV's anywhere in the image, px.

    Raises
    ------
    ValueError
        For other shapes, a matrix with skew, or values that no Camera has.
    """
    matrix = expected.numbers("matrix", matrix, (3, 3))
    distortion = expected.numbers("distortion", distortion, ("n",))
    expected.one_of("len(distortion)", len(distortion), (4, 5, 8, 12, 14))
    if matrix[0, 1] or matrix[1, 0]:
        msg = f"matrix: expected no skew, got {matrix[0, 1]} and {matrix[1, 0]}"
        raise ValueError(msg)
    (fx, _, cx), (_, fy, cy) = matrix[:2].tolist()
    f, scale = fy * pixel_mm, fy / fx
    colrow = _nodes(width_px, height_px)
    measured = (colrow - [cx, cy]) / [fx, fy]
    ideal = _undistorted(colrow, matrix, distortion)
    (c1, c2, c3, c4, c5), left = _fitted(measured, ideal - measured)
    interior = Interior(
        f=f,
        xp=(cx - (width_px - 1) / 2) * pixel_mm * scale,
        yp=((height_px - 1) / 2 - cy) * pixel_mm,
        k1=-c1 / f**2,
        k2=-c2 / f**4,
        k3=-c5 / f**6,
        p1=-c4 / f,
        p2=c3 / f,
        b1=scale - 1,
    )
    camera = Camera(
        name=name, width_px=width_px, height_px=height_px, pixel_mm=pixel_mm, interior=interior
    )
    return camera, fy * left


def _nodes(width_px: int, height_px: int) -> Array:
    """Return pixels all over an image, its outer edges included, shape (n, 2)."""
    cols, rows = (
        np.linspace(-0.5, size - 0.5, n)
        for size, n in zip((width_px, height_px), NODES, strict=True)
    )
    return np.stack(np.meshgrid(cols, rows), axis=-1).reshape(-1, 2)


def _undistorted(colrow: Array, matrix: Array, distortion: Array) -> Array:
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-13)
    found = cv2.undistortPoints(colrow[:, None], matrix, distortion, None, None, None, criteria)
    return np.asarray(found[:, 0], dtype=float)


def _fitted(at: Array, off: Array) -> tuple[Array, float]:
    """Return OpenCV's coefficients, linear least squares, and the largest distance left.

    Parameters
    ----------
    at, off : ndarray, shape (n, 2)
        Points and what is to be added to them, in units of the focal length.
    """
    x, y = at.T
    r2 = x * x + y * y
    radial = np.stack([r2, r2**2, r2**3])
    along = [x * radial[0], x * radial[1], 2 * x * y, r2 + 2 * x * x, x * radial[2]]
    across = [y * radial[0], y * radial[1], r2 + 2 * y * y, 2 * x * y, y * radial[2]]
    A = np.concatenate([np.stack(along, axis=1), np.stack(across, axis=1)])
    size = np.abs(A).max(axis=0)  # so that high powers count as much as low ones
    coefficients = np.linalg.lstsq(A / size, off.T.ravel(), rcond=None)[0] / size
    left = (A @ coefficients - off.T.ravel()).reshape(2, -1)
    return coefficients, float(np.hypot(*left).max())
