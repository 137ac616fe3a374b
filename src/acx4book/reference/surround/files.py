"""Calibrations of a surround-view rig: fisheye cameras fixed to a car, in OpenCV's format.

A file has the camera matrix, the four coefficients of OpenCV's fisheye model, a scale and a shift
of the undistorted image, and the homography from this image to the camera's view of the ground. The
undistorted image is that of a pinhole camera: its focal lengths are those of the camera matrix
times the scale, its principal point is that of the camera matrix plus the shift. Each camera's view
has its own direction up. After quarter turns, the four views lie in one frame of 1200 x 1600 px,
with the car's front up.
"""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from acx4book.reference.surround.cameras import FRAME_PX, FisheyeCamera
from acx4lib.expected import Array, Raster

QUARTER_TURNS = {"front": 0, "left": 1, "back": 2, "right": 3}
"""Number of anticlockwise quarter turns of a camera's view to the frame."""


def read(path: Path, *, quarter_turns: int) -> FisheyeCamera:
    """Read the calibration of one camera.

    Parameters
    ----------
    path : Path
        Path of the yaml file; the camera has the name of the file.
    quarter_turns : int
        Anticlockwise quarter turns of the camera's view to the frame; see `QUARTER_TURNS`.

    Returns
    -------
    FisheyeCamera

    Raises
    ------
    ValueError
        Where the file lacks one of the matrices.
    """
    K = _matrix(path, "camera_matrix")
    scale, shift = (_matrix(path, name).ravel() for name in ("scale_xy", "shift_xy"))
    width_px, height_px = _matrix(path, "resolution").ravel()
    K_undistorted = K * [[scale[0], 1, 1], [1, scale[1], 1], [1, 1, 1]]
    K_undistorted[:2, 2] += shift
    return FisheyeCamera(
        name=path.stem,
        width_px=int(width_px),
        height_px=int(height_px),
        K=K,
        theta_coefficients=_matrix(path, "dist_coeffs").ravel(),
        K_undistorted=K_undistorted,
        H_s_u=quarter_turn(quarter_turns) @ _matrix(path, "project_matrix"),
    )


def quarter_turn(n: int) -> Array:
    """Return the 3 x 3 matrix from pixels of a view to the frame, for n quarter turns.

    Parameters
    ----------
    n : int
        Anticlockwise quarter turns; the pixel (0, 0) of the view becomes a corner of the frame.
    """
    right, bottom = FRAME_PX[0] - 1, FRAME_PX[1] - 1
    col, row = (
        ([1, 0, 0], [0, 1, 0]),
        ([0, 1, 0], [-1, 0, bottom]),
        ([-1, 0, right], [0, -1, bottom]),
        ([0, -1, right], [1, 0, 0]),
    )[n % 4]
    return np.array([col, row, [0, 0, 1]], dtype=float)


def read_image(path: Path) -> Raster:
    """Read an image, shape (rows, cols, 3), red, green, blue.

    Raises
    ------
    ValueError
        Where the file is no image.
    """
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        msg = f"{path} is no image that OpenCV reads"
        raise ValueError(msg)
    return np.ascontiguousarray(image[:, :, ::-1])


def _matrix(path: Path, name: str) -> Array:
    """Return one of the matrices in a file."""
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)  # kept, as its nodes need it
    found = storage.getNode(name).mat()
    if found is None:
        msg = f"{path} has no matrix {name!r}"
        raise ValueError(msg)
    return np.asarray(found, dtype=float)
