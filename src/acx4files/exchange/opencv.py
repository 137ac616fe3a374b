"""OpenCV's cameras: matrix and forward distortion, from the ideal point to the measured one.

OpenCV's camera axes have y down and z ahead; the library's are turned by 180 degrees about x.
Pixels are the same: (0, 0) is the centre of the top-left one.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from acx4files.exchange import lens
from acx4lib import expected
from acx4lib.expected import Array
from acx4lib.geometry.camera import Camera


@dataclass(frozen=True, kw_only=True, eq=False)
class OpenCvCamera:
    """A camera as OpenCV's functions take it.

    Attributes
    ----------
    matrix : ndarray, shape (3, 3)
        Focal lengths and principal point, px.
    distortion : ndarray, shape (5,)
        k1, k2, p1, p2, k3 of OpenCV.
    left : Left
        Distances, in the whole image, of its measured points from the library's.
    """

    matrix: Array
    distortion: Array
    left: lens.Left


def to_opencv(camera: Camera) -> OpenCvCamera:
    """Return the OpenCV camera nearest to a camera, over the whole image.

    The two polynomials are no inverses of each other, so something is `left`.
    """
    hole, coefficients, left = lens.without_skew(camera)
    return OpenCvCamera(
        matrix=np.array([[hole.fx, 0.0, hole.cx], [0.0, hole.fy, hole.cy], [0.0, 0.0, 1.0]]),
        distortion=coefficients,
        left=left,
    )


def from_opencv(
    matrix: Array, distortion: Array, *, name: str, width_px: int, height_px: int, pixel_mm: float
) -> tuple[Camera, lens.Left]:
    """Return the camera nearest to an OpenCV camera, over the whole image.

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
    left : Left
        Distances of its ideal points from OpenCV's in the whole image.

    Raises
    ------
    ValueError
        For other shapes, a matrix with skew, or values that no Camera has.
    """
    matrix = expected.numbers("matrix", matrix, (3, 3))
    distortion = expected.numbers("distortion", distortion, ("n",))
    expected.one_of("len(distortion)", len(distortion), (4, 5, 8, 12, 14))
    if matrix[0, 1] or matrix[1, 0]:
        raise ValueError(f"matrix: expected no skew, got {matrix[0, 1]} and {matrix[1, 0]}")
    (fx, _, cx), (_, fy, cy) = matrix[:2].tolist()
    return lens.camera_of(
        lambda colrow: _undistorted(colrow, matrix, distortion),
        lens.Pinhole(fx=fx, fy=fy, cx=cx, cy=cy),
        name=name,
        width_px=width_px,
        height_px=height_px,
        pixel_mm=pixel_mm,
    )


def _undistorted(colrow: Array, matrix: Array, distortion: Array) -> Array:
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-13)
    ideal = cv2.undistortPoints(colrow[:, None], matrix, distortion, None, None, None, criteria)
    return np.asarray(ideal[:, 0], dtype=float)
