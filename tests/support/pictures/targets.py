"""Signalised points in simulated pictures: white discs of 60 cm on dark pads of 1.8 m."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acx4sim.optics import Camera

PAD_DN = 3200


def cut_out(camera: Camera, col: int, row: int, width: int, height: int) -> Camera:
    """Return the camera of a part of the sensor, which begins at a column and row."""
    pixel = camera.pixel_um / 1000
    dx = (col + (width - camera.width_px) / 2) * pixel
    dy = -(row + (height - camera.height_px) / 2) * pixel
    return replace(
        camera,
        width_px=width,
        height_px=height,
        xp_mm=camera.xp_mm - dx,
        yp_mm=camera.yp_mm - dy,
    )


def middle_of_disc(grey: np.ndarray, near: np.ndarray, radius_px: float) -> np.ndarray:
    """Return col, row of the centroid of what is brighter than the pad, around a place."""
    rows, cols = np.indices(grey.shape)
    white = grey.astype(float) - PAD_DN
    white[np.hypot(cols - near[0], rows - near[1]) > radius_px] = 0
    return np.array([(cols * white).sum(), (rows * white).sum()]) / white.sum()
