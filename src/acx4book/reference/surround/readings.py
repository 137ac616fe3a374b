"""Ways to interpret the calibration of the surround-view rig, tested with its photographs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import cv2
import numpy as np
import pandas as pd

from acx4book.reference.surround.cameras import FRAME_PX, FisheyeCamera, image_from_frame
from acx4book.reference.surround.comparisons import around, load, solved
from acx4book.reference.surround.files import quarter_turn
from acx4book.reference.surround.greys import grey_correlation
from acx4book.reference.surround.views import View
from acx4lib.expected import Raster

COARSE_PX = 4
"""Pixels of the frame between the grey values that are compared."""


def _unscaled(camera: FisheyeCamera) -> FisheyeCamera:
    return replace(camera, K_undistorted=camera.K)


def _scaled_as_a_whole(camera: FisheyeCamera) -> FisheyeCamera:
    """Return the reading in which the scale also applies to the principal point."""
    K, K_undistorted = camera.K, camera.K_undistorted.copy()
    scale = np.diag(K_undistorted)[:2] / np.diag(K)[:2]
    K_undistorted[:2, 2] += (scale - 1) * K[:2, 2]
    return replace(camera, K_undistorted=K_undistorted)


def _unbent(camera: FisheyeCamera) -> FisheyeCamera:
    return replace(camera, theta_coefficients=np.zeros(4))


def _exchanged(camera: FisheyeCamera) -> FisheyeCamera:
    """Return the reading in which the left and right views are exchanged."""
    half_turn = quarter_turn(2 if camera.name in ("left", "right") else 0)
    return replace(camera, H_s_u=half_turn @ camera.H_s_u)


def _mirrored(camera: FisheyeCamera) -> FisheyeCamera:
    """Return the reading in which the left and right views are mirrored, back to front."""
    mirror = np.diag([1.0, -1.0, 1.0])
    mirror[1, 2] = FRAME_PX[1] - 1
    side = camera.name in ("left", "right")
    return replace(camera, H_s_u=(mirror if side else np.eye(3)) @ camera.H_s_u)


READINGS: Mapping[str, Callable[[FisheyeCamera], FisheyeCamera]] = {
    "as read here": lambda camera: camera,
    "scale and shift left out": _unscaled,
    "principal point scaled, too": _scaled_as_a_whole,
    "no polynomial of the lens": _unbent,
    "left and right exchanged": _exchanged,
    "left and right mirrored": _mirrored,
}
"""Ways to interpret the calibration, by name."""


def readings() -> pd.DataFrame:
    """Return the correlations of neighbouring cameras' views of the ground for every reading.

    Returns
    -------
    DataFrame
        reading, and for every overlap the correlation of grey values; NaN without an overlap.
    """
    cameras, images = load()
    pairs = around(solved().views)
    rows: list[dict[str, object]] = []
    for name, read in READINGS.items():
        views = [_coarse(read(c), image) for c, image in zip(cameras, images, strict=True)]
        found = {
            f"{cameras[a].name}-{cameras[b].name}": round(grey_correlation(views[a], views[b]), 3)
            for a, b in pairs
        }
        rows.append({"reading": name, **found})
    return pd.DataFrame(rows)


def _coarse(camera: FisheyeCamera, image: Raster) -> View:
    """Return a camera's view on a coarse grid, sampled by OpenCV."""
    cols, rows = (np.arange(0.0, n, COARSE_PX) for n in FRAME_PX)
    grid = np.stack(np.meshgrid(cols, rows), axis=-1)
    at = image_from_frame(camera, grid.reshape(-1, 2)).reshape(grid.shape).astype(np.float32)
    col, row = np.moveaxis(np.nan_to_num(at, nan=-1.0), -1, 0)
    sampled = cv2.remap(image, col, row, cv2.INTER_LINEAR)
    return View(image=np.asarray(sampled, dtype=np.uint8), seen=np.isfinite(at[:, :, 0]))
