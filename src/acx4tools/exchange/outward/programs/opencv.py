"""Cameras as OpenCV's file storage has them: ``cv::FileStorage``, YAML."""

from __future__ import annotations

import cv2
import numpy as np

from acx4lib.geometry.camera import Camera
from acx4lib.results.whole_files import file_stem
from acx4tools.exchange.opencv import OpenCvCamera, to_opencv
from acx4tools.exchange.outward import relative
from acx4tools.exchange.outward.calibrated import Calibrated
from acx4tools.exchange.outward.relative import Relative
from acx4tools.exchange.outward.taken import BODY, SIGMA, Taken

ASSUMED = (
    "distortion_coefficients are k1, k2, p1, p2, k3, from the ideal to the measured point",
    "pixel (0, 0) is the centre of the top-left one; y is down and z ahead",
)
RIG = "R and T take a point from the axes of {} to those of the head: x = R x + T, m"


def cameras(calibrated: Calibrated) -> Taken:
    """Return a YAML file for every camera, with its place in the rig where there are several."""
    cameras = calibrated.cameras
    rig = relative.to_first(calibrated.calibration)
    found = [to_opencv(camera) for camera in cameras]
    return Taken(
        files={
            f"{file_stem(camera.name)}.yaml": _text(camera, lens, one)
            for camera, lens, one in zip(cameras, found, rig, strict=True)
        },
        lenses={c.name: lens.left for c, lens in zip(cameras, found, strict=True)},
        assumed=(*ASSUMED, *([RIG.format(cameras[0].name)] if rig[1:] else [])),
        left_out=(SIGMA, BODY),
    )


def _text(camera: Camera, lens: OpenCvCamera, one: Relative) -> str:
    """Return the file of a camera, with the names of OpenCV's own examples of calibration."""
    T_h_r = one.T_v_r_h.inverse
    storage = cv2.FileStorage(".yaml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.write("image_width", camera.width_px)
    storage.write("image_height", camera.height_px)
    storage.write("camera_name", camera.name)
    storage.write("camera_matrix", lens.matrix)
    storage.write("distortion_coefficients", lens.distortion[None])
    storage.write("R", np.ascontiguousarray(T_h_r.R))
    storage.write("T", np.ascontiguousarray(T_h_r.r[:, None]))
    return str(storage.releaseAndGetString())
