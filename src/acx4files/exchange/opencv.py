"""OpenCV's cameras: matrix and forward distortion, from the ideal point to the measured one.

OpenCV's camera axes have y down and z ahead; the library's are turned by 180 degrees about x.
Pixels are the same: (0, 0) is the centre of the top-left one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acx4files.exchange.lens import Left
from acx4files.exchange.outward.brown import nearest
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
    left: Left


def to_opencv(camera: Camera) -> OpenCvCamera:
    """Return the OpenCV camera nearest to a camera, over the whole image.

    The two polynomials are no inverses of each other, so something is `left`.
    """
    lens = nearest(camera, "plain")
    hole = lens.hole
    matrix = np.array([[hole.fx, 0.0, hole.cx], [0.0, hole.fy, hole.cy], [0.0, 0.0, 1.0]])
    return OpenCvCamera(matrix=matrix, distortion=lens.coefficients, left=lens.left)
